# SPDX-License-Identifier: Apache-2.0
"""Downhill on a distance function to its goal: the way of the steepest slope, then pulled taut."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_vision.planning.distance import ExactField, shortest_way
from robot_vision.planning.fields import checked_cost
from robot_vision.planning.grid import NoWayError, PlanningError, checked_cell

BAND = 6
"""Cells on either side of a descent in which it may be pulled taut."""
_AROUND = [(down, right) for down in (-1, 0, 1) for right in (-1, 0, 1) if down or right]


def descend(
    field: ArrayLike | ExactField, start: Sequence[float], cost: ArrayLike | None = None
) -> NDArray[np.float64]:
    """The way downhill from a cell to the goal of a field.

    On an `ExactField` it is the chain of the corners where the shortest way turns. On any other field each step goes
    to the neighbour with the steepest slope down, diagonally only where both cells beside the step are free; as the
    field falls with every step, no cell is met twice and the way ends where no neighbour lies lower. It is then pulled
    taut: over an even floor to the shortest way within BAND cells of it, else wherever the straight line costs no more.

    Args:
        field: what `exact_field`, `distance_field`, `connected_field` or `cost_field` returned.
        start: row and column.
        cost: float (R, C), the prices the field was made with; None: the same everywhere.

    Returns:
        float64 (M, 2) row, column: first the start, last the goal.

    Raises:
        NoWayError: no way leads from there, or the field has a hollow that is no goal.
        PlanningError: the start lies outside, or field and cost do not fit.
    """
    if isinstance(field, ExactField):
        return field.way_from(start)
    from robot_vision.planning.sight import pulled_taut  # numba: slow to import

    heights = np.asarray(field, np.float64)
    if heights.ndim != 2 or 0 in heights.shape:
        raise PlanningError(
            f"field must be a grid of rows and columns, not an array of shape {heights.shape}"
        )
    cell = checked_cell(heights.shape, start, "start")
    if not np.isfinite(heights[cell]):
        raise NoWayError(f"no way leads from {cell} to the goal")
    prices = checked_cost(np.where(np.isfinite(heights), 1.0, np.inf) if cost is None else cost)
    if prices.shape != (heights.shape[0] + 2, heights.shape[1] + 2):
        raise PlanningError(
            f"cost must have the shape {heights.shape} of the field, not {(prices.shape[0] - 2, prices.shape[1] - 2)}"
        )
    steps = _steps_down(np.pad(heights, 1, constant_values=np.inf), (cell[0] + 1, cell[1] + 1))
    if heights[steps[-1][0] - 1, steps[-1][1] - 1] != np.min(heights):
        raise NoWayError(
            f"the field has a hollow at {(steps[-1][0] - 1, steps[-1][1] - 1)} that is no goal: "
            "it is no distance function"
        )
    cells = np.array(steps)
    if cost is None:
        return _shortest_nearby(np.isfinite(prices[1:-1, 1:-1]), cells - 1)
    return np.asarray(pulled_taut(prices, cells) - 1.0)


def _shortest_nearby(free: NDArray[np.bool_], cells: NDArray[np.int64]) -> NDArray[np.float64]:
    """The shortest way between the ends of a chain of cells (M, 2), within BAND cells of it."""
    band = np.zeros(free.shape, np.uint8)
    band[cells[:, 0], cells[:, 1]] = 1
    near = cv2.dilate(band, np.ones((2 * BAND + 1, 2 * BAND + 1), np.uint8)).astype(np.bool_)
    return shortest_way(free & near, cells[0], cells[-1])


def _steps_down(heights: NDArray[np.float64], cell: tuple[int, int]) -> list[tuple[int, int]]:
    """Cells from one to the next by the steepest slope, until none lies lower; heights padded by inf."""
    steps = [cell]
    while True:
        # touching the corner of a wall is the last resort, for a cell that lies right behind one
        below = _steepest(heights, cell, 2) or _steepest(heights, cell, 1)
        if below is None:
            return steps
        cell = below
        steps.append(cell)


def _steepest(heights: NDArray[np.float64], cell: tuple[int, int], room: int) -> tuple[int, int] | None:
    """The neighbour with the steepest slope down; diagonally with so many free cells beside the step."""
    row, column = cell
    best, slope = None, 0.0
    for down, right in _AROUND:
        beside = heights[row + down, column], heights[row, column + right]
        if down and right and np.isfinite(beside).sum() < room:
            continue
        fall = (heights[cell] - heights[row + down, column + right]) / np.hypot(down, right)
        if fall > slope:
            best, slope = (row + down, column + right), fall
    return best
