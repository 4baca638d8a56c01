# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs, allow-untyped-calls
"""Fast marching for floors where some places cost more than others, exact where all cost the same; compiled.

Solves |grad T| = cost with T = 0 at the goal (Sethian 1996): cells are accepted in the order of their T. Plain
differences of T fail at the goal and at every corner of a wall, where T has a kink, and the error travels on. So T is
written as D tau (Fomel, Luo and Zhao 2009), with D the exact distance around the walls, not just the distance from
the goal: D has all the kinks, and its gradient is known, the unit vector away from the corner the way turns at. Then

    grad T = D grad tau + tau grad D,

where tau is smooth: 1 everywhere on an even floor. Its differences are one-sided, of the second order where two
accepted cells stand in line. Along an axis without accepted neighbours T does not change, as in the plain method; but
where a wall or a farther cell stands upstream on it, tau does not.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from robot_vision.planning.heap import doubled, drop_first, push

_ACCEPTED = 1


@njit(cache=True)
def _nearer_side(travel, state, row, column, down, right):
    """On which side of a cell the accepted neighbour with the least T stands: -1, 1, or 0 for none."""
    before = travel[row - down, column - right] if state[row - down, column - right] == _ACCEPTED else np.inf
    after = travel[row + down, column + right] if state[row + down, column + right] == _ACCEPTED else np.inf
    return 0 if before == after == np.inf else -1 if before <= after else 1


@njit(cache=True)
def _axis(travel, distance, state, row, column, down, right, side, slope):
    """One axis of the gradient of T at a cell, a tau - b, by the accepted neighbour on one side (0: there is none).

    Returns:
        T of that neighbour (inf: none), a, b.
    """
    d = distance[row, column]
    if side == 0:
        upstream = -1 if slope > 0.0 else 1
        if slope != 0.0 and distance[row + upstream * down, column + upstream * right] >= d:
            return (
                np.inf,
                slope,
                0.0,
            )  # a wall stands upstream, or all comes from the side: tau does not change
        return np.inf, 0.0, 0.0
    r, c = row + side * down, column + side * right
    near = travel[r, c]
    if distance[r, c] == 0.0:  # the goal itself, from where nothing can be told of tau
        return near, slope, 0.0
    value, factor = near / distance[r, c], -1.0 * side
    r, c = r + side * down, c + side * right
    if 0 <= r < state.shape[0] and 0 <= c < state.shape[1] and state[r, c] == _ACCEPTED:
        if travel[r, c] <= near and distance[r, c] > 0.0:
            value, factor = (4.0 * value - travel[r, c] / distance[r, c]) / 3.0, -1.5 * side
    return near, d * factor + slope, d * factor * value


@njit(cache=True)
def _by_sides(travel, distance, state, row, column, price, slope_y, slope_x, side_y, side_x):
    """T of a cell from its accepted neighbours on given sides; inf if that makes no sense."""
    near_y, a_y, b_y = _axis(travel, distance, state, row, column, 1, 0, side_y, slope_y)
    near_x, a_x, b_x = _axis(travel, distance, state, row, column, 0, 1, side_x, slope_x)
    while near_y < np.inf or near_x < np.inf:
        # (a_y tau - b_y)^2 + (a_x tau - b_x)^2 = price^2
        a, b = a_y * a_y + a_x * a_x, a_y * b_y + a_x * b_x
        inside = b * b - a * (b_y * b_y + b_x * b_x - price * price)
        if inside >= 0.0 and a > 0.0:
            found = distance[row, column] * (b + math.sqrt(inside)) / a
            if (near_y == np.inf or found > near_y) and (near_x == np.inf or found > near_x):
                return found
        # a neighbour that is not upstream says nothing: leave out the farther one
        if near_x == np.inf or (near_y < np.inf and near_y >= near_x):
            near_y, a_y, b_y = np.inf, 0.0, 0.0
        else:
            near_x, a_x, b_x = np.inf, 0.0, 0.0
    return np.inf


@njit(cache=True)
def _solved(travel, distance, roots, state, row, column, price, slope_y, slope_x):
    """T of a cell with a price from its accepted neighbours; slope_y, slope_x: gradient of D there.

    Where fronts meet that come around different corners, the neighbour with the least T may stand on the far side;
    then both sides are tried.
    """
    side_y = _nearer_side(travel, state, row, column, 1, 0)
    side_x = _nearer_side(travel, state, row, column, 0, 1)
    found = _by_sides(travel, distance, state, row, column, price, slope_y, slope_x, side_y, side_x)
    turned_y, turned_x = side_y, side_x
    root = roots[row - 1, column - 1]
    if side_y * slope_y > 0.0 and roots[row - 1 + side_y, column - 1] != root:
        turned_y = -side_y if state[row - side_y, column] == _ACCEPTED else side_y
    if side_x * slope_x > 0.0 and roots[row - 1, column - 1 + side_x] != root:
        turned_x = -side_x if state[row, column - side_x] == _ACCEPTED else side_x
    if turned_y != side_y or turned_x != side_x:
        other = _by_sides(travel, distance, state, row, column, price, slope_y, slope_x, turned_y, turned_x)
        found = min(found, other)
    if found == np.inf:
        nearest = np.inf
        for side in range(4):
            r, c = row + (side == 0) - (side == 1), column + (side == 2) - (side == 3)
            if state[r, c] == _ACCEPTED:
                nearest = min(nearest, travel[r, c])
        found = nearest + price
    return found


@njit(cache=True)
def _around_corner(travel, distance, state, row, column, price, corner_y, corner_x, away):
    """T of a cell right behind the corner (not padded) its way turns at, by the cells before the corner; inf if none.

    No neighbour on an axis tells of that way: T of the corner is its distance times the tau of a cell beside it.
    """
    found = np.inf
    for down in range(2):
        for right in range(2):
            r, c = int(math.floor(corner_y)) + 1 + down, int(math.floor(corner_x)) + 1 + right
            if state[r, c] == _ACCEPTED and distance[r, c] > 0.0 and (r != row or c != column):
                before = (distance[row, column] - away) * travel[r, c] / distance[r, c]
                if before + price * away > travel[r, c]:
                    found = min(found, before + price * away)
    return found


@njit(cache=True)
def march(cost, goal, until, distance, roots, corners, travel):
    """Spread the travel cost from a goal.

    Args:
        cost: float64 (R + 2, C + 2), of a cell's side, padded by inf; inf in walls.
        goal: row, column, padded.
        until: row, column where to stop, padded; (-1, -1): nowhere.
        distance: float64 (R + 2, C + 2), exact distance, cells.
        roots: int32 (R, C), the corner each cell is reached from.
        corners: float64 (N, 2), row, column of corners, not padded.
        travel: float64 (R + 2, C + 2), inf; becomes the cost of the best way to the goal.
    """
    columns = cost.shape[1]
    state = np.zeros(cost.shape, np.uint8)
    keys, items, waiting = np.zeros(1024), np.zeros(1024, np.int64), 1
    items[0] = goal[0] * columns + goal[1]
    travel[goal[0], goal[1]] = 0.0
    last = np.inf
    while waiting > 0:
        value, item = keys[0], items[0]
        drop_first(keys, items, waiting)
        waiting -= 1
        row, column = item // columns, item % columns
        if state[row, column] == _ACCEPTED or value != travel[row, column]:
            continue
        if value > last:
            break
        state[row, column] = _ACCEPTED
        if row == until[0] and column == until[1]:
            last = value
        if waiting + 4 > len(keys):
            keys, items = doubled(keys), doubled(items)
        for side in range(4):
            r = row + (side == 0) - (side == 1)
            c = column + (side == 2) - (side == 3)
            if state[r, c] == _ACCEPTED or cost[r, c] == np.inf:
                continue
            root = roots[r - 1, c - 1]
            away_y, away_x = r - 1 - corners[root, 0], c - 1 - corners[root, 1]
            away = math.hypot(away_y, away_x)
            # next to the goal the cost on the way is that of half of either cell
            here = cost[r, c] if value > 0.0 else 0.5 * (cost[r, c] + cost[row, column])
            fresh = _solved(travel, distance, roots, state, r, c, here, away_y / away, away_x / away)
            if root > 0 and away < 1.0:
                turned = _around_corner(
                    travel, distance, state, r, c, here, corners[root, 0], corners[root, 1], away
                )
                fresh = min(fresh, turned)
            # what a second axis adds may raise it; the lower key then no longer counts
            if fresh != travel[r, c]:
                travel[r, c] = fresh
                push(keys, items, waiting, fresh, r * columns + c)
                waiting += 1
    for row in range(cost.shape[0]):
        for column in range(columns):
            if state[row, column] != _ACCEPTED:
                travel[row, column] = np.inf
