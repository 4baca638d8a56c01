# SPDX-License-Identifier: Apache-2.0
"""Distance functions other than the exact one: from cell to cell for mazes, and over floors that cost unevenly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_vision.planning.distance import exact_field
from robot_vision.planning.grid import (
    Cell,
    PlanningError,
    checked_free_cell,
    checked_grid,
    checked_positive,
    padded,
)


def connected_field(
    free: ArrayLike,
    goal: Sequence[float],
    neighbours: int = 4,
    resolution: float = 1.0,
    until: Sequence[float] | None = None,
) -> NDArray[np.float64]:
    """Lengths of ways from cell to cell, to the four neighbours or, never past the corner of a wall, to all eight.

    Args:
        free: bool (R, C), where the robot may be.
        goal: row and column of a free cell.
        neighbours: 4 or 8.
        resolution: side of a cell, metres.
        until: row and column of the robot: what is farther than it is left at inf.

    Returns:
        float64 (R, C), metres; inf in walls and where no way leads to the goal.

    Raises:
        PlanningError: goal or robot lie outside or in a wall, or an argument makes no sense.
    """
    from robot_vision.planning import connected  # numba: slow to import

    if neighbours not in (4, 8):
        raise PlanningError(f"neighbours must be 4 or 8, not {neighbours}")
    grid = checked_grid(free)
    checked_positive(resolution, "resolution")
    place = checked_free_cell(grid, goal, "goal")
    end = _end(grid, until)
    distance = np.full(grid.shape, np.inf)
    kernel = connected.spread_to_four if neighbours == 4 else connected.spread_to_eight
    kernel(padded(grid), place, end, distance)
    distance *= resolution
    return distance


def cost_field(
    cost: ArrayLike, goal: Sequence[float], resolution: float = 1.0, until: Sequence[float] | None = None
) -> NDArray[np.float64]:
    """Cost of the best ways to a goal over a floor where each cell has a price, by fast marching.

    Args:
        cost: float (R, C), price of a metre in each cell: positive, inf in walls. With 1 everywhere the field is a
            length; the exact one is `distance_field`.
        goal: row and column of a free cell.
        resolution: side of a cell, metres.
        until: row and column of the robot: what costs more than it is left at inf.

    Returns:
        float64 (R, C), price to the goal; inf in walls and where no way leads to the goal.

    Raises:
        PlanningError: a price is not positive, goal or robot lie outside or in a wall, or an argument makes no sense.
    """
    from robot_vision.planning.marching import march  # numba: slow to import

    prices = checked_cost(cost)
    checked_positive(resolution, "resolution")
    grid = np.isfinite(prices[1:-1, 1:-1])
    place = checked_free_cell(grid, goal, "goal")
    end = _end(grid, until)
    exact = exact_field(grid, place)
    distance = np.pad(exact.distance, 1, constant_values=np.inf)
    travel = np.full(prices.shape, np.inf)
    inner = [(cell[0] + 1, cell[1] + 1) if cell[0] >= 0 else cell for cell in (place, end)]
    march(prices, inner[0], inner[1], distance, exact.roots, exact.corners, travel)
    return np.asarray(travel[1:-1, 1:-1] * resolution)


def checked_cost(cost: ArrayLike) -> NDArray[np.float64]:
    """Prices as float64 (R + 2, C + 2), with a border of inf.

    Raises:
        PlanningError: the grid is empty, or a price is no number or not positive; says where.
    """
    given = np.asarray(cost, np.float64)
    if given.ndim != 2 or 0 in given.shape:
        raise PlanningError(f"cost must be a grid of rows and columns, not an array of shape {given.shape}")
    bad = ~(given > 0.0)
    if bad.any():
        row, column = (int(part) for part in np.argwhere(bad)[0])
        raise PlanningError(f"cost at ({row}, {column}) must be positive, not {given[row, column]}")
    return np.pad(given, 1, constant_values=np.inf)


def _end(grid: NDArray[np.bool_], until: Sequence[float] | None) -> Cell:
    return (-1, -1) if until is None else checked_free_cell(grid, until, "until")
