# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs, allow-untyped-calls
"""The plain distance functions of cell mazes, from cell to cell; compiled, and numba is slow to import."""

from __future__ import annotations

import numpy as np
from numba import njit

from robot_vision.planning.heap import doubled, drop_first, push

_DIAGONAL = np.sqrt(2.0)


@njit(cache=True)
def spread_to_four(free, goal, until, distance):
    """Count steps to the four neighbours (breadth first) until a cell is reached.

    Args:
        free: uint8 (R + 2, C + 2), padded by walls.
        goal: row, column, not padded.
        until: row, column where to stop; (-1, -1): nowhere.
        distance: float64 (R, C), inf; becomes the number of steps.
    """
    queue = np.empty((distance.size, 2), np.int32)
    queue[0, 0], queue[0, 1] = goal[0], goal[1]
    distance[goal[0], goal[1]] = 0.0
    head, tail = 0, 1
    last = 0.0 if goal[0] == until[0] and goal[1] == until[1] else np.inf
    while head < tail:
        row, column = queue[head]
        head += 1
        d = distance[row, column]
        if d >= last:
            break
        for side in range(4):
            down = (side == 0) - (side == 1)
            right = (side == 2) - (side == 3)
            r, c = row + down, column + right
            if free[r + 1, c + 1] and d + 1.0 <= last and distance[r, c] == np.inf:
                distance[r, c] = d + 1.0
                queue[tail, 0], queue[tail, 1] = r, c
                tail += 1
                if r == until[0] and c == until[1]:
                    last = d + 1.0


@njit(cache=True)
def spread_to_eight(free, goal, until, distance):
    """Sum steps of 1 and sqrt(2) to the eight neighbours (Dijkstra), never diagonally past a wall; see above."""
    columns = distance.shape[1]
    closed = np.zeros(distance.shape, np.bool_)
    keys, items, waiting = np.zeros(1024), np.zeros(1024, np.int64), 1
    items[0] = goal[0] * columns + goal[1]
    distance[goal[0], goal[1]] = 0.0
    last = np.inf
    while waiting > 0:
        d, item = keys[0], items[0]
        drop_first(keys, items, waiting)
        waiting -= 1
        row, column = item // columns, item % columns
        if d > last:
            break
        if closed[row, column]:
            continue
        closed[row, column] = True
        if row == until[0] and column == until[1]:
            last = d
        if waiting + 8 > len(keys):
            keys, items = doubled(keys), doubled(items)
        for down in range(-1, 2):
            for right in range(-1, 2):
                r, c = row + down, column + right
                if not free[r + 1, c + 1] or not free[row + 1, c + 1] or not free[r + 1, column + 1]:
                    continue
                way = d + (_DIAGONAL if down and right else 1.0)
                if way < distance[r, c]:
                    distance[r, c] = way
                    push(keys, items, waiting, way, r * columns + c)
                    waiting += 1
    for row in range(distance.shape[0]):
        for column in range(columns):
            if not closed[row, column]:
                distance[row, column] = np.inf
