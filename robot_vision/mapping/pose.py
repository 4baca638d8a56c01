# SPDX-License-Identifier: Apache-2.0
"""Where odometry says that the robot stood when a picture was taken."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Pose(NamedTuple):
    """Of base_link in odom: x, y (m), yaw (rad, counter-clockwise)."""

    x: float
    y: float
    yaw: float

    @property
    def matrix(self) -> NDArray[np.float64]:
        """(3, 3) from ground points (x, y, 1) of base_link to those of odom."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return np.array([[cos, -sin, self.x], [sin, cos, self.y], [0.0, 0.0, 1.0]])

    def to_here(self, later: Pose) -> NDArray[np.float64]:
        """(3, 3) from ground points of a later base_link to those of this one."""
        return np.asarray(np.linalg.solve(self.matrix, later.matrix))
