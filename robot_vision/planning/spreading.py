# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs, allow-untyped-calls
"""The order in which the exact distance function spreads from corner to corner; `cones` holds the argument."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from robot_vision.planning.cones import FULL, TOLERANCE, scan_cone, walk_wall
from robot_vision.planning.heap import doubled, drop_first, push

_HALF_DIAGONAL = math.sqrt(0.5)


@njit(cache=True)
def _is_beaten(free, distance, x, y, d):
    """Whether a lattice vertex at (x, y) of the padded grid is reached by a shorter way over a cell beside it."""
    for down in range(2):
        for right in range(2):
            row, column = y - down, x - right
            if free[row, column] != 0 and distance[row - 1, column - 1] + _HALF_DIAGONAL < d - TOLERANCE:
                return True
    return False


@njit(cache=True)
def spread(free, goal, target, heads_for_target, bound, distance, roots):
    """Spread the distance from the goal's centre over a grid.

    Args:
        free: uint8 (R + 2, C + 2), 1 where free, padded by a border of walls.
        goal: row, column, not padded.
        target: row, column where to stop; (-1, -1): nowhere.
        heads_for_target: whether corners nearer to the target come first (A*). Then only the target's distance
            is final in the end; otherwise all distances up to the target's are.
        bound: ways longer than this need not be found; cells.
        distance: float64 (R, C), inf; becomes the distance in cells.
        roots: int32 (R, C), or (0, 0) if not wanted; becomes the number of the corner each cell is reached from.

    Returns:
        Corners int32 (N, 3): doubled column and row in the padded grid, number of the corner before; the first is
        the goal itself, its predecessor -1.
    """
    length = np.zeros(256)
    place = np.zeros((256, 8), np.int32)  # x2, y2, before, ray u, v, hx, sy, kind
    closed = np.zeros(256, np.uint8)
    count = 1
    place[0, 0], place[0, 1], place[0, 2] = 2 * goal[1] + 3, 2 * goal[0] + 3, -1
    numbers = np.zeros((free.shape[0] + 1, free.shape[1] + 1), np.int32)
    keys, items, waiting = np.zeros(256), np.zeros(256, np.int32), 0
    stack = np.zeros((256, 5), np.int64)
    met = np.zeros((256, 7), np.int64)
    target_x, target_y = 2 * target[1] + 3, 2 * target[0] + 3
    aims = target[0] >= 0
    best = bound
    quadrant = 0
    distance[goal[0], goal[1]] = 0.0
    while True:
        if quadrant < 4:
            root, base, kind = 0, 0.0, 0
            hx, sy = 1 - 2 * (quadrant & 1), 1 - (quadrant & 2)
            cone = (0, 1, 1, 0)
            x2, y2 = int(place[0, 0]), int(place[0, 1])
            quadrant += 1
        else:
            if waiting == 0:
                break
            key, root = keys[0], items[0]
            drop_first(keys, items, waiting)
            waiting -= 1
            if closed[root]:
                continue
            if key > best + TOLERANCE:
                break
            closed[root] = 1
            base = length[root]
            x2, y2 = int(place[root, 0]), int(place[root, 1])
            if _is_beaten(free, distance, x2 >> 1, y2 >> 1, base):
                continue
            u, v = int(place[root, 3]), int(place[root, 4])
            hx, sy, kind = int(place[root, 5]), int(place[root, 6]), int(place[root, 7])
            cone = (0, 1, u, v) if kind == 0 else (u, v, 1, 0)
        far = max(free.shape[0], free.shape[1])
        if best - base < far:
            far = int(best - base) + 2
        while True:
            found = 0 if root == 0 else walk_wall(free, x2 >> 1, y2 >> 1, hx, sy, kind, met)
            if found != FULL:
                found = scan_cone(
                    free, distance, roots, root, x2, y2, base, hx, sy, cone, far, far, stack, met, found
                )
            if found != FULL:
                break
            stack, met = doubled(stack), doubled(met)
        while count + found > len(length):
            length, place, closed = doubled(length), doubled(place), doubled(closed)
        while waiting + found > len(keys):
            keys, items = doubled(keys), doubled(items)
        if aims:
            best = min(best, distance[target[0], target[1]])
        for k in range(found):
            x, y = met[k, 0], met[k, 1]
            d = base + 0.5 * math.hypot(2.0 * x - x2, 2.0 * y - y2)
            ahead = 0.0
            if heads_for_target:
                ahead = 0.5 * math.hypot(2.0 * x - target_x, 2.0 * y - target_y)
            if d + ahead > best + TOLERANCE or _is_beaten(free, distance, x, y, d):
                continue
            number = numbers[y, x]
            if number == 0:
                number = count
                numbers[y, x] = number
                count += 1
            elif closed[number] or d >= length[number]:
                continue
            length[number] = d
            place[number, 0], place[number, 1], place[number, 2] = 2 * x, 2 * y, root
            for column in range(3, 8):
                place[number, column] = met[k, column - 1]
            push(keys, items, waiting, d + ahead, number)
            waiting += 1
    return place[:count, :3].copy()
