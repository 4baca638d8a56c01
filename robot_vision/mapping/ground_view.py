# SPDX-License-Identifier: Apache-2.0
"""Pixels of one picture and metres of its floor, both ways and fast: the plan's own lookup of (20.2) and (20.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera, GroundPlane

Array = NDArray[np.float64]
Grid = NDArray[np.float32]


@dataclass(frozen=True)
class GroundView:
    """The floor in a picture that is `scale` times as large as the camera's.

    Attributes:
        camera: rectified, with height, roll and pitch of the moment.
        scale: of the working picture, 0.5 for half the width.
    """

    camera: Camera
    scale: float = 1.0

    @cached_property
    def projection(self) -> Array:
        """(3, 4) from points (x, y, z, 1), m in base_link, to homogeneous working pixels."""
        pose = np.linalg.inv(GroundPlane(self.camera).base_from_optical)
        shift = (self.scale - 1.0) / 2.0
        scaling = np.array([[self.scale, 0.0, shift], [0.0, self.scale, shift], [0.0, 0.0, 1.0]])
        return np.asarray(scaling @ self.camera.matrix @ pose[:3])

    @cached_property
    def matrix(self) -> Array:
        """(3, 3) from ground points (x, y, 1), m in base_link, to homogeneous working pixels (20.2, 20.3)."""
        return self.projection[:, [0, 1, 3]]

    def planes(self, shares: Sequence[float]) -> Array:
        """As `matrix` (N, 3, 3) for planes that lie by shares of the camera's height above the floor."""
        raised = np.tile(self.matrix, (len(shares), 1, 1))
        raised[:, :, 2] += np.outer(shares, self.projection[:, 2] * (self.camera.height_m or 1.0))
        return raised

    @cached_property
    def inverse(self) -> Array:
        """(3, 3) from homogeneous working pixels to ground points."""
        return np.asarray(np.linalg.inv(self.matrix))

    @cached_property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the working picture."""
        return round(self.camera.height * self.scale), round(self.camera.width * self.scale)

    def ground(self, u: NDArray[np.floating], v: NDArray[np.floating]) -> tuple[Array, Array]:
        """Metres ahead and to the left (shape of u and v) under working pixels; nan at and above the horizon."""
        m = self.inverse
        depth = m[2, 0] * u + m[2, 1] * v + m[2, 2]
        # In front of the camera the homogeneous coordinate has the sign it has at the bottom of the picture.
        below = depth * self._sign > 1e-9
        safe = np.where(below, depth, np.nan)
        return (
            (m[0, 0] * u + m[0, 1] * v + m[0, 2]) / safe,
            (m[1, 0] * u + m[1, 1] * v + m[1, 2]) / safe,
        )

    def pixels(self, x: NDArray[np.floating], y: NDArray[np.floating]) -> tuple[Array, Array]:
        """Working pixels u, v of ground points x, y (m); nan behind the camera."""
        m = self.matrix
        depth = m[2, 0] * x + m[2, 1] * y + m[2, 2]
        safe = np.where(depth > 1e-6, depth, np.nan)
        return (
            (m[0, 0] * x + m[0, 1] * y + m[0, 2]) / safe,
            (m[1, 0] * x + m[1, 1] * y + m[1, 2]) / safe,
        )

    @cached_property
    def horizon_rows(self) -> Array:
        """Row (W,) of the horizon in each working column."""
        m = self.inverse[2]
        columns = np.arange(self.shape[1])
        return np.asarray(-(m[0] * columns + m[2]) / m[1])

    @cached_property
    def top(self) -> int:
        """First row of the working picture that shows ground in every column."""
        return int(np.clip(np.ceil(self.horizon_rows.max()) + 1, 0, self.shape[0] - 1))

    @cached_property
    def _sign(self) -> float:
        rows, columns = self.shape
        sign = np.sign(self.inverse[2] @ (columns / 2.0, 1e5 + rows, 1.0))
        return float(sign)
