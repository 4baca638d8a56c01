# SPDX-License-Identifier: Apache-2.0
"""Fields from cell to cell against a graph solver, and fast marching against fields that are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from robot_vision.planning import PlanningError, connected_field, cost_field, descend, distance_field

EIGHT = [(0, 1), (1, 0), (1, 1), (1, -1)]


def solved(free: NDArray[np.bool_], goal: tuple[int, int], neighbours: int) -> NDArray[np.float64]:
    """Distances over the graph of cells, diagonals only where both cells beside them are free."""
    rows, columns = free.shape
    begins, ends, lengths = [], [], []
    for row in range(rows):
        for column in range(columns):
            for down, right in EIGHT[: 2 if neighbours == 4 else 4]:
                r, c = row + down, column + right
                if not (0 <= r < rows and 0 <= c < columns and free[row, column] and free[r, c]):
                    continue
                if down and right and not (free[row, c] and free[r, column]):
                    continue
                begins.append(row * columns + column)
                ends.append(r * columns + c)
                lengths.append(np.hypot(down, right))
    graph = coo_array((lengths, (begins, ends)), shape=(free.size, free.size))
    return np.asarray(dijkstra(graph, directed=False, indices=goal[0] * columns + goal[1])).reshape(
        free.shape
    )


@pytest.mark.parametrize("neighbours", [4, 8])
def test_cell_by_cell(neighbours: int) -> None:
    random = np.random.default_rng(neighbours)
    for _ in range(30):
        free = random.random(random.integers(1, 25, 2)) > 0.3
        free.flat[0] = True
        found, true = connected_field(free, (0, 0), neighbours), solved(free, (0, 0), neighbours)
        assert np.allclose(found, np.where(free, true, np.inf), atol=1e-9)
        robot = tuple(int(part) for part in np.argwhere(np.isfinite(true) & free)[-1])
        part = connected_field(free, (0, 0), neighbours, until=robot)
        assert np.isinf(part[found > found[robot]]).all()
        assert part[robot] == found[robot]


def test_other_numbers_of_neighbours_are_refused() -> None:
    with pytest.raises(PlanningError, match="4 or 8, not 6"):
        connected_field(np.ones((2, 2), bool), (0, 0), 6)


def with_walls(seed: int, size: int = 150) -> NDArray[np.bool_]:
    random = np.random.default_rng(seed)
    free = np.ones((size, size), bool)
    for _ in range(25):
        row, column = random.integers(0, size - 30, 2)
        high, wide = random.integers(2, 30, 2)
        free[row : row + high, column : column + wide] = False
    return free


@pytest.mark.parametrize("seed", range(6))
def test_marching_over_an_even_floor_is_exact_around_walls_too(seed: int) -> None:
    free = with_walls(seed)
    goal = tuple(int(part) for part in np.argwhere(free)[free.sum() // 2])
    true = distance_field(free, goal)
    found = cost_field(np.where(free, 1.0, np.inf), goal)
    assert np.array_equal(np.isfinite(found), np.isfinite(true))
    far = np.isfinite(true) & (true > 10)
    assert np.abs(found[far] / true[far] - 1).max() <= 0.005


@pytest.mark.parametrize(("slope", "price"), [(0.01, 1.0), (0.03, 2.0), (-0.004, 0.5)])
def test_marching_over_a_floor_whose_speed_rises_evenly(slope: float, price: float) -> None:
    """Where the speed is linear in x, ways are arcs and T = acosh(1 + a² d² / (2 v v0)) / |a|."""
    rows, columns = np.mgrid[:200, :200]
    speed = (1 + slope * columns) / price
    found = cost_field(1 / speed, (100, 20))
    squares = (rows - 100.0) ** 2 + (columns - 20.0) ** 2
    a = slope / price
    true = np.arccosh(1 + a**2 * squares / (2 * speed * speed[100, 20])) / abs(a)
    far = squares > 100
    assert np.abs(found[far] / true[far] - 1).max() <= 0.005


def test_a_dear_strip_is_gone_around() -> None:
    cost = np.ones((60, 60))
    cost[20:40, 10:60] = 8.0
    field = cost_field(cost, (50, 50))
    way = descend(field, (5, 50), cost)
    assert way[:, 1].min() < 10.5
    straight = descend(cost_field(np.ones((60, 60)), (50, 50)), (5, 50))
    assert len(straight) == 2


def test_until_and_resolution() -> None:
    free = with_walls(9)
    cost = np.where(free, 1.0 + np.linspace(0, 1, 150), np.inf)
    goal, robot = (149, 149), (100, 149)
    whole, part = cost_field(cost, goal, 0.1), cost_field(cost, goal, 0.1, until=robot)
    assert part[robot] == whole[robot] == pytest.approx(0.1 * cost_field(cost, goal)[robot])
    assert np.isinf(part[whole > whole[robot]]).all()


@pytest.mark.parametrize(("value", "words"), [(0.0, "not 0"), (-1.0, "not -1"), (float("nan"), "not nan")])
def test_prices_that_make_no_sense_are_named_by_their_place(value: float, words: str) -> None:
    cost = np.ones((4, 5))
    cost[2, 3] = value
    with pytest.raises(PlanningError, match=rf"cost at \(2, 3\) must be positive, {words}"):
        cost_field(cost, (0, 0))
