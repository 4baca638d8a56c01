# SPDX-License-Identifier: Apache-2.0
"""Where leaves of the crop cover the ground, cell by cell: where these close, nobody can say whose each leaf is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping.pose import Pose
from robot_vision.perception.crop_rows.ground_window import GroundWindow

Array = NDArray[np.float64]
Cells = NDArray[np.intp]

CELL_M = 0.015
"""Side of the cells."""
_CELLS = 271
"""Along each side of the ground that is known; the robot stands about its middle."""
#: From farther ahead than this, from the nearest ground in view on, leaves hide too much beyond them, m.
_NEAR_M = 1.0
#: Share of earlier pictures' word that is left, and share of it from which on a cell is covered.
_FADES, _COVERED = 0.7, 0.5


class LeafCover:
    """Keeps which cells of the ground around the robot leaves of the crop cover, as seen from nearby."""

    def __init__(self) -> None:
        self._grown, self._seen = np.zeros((2, _CELLS, _CELLS))
        self._corner = np.zeros(2, np.intp)

    def reset(self) -> None:
        """Forget all leaves."""
        self._grown[:], self._seen[:] = 0.0, 0.0

    def see(self, window: GroundWindow, pose: Pose) -> None:
        """Take in the ground before the robot.

        Args:
            window: seen from above.
            pose: of the robot in the field.
        """
        self._follow(pose)
        step = max(int(CELL_M / window.side), 1)
        row, column = step * np.stack(np.nonzero(window.seen[: int(_NEAR_M / window.side) : step, ::step]))
        places = window.corner + window.side * np.column_stack([row, column])
        index = np.rint(_turned(places, pose.yaw) / CELL_M + (pose.x / CELL_M, pose.y / CELL_M)).astype(
            np.intp
        )
        index -= self._corner
        inside = ((index >= 0) & (index < _CELLS)).all(axis=1)
        cell = (index[:, 0] * _CELLS + index[:, 1])[inside]
        crop = ((window.cells[row, column] > 0) & ~window.foreign[row, column])[inside]
        count = np.bincount(cell, minlength=_CELLS**2).reshape(_CELLS, _CELLS)
        grown = np.bincount(cell, crop, _CELLS**2).reshape(_CELLS, _CELLS)
        now = count > 0
        self._grown[now] = _FADES * self._grown[now] + grown[now] / count[now]
        self._seen[now] = _FADES * self._seen[now] + 1.0

    def places(self, pose: Pose) -> Array:
        """Middles (L, 2) of the covered cells, ahead and left of base_link, m."""
        index = np.argwhere(self._grown > _COVERED * self._seen) + self._corner
        places = np.asarray(CELL_M * index - (pose.x, pose.y), np.float64)
        return _turned(places, -pose.yaw)

    def _follow(self, pose: Pose) -> None:
        """Shift the cells, so that the robot stays in their middle."""
        corner = np.rint(np.array([pose.x, pose.y]) / CELL_M).astype(np.intp) - _CELLS // 2
        by = corner - self._corner
        self._corner = corner
        for grid in (self._grown, self._seen):
            before = grid.copy()
            grid[:] = 0.0
            (to_row, from_row), (to_column, from_column) = (_overlap(int(step)) for step in by)
            grid[to_row, to_column] = before[from_row, from_column]


def _overlap(step: int) -> tuple[slice, slice]:
    """Where cells come to lie, and where they lay, when the corner goes on by so many."""
    step = min(max(step, -_CELLS), _CELLS)
    return slice(max(-step, 0), _CELLS - max(step, 0)), slice(max(step, 0), _CELLS - max(-step, 0))


def _turned(places: Array, yaw: float) -> Array:
    """Vectors (N, 2), turned counter-clockwise."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    return np.asarray(places @ np.array([[cosine, sine], [-sine, cosine]]))
