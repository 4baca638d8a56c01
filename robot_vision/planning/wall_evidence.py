# SPDX-License-Identifier: Apache-2.0
"""Which walls of a maze of square cells stand: evidence of many plans of the floor, seen from where the robot was."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping import PlanView, Pose
from robot_vision.planning.grid import Cell, checked_positive
from robot_vision.planning.known_maze import KnownMaze

_FREE, _OCCUPIED = 0, 50
_ALONG = np.linspace(-0.3, 0.3, 7)
"""Where a wall is looked at, cells from its middle: not at its ends, where others may meet it."""
_LEAST = 4
"""Of these places must be seen: less may be a shadow, or the end of another wall."""
_ACROSS = np.linspace(-0.24, 0.24, 9)
"""Of each of these places, cells across the wall."""
_AT, _BEYOND = slice(2, 7), slice(7, 9)
"""Of those, counted from the robot's side, where a wall would end the floor, and where floor can be seen only if none
stands there: a wall so near that its foot is below the picture fills the picture's columns."""

_WITHIN = 0.45
"""Cells from the middle of a wall within which a view leads through it."""


@dataclass
class WallEvidence:
    """Log-odds of each wall between two cells of a maze.

    A plan speaks for a wall where floor ends about its middle line, and against it where floor goes through.

    Args:
        size: rows, columns of the maze.
        cell: side of a cell, m.
        reach: farthest wall looked at, cells.
        near: distance at which a plan counts half, cells.
        sure: log-odds from which a wall is known to stand; shadows look like walls, nothing looks like an opening.
        open: log-odds from which it is known not to stand.
        limit: greatest amount of the log-odds: what was seen wrongly can be unseen.

    Raises:
        PlanningError: naming the setting that is not a positive number.
    """

    size: Cell
    cell: float
    reach: float = 2.6
    near: float = 2.0
    sure: float = 1.3
    open: float = 1.0
    limit: float = 4.0
    _odds: NDArray[np.float64] = field(init=False, repr=False)
    _told: NDArray[np.int8] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("cell", "reach", "near", "sure", "open", "limit"):
            checked_positive(getattr(self, name), name)
        rows, columns = self.size
        self._odds = np.zeros((2, rows, columns))
        self._told = np.zeros((2, rows, columns), np.int8)
        row, column = np.mgrid[:rows, :columns].astype(np.float64)
        east = np.stack([column + 1.0, row + 0.5], axis=-1)
        north = np.stack([column + 0.5, row + 1.0], axis=-1)
        self._middles = self.cell * np.stack([east, north])
        along, across = (self.cell * part.ravel() for part in np.meshgrid(_ALONG, _ACROSS, indexing="ij"))
        self._offsets = np.stack([np.stack([across, along], axis=-1), np.stack([along, across], axis=-1)])

    @property
    def odds(self) -> NDArray[np.float64]:
        """Log-odds (2, R, C) of the walls to the east [0] and to the north [1] of each cell; 0: nobody knows."""
        return self._odds.copy()

    def see(self, plan: PlanView, pose: Pose, trust: float = 1.0) -> None:
        """Take in a plan.

        Args:
            plan: of the floor, in base_link.
            pose: of base_link in the maze: x to the east, y to the north from its south-western corner, m.
            trust: share of its usual weight.
        """
        away = self._middles - (pose.x, pose.y)
        distance = np.hypot(away[..., 0], away[..., 1]) / self.cell
        side, row, column = np.nonzero(distance < self.reach)
        places = self._middles[side, row, column][:, None] + self._offsets[side]
        cells = _looked_up(plan, places, pose).reshape(len(side), len(_ALONG), len(_ACROSS))
        from_beyond = away[side, row, column, side] < 0.0
        cells[from_beyond] = cells[from_beyond, :, ::-1]
        taken = (cells[:, :, _AT] >= _OCCUPIED).any(axis=2)
        through = (cells[:, :, _BEYOND] == _FREE).all(axis=2) & ~taken
        through &= self._crossed(side, away[side, row, column])
        told = (taken | through).sum(axis=1)
        votes = np.where(told >= _LEAST, taken.sum(axis=1) - through.sum(axis=1), 0) / len(_ALONG)
        weight = trust / (1.0 + (distance[side, row, column] / self.near) ** 2)
        odds = self._odds[side, row, column] + votes * weight
        self._odds[side, row, column] = np.clip(odds, -self.limit, self.limit)

    def _crossed(self, side: NDArray[np.intp], away: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether the view of each place beyond a wall (N, 7) leads through that wall and not past its end.

        Args:
            side: (N,) 0 for walls that run north and south, 1 for the others.
            away: (N, 2) from the robot to their middles, m.
        """
        number = np.arange(len(side))
        across, along = np.abs(away[number, side]), away[number, 1 - side]
        share = across / (across + _ACROSS[_BEYOND][-1] * self.cell)
        places = along[:, None] + self.cell * _ALONG
        return np.asarray(np.abs(places * share[:, None] - along[:, None]) < _WITHIN * self.cell)

    def tell(self, known: KnownMaze) -> bool:
        """Note in a maze what is known by now; returns whether that is more than before, or something else."""
        state = np.where(self._odds >= self.sure, 1, np.where(self._odds <= -self.open, -1, self._told))
        changed = np.argwhere(state != self._told)
        for side, row, column in changed:
            known.see((int(row), int(column)), 1 - int(side), bool(state[side, row, column] > 0))
        self._told = state.astype(np.int8)
        return len(changed) > 0

    def forget_weakest(self, known: KnownMaze) -> bool:
        """Take back the wall there is least evidence of; False if there is none.

        A robot that finds itself walled in has seen a wall that is not there.
        """
        places = np.argwhere(self._told > 0)
        if not len(places):
            return False
        side, row, column = (int(part) for part in places[np.argmin(self._odds[tuple(places.T)])])
        known.forget((row, column), 1 - side)
        self._odds[side, row, column] = self._told[side, row, column] = 0
        return True


def _looked_up(plan: PlanView, places: NDArray[np.float64], pose: Pose) -> NDArray[np.int8]:
    """What a plan says of places (..., 2) in the maze, m; -1 beyond its edges."""
    away = places - (pose.x, pose.y)
    cos, sin = np.cos(pose.yaw), np.sin(pose.yaw)
    ahead = cos * away[..., 0] + sin * away[..., 1]
    left = cos * away[..., 1] - sin * away[..., 0]
    column = np.floor((ahead - plan.origin[0]) / plan.resolution).astype(np.int64)
    row = np.floor((left - plan.origin[1]) / plan.resolution).astype(np.int64)
    rows, columns = plan.cells.shape
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    found = plan.cells[np.where(inside, row, 0), np.where(inside, column, 0)]
    return np.where(inside, found, np.int8(-1))
