# SPDX-License-Identifier: Apache-2.0
"""Whether a robot sees where it drives: how much a plan of the floor tells that earlier ones did not, if anything."""

from __future__ import annotations

from dataclasses import dataclass, field

from robot_vision.mapping import PlanView, Pose
from robot_vision.mapping.freeze import FreezeDetector
from robot_vision.planning.grid import checked_positive

_WAY, _TURN = 0.03, 0.05
"""Cells of way and radians of turn after which a picture tells something new."""
_SAME_VIEW = 0.3
"""Trust in a picture that tells nothing new."""


@dataclass
class FreshSight:
    """Looks after plans of the floor and odometry, picture by picture.

    Args:
        cell: side of a maze's cells, m.

    Raises:
        PlanningError: it is not a positive number.
    """

    cell: float
    _freeze: FreezeDetector = field(init=False, repr=False)
    _viewed: Pose | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        checked_positive(self.cell, "cell")
        self._freeze = FreezeDetector(_WAY * self.cell, _TURN)

    def fault(self, plan: PlanView, odometry: Pose) -> str:
        """Why a plan is none to drive by; empty when it is one. No two pictures taken on the way give the same plan.

        Args:
            plan: of the floor.
            odometry: by now, in whatever frame.
        """
        if (plan.cells < 0).all():
            return "the plan of the floor shows nothing"
        if self._freeze.update(plan.cells, odometry):
            return "the plan of the floor stays the same while the robot moves"
        return ""

    def trust(self, pose: Pose) -> float:
        """Share of its usual weight that a plan from this pose has: errors of pictures from one place are the same."""
        if self._viewed is not None and not pose.is_apart(self._viewed, self._freeze.way, self._freeze.turn):
            return _SAME_VIEW
        self._viewed = pose
        return 1.0
