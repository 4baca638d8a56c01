# SPDX-License-Identifier: Apache-2.0
"""The distance function of a floor plan: it starts at the goal, spreads around walls, and stops at the robot.

It is exact at any angle (no grid metric): the length of the shortest way of a point robot that may touch walls, but
passes neither through them nor between two that touch in a point. `cones` tells how, and why nothing is missed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_vision.planning.grid import (
    Cell,
    NoWayError,
    checked_cell,
    checked_free_cell,
    checked_grid,
    checked_positive,
    padded,
)

_SLACK = 1e-6
"""Cells; lengths that differ by less are equal."""
_FIRST_GUESS, _FIRST_MARGIN = 1.1, 2.0
"""A way is first looked for up to this multiple of the straight line, and so many cells more."""
_WIDER = 1.7
"""Then up to so many times that length."""


@dataclass(frozen=True, eq=False)
class ExactField:
    """An exact distance function with the ways it stands for.

    Attributes:
        distance: float64 (R, C), metres to the goal; inf where there is no way.
        roots: int32 (R, C), the corner after which the way from each cell turns for the first time; 0: the goal.
        corners: float64 (N, 2) row, column of the goal (the first) and of the corners where ways turn; cell
            centres are whole numbers, corners lie between them.
        before: int32 (N,), the next corner towards the goal; -1 for the goal.
        resolution: of a cell, metres.
    """

    distance: NDArray[np.float64]
    roots: NDArray[np.int32]
    corners: NDArray[np.float64]
    before: NDArray[np.int32]
    resolution: float

    def way_from(self, start: Sequence[float]) -> NDArray[np.float64]:
        """The shortest way from a cell to the goal, float64 (M, 2) row, column; first the start, last the goal.

        Raises:
            NoWayError: there is none.
            PlanningError: the start lies outside.
        """
        row, column = checked_cell(self.distance.shape, start, "start")
        if not np.isfinite(self.distance[row, column]):
            raise NoWayError(f"no way leads from ({row}, {column}) to the goal")
        points = [np.array([row, column], np.float64)]
        root = int(self.roots[row, column])
        while root >= 0:
            points.append(self.corners[root])
            root = int(self.before[root])
        return np.array(points)


def distance_field(
    free: ArrayLike, goal: Sequence[float], resolution: float = 1.0, until: Sequence[float] | None = None
) -> NDArray[np.float64]:
    """Lengths of the shortest ways from all cells to a goal.

    Args:
        free: bool (R, C), where the robot may be.
        goal: row and column of a free cell.
        resolution: side of a cell, metres.
        until: row and column of the robot: what is farther than it is left at inf, and costs nothing.

    Returns:
        float64 (R, C), metres between cell centres; inf in walls, and where no way leads to the goal.

    Raises:
        PlanningError: goal or robot lie outside or in a wall, or an argument makes no sense.
    """
    grid, place, robot = _checked(free, goal, resolution, until)
    distance = np.full(grid.shape, np.inf)
    if robot is None:
        _spread(grid, place, None, False, np.inf, distance, _NO_ROOTS)
    else:
        for bound in _bounds(place, robot):
            window = _window(grid.shape, (place, place), bound)
            _spread(grid, place, robot, False, bound, distance, _NO_ROOTS, window)
            if distance[robot] <= bound + _SLACK or _is_whole(window, grid.shape):
                distance[window][distance[window] > distance[robot] + _SLACK] = np.inf
                break
            distance[window] = np.inf
    distance *= resolution
    return distance


def exact_field(free: ArrayLike, goal: Sequence[float], resolution: float = 1.0) -> ExactField:
    """The same as `distance_field` over the whole grid, with the ways.

    Raises:
        PlanningError: see `distance_field`.
    """
    grid, place, _ = _checked(free, goal, resolution, None)
    distance, roots = np.full(grid.shape, np.inf), np.zeros(grid.shape, np.int32)
    corners, before = _spread(grid, place, None, False, np.inf, distance, roots)
    distance *= resolution
    return ExactField(distance, roots, corners, before, resolution)


def shortest_way(free: ArrayLike, start: Sequence[float], goal: Sequence[float]) -> NDArray[np.float64]:
    """The shortest way between two cells, at any angle, without working out the whole field.

    Only ways up to a bound are looked for, in the window that holds all of them; the bound grows until there is one.

    Returns:
        float64 (M, 2) row, column: start, corners where it turns, goal.

    Raises:
        NoWayError: no way leads there.
        PlanningError: start or goal lie outside or in a wall.
    """
    grid = checked_grid(free)
    end = checked_free_cell(grid, goal, "goal")
    begin = checked_free_cell(grid, start, "start")
    if begin == end:
        return np.array([begin, end], np.float64)
    for bound in _bounds(end, begin):
        window = _window(grid.shape, (begin, end), bound)
        shape = (window[0].stop - window[0].start, window[1].stop - window[1].start)
        distance, roots = np.full(shape, np.inf), np.zeros(shape, np.int32)
        offset = window[0].start, window[1].start
        ends = [(cell[0] - offset[0], cell[1] - offset[1]) for cell in (begin, end)]
        corners, before = _spread(grid[window], ends[1], ends[0], True, bound, distance, roots)
        if distance[ends[0]] <= bound + _SLACK or _is_whole(window, grid.shape):
            break
    if not np.isfinite(distance[ends[0]]):
        raise NoWayError(f"no way leads from {begin} to {end}: walls lie between them")
    return ExactField(distance, roots, corners, before, 1.0).way_from(ends[0]) + offset


_NO_ROOTS = np.zeros((0, 0), np.int32)
_Window = tuple[slice, slice]


def _checked(
    free: ArrayLike, goal: Sequence[float], resolution: float, until: Sequence[float] | None
) -> tuple[NDArray[np.bool_], Cell, Cell | None]:
    grid = checked_grid(free)
    checked_positive(resolution, "resolution")
    place = checked_free_cell(grid, goal, "goal")
    return grid, place, None if until is None else checked_free_cell(grid, until, "until")


def _bounds(a: Cell, b: Cell) -> list[float]:
    """Lengths up to which a way from a to b is looked for, one after the other; the last one is longer than any."""
    straight = float(np.hypot(a[0] - b[0], a[1] - b[1]))
    first = _FIRST_GUESS * straight + _FIRST_MARGIN
    return [*(first * _WIDER**k for k in range(60)), np.inf]


def _window(shape: tuple[int, ...], ends: tuple[Cell, Cell], bound: float) -> _Window:
    """The part of a grid that holds every way up to a length between two cells (an ellipse's frame)."""
    straight = float(np.hypot(ends[0][0] - ends[1][0], ends[0][1] - ends[1][1]))
    around = float(np.sqrt(bound**2 - straight**2)) / 2 if straight else bound
    if not around < sum(shape):
        return slice(0, shape[0]), slice(0, shape[1])
    wide = int(around) + 1
    rows, columns = (sorted(part) for part in zip(*ends, strict=True))
    return (
        slice(max(0, rows[0] - wide), min(shape[0], rows[1] + wide + 1)),
        slice(max(0, columns[0] - wide), min(shape[1], columns[1] + wide + 1)),
    )


def _is_whole(window: _Window, shape: tuple[int, ...]) -> bool:
    return all(part.start == 0 and part.stop == size for part, size in zip(window, shape, strict=True))


def _spread(
    free: NDArray[np.bool_],
    goal: Cell,
    target: Cell | None,
    heads_for_target: bool,
    bound: float,
    distance: NDArray[np.float64],
    roots: NDArray[np.int32],
    window: _Window | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Call the kernel on a window of the grid; returns corners (N, 2) and what comes before each."""
    from robot_vision.planning.spreading import spread  # numba: slow to import

    window = window or (slice(0, free.shape[0]), slice(0, free.shape[1]))
    top, left = window[0].start, window[1].start
    inside = (-1, -1) if target is None else (target[0] - top, target[1] - left)
    part = np.ascontiguousarray(distance[window])
    place = spread(
        padded(free[window]),
        (goal[0] - top, goal[1] - left),
        inside,
        heads_for_target,
        np.inf if _is_whole(window, free.shape) else bound,
        part,
        roots,
    )
    if not np.shares_memory(part, distance):
        distance[window] = part
    corners = place[:, 1::-1] * 0.5 - 1.5 + (top, left)
    return corners, place[:, 2].copy()
