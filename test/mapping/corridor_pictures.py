# SPDX-License-Identifier: Apache-2.0
"""A corridor of flat colours drawn by its geometry alone: what is floor in its pictures is known to the pixel."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera, GroundPlane
from robot_vision.geometry.sphere import normalised
from robot_vision.perception import LineSegments, Role, VanishingPoints

CAMERA = Camera(460.0, 460.0, 319.5, 239.5, 640, 480, height_m=0.6, pitch=float(np.radians(5.0)))
HALF_M, NOISE = 1.0, 8.0
FLOOR, WALL, SKIRTING = (128, 136, 140), (205, 220, 226), (70, 76, 80)


@dataclass(frozen=True)
class Box:
    """Stands on the floor: x, y of the middle of its front, width and height (m), colour (BGR), None: as the floor."""

    x: float
    y: float
    width: float = 0.4
    height: float = 0.5
    colour: tuple[int, int, int] | None = (40, 60, 150)


@dataclass(frozen=True)
class Shade:
    """A shadow on the floor: x and y from and to (m), share of the light that is left."""

    x: tuple[float, float]
    y: tuple[float, float]
    left: float = 0.45


def texture(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Grey levels of a pattern at places in the world (m), the same from wherever it is seen; 0 in the mean."""
    waves = (
        (7.0, 3.0),
        (-5.0, 11.0),
        (17.0, -13.0),
        (23.0, 29.0),
        (-31.0, 7.0),
        (41.0, -37.0),
        (90.0, 71.0),
        (-83.0, 105.0),
    )
    return NOISE * sum(np.sin(a * x + b * y + a * b) for a, b in waves) / 1.8


@lru_cache(maxsize=64)
def picture(
    along: float = 0.0,
    boxes: tuple[Box, ...] = (),
    shades: tuple[Shade, ...] = (),
    camera: Camera = CAMERA,
) -> NDArray[np.uint8]:
    """What a robot sees that stands in the middle, `along` metres down the corridor."""
    rotation, eye = camera.optical_to_base, np.array([0.0, 0.0, camera.height_m or 0.0])
    u, v = np.meshgrid(np.arange(camera.width, dtype=float), np.arange(camera.height, dtype=float))
    rays = camera.rays(np.column_stack([u.ravel(), v.ravel()])) @ rotation.T
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(rays[:, 2] < -1e-9, -eye[2] / rays[:, 2], np.inf)
        wall = HALF_M / np.abs(rays[:, 1])
    on_floor = reach < wall
    depth = np.minimum(reach, wall)
    x, y, z = (eye[k] + depth * rays[:, k] for k in range(3))
    drawn = np.where(on_floor[:, None], FLOOR, WALL).astype(np.float64)
    drawn[~on_floor & (z < 0.07)] = SKIRTING
    drawn += np.where(on_floor, texture(x + along, y), texture(x + along, z + 9.0))[:, None]
    for shade in shades:
        dark = (
            on_floor
            & (x + along > shade.x[0])
            & (x + along < shade.x[1])
            & (y > shade.y[0])
            & (y < shade.y[1])
        )
        drawn[dark] *= shade.left ** (1 / 2.2)
    for box in boxes:
        with np.errstate(divide="ignore", invalid="ignore"):
            front = np.where(rays[:, 0] > 1e-9, (box.x - along) / rays[:, 0], np.inf)
        side, up = eye[1] + front * rays[:, 1], eye[2] + front * rays[:, 2]
        hit = (front < depth) & (np.abs(side - box.y) < box.width / 2) & (up > 0.0) & (up < box.height)
        colour = np.array(FLOOR) * 0.93 if box.colour is None else np.array(box.colour, float)
        drawn[hit] = colour + texture(side[hit] + box.x, up[hit] + 5.0)[:, None]
    shown = np.clip(drawn, 0, 255).reshape(camera.height, camera.width, 3).astype(np.uint8)
    return np.asarray(cv2.GaussianBlur(shown, (0, 0), 0.6), np.uint8)


def feet(camera: Camera = CAMERA) -> LineSegments:
    """The lines between floor and walls, and one of the ceiling."""
    ends = []
    for side in (-HALF_M, HALF_M):
        for near, far in ((2.5, 4.0), (4.0, 8.0)):
            ends.append(GroundPlane(camera).to_pixels([(near, side), (far, side)]).ravel())
        above = np.array([(3.0, side, 2.4 - 0.6), (8.0, side, 2.4 - 0.6)]) @ camera.optical_to_base
        ends.append(camera.pixels(above).ravel())
    return LineSegments.from_endpoints(np.array(ends))


def vanishing_points(camera: Camera = CAMERA, sigma: float = 1e-3) -> VanishingPoints:
    """Straight ahead and upright, as the camera is mounted."""
    directions = normalised(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]) @ camera.optical_to_base)
    return VanishingPoints(
        directions=directions,
        covariance=np.tile(sigma**2 * np.eye(2), (2, 1, 1)),
        weight=np.array([20.0, 10.0]),
        roles=np.array([Role.PRIMARY, Role.VERTICAL], np.uint32),
        ids=np.array([1, 2], np.uint32),
        labels=np.zeros(0, np.intp),
        camera=camera,
    )
