# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs, allow-untyped-calls
"""The exact distance function on a grid of walls: from corner to corner, each scanning the cone it alone serves.

A shortest way between walls is a chain of straight pieces that turn only at convex corners of walls, and only
around them (it is taut). So distances spread from corner to corner in the order of their length (Dijkstra), and
each corner writes `distance of the corner + Euclidean distance` into the cells it sees within the cone of taut
continuations: between the straight continuation of the way that reached it and the wall it turns around. The
cone lies in one quadrant, so it is scanned row by row outwards, with rays kept as integer ratios: what is seen and
what is hidden is decided exactly.

Coordinates are doubled: lattice vertices are even, cell centres odd. In its quadrant a root looks along u (columns
away from it) and v (rows away from it), both >= 0; `off` is 1 for a root in a cell's centre, 0 for a vertex. A ray is
(u, v); the left ray of a cone is the one nearer to the v axis.

Which rays may be dropped. Let c be the centre of a free cell whose distance is at most D(c), d(p) = G + |p - w| the
length of the way over the root w, and p a point of the same free stretch of the row's middle line, t away from c. Then
the true distance of p is at most D(c) + t, and as d is convex along the line with slope s = (c - w) . u / |c - w| at c,
d(p) >= d(c) - t s to the left of c (t (1 + s) is lost at most) and d(p) >= d(c) + t s to the right of it. So with the
excess e = d(c) - D(c) > 0, every p with

    c - e / (1 + s) < p < c + e / (1 - s)

is reached by a way strictly shorter than over w, and so is everything behind p on its ray: no shortest way runs along
it. Intervals of that kind are joined from either end of a stretch inwards, and the rays they cover are dropped. By
induction over the pieces of any shortest way no piece of it is ever dropped: the field stays exact. No margin
is left to choice; TOLERANCE only covers the rounding of sums.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

TOLERANCE = 1e-7
"""Cells; ways that differ by less may take either course. Far above the rounding of sums up to some 100 000 cells."""
FULL = -1
"""In place of a count: a buffer is too small. (Buffers that grow inside the loops would cost half of the time.)"""


@njit(cache=True, error_model="numpy")
def _up(a, b):
    """A / b rounded up, for b > 0; in double precision, which is exact as long as |a| < 2**52."""
    return int(math.ceil(a / b))


@njit(cache=True, error_model="numpy")
def _down(a, b):
    """A / b rounded down, likewise: a quotient that is no whole number is 1 / b or more away from one."""
    return int(math.floor(a / b))


@njit(cache=True, error_model="numpy")
def _met(corners, count, x, y, u, v, hx, sy, kind):
    corners[count, 0] = x
    corners[count, 1] = y
    corners[count, 2] = u
    corners[count, 3] = v
    corners[count, 4] = hx
    corners[count, 5] = sy
    corners[count, 6] = kind


@njit(cache=True, error_model="numpy")
def walk_wall(free, x, y, hx, sy, kind, corners):
    """Follow the wall a root has turned around, and the straight line on; collect the corners that end on it.

    Args:
        free: uint8, padded by a border of walls.
        x: column of the root, a lattice vertex of the padded grid.
        y: its row.
        hx: direction of u, 1 or -1.
        sy: direction of v, 1 or -1.
        kind: 0, the wall runs along v; 1, along u.
        corners: buffer.

    Returns:
        How many corners were met; the buffer holds of each: vertex x, y, ray of arrival u, v, hx, sy, kind.
        FULL if the buffer is too small.
    """
    count = 0
    ax, ay = (0, sy) if kind == 0 else (hx, 0)
    first = True
    was_low = was_high = False
    while True:
        # the two cells beside the next edge of the line
        if ay != 0:
            row = y if ay > 0 else y - 1
            low, high = free[row, x - 1] != 0, free[row, x] != 0
        else:
            column = x if ax > 0 else x - 1
            low, high = free[y - 1, column] != 0, free[y, column] != 0
        if not first:
            if (not was_low and not high) or (not was_high and not low):
                break  # walls that touch in a point
            if low and high and not (was_low and was_high):
                side = 1 if was_low else -1
                if count == len(corners):
                    return FULL
                if ay != 0:
                    _met(corners, count, x, y, 0, 1, side, sy, 1)
                else:
                    _met(corners, count, x, y, 1, 0, hx, side, 0)
                count += 1
        if not (low or high):
            break
        first = False
        was_low, was_high = low, high
        x += ax
        y += ay
    return count


@njit(cache=True, error_model="numpy")
def _covered_from_left(distance, row, first, last, step, origin, x0, height2, base, begin):
    """How far from the left end of a stretch shorter ways are known; `begin` if not at all.

    Args:
        distance: (R, C).
        row: of the stretch.
        first: cell to begin at.
        last: cell to end at.
        step: direction of u in `row`.
        origin: place of cell 0 in `row`.
        x0: of the centre of cell 0, cells right of the root.
        height2: squared distance of the row from the root.
        base: distance of the root, tolerance taken off.
        begin: where the cone begins on the middle line, cells right of the root.
    """
    reach = begin
    q = first
    while q <= last:
        x = q + x0
        rho = math.sqrt(x * x + height2)
        excess = base + rho - distance[row, origin + step * q]
        if excess <= 0.0 or x - excess * rho / (rho + x) > reach:
            break
        reach = max(reach, x + excess * rho * (rho + x) / height2)
        q = max(q + 1, int(min(reach - x0, last + 1.0)))
    return reach


@njit(cache=True, error_model="numpy")
def _covered_from_right(distance, row, first, last, step, origin, x0, height2, base, begin):
    """The same from the right end inwards; see `_covered_from_left`."""
    reach = begin
    q = last
    while q >= first:
        x = q + x0
        rho = math.sqrt(x * x + height2)
        excess = base + rho - distance[row, origin + step * q]
        if excess <= 0.0 or x + excess * rho * (rho + x) / height2 < reach:
            break
        reach = min(reach, x - excess * rho / (rho + x))
        q = min(q - 1, int(max(math.ceil(reach - x0), first - 1.0)))
    return reach


@njit(cache=True, error_model="numpy")
def _lower(distance, row, first, last, x, step, height2, base):
    """Lower columns `first` to `last` to their distance over the root; the first lies x to its side."""
    for k in range(last - first + 1):
        away = x + step * k
        d = base + math.sqrt(away * away + height2)
        known = distance[row, first + k]
        distance[row, first + k] = d if d < known else known


@njit(cache=True, error_model="numpy")
def _write(distance, roots, root, row, first, last, x, step, height2, base):
    """The same, and note the root where it is the nearer one."""
    for k in range(last - first + 1):
        away = x + step * k
        d = base + math.sqrt(away * away + height2)
        known = distance[row, first + k]
        distance[row, first + k] = d if d < known else known
        roots[row, first + k] = root if d < known else roots[row, first + k]


@njit(cache=True, error_model="numpy")
def scan_cone(
    free, distance, roots, shift, root, x2, y2, base, hx, sy, cone, far_i, far_j, stack, corners, count
):
    """Write the distances of all cells a root sees within its cone, and collect the corners it meets.

    Args:
        free: uint8 (R + 2, C + 2), padded by a border of walls.
        distance: float64, lowered where the root offers less; cells.
        roots: int32, the root of each cell; (0, 0) if not wanted.
        shift: row, column in these two of the padded grid's corner.
        root: number of this root.
        x2: its column in the padded grid, doubled.
        y2: its row, doubled.
        base: its distance, cells.
        hx: direction of u, 1 or -1.
        sy: direction of v, 1 or -1.
        cone: left ray u, v, right ray u, v.
        far_i: last row to look at, counted from the root.
        far_j: last column.
        stack: buffer (K, 5).
        corners: buffer (K, 7), see `walk_wall`.
        count: how many corners it already holds.

    Returns:
        The new count, and whether `far_i` or `far_j` kept it from looking farther. FULL in place of the count if a
        buffer is too small: then give larger ones and scan again, no harm is done.
    """
    is_cut = False
    off = x2 & 1
    keep = roots.size > 0
    column0 = (x2 >> 1) if hx > 0 or off == 1 else (x2 >> 1) - 1
    row0 = (y2 >> 1) if sy > 0 or off == 1 else (y2 >> 1) - 1
    origin = column0 + shift[1]
    x0 = 0.5 * (1 - off)
    stack[0, 0] = 0
    for k in range(4):
        stack[0, 1 + k] = cone[k]
    depth = 1
    while depth > 0:
        depth -= 1
        i = stack[depth, 0]
        if i > far_i:
            is_cut = True
            continue
        left_u, left_v, right_u, right_v = (
            stack[depth, 1],
            stack[depth, 2],
            stack[depth, 3],
            stack[depth, 4],
        )
        r = row0 + sy * i
        out = r + shift[0]
        top = 2 * i - off
        middle, bottom = top + 1, top + 2
        height2 = 0.25 * middle * middle
        j = 0 if i == 0 else _down(left_u * top + off * left_v, 2 * left_v)
        last_top = 0 if i == 0 else _up(right_u * top + off * right_v, 2 * right_v) - 1
        last_bottom = far_j
        if right_v > 0:
            last_bottom = min(far_j, _up(right_u * bottom + off * right_v, 2 * right_v) - 1)
        while j <= last_top + 1 and j <= far_j:
            if free[r, column0 + hx * j] == 0:
                j += 1
                continue
            # a stretch of free cells begins at j; its left side is at u = a
            start, a = j, 2 * j - off
            wall_left = free[r, column0 + hx * (j - 1)] == 0
            if i > 0:
                if (
                    wall_left
                    and a > 0
                    and left_u * top <= a * left_v
                    and a * right_v <= right_u * top
                    and free[r - sy, column0 + hx * j] != 0
                    and free[r - sy, column0 + hx * (j - 1)] != 0
                ):
                    if count == len(corners):
                        return FULL, is_cut
                    _met(corners, count, (x2 + hx * a) >> 1, (y2 + sy * top) >> 1, a, top, hx, sy, 0)
                    count += 1
                if a * right_v >= right_u * top:
                    break
            elif j > 0:
                break
            end = start + 1
            while end <= last_bottom and free[r, column0 + hx * end] != 0:
                end += 1
            j = end + 1
            is_cut = is_cut or end > far_j
            wall_right = free[r, column0 + hx * end] == 0
            b = 2 * end - off
            lu, lv, ru, rv = left_u, left_v, right_u, right_v
            if wall_left and i > 0 and a * left_v > left_u * top:
                lu, lv = a, top
            # the cells whose centres the cone holds
            low = max(start, _up(lu * middle + (off - 1) * lv, 2 * lv))
            high = end - 1
            if rv > 0:
                high = min(high, _down(ru * middle + (off - 1) * rv, 2 * rv))
            if middle > 0:
                begin = 0.5 * lu * middle / lv
                finish = 0.5 * ru * middle / rv if rv > 0 else np.inf
                # a cone between two centres is judged by the cells on either side of it
                first, last = (low, high) if low <= high else (max(start, low - 1), min(low, end - 1))
                base_less = base - TOLERANCE
                reach = _covered_from_left(
                    distance, out, first, last, hx, origin, x0, height2, base_less, begin
                )
                if reach >= finish or reach >= 0.5 * b:
                    continue
                cut = int(math.floor(2.0 * reach))
                if cut * lv > lu * middle:
                    lu, lv = cut, middle
                    low = max(low, (cut + off) >> 1)
                if finish < np.inf or wall_right:
                    edge = min(finish, 0.5 * b)
                    reach = _covered_from_right(
                        distance, out, low, high, hx, origin, x0, height2, base_less, edge
                    )
                    cut = int(math.ceil(2.0 * reach))
                    if reach < edge and (rv == 0 or cut * rv < ru * middle):
                        ru, rv = cut, middle
                        high = min(high, (cut + off - 1) >> 1)
                if lu * rv >= ru * lv:
                    continue
            if low <= high:
                nearest, outermost = (low, high) if hx > 0 else (high, low)
                first, last = origin + hx * nearest, origin + hx * outermost
                if keep:
                    _write(distance, roots, root, out, first, last, nearest + x0, hx, height2, base)
                else:
                    _lower(distance, out, first, last, nearest + x0, hx, height2, base)
            # on to the next row
            if lu * bottom > b * lv:
                continue
            if wall_right and (rv == 0 or b * rv <= ru * bottom):
                if free[r + sy, column0 + hx * end] != 0 and free[r + sy, column0 + hx * (end - 1)] != 0:
                    if count == len(corners):
                        return FULL, is_cut
                    _met(corners, count, (x2 + hx * b) >> 1, (y2 + sy * bottom) >> 1, b, bottom, hx, sy, 1)
                    count += 1
                ru, rv = b, bottom
            elif rv == 0 or (end > far_j and b * rv < ru * bottom):
                ru, rv = b, bottom
            if lu * rv < ru * lv:
                if depth == len(stack):
                    return FULL, is_cut
                stack[depth, 0] = i + 1
                stack[depth, 1] = lu
                stack[depth, 2] = lv
                stack[depth, 3] = ru
                stack[depth, 4] = rv
                depth += 1
        is_cut = is_cut or far_j < j <= last_top + 1
    return count, is_cut
