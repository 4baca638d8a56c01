# SPDX-License-Identifier: Apache-2.0
"""Exact shortest ways by brute force: every corner joined with every corner it sees, then Dijkstra.

Slow, plain, and written apart from the planner, so that the planner can be held to it on maps of real size.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def _is_free(free, row, column):  # type: ignore[no-untyped-def]
    return 0 <= row < free.shape[0] and 0 <= column < free.shape[1] and free[row, column]


@njit(cache=True)
def _is_pinched(free, x, y):  # type: ignore[no-untyped-def]
    a, b = _is_free(free, y - 1, x - 1), _is_free(free, y - 1, x)
    c, d = _is_free(free, y, x - 1), _is_free(free, y, x)
    return a == d and b == c and a != b


@njit(cache=True)
def sees(free, x0, y0, x1, y1):  # type: ignore[no-untyped-def]
    """Whether one may go straight between two points in half cells: even on the lattice, odd in a cell's middle."""
    if y0 == y1:
        row = y0 // 2
        for column in range(min(x0, x1) // 2, (max(x0, x1) + 1) // 2):
            if y0 % 2 == 1:
                if not _is_free(free, row, column):
                    return False
            elif not (_is_free(free, row - 1, column) or _is_free(free, row, column)):
                return False
            if y0 % 2 == 0 and 2 * column > min(x0, x1) and _is_pinched(free, column, row):
                return False
        return True
    if y0 > y1:
        x0, y0, x1, y1 = x1, y1, x0, y0
    dx, dy = x1 - x0, y1 - y0
    for row in range(y0 // 2, (y1 + 1) // 2):
        top, bottom = max(2 * row, y0), min(2 * row + 2, y1)
        # x of the line at the top and bottom of the row, times dy
        begin, end = x0 * dy + dx * (top - y0), x0 * dy + dx * (bottom - y0)
        if top > y0 and begin % (2 * dy) == 0 and _is_pinched(free, begin // (2 * dy), row):
            return False
        low, high = min(begin, end), max(begin, end)
        if low == high and low % (2 * dy) == 0:
            column = low // (2 * dy)
            if not (_is_free(free, row, column - 1) or _is_free(free, row, column)):
                return False
            continue
        for column in range(low // (2 * dy), -((-high) // (2 * dy))):
            if not _is_free(free, row, column):
                return False
            # lattice vertices are met at the top and bottom of rows only
    return True


@njit(cache=True)
def _seen_lengths(free, points):  # type: ignore[no-untyped-def]
    """Lengths between all pairs of points (N, 2) x, y in half cells that see each other, float32 (N, N), cells."""
    count = len(points)
    lengths = np.full((count, count), np.float32(np.inf))
    for a in range(count):
        for b in range(a):
            if sees(free, points[a, 0], points[a, 1], points[b, 0], points[b, 1]):
                lengths[a, b] = lengths[b, a] = 1.0
    return lengths


@njit(cache=True)
def _shortest(free, points, seen, start, goal):  # type: ignore[no-untyped-def]
    """Dijkstra over the corners, from one point to another (x, y in half cells)."""
    straight = 0.5 * np.hypot(goal[0] - start[0], goal[1] - start[1])
    if sees(free, start[0], start[1], goal[0], goal[1]):
        return straight
    count = len(points)
    length, closed = np.full(count, np.inf), np.zeros(count, np.bool_)
    for k in range(count):
        if sees(free, start[0], start[1], points[k, 0], points[k, 1]):
            length[k] = 0.5 * np.hypot(points[k, 0] - start[0], points[k, 1] - start[1])
    best = np.inf
    while True:
        node, least = -1, best
        for k in range(count):
            if not closed[k] and length[k] < least:
                node, least = k, length[k]
        if node < 0:
            return best
        closed[node] = True
        x, y = points[node, 0], points[node, 1]
        if sees(free, x, y, goal[0], goal[1]):
            best = min(best, least + 0.5 * np.hypot(goal[0] - x, goal[1] - y))
        for k in range(count):
            if seen[node, k] < np.inf and not closed[k]:
                way = least + 0.5 * np.hypot(points[k, 0] - x, points[k, 1] - y)
                if way < length[k]:
                    length[k] = way


class VisibilityGraph:
    """The corners of a grid and which of them see each other.

    Args:
        free: bool (R, C).
    """

    def __init__(self, free: NDArray[np.bool_]) -> None:
        self._free = np.ascontiguousarray(free)
        around = np.pad(free, 1).astype(int)
        count = around[:-1, :-1] + around[1:, :-1] + around[:-1, 1:] + around[1:, 1:]
        rows, columns = np.nonzero(count == 3)
        self._corners = 2 * np.column_stack([columns, rows]).astype(np.int64)
        self._seen = _seen_lengths(self._free, self._corners)

    def distance(self, start: tuple[int, int], goal: tuple[int, int]) -> float:
        """Length of the shortest way between two cells (row, column), cells."""
        ends = [(2 * cell[1] + 1, 2 * cell[0] + 1) for cell in (start, goal)]
        return float(_shortest(self._free, self._corners, self._seen, *ends))
