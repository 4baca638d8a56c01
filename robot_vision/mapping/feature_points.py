# SPDX-License-Identifier: Apache-2.0
"""Points of the picture with their places on the floor and how well these are known (20.2, 20.3)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping.boundary import Boundary
from robot_vision.mapping.ground_view import GroundView

Array = NDArray[np.float64]
Gray = NDArray[np.uint8]


class PointKind(IntEnum):
    """What a feature point belongs to."""

    GROUND = 0
    OBJECT = 1
    SHADOW = 2


@dataclass(frozen=True)
class GroundPoints:
    """Feature points on the floor or at the foot of what stands on it.

    Attributes:
        x, y: (N,) m in base_link.
        covariance: (N, 2, 2) of x and y, m^2.
        kind: (N,) uint8, a `PointKind` each.
        pixels: (N, 2) of the rectified picture.
    """

    x: Array
    y: Array
    covariance: Array
    kind: NDArray[np.uint8]
    pixels: Array

    def __len__(self) -> int:
        return len(self.x)


@dataclass(frozen=True)
class FeatureAnnotator:
    """Picks corners of the floor, the feet of what stands on it, and gives them coordinates.

    Args:
        corners: on the floor at most.
        step: columns of the working picture from foot to foot.
        pixel_sigma: of a point's place, px of the rectified picture.
    """

    corners: int = 200
    step: int = 4
    pixel_sigma: float = 0.5

    def annotate(
        self,
        gray: Gray,
        boundary: Boundary,
        shadow: NDArray[np.bool_],
        view: GroundView,
        tilt: Array,
        reach: float,
    ) -> GroundPoints:
        """Annotate the points of one picture.

        Args:
            gray: (H, W) the working picture.
            boundary: of the floor.
            shadow: (H - view.top, W) what is floor in shadow.
            view: of the ground in the working picture.
            tilt: (2, 2) covariance of roll and pitch, rad^2.
            reach: points beyond are left out, m.
        """
        rows = np.arange(view.shape[0])[:, None]
        floor = (rows > boundary.rows + 1.0).astype(np.uint8)
        floor[: view.top] = 0
        found = cv2.goodFeaturesToTrack(gray, self.corners, 0.01, 6, mask=floor, blockSize=3)
        ground = np.zeros((0, 2)) if found is None else np.asarray(found, np.float64).reshape(-1, 2)
        feet = np.flatnonzero(boundary.ended)[:: self.step]
        foot = np.column_stack([feet, boundary.rows[feet]])
        points = np.concatenate([ground, foot])
        kind = np.full(len(points), PointKind.OBJECT, np.uint8)
        column, row = np.round(ground).astype(int).T if len(ground) else np.zeros((2, 0), int)
        kind[: len(ground)] = np.where(shadow[row - view.top, column], PointKind.SHADOW, PointKind.GROUND)
        x, y = view.ground(points[:, 0], points[:, 1])
        kept = np.isfinite(x) & (np.hypot(x, y) < reach)
        points, x, y, kind = points[kept], x[kept], y[kept], kind[kept]
        shift = (view.scale - 1.0) / 2.0
        pixels = (points - shift) / view.scale
        return GroundPoints(x, y, self._covariance(x, y, view, tilt), kind, pixels)

    def _covariance(self, x: Array, y: Array, view: GroundView, tilt: Array) -> Array:
        """Of points of the floor: of the pixel and of the tilt, carried through (20.2) and (20.3)."""
        camera = view.camera
        height = camera.height_m or 1.0
        ahead = x - camera.x_m
        square = ahead**2 + y**2 + height**2
        turn = self.pixel_sigma / camera.fx  # of the ray, rad
        # A pitch d moves a point by d (X^2 + H^2) / H along and d X Y / H aside, a roll likewise with X and Y changed.
        by_pitch = np.stack([-(ahead**2 + height**2), -ahead * y], axis=1) / height
        by_roll = np.stack([ahead * y, y**2 + height**2], axis=1) / height
        moves = np.stack([by_roll, by_pitch], axis=2)
        aside = np.stack([-y, ahead], axis=1) / np.maximum(np.hypot(ahead, y), 1e-9)[:, None]
        along = np.stack([aside[:, 1], -aside[:, 0]], axis=1) * (square / height)[:, None]
        aside = aside * np.sqrt(square)[:, None]
        pixel = turn**2 * (aside[:, :, None] * aside[:, None, :] + along[:, :, None] * along[:, None, :])
        return np.asarray(moves @ tilt @ moves.transpose(0, 2, 1) + pixel)
