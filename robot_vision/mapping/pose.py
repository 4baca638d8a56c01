# SPDX-License-Identifier: Apache-2.0
"""Where odometry says that the robot stood when a picture was taken."""

from __future__ import annotations

import bisect
import math
from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry.rotation import wrap_angle


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

    @property
    def inverse(self) -> Pose:
        """Pose of odom in base_link."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return Pose(-cos * self.x - sin * self.y, sin * self.x - cos * self.y, -self.yaw)

    def then(self, pose: Pose) -> Pose:
        """A pose told in the frame of this one, in the frame that this one is told in."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return Pose(
            float(self.x + cos * pose.x - sin * pose.y),
            float(self.y + sin * pose.x + cos * pose.y),
            float(wrap_angle(self.yaw + pose.yaw)),
        )

    def is_apart(self, other: Pose, way: float, turn: float) -> bool:
        """Whether another pose is at least so far away (m), or turned by at least so much (rad)."""
        apart = math.hypot(self.x - other.x, self.y - other.y)
        return apart >= way or bool(abs(wrap_angle(self.yaw - other.yaw)) >= turn)

    def to_here(self, later: Pose) -> NDArray[np.float64]:
        """(3, 3) from ground points of a later base_link to those of this one."""
        return np.asarray(np.linalg.solve(self.matrix, later.matrix))


class PoseHistory:
    """Keeps poses with their stamps and tells the one at the time of a picture.

    Args:
        longest: odometry older than this before a picture says nothing about it, s.
        most: poses kept.
    """

    def __init__(self, longest: float = 0.2, most: int = 1000) -> None:
        self._longest = longest
        self._stamps: deque[float] = deque(maxlen=most)
        self._poses: deque[tuple[Pose, float]] = deque(maxlen=most)

    def add(self, stamp_s: float, pose: Pose, pitch: float = 0.0) -> None:
        """Take in a pose and the pitch (rad, nose down) of the body; a stamp that goes back forgets all before."""
        if self._stamps and stamp_s <= self._stamps[-1]:
            self.clear()
        self._stamps.append(stamp_s)
        self._poses.append((pose, pitch))

    def clear(self) -> None:
        """Forget all."""
        self._stamps.clear()
        self._poses.clear()

    def at(self, stamp_s: float) -> tuple[Pose, float] | None:
        """Pose and pitch at a time, between the two readings about it; None where odometry is missing or too old.

        After the last reading the robot goes on as it did between the last two.
        """
        after = bisect.bisect_left(self._stamps, stamp_s)
        if not self._stamps or (after == len(self._stamps) and stamp_s - self._stamps[-1] > self._longest):
            return None
        if after < len(self._stamps) and self._stamps[after] == stamp_s:
            return self._poses[after]
        if len(self._stamps) == 1 or after == 0:
            near = self._stamps[0] - stamp_s <= self._longest
            return self._poses[0] if near else None
        second = min(after, len(self._stamps) - 1)
        (a, pitch_a), (b, pitch_b) = self._poses[second - 1], self._poses[second]
        gap = self._stamps[second] - self._stamps[second - 1]
        if gap > self._longest:
            return None
        share = (stamp_s - self._stamps[second - 1]) / gap
        turn = wrap_angle(b.yaw - a.yaw)
        pose = Pose(a.x + share * (b.x - a.x), a.y + share * (b.y - a.y), a.yaw + share * turn)
        return pose, pitch_a + share * (pitch_b - pitch_a)
