# SPDX-License-Identifier: Apache-2.0
"""What every planner asks of a grid before it starts, so that each bad one is refused in the same plain words."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Cell = tuple[int, int]
"""Row and column of a cell."""


class PlanningError(ValueError):
    """A grid, a place or a setting that makes no sense; the text names it and says what is wrong with it."""


class NoWayError(PlanningError):
    """There is no way between two places; the text says why."""


def checked_grid(free: ArrayLike) -> NDArray[np.bool_]:
    """A grid of free cells as bool (R, C).

    Raises:
        PlanningError: it is empty or not of two dimensions.
    """
    grid = np.asarray(free)
    if grid.ndim != 2 or 0 in grid.shape:
        raise PlanningError(f"free must be a grid of rows and columns, not an array of shape {grid.shape}")
    return grid.astype(np.bool_, copy=False)


def checked_cell(shape: tuple[int, ...], cell: Sequence[float], what: str) -> Cell:
    """A cell of a grid as two whole numbers; `what` is what errors call it.

    Raises:
        PlanningError: it lies outside, or is no row and column.
    """
    if len(cell) != 2 or not all(math.isfinite(part) and part == int(part) for part in cell):
        raise PlanningError(f"{what} must be a row and a column in whole numbers, not {tuple(cell)}")
    row, column = int(cell[0]), int(cell[1])
    if not (0 <= row < shape[0] and 0 <= column < shape[1]):
        size = f"{shape[0]} rows and {shape[1]} columns"
        raise PlanningError(f"{what} ({row}, {column}) lies outside the grid of {size}")
    return row, column


def checked_free_cell(free: NDArray[np.bool_], cell: Sequence[float], what: str) -> Cell:
    """The same for a cell that must be free.

    Raises:
        PlanningError: it lies outside or in a wall, or is no row and column.
    """
    row, column = checked_cell(free.shape, cell, what)
    if not free[row, column]:
        raise PlanningError(f"{what} ({row}, {column}) lies in a wall")
    return row, column


def checked_positive(value: float, what: str) -> float:
    """A positive finite number.

    Raises:
        PlanningError: it is none.
    """
    if not (math.isfinite(value) and value > 0.0):
        raise PlanningError(f"{what} must be a positive number, not {value}")
    return float(value)


def padded(free: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """The grid with a border of walls, uint8 (R + 2, C + 2), 1 where free, for kernels that look at neighbours."""
    grid = np.zeros((free.shape[0] + 2, free.shape[1] + 2), np.uint8)
    grid[1:-1, 1:-1] = free
    return grid
