# SPDX-License-Identifier: Apache-2.0
"""From where the robot is to where it shall be: the shortest way with room for the robot, or why there is none."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_vision.planning.clearance import price_of_nearness, with_clearance
from robot_vision.planning.descent import descend
from robot_vision.planning.distance import distance_field, shortest_way
from robot_vision.planning.fields import cost_field
from robot_vision.planning.grid import (
    Cell,
    NoWayError,
    checked_cell,
    checked_free_cell,
    checked_grid,
    checked_positive,
)


def plan_path(
    free: ArrayLike,
    start: Sequence[float],
    goal: Sequence[float],
    resolution: float = 1.0,
    *,
    clearance: float = 0.0,
    middle: float = 0.0,
    nearest: bool = False,
) -> NDArray[np.float64]:
    """Plan a way over a grid.

    Args:
        free: bool (R, C), where there is no wall.
        start: row and column of the robot.
        goal: row and column.
        resolution: side of a cell, metres.
        clearance: least distance of the way from every wall, metres: the robot's radius. A robot that stands closer
            than that is first led to the nearest place that has it.
        middle: within this distance of a wall the way is drawn to the middle, metres; 0: the way is the shortest.
        nearest: if the goal cannot be reached, go to the reachable cell next to it.

    Returns:
        float64 (M, 2) row, column, cell centres at whole numbers: the start, where the way turns, the goal. It passes
        neither through walls nor between walls that touch in a point.

    Raises:
        NoWayError: the goal lies in a wall or too close to one, or walls lie between; says which.
        PlanningError: start or goal lie outside, the start in a wall, or an argument makes no sense.
    """
    grid = checked_grid(free)
    checked_positive(resolution, "resolution")
    begin = checked_free_cell(grid, start, "start")
    end = checked_cell(grid.shape, goal, "goal")
    roomy = with_clearance(grid, clearance, resolution)
    lead_in = _lead_in(grid, roomy, begin, clearance)
    entry = begin if lead_in is None else (int(lead_in[-1, 0]), int(lead_in[-1, 1]))
    try:
        way = _way(grid, roomy, entry, end, resolution, clearance, middle)
    except NoWayError:
        if not nearest:
            raise
        way = _way(grid, roomy, entry, nearest_reachable(roomy, entry, end), resolution, clearance, middle)
    return way if lead_in is None else np.concatenate([lead_in[:-1], way])


def warm_up() -> None:
    """Compile what plans on grids, or load it from the disk."""
    floor = np.ones((3, 3), np.bool_)
    for middle in (0.0, 1.0):
        plan_path(floor, (0, 0), (2, 2), middle=middle)


def nearest_reachable(free: ArrayLike, start: Sequence[float], goal: Sequence[float]) -> Cell:
    """The cell that can be reached from the start and lies nearest to the goal, as the crow flies.

    Raises:
        PlanningError: start or goal lie outside, or the start in a wall.
    """
    grid = checked_grid(free)
    end = checked_cell(grid.shape, goal, "goal")
    reached = np.argwhere(np.isfinite(distance_field(grid, start)))
    row, column = reached[np.argmin(((reached - end) ** 2).sum(axis=1))]
    return int(row), int(column)


def _way(
    grid: NDArray[np.bool_],
    roomy: NDArray[np.bool_],
    begin: Cell,
    end: Cell,
    resolution: float,
    clearance: float,
    middle: float,
) -> NDArray[np.float64]:
    if not grid[end]:
        raise NoWayError(f"the goal {end} lies in a wall")
    if not roomy[end]:
        raise NoWayError(f"the goal {end} is closer than {clearance:g} m to a wall")
    try:
        if not middle:
            return shortest_way(roomy, begin, end)
        cost = np.where(roomy, price_of_nearness(grid, middle, _MOST, resolution), np.inf)
        return descend(cost_field(cost, end, resolution, until=begin), begin, cost)
    except NoWayError as error:
        room = f" with {clearance:g} m of room to every wall" if clearance else ""
        raise NoWayError(f"no way{room} leads from {begin} to {end}: walls lie between them") from error


def _lead_in(
    grid: NDArray[np.bool_], roomy: NDArray[np.bool_], begin: Cell, clearance: float
) -> NDArray[np.float64] | None:
    """The way out of a place that is too narrow to the nearest one that is not; None if there is no need."""
    if roomy[begin]:
        return None
    far = distance_field(grid, begin)
    far[~roomy] = np.inf
    exit_cell = np.unravel_index(int(np.argmin(far)), far.shape)
    if not np.isfinite(far[exit_cell]):
        raise NoWayError(f"nowhere around the start {begin} is there {clearance:g} m of room to every wall")
    return shortest_way(grid, begin, (int(exit_cell[0]), int(exit_cell[1])))


_MOST = 4.0
"""How many times more a metre right at a wall costs than one in the middle, when the middle is asked for."""
