# SPDX-License-Identifier: Apache-2.0
"""Fields of round green plants on brown soil, drawn where geometry puts them, for the tests of this room."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera, rotation_from_rpy

Picture = NDArray[np.uint8]
Array = NDArray[np.float64]

SOIL, LEAF = (88, 112, 134), (60, 150, 80)
CAMERA = Camera(460.0, 460.0, 319.5, 239.5, 640, 480, height_m=1.4, pitch=float(np.deg2rad(35.0)))


@dataclass(frozen=True)
class Sown:
    """How rows lie about the robot, and how well plants came up.

    Attributes:
        offset: of the robot to the left of the middle row, m.
        yaw: of the robot relative to it, rad.
        curvature: of the middle row, 1/m, to the left positive.
        spacing: between rows, m.
        step: between plants, m.
        radius: of a plant, m.
        missing: share of the plants.
        scatter: standard deviation of a plant about the line of its row, m.
        weeds: number of them for each plant.
        end: where the rows end, m ahead of the robot.
        gap: (from, to) where nothing was sown, m ahead of the robot.
    """

    offset: float = 0.0
    yaw: float = 0.0
    curvature: float = 0.0
    spacing: float = 0.5
    step: float = 0.25
    radius: float = 0.06
    missing: float = 0.2
    scatter: float = 0.012
    weeds: float = 0.0
    end: float = 30.0
    gap: tuple[float, float] = (0.0, 0.0)


def drawn(
    sown: Sown, camera: Camera = CAMERA, seed: int = 0, roll: float = 0.0, pitch: float = 0.0
) -> Picture:
    """The picture (H, W, 3) BGR that a camera has of a field, its body leaning by roll and pitch."""
    random = np.random.default_rng(seed)
    picture = np.empty((camera.height, camera.width, 3), np.uint8)
    picture[:] = SOIL
    picture = np.clip(picture + random.normal(0.0, 4.0, picture.shape), 0, 255).astype(np.uint8)
    leaning = rotation_from_rpy(roll, pitch, 0.0) @ camera.optical_to_base
    eye = np.array([camera.x_m, 0.0, camera.height_m])
    crop = plants(sown, random)
    count = int(sown.weeds * len(crop))
    weeds = np.column_stack([random.uniform(0.0, 12.0, count), random.uniform(-6.0, 6.0, count)])
    for places, radius in ((weeds, 0.4 * sown.radius), (crop, sown.radius)):
        for place in places:
            outline = place + radius * np.column_stack([np.cos(_ROUND), np.sin(_ROUND)])
            if np.all(outline[:, 0] > 0.2):
                flat = np.column_stack([outline, np.zeros(len(outline))])
                corners = camera.pixels((flat - eye) @ leaning)
                if np.isfinite(corners).all() and np.abs(corners).max() < 4000:
                    cv2.fillPoly(picture, [np.rint(corners * 16).astype(np.int32)], LEAF, cv2.LINE_AA, 4)
    return picture


def plants(sown: Sown, random: np.random.Generator) -> Array:
    """Places (N, 2) of the crop in base_link, m."""
    places = []
    sine, cosine = np.sin(sown.yaw), np.cos(sown.yaw)
    for row in range(-12, 13):
        along = np.arange(-1.0, min(sown.end, 14.0), sown.step)
        along = along + random.normal(0.0, 0.02, len(along))
        aside = row * sown.spacing + random.normal(0.0, sown.scatter, len(along))
        kept = (random.random(len(along)) > sown.missing) & (along < sown.end)
        kept &= ~((along > sown.gap[0]) & (along < sown.gap[1]))
        along, aside = along[kept], aside[kept]
        turned = sown.curvature * along
        chord = along * np.sinc(turned / (2.0 * np.pi))
        x = chord * np.cos(turned / 2.0) - aside * np.sin(turned)
        y = chord * np.sin(turned / 2.0) + aside * np.cos(turned) - sown.offset
        places.append(np.column_stack([cosine * x + sine * y, cosine * y - sine * x]))
    return np.concatenate(places)


_ROUND = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
