# SPDX-License-Identifier: Apache-2.0
"""The floor just before the robot is the sample of what floor looks like, unless something may stand in it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping.appearance import FloorAppearance
from robot_vision.mapping.ground_view import GroundView
from robot_vision.mapping.pose import Pose

Mask = NDArray[np.bool_]
STRANGE = "what is just before the robot looks like no floor seen so far"


@dataclass
class FloorSample:
    """Chooses the pixels from which the looks of the floor are learnt.

    What suddenly stands before the robot must not be learnt: another floor is believed once the robot has driven over
    it.

    Args:
        lowest: share of the ground's rows above those in which the sample lies.
        half_width: of the sample, as a multiple of the camera's height.
        alike: share of the sample that must look like floor, or it is strange.
        sure: share of it that looks like floor beyond which new tints among it are floor, too.
        over: way over strange floor after which it is floor, as a multiple of the camera's height.
    """

    lowest: float = 0.62
    half_width: float = 0.6
    alike: float = 0.3
    sure: float = 0.9
    over: float = 2.5
    _unlike: Pose | None = field(default=None, init=False, repr=False)

    def reset(self) -> None:
        """Forget where a strange floor began."""
        self._unlike = None

    def choose(
        self, lab: NDArray[np.uint8], appearance: FloorAppearance, view: GroundView, pose: Pose | None
    ) -> tuple[Mask | None, str]:
        """Choose the sample.

        Args:
            lab: (H - view.top, W, 3) the part of the working picture that shows ground, CIE Lab of OpenCV.
            appearance: of the floor as it is known so far.
            view: of the ground in the working picture.
            pose: of the robot in odom; None without odometry.

        Returns:
            The sample (H - view.top, W), None when nothing must be learnt, and why the floor is strange, empty when it
            is not.
        """
        rows, columns = view.shape
        height = view.camera.height_m or 1.0
        first = view.top + int(self.lowest * (rows - view.top))
        v = np.arange(first, rows, dtype=np.float64)
        _, y = view.ground(np.arange(columns, dtype=np.float64), v[:, None])
        sample = np.zeros(lab.shape[:2], bool)
        part = sample[-len(v) :]
        part[:] = np.abs(y) < self.half_width * height
        if not appearance.knows:
            return sample, ""
        like = np.asarray(appearance.score(lab[-len(v) :]) > 0.0)
        share = float(like[part].mean()) if part.any() else 0.0
        if share < self.alike:
            self._unlike = self._unlike or pose
            over = pose and self._unlike and np.hypot(pose.x - self._unlike.x, pose.y - self._unlike.y)
            return (None if not over or over < self.over * height else sample), STRANGE
        self._unlike = None
        part &= like if share <= self.sure else ~_from_above(like)
        return sample, ""


def _from_above(like: Mask) -> Mask:
    """What reaches down from above (H, W) in columns of a picture before anything is like the floor.

    New tints among those of the floor are floor, too; what comes in from above may be the foot of a wall.
    """
    return ~np.logical_or.accumulate(like, axis=0)
