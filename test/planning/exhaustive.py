# SPDX-License-Identifier: Apache-2.0
"""Shortest ways by brute force: every lattice vertex and cell centre a node, every straight line tried."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def is_free(free, row, column):  # type: ignore[no-untyped-def]
    inside = 0 <= row < free.shape[0] and 0 <= column < free.shape[1]
    return inside and free[row, column]


@njit(cache=True)
def is_pinched(free, x, y):  # type: ignore[no-untyped-def]
    """Whether walls touch in the lattice vertex in column x, row y with free cells on the other diagonal."""
    a, b = is_free(free, y - 1, x - 1), is_free(free, y - 1, x)
    c, d = is_free(free, y, x - 1), is_free(free, y, x)
    return (a and d and not b and not c) or (b and c and not a and not d)


@njit(cache=True)
def is_straight_way(free, x0, y0, x1, y1):  # type: ignore[no-untyped-def]
    """Whether a robot without width may go straight between two points, in half cells from the grid's corner.

    It may touch walls and run along them; it may not pass between walls that touch in a point.
    """
    dx, dy = x1 - x0, y1 - y0
    # parameters (times 2 |dx dy|) at which a lattice line is crossed, cut the line into pieces
    cuts = [0.0, 1.0]
    for x in range(min(x0, x1) + 1, max(x0, x1)):
        if x % 2 == 0:
            cuts.append((x - x0) / dx)
    for y in range(min(y0, y1) + 1, max(y0, y1)):
        if y % 2 == 0:
            cuts.append((y - y0) / dy)
    cuts.sort()
    for k in range(len(cuts) - 1):
        if cuts[k + 1] - cuts[k] < 1e-9:
            continue
        t = 0.5 * (cuts[k] + cuts[k + 1])
        x, y = 0.5 * (x0 + t * dx), 0.5 * (y0 + t * dy)
        column, row = int(np.floor(x)), int(np.floor(y))
        if dx == 0 and x0 % 2 == 0:
            if not (is_free(free, row, column - 1) or is_free(free, row, column)):
                return False
        elif dy == 0 and y0 % 2 == 0:
            if not (is_free(free, row - 1, column) or is_free(free, row, column)):
                return False
        elif not is_free(free, row, column):
            return False
    for t in cuts:
        x, y = 0.5 * (x0 + t * dx), 0.5 * (y0 + t * dy)
        near_x, near_y = int(round(x)), int(round(y))
        if abs(x - near_x) < 1e-9 and abs(y - near_y) < 1e-9 and is_pinched(free, near_x, near_y):
            if 1e-9 < t < 1 - 1e-9:
                return False
    return True


@njit(cache=True)
def exhaustive_field(free: NDArray[np.bool_], goal_row: int, goal_column: int) -> NDArray[np.float64]:
    """Lengths of the shortest ways from a cell's centre to all others (R, C), cells; inf where there is none."""
    rows, columns = free.shape
    xs, ys = [2 * goal_column + 1], [2 * goal_row + 1]
    for y in range(rows + 1):
        for x in range(columns + 1):
            around = (
                int(is_free(free, y - 1, x - 1))
                + int(is_free(free, y - 1, x))
                + int(is_free(free, y, x - 1))
                + int(is_free(free, y, x))
            )
            if around >= 2 and not is_pinched(free, x, y):
                xs.append(2 * x)
                ys.append(2 * y)
    count = len(xs)
    length = np.full(count, np.inf)
    length[0] = 0.0
    closed = np.zeros(count, np.bool_)
    field = np.full(free.shape, np.inf)
    while True:
        node, least = -1, np.inf
        for k in range(count):
            if not closed[k] and length[k] < least:
                node, least = k, length[k]
        if node < 0:
            break
        closed[node] = True
        for k in range(count):
            way = least + 0.5 * np.hypot(xs[k] - xs[node], ys[k] - ys[node])
            if not closed[k] and way < length[k] and is_straight_way(free, xs[node], ys[node], xs[k], ys[k]):
                length[k] = way
        for row in range(rows):
            for column in range(columns):
                x, y = 2 * column + 1, 2 * row + 1
                way = least + 0.5 * np.hypot(x - xs[node], y - ys[node])
                if (
                    free[row, column]
                    and way < field[row, column]
                    and is_straight_way(free, xs[node], ys[node], x, y)
                ):
                    field[row, column] = way
    return field
