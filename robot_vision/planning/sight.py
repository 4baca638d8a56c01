# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs, allow-untyped-calls
"""Straight lines between cell centres, decided exactly in whole numbers; compiled, and numba is slow to import."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def line_cost(cost, row, column, end_row, end_column):
    """Cost of the straight line between two cell centres; inf where it meets a wall.

    It may touch the corner of a wall, but not pass between two walls that touch in a point.

    Args:
        cost: float64 (R + 2, C + 2), of a cell's side, padded by inf; inf in walls.
        row: of the first cell, padded.
        column: of the first cell, padded.
        end_row: of the last cell, padded.
        end_column: of the last cell, padded.
    """
    down, right = end_row - row, end_column - column
    length = np.hypot(down, right)
    if length == 0.0:
        return 0.0 * cost[row, column]
    step_row, step_column = (1 if down > 0 else -1), (1 if right > 0 else -1)
    down, right = abs(down), abs(right)
    # the line leaves row k at (2 k + 1) / (2 down) of its length, column k likewise: compare by cross products
    rows, columns = 0, 0
    total, at = 0.0, 0.0
    while rows < down or columns < right:
        total_here = cost[row, column]
        if total_here == np.inf:
            return np.inf
        by_row, by_column = (2 * rows + 1) * right, (2 * columns + 1) * down
        goes_down = rows < down and (columns == right or by_row <= by_column)
        goes_right = columns < right and (rows == down or by_column <= by_row)
        leaves = (2 * rows + 1) / (2.0 * down) if goes_down else (2 * columns + 1) / (2.0 * right)
        total += total_here * (leaves - at)
        at = leaves
        if goes_down and goes_right:
            if cost[row + step_row, column] == np.inf and cost[row, column + step_column] == np.inf:
                return np.inf
        if goes_down:
            row += step_row
            rows += 1
        if goes_right:
            column += step_column
            columns += 1
    if cost[row, column] == np.inf:
        return np.inf
    return length * (total + cost[row, column] * (1.0 - at))


@njit(cache=True)
def pulled_taut(cost, cells):
    """Leave out cells of a way where the straight line costs no more; cells int64 (M, 2), padded. Returns (K, 2)."""
    count = len(cells)
    along = np.zeros(count)
    for k in range(1, count):
        along[k] = along[k - 1] + line_cost(cost, cells[k - 1, 0], cells[k - 1, 1], cells[k, 0], cells[k, 1])
    kept = np.zeros(count, np.int64)
    size, here = 1, 0
    while here < count - 1:
        ahead = here + 1
        for other in range(count - 1, here + 1, -1):
            straight = line_cost(cost, cells[here, 0], cells[here, 1], cells[other, 0], cells[other, 1])
            if straight <= along[other] - along[here] + 1e-9:
                ahead = other
                break
        here = ahead
        kept[size] = here
        size += 1
    return cells[kept[:size]]
