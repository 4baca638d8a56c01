# SPDX-License-Identifier: Apache-2.0
"""What odometry and horizon have wrong, as far as points of the floor tell that are seen from two places."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping.ground_view import GroundView

Array = NDArray[np.float64]

FEWEST_POINTS = 12
"""Points below which nothing is told."""
USUAL_SLIP = 0.01
"""Standard deviation of the slip of an odometry that is believed."""
_PIXEL = 0.2
"""How well a tracked point is placed, working pixels."""
_USUAL = (0.004, 0.01, 0.01, USUAL_SLIP, 0.02, 0.05)
"""Standard deviations of what may be wrong, where the floor shows nothing of it."""


class Disagreement(NamedTuple):
    """By what the floor seems to move against odometry and horizon.

    Roll, pitch and yaw (rad) of this picture are wrong by so much against those of the earlier one; the way is wrong
    by the share `slip`, and by `aside` (m) across it. The pitch of both is wrong by `common`, which has the standard
    deviation `common_sigma`.
    """

    roll: float
    pitch: float
    yaw: float
    slip: float
    aside: float
    common: float = 0.0
    common_sigma: float = float("inf")

    def righted(self, step: Array) -> Array:
        """A step (3, 3) from ground points of this base_link to the earlier one, with what is wrong put right."""
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        way = step[:2, 2]
        aside = np.array([-way[1], way[0]]) / np.hypot(*way) * self.aside
        better = step.copy()
        better[:2, :2] = step[:2, :2] @ np.array([[cos, -sin], [sin, cos]]).T
        better[:2, 2] = way * (1.0 - self.slip) - aside
        return better


class FloorMotion:
    """Points that are mostly floor in two pictures.

    A pitch wrong by d moves the floor at (X, Y) by d (X^2 + H^2) / H along and d X Y / H aside, a roll by the same
    with X and Y changed, a yaw by d (-Y, X). A pitch that is wrong in both pictures makes way that grows with
    distance, a slip the same way everywhere.

    Args:
        points: (N, 2) in this picture, working pixels.
        seen_at: (N, 2) the same in the earlier one.
        before: of the ground in the earlier picture.
        view: of the ground in this one.
        step: (3, 3) from ground points of this base_link to the earlier one.
    """

    def __init__(
        self, points: Array, seen_at: Array, before: GroundView, view: GroundView, step: Array
    ) -> None:
        self._enough = len(points) >= FEWEST_POINTS
        if not self._enough:
            return
        camera = view.camera
        height = camera.height_m or 1.0
        here = np.column_stack(view.ground(points[:, 0], points[:, 1]))
        there = np.column_stack(before.ground(seen_at[:, 0], seen_at[:, 1]))
        turn, shift = step[:2, :2], step[:2, 2]
        onward = turn.T @ shift
        error = (there - shift) @ turn - here
        good = np.isfinite(error).all(axis=1) & np.isfinite(here[:, 0])
        error, here, there = error[good], here[good], there[good]
        x, y = here[:, 0] - camera.x_m, here[:, 1]
        square, way = height**2, np.tile(height * onward, (len(x), 1)).T
        along = np.column_stack([-x * y, x**2 + square, height * y, -way[0], way[1]])
        aside = np.column_stack([-(y**2) - square, x * y, -height * x, -way[1], -way[0]])
        xp, yp = there[:, 0] - camera.x_m, there[:, 1]
        common = np.column_stack([-(xp**2 - x**2), -(xp * yp - x * y)]) @ turn
        terms = np.concatenate([np.stack([along, aside], axis=1), common[:, :, None]], axis=2) / height
        terms[:, :, 4] /= float(np.hypot(*onward))
        ray = _PIXEL / (camera.fx * view.scale)
        sigma = ray * np.stack([(x**2 + square) / height, np.sqrt(x**2 + square)], axis=1)
        self._terms = (terms / sigma[:, :, None]).reshape(-1, len(_USUAL))
        self._error = (error / sigma).ravel()

    def disagreement(self, slip: float) -> Disagreement:
        """What is wrong, where the way is usually wrong by the share `slip`: robust least squares (Cauchy)."""
        if not self._enough:
            return Disagreement(0.0, 0.0, 0.0, 0.0, 0.0)
        terms, error = self._terms, self._error
        usual = np.array(_USUAL)
        usual[3] = slip
        prior = np.diag(1.0 / usual**2)
        information, unknown, weight = prior, np.zeros_like(usual), np.ones_like(error)
        for _ in range(6):
            weighted = terms.T * weight
            information = weighted @ terms + prior
            unknown = np.linalg.solve(information, weighted @ error)
            rest = (error - terms @ unknown).reshape(-1, 2)
            weight = np.asarray(np.repeat(1.0 / (1.0 + (rest**2).sum(axis=1) / 8.0), 2), np.float64)
        sigma_common = float(np.sqrt(np.linalg.inv(information)[5, 5]))
        return Disagreement._make([*(float(value) for value in unknown), sigma_common])
