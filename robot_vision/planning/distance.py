# SPDX-License-Identifier: Apache-2.0
"""The distance function of a floor plan: it starts at the goal, spreads around walls, and stops at the robot.

It is exact at any angle (no grid metric): the length of the shortest way of a point robot that may touch walls, but
passes neither through them nor between two that touch in a point. `cones` tells how, and why nothing is missed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

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
_FIRST_GUESS, _FIRST_MARGIN = 1.3, 2.0
"""A way is first looked for up to this multiple of the straight line, and so many cells more."""
_WIDER = 2.2
"""Then up to so many times that length."""
_NEAR, _NEAR_MARGIN, _NEAR_WIDER = 3.0, 64.0, 4.0
"""The same where all around the goal is looked for, no farther than the robot: a wide bound costs little there."""
_REACH = 32.0
"""Cells; so far around a corner is looked first when the robot is not to be passed by much."""


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
        _spread(grid, place, distance, _NO_ROOTS)
        return _in_metres(distance, resolution)
    for bound in _bounds(_NEAR * _straight(place, robot) + _NEAR_MARGIN, _NEAR_WIDER):
        window = _around(grid.shape, place, bound)
        part, corner = grid[window], (window[0].start, window[1].start)
        if part.shape == grid.shape:
            bound = np.inf
        first, last = _inside(window, robot), _inside(window, place)
        spread = _spread(part, last, distance, _NO_ROOTS, first, bound=bound, reach=_REACH, corner=corner)
        near = distance[spread.written]
        if distance[robot] <= bound + _SLACK:
            break
        near[:] = np.inf
    np.copyto(near, np.inf, where=near > distance[robot] + _SLACK)
    _in_metres(near, resolution)
    return distance


def exact_field(free: ArrayLike, goal: Sequence[float], resolution: float = 1.0) -> ExactField:
    """The same as `distance_field` over the whole grid, with the ways.

    Raises:
        PlanningError: see `distance_field`.
    """
    grid, place, _ = _checked(free, goal, resolution, None)
    distance, roots = np.full(grid.shape, np.inf), np.zeros(grid.shape, np.int32)
    spread = _spread(grid, place, distance, roots)
    return ExactField(_in_metres(distance, resolution), roots, spread.corners, spread.before, resolution)


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
    for bound in _bounds(_FIRST_GUESS * _straight(begin, end) + _FIRST_MARGIN, _WIDER):
        window = _window(grid.shape, (begin, end), bound)
        part = grid[window]
        if part.shape == grid.shape:
            bound = np.inf
        distance, roots = np.full(part.shape, np.inf), np.zeros(part.shape, np.int32)
        first, last = _inside(window, begin), _inside(window, end)
        spread = _spread(part, last, distance, roots, first, heads_for_target=True, bound=bound)
        if distance[first] <= bound + _SLACK:
            break
    if not np.isfinite(distance[first]):
        raise NoWayError(f"no way leads from {begin} to {end}: walls lie between them")
    way = ExactField(distance, roots, spread.corners, spread.before, 1.0).way_from(first)
    return way + (window[0].start, window[1].start)


_NO_ROOTS = np.zeros((0, 0), np.int32)
_Window = tuple[slice, slice]


def _checked(
    free: ArrayLike, goal: Sequence[float], resolution: float, until: Sequence[float] | None
) -> tuple[NDArray[np.bool_], Cell, Cell | None]:
    grid = checked_grid(free)
    checked_positive(resolution, "resolution")
    place = checked_free_cell(grid, goal, "goal")
    return grid, place, None if until is None else checked_free_cell(grid, until, "until")


def _straight(a: Cell, b: Cell) -> float:
    return math.hypot(a[0] - b[0], a[1] - b[1])


def _bounds(first: float, wider: float) -> Iterator[float]:
    """Lengths up to which a way is looked for, one after the other; the last one is longer than any."""
    yield from (first * wider**k for k in range(60))
    yield np.inf


def _around(shape: tuple[int, ...], place: Cell, bound: float) -> _Window:
    """The part of a grid that holds every way up to a length from a cell."""
    wide = int(min(bound, sum(shape))) + 1
    rows, columns = (
        slice(max(0, at - wide), min(end, at + wide + 1)) for at, end in zip(place, shape, strict=True)
    )
    return rows, columns


def _window(shape: tuple[int, ...], ends: tuple[Cell, Cell], bound: float) -> _Window:
    """The part of a grid that holds every way up to a length between two cells (an ellipse's frame)."""
    around = math.sqrt(bound**2 - _straight(*ends) ** 2) / 2
    if not around < sum(shape):
        return slice(0, shape[0]), slice(0, shape[1])
    wide = int(around) + 1
    rows, columns = (sorted(part) for part in zip(*ends, strict=True))
    return (
        slice(max(0, rows[0] - wide), min(shape[0], rows[1] + wide + 1)),
        slice(max(0, columns[0] - wide), min(shape[1], columns[1] + wide + 1)),
    )


def _inside(window: _Window, cell: Cell) -> Cell:
    """The same cell counted from the window's corner."""
    return cell[0] - window[0].start, cell[1] - window[1].start


def _in_metres(distance: NDArray[np.float64], resolution: float) -> NDArray[np.float64]:
    if resolution != 1.0:
        distance *= resolution
    return distance


class _Spread(NamedTuple):
    """What the kernel tells.

    Attributes:
        corners: float64 (N, 2) row, column in the grid it spread over; the first is the goal.
        before: int32 (N,), which one comes before each.
        written: part of the distances outside which nothing was written.
    """

    corners: NDArray[np.float64]
    before: NDArray[np.int32]
    written: _Window


def _spread(
    free: NDArray[np.bool_],
    goal: Cell,
    distance: NDArray[np.float64],
    roots: NDArray[np.int32],
    target: Cell = (-1, -1),
    *,
    heads_for_target: bool = False,
    bound: float = np.inf,
    reach: float = np.inf,
    corner: Cell = (0, 0),
) -> _Spread:
    """Call the kernel; `corner` is where in `distance` and `roots` the corner of the grid lies."""
    from robot_vision.planning.spreading import spread  # numba: slow to import

    shift = corner[0] - 1, corner[1] - 1
    place, *spans = spread(padded(free), goal, target, heads_for_target, bound, reach, distance, roots, shift)
    rows, columns = (
        slice(max(0, at + first), at + last + 1) for at, (first, last) in zip(corner, spans, strict=True)
    )
    return _Spread(place[:, 1::-1] * 0.5 - 1.5, place[:, 2].copy(), (rows, columns))
