# SPDX-License-Identifier: Apache-2.0
"""The exact distance function against brute force, and what it refuses."""

from __future__ import annotations

import numpy as np
import pytest
from exhaustive import exhaustive_field
from numpy.typing import NDArray

from robot_vision.planning import (
    NoWayError,
    PlanningError,
    distance,
    distance_field,
    exact_field,
    shortest_way,
)

ROUNDING = 1e-9


def random_grid(random: np.random.Generator, most: int) -> NDArray[np.bool_]:
    rows, columns = random.integers(1, most, 2)
    free = random.random((rows, columns)) > random.uniform(0.05, 0.55)
    free[random.integers(rows), random.integers(columns)] = True
    return np.asarray(free)


def random_cell(random: np.random.Generator, free: NDArray[np.bool_]) -> tuple[int, int]:
    cells = np.argwhere(free)
    row, column = cells[random.integers(len(cells))]
    return int(row), int(column)


def length(way: NDArray[np.float64]) -> float:
    return float(np.hypot(*np.diff(way, axis=0).T).sum())


@pytest.mark.parametrize(("count", "most"), [(20_000, 8), (300, 20)])
def test_it_is_exact_on_random_grids(count: int, most: int) -> None:
    random = np.random.default_rng(count)
    for _ in range(count):
        free = random_grid(random, most)
        goal = random_cell(random, free)
        found, true = distance_field(free, goal), exhaustive_field(free, *goal)
        assert np.array_equal(np.isfinite(found), np.isfinite(true)), (free, goal)
        assert np.allclose(found, true, rtol=0, atol=ROUNDING), (free, goal)


@pytest.mark.parametrize(("reach", "bound"), [(1.0, 2.0), (4.0, 1000.0), (32.0, 64.0)])
def test_until_leaves_out_what_is_farther_than_the_robot(
    reach: float, bound: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(distance, "_REACH", reach)  # the least ones: roots are looked around again and again
    monkeypatch.setattr(distance, "_NEAR", 1.0)
    monkeypatch.setattr(distance, "_NEAR_MARGIN", bound)  # and whole searches begin anew
    random = np.random.default_rng(2)
    for _ in range(300):
        free = random_grid(random, 60)
        goal, robot = random_cell(random, free), random_cell(random, free)
        whole, part = distance_field(free, goal), distance_field(free, goal, until=robot)
        near = whole <= whole[robot] + ROUNDING
        assert np.allclose(part[near & np.isfinite(whole)], whole[near & np.isfinite(whole)], atol=ROUNDING)
        assert np.isinf(part[~near]).all()


def test_until_costs_what_lies_around_the_robot_and_not_what_the_whole_grid_does() -> None:
    open_floor, goal = np.ones((900, 700), bool), (500, 300)
    written = np.full(open_floor.shape, np.inf)
    distance._spread(open_floor, goal, written, distance._NO_ROOTS, (503, 304), reach=distance._REACH)
    rows, columns = np.nonzero(np.isfinite(written))
    assert np.hypot(rows - 500, columns - 300).max() <= 2 * distance._REACH


def test_ways_are_as_long_as_the_field_says_and_keep_out_of_walls() -> None:
    from exhaustive import is_straight_way

    random = np.random.default_rng(3)
    for _ in range(300):
        free = random_grid(random, 16)
        goal, robot = random_cell(random, free), random_cell(random, free)
        field = exact_field(free, goal)
        if np.isinf(field.distance[robot]):
            with pytest.raises(NoWayError, match="no way leads"):
                field.way_from(robot)
            with pytest.raises(NoWayError, match="no way leads"):
                shortest_way(free, robot, goal)
            continue
        for way in (field.way_from(robot), shortest_way(free, robot, goal)):
            assert tuple(way[0]) == robot
            assert tuple(way[-1]) == goal
            assert length(way) == pytest.approx(field.distance[robot], abs=ROUNDING)
            halves = np.rint(2 * way + 1).astype(int)
            for (y0, x0), (y1, x1) in zip(halves, halves[1:], strict=False):
                assert (y0, x0) == (y1, x1) or is_straight_way(free, x0, y0, x1, y1)


def test_the_distance_does_not_depend_on_which_end_is_the_goal() -> None:
    random = np.random.default_rng(4)
    free = random.random((120, 150)) > 0.3
    a, b = random_cell(random, free), random_cell(random, free)
    assert distance_field(free, a)[b] == pytest.approx(distance_field(free, b)[a], abs=1e-8)


def test_on_open_floor_it_is_the_euclidean_distance_in_metres() -> None:
    rows, columns = np.mgrid[:300, :200]
    found = distance_field(np.ones((300, 200), bool), (40, 170), resolution=0.05)
    assert np.allclose(found, 0.05 * np.hypot(rows - 40, columns - 170), rtol=1e-12)


def test_nothing_leaks_between_walls_that_touch_in_a_point() -> None:
    free = np.ones((6, 6), bool)
    np.fill_diagonal(free, False)
    free[5, 5] = free[4, 5] = True  # a way around the end of the diagonal
    found = distance_field(free, (0, 5))
    assert found[5, 0] > np.hypot(5, 5) + 1.0
    free[5, 5] = False
    assert np.isinf(distance_field(free, (0, 5))[5, 0])


def test_very_long_very_flat_and_very_small_grids() -> None:
    long = np.ones((20_000, 200), bool)
    long[::4, :-1] = long[2::4, 1:] = False  # to and fro, a way of some 2 million cells
    corridors = np.isfinite(distance_field(long, (1, 0)))[1::2]
    assert corridors.all()
    end = distance_field(long, (1, 0))[19_999]
    assert 9_999 * 198 < end.max() < 9_999 * 201
    assert distance_field(np.ones((1, 1), bool), (0, 0)).tolist() == [[0.0]]
    assert distance_field(np.ones((1, 7), bool), (0, 3)).tolist() == [[3, 2, 1, 0, 1, 2, 3]]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"goal": (1, 1)}, r"goal \(1, 1\) lies in a wall"),
        ({"goal": (3, 0)}, r"goal \(3, 0\) lies outside the grid of 3 rows and 3 columns"),
        ({"goal": (0.5, 0)}, "whole numbers"),
        ({"goal": (float("nan"), 0)}, "whole numbers"),
        ({"until": (1, 1)}, r"until \(1, 1\) lies in a wall"),
        ({"until": (0, -1)}, "outside"),
        ({"resolution": 0.0}, "resolution must be a positive number, not 0"),
        ({"free": np.zeros((0, 3), bool)}, r"shape \(0, 3\)"),
        ({"free": np.ones(3, bool)}, r"shape \(3,\)"),
    ],
)
def test_what_makes_no_sense_is_refused_by_name(change: dict[str, object], words: str) -> None:
    free = np.ones((3, 3), bool)
    free[1, 1] = False
    given: dict[str, object] = {"free": free, "goal": (0, 0), **change}
    with pytest.raises(PlanningError, match=words):
        distance_field(**given)  # type: ignore[arg-type]
