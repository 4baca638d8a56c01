# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs, allow-untyped-calls
"""Steps from cell to cell through the openings of a maze; compiled, and numba is slow to import."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def flood(open_east, open_north, seeds):
    """Count steps from the nearest seed to every cell.

    Args:
        open_east: bool (R, C), whether one can go from each cell to its eastern neighbour.
        open_north: bool (R, C), the same to the north.
        seeds: bool (R, C).

    Returns:
        int32 (R, C) steps; -1 where no way leads.
    """
    rows, columns = seeds.shape
    steps = np.full(seeds.shape, -1, np.int32)
    queue = np.empty(seeds.size, np.int32)
    tail = 0
    for row in range(rows):
        for column in range(columns):
            if seeds[row, column]:
                steps[row, column] = 0
                queue[tail] = row * columns + column
                tail += 1
    head = 0
    while head < tail:
        row, column = queue[head] // columns, queue[head] % columns
        head += 1
        ahead = steps[row, column] + 1
        if open_east[row, column] and steps[row, column + 1] < 0:
            steps[row, column + 1] = ahead
            queue[tail] = row * columns + column + 1
            tail += 1
        if column > 0 and open_east[row, column - 1] and steps[row, column - 1] < 0:
            steps[row, column - 1] = ahead
            queue[tail] = row * columns + column - 1
            tail += 1
        if open_north[row, column] and steps[row + 1, column] < 0:
            steps[row + 1, column] = ahead
            queue[tail] = (row + 1) * columns + column
            tail += 1
        if row > 0 and open_north[row - 1, column] and steps[row - 1, column] < 0:
            steps[row - 1, column] = ahead
            queue[tail] = (row - 1) * columns + column
            tail += 1
    return steps
