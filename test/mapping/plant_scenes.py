# SPDX-License-Identifier: Apache-2.0
"""Round plants, a little above brown soil, seen from a robot that drives over them, with all that is true of them."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera, rotation_from_rpy
from robot_vision.mapping.pose import Pose
from robot_vision.perception.crop_rows.ground_fit import RowsOnGround
from robot_vision.perception.crop_rows.tracker import RowEstimate
from robot_vision.perception.lane import LaneHeading

Array = NDArray[np.float64]

SOIL, LEAF = (88, 112, 134), (60, 150, 80)
HEIGHT = 1.4
TALL = 0.6
"""Height of the leaves in radii."""
CAMERA = Camera(460.0, 460.0, 319.5, 239.5, 640, 480, height_m=HEIGHT, pitch=float(np.deg2rad(35.0)))
SPACING, STEP, CROP_RADIUS = 0.5, 0.25, 0.05
_ROUND = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)


@dataclass(frozen=True)
class Scene:
    """Plants in the field: places (N, 2), m, radii (N,), m, and which (N,) are weeds; rows run along x.

    Weeds are of a colour of their own, if one is given.
    """

    places: Array
    radii: Array
    weed: NDArray[np.bool_]
    weed_leaf: tuple[int, int, int] = LEAF

    def seen_from(self, pose: Pose) -> Array:
        """Places (N, 2) in base_link, m."""
        cos, sin = np.cos(pose.yaw), np.sin(pose.yaw)
        away = self.places - (pose.x, pose.y)
        return np.column_stack([away @ (cos, sin), away @ (-sin, cos)])

    def picture(self, pose: Pose, roll: float = 0.0, pitch: float = 0.0) -> NDArray[np.uint8]:
        """What the camera sees, BGR."""
        picture = np.full((CAMERA.height, CAMERA.width, 3), SOIL, np.uint8)
        leaning = rotation_from_rpy(roll, pitch, 0.0) @ CAMERA.optical_to_base
        for place, radius, weed in zip(self.seen_from(pose), self.radii, self.weed, strict=True):
            outline = place + radius * np.column_stack([np.cos(_ROUND), np.sin(_ROUND)])
            if not 0.2 < place[0] < 6.0:
                continue
            leaves = np.column_stack([outline, np.full(len(outline), TALL * radius - HEIGHT)])
            corners = CAMERA.pixels(leaves @ leaning)
            leaf = self.weed_leaf if weed else LEAF
            if np.isfinite(corners).all() and np.abs(corners).max() < 4000:
                cv2.fillPoly(picture, [np.rint(corners * 16).astype(np.int32)], leaf, cv2.LINE_AA, 4)
        return picture


def sown(
    seed: int = 0, weeds: int = 60, crop_radius: float = CROP_RADIUS, weed_radius: float = 0.02
) -> Scene:
    """Five rows of crop, a fifth of it missing, and weeds between them that keep off the crop."""
    random = np.random.default_rng(seed)
    along, row = np.meshgrid(np.arange(0.1, 10.0, STEP), np.arange(-2, 3) * SPACING, indexing="ij")
    crop = np.column_stack([along.ravel(), row.ravel()])
    crop = crop[random.random(len(crop)) > 0.2] + 0.0
    crop += random.normal(0.0, 0.008, crop.shape)
    places = np.column_stack([random.uniform(0.0, 10.0, 4 * weeds), random.uniform(-1.0, 1.0, 4 * weeds)])
    kept = list[Array]()
    for place in places:
        others = np.concatenate([crop, np.array(kept).reshape(-1, 2)])
        if np.linalg.norm(others - place, axis=1).min() > 0.11 and len(kept) < weeds:
            kept.append(place)
    radii = np.concatenate([np.full(len(crop), crop_radius), np.full(len(kept), weed_radius)])
    return Scene(
        np.concatenate([crop, np.array(kept).reshape(-1, 2)]),
        radii,
        np.arange(len(radii)) >= len(crop),
    )


def rows_seen(pose: Pose, fit: bool = True, lean: float = 1e-3) -> RowEstimate:
    """What the tracker would say, the body taken to be upright; without `fit` only the lane is known.

    Args:
        pose: of the robot.
        fit: whether rows are found.
        lean: standard deviation claimed for roll and pitch, rad.
    """
    lane = LaneHeading(pose.yaw, 1e-6, pose.y, 1e-6, SPACING, 0.0)
    rows = None
    if fit:
        values = np.array([pose.y, pose.yaw, 0.0, 0.0, 0.0, np.log(1.0 - TALL * CROP_RADIUS / HEIGHT)])
        variance = np.array([1e-6, 1e-6, 1e-6, lean**2, lean**2, 1e-6])
        rows = RowsOnGround(values, np.diag(variance), SPACING, 0.8, 50)
    return RowEstimate(lane, "", fit, rows, None)
