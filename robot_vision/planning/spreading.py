# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs, allow-untyped-calls
"""The order in which the exact distance function spreads from corner to corner; `cones` holds the argument."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from robot_vision.planning.cones import FULL, TOLERANCE, scan_cone, walk_wall
from robot_vision.planning.heap import doubled, drop_first, push
from robot_vision.planning.vertices import slot_of, with_room

_HALF_DIAGONAL = math.sqrt(0.5)


@njit(cache=True)
def _is_beaten(free, distance, shift, x, y, d):
    """Whether a lattice vertex at (x, y) of the padded grid is reached by a shorter way over a cell beside it."""
    for down in range(2):
        for right in range(2):
            row, column = y - down, x - right
            if (
                free[row, column] != 0
                and distance[row + shift[0], column + shift[1]] + _HALF_DIAGONAL < d - TOLERANCE
            ):
                return True
    return False


@njit(cache=True)
def _widened(span, vertex, far):
    """First and last row (or column), widened to so many cells on one side of a lattice vertex of the padded grid."""
    return min(span[0], vertex - 2 + min(far, 0)), max(span[1], vertex + max(far, 0))


@njit(cache=True)
def spread(free, goal, target, heads_for_target, bound, reach, distance, roots, shift):
    """Spread the distance from the goal's centre over a grid.

    A root is looked around only as far as `reach`; what that cut off is looked at, twice as far, when the wave has
    come so far: the root waits for that at its own length and the reach. All that lies beyond the reach is farther than
    that, so the order of lengths is kept, and little is looked at that is farther than the target.

    Args:
        free: uint8 (R + 2, C + 2), 1 where free, padded by a border of walls.
        goal: row, column, not padded.
        target: row, column where to stop; (-1, -1): nowhere.
        heads_for_target: whether corners nearer to the target come first (A*). Then only the target's distance
            is final in the end; otherwise all distances up to the target's are.
        bound: ways longer than this need not be found; cells.
        reach: how far around a root is looked at first, cells; inf, as with A*: as far as there is anything.
        distance: float64, inf; becomes the distance in cells.
        roots: int32, or (0, 0) if not wanted; becomes the number of the corner each cell is reached from.
        shift: row, column in these two of the padded grid's corner; (-1, -1) if they are no larger than the grid.

    Returns:
        Corners int32 (N, 3): doubled column and row in the padded grid, number of the corner before; the first is
        the goal itself, its predecessor -1. And first and last row, first and last column between which distances
        were written; they may lie outside the grid.
    """
    length = np.zeros(256)
    reached = np.zeros(256)  # how far around the root was looked; 0: not at all
    place = np.zeros((256, 8), np.int32)  # x2, y2, before, ray u, v, hx, sy, kind
    slots = np.zeros(1024, np.int32)
    count = 1
    place[0, 0], place[0, 1], place[0, 2] = 2 * goal[1] + 3, 2 * goal[0] + 3, -1
    keys, items = np.zeros(256), np.zeros(256, np.int32)
    stack = np.zeros((256, 5), np.int64)
    met = np.zeros((256, 7), np.int64)
    target_x, target_y = 2 * target[1] + 3, 2 * target[0] + 3
    aims = target[0] >= 0
    best = bound
    rows, columns = (goal[0], goal[0]), (goal[1], goal[1])
    distance[goal[0] + 1 + shift[0], goal[1] + 1 + shift[1]] = 0.0
    waiting = 1  # the goal, at length 0
    while waiting > 0:
        key, item = keys[0], items[0]
        drop_first(keys, items, waiting)
        waiting -= 1
        if key > best + TOLERANCE:
            break
        root = item if item >= 0 else ~item
        base = length[root]
        x2, y2 = int(place[root, 0]), int(place[root, 1])
        if item < 0:
            reached[root] *= 2.0
        elif reached[root] > 0.0:
            continue
        else:
            reached[root] = reach
            if root > 0 and _is_beaten(free, distance, shift, x2 >> 1, y2 >> 1, base):
                continue
        far = max(free.shape[0], free.shape[1])
        if min(reached[root], best - base) < far:
            far = int(min(reached[root], best - base)) + 2
        is_cut = False
        for quadrant in range(4 if root == 0 else 1):
            if root == 0:
                hx, sy, kind = 1 - 2 * (quadrant & 1), 1 - (quadrant & 2), 0
                cone = (0, 1, 1, 0)
            else:
                u, v = int(place[root, 3]), int(place[root, 4])
                hx, sy, kind = int(place[root, 5]), int(place[root, 6]), int(place[root, 7])
                cone = (0, 1, u, v) if kind == 0 else (u, v, 1, 0)
            while True:
                found, is_cut_here = 0, False
                if item > 0:
                    found = walk_wall(free, x2 >> 1, y2 >> 1, hx, sy, kind, met)
                if found != FULL:
                    found, is_cut_here = scan_cone(
                        free,
                        distance,
                        roots,
                        shift,
                        root,
                        x2,
                        y2,
                        base,
                        hx,
                        sy,
                        cone,
                        far,
                        far,
                        stack,
                        met,
                        found,
                    )
                if found != FULL:
                    break
                stack, met = doubled(stack), doubled(met)
            is_cut = is_cut or is_cut_here
            rows = _widened(rows, y2 >> 1, sy * far)
            columns = _widened(columns, x2 >> 1, hx * far)
            while count + found > len(length):
                length, reached, place = doubled(length), doubled(reached), doubled(place)
            while 2 * (count + found) > len(slots):
                slots = with_room(slots, place, count)
            while waiting + found + 1 > len(keys):
                keys, items = doubled(keys), doubled(items)
            if aims:
                best = min(best, distance[target[0] + 1 + shift[0], target[1] + 1 + shift[1]])
            for k in range(found):
                x, y = met[k, 0], met[k, 1]
                d = base + 0.5 * math.hypot(2.0 * x - x2, 2.0 * y - y2)
                ahead = 0.0
                if heads_for_target:
                    ahead = 0.5 * math.hypot(2.0 * x - target_x, 2.0 * y - target_y)
                if d + ahead > best + TOLERANCE or _is_beaten(free, distance, shift, x, y, d):
                    continue
                slot = slot_of(slots, place, x, y)
                number = slots[slot]
                if number == 0:
                    number = count
                    slots[slot] = number
                    count += 1
                elif reached[number] > 0.0 or d >= length[number]:
                    continue
                length[number] = d
                place[number, 0], place[number, 1], place[number, 2] = 2 * x, 2 * y, root
                for column in range(3, 8):
                    place[number, column] = met[k, column - 1]
                push(keys, items, waiting, d + ahead, number)
                waiting += 1
        if is_cut and base + reached[root] < best:
            push(keys, items, waiting, base + reached[root], ~root)
            waiting += 1
    return place[:count, :3].copy(), rows, columns
