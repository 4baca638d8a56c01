# SPDX-License-Identifier: Apache-2.0
"""Whether a camera hangs: what it shows stays the very same while odometry says that the robot moves."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping.pose import Pose


class FreezeDetector:
    """Compares pictures, or what is drawn of them, and the places they are said to be from.

    Args:
        way: after which no two are the same, m.
        turn: likewise, rad.
    """

    def __init__(self, way: float, turn: float) -> None:
        self.way, self.turn = way, turn
        self._first: tuple[NDArray[Any], Pose] | None = None

    def reset(self) -> None:
        """Forget what was seen."""
        self._first = None

    def update(self, seen: NDArray[Any], pose: Pose) -> bool:
        """Whether this is the very thing that was first seen from another place.

        Args:
            seen: of whatever shape and type; kept, not copied.
            pose: of base_link at that time, in whatever frame.
        """
        if self._first is None or not np.array_equal(self._first[0], seen):
            self._first = seen, pose
        return pose.is_apart(self._first[1], self.way, self.turn)
