# SPDX-License-Identifier: Apache-2.0
"""Planned ways keep out of walls and away from them, and where there is none it is said why."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from exhaustive import is_straight_way
from numpy.typing import NDArray

from robot_vision.planning import (
    NoWayError,
    PlanningError,
    connected_field,
    cost_field,
    descend,
    distance_field,
    exact_field,
    plan_path,
    room_around,
    with_clearance,
)


def blocks(seed: int, size: int = 80, count: int = 12) -> NDArray[np.bool_]:
    random = np.random.default_rng(seed)
    free = np.ones((size, size), bool)
    for _ in range(count):
        row, column = random.integers(0, size - 20, 2)
        high, wide = random.integers(2, 20, 2)
        free[row : row + high, column : column + wide] = False
    free[0, 0] = free[-1, -1] = True
    return free


def room_of_way(free: NDArray[np.bool_], way: NDArray[np.float64]) -> float:
    """Distance in cells of a way from the nearest square of a wall, looked at 20 times a cell along it."""
    walls = np.argwhere(np.pad(~free, 1, constant_values=True)) - 1
    least = np.inf
    for begin, end in zip(way, way[1:], strict=False):
        steps = int(np.ceil(20 * np.hypot(*(end - begin)))) + 1
        for place in begin + np.linspace(0, 1, steps)[:, None] * (end - begin):
            gaps = np.maximum(np.abs(walls - place) - 0.5, 0.0)
            least = min(least, float(np.hypot(*gaps.T).min()))
    return least


@pytest.mark.parametrize("seed", range(6))
def test_a_way_keeps_its_clearance_and_is_the_shortest_that_does(seed: int) -> None:
    free = np.pad(blocks(seed, 40, 6), 6, constant_values=True)
    start, goal = (4, 4), (47, 47)
    way = plan_path(free, start, goal, resolution=0.05, clearance=0.1)
    assert room_of_way(free, way) >= 2.0 - 1e-6
    roomy = with_clearance(free, 2.0)
    assert np.hypot(*np.diff(way, axis=0).T).sum() == pytest.approx(distance_field(roomy, goal)[start])


def test_room_is_the_gap_between_squares() -> None:
    free = np.ones((9, 9), bool)
    free[4, 4] = False
    room = room_around(np.pad(free, 20, constant_values=True))[20:-20, 20:-20]
    rows, columns = np.abs(np.mgrid[-4:5, -4:5])
    assert np.allclose(room, np.hypot(np.maximum(rows - 1, 0), np.maximum(columns - 1, 0)), atol=1e-5)


def test_asked_for_the_middle_it_keeps_to_the_middle() -> None:
    free = np.zeros((40, 60), bool)
    free[3:18, 3:57] = free[3:37, 42:57] = True
    way = plan_path(free, (10, 5), (34, 49), middle=8.0)
    shortest = plan_path(free, (10, 5), (34, 49))
    assert room_of_way(free, shortest) == pytest.approx(0.0, abs=1e-9)
    assert room_of_way(free, way) > 2.0  # at the inner corner, which it may cut a little
    assert abs(way[0, 0] - way[1, 0]) < 1.0
    assert way[-2, 1] == pytest.approx(49.0, abs=1.0)


def test_a_robot_too_close_to_a_wall_is_led_away_from_it_first() -> None:
    free = np.ones((30, 30), bool)
    free[:, 0] = False
    way = plan_path(free, (15, 1), (15, 20), clearance=4.0)
    assert tuple(way[0]) == (15, 1)
    assert room_of_way(free, way[2:]) >= 4.0 - 1e-6


@pytest.mark.parametrize(
    ("start", "goal", "given", "words"),
    [
        ((2, 2), (10, 10), {}, r"the goal \(10, 10\) lies in a wall"),
        ((2, 2), (9, 12), {"clearance": 2.0}, r"the goal \(9, 12\) is closer than 2 m to a wall"),
        ((2, 2), (17, 17), {}, r"no way leads from \(2, 2\) to \(17, 17\): walls lie between"),
        ((2, 2), (17, 17), {"middle": 2.0}, r"no way leads from \(2, 2\) to \(17, 17\)"),
        ((10, 10), (2, 2), {}, r"start \(10, 10\) lies in a wall"),
        ((2, 2), (2, 20), {}, r"goal \(2, 20\) lies outside"),
        ((-1, 2), (2, 2), {}, r"start \(-1, 2\) lies outside"),
        ((2, 2), (4, 4), {"clearance": -1.0}, "clearance must be 0 or more, not -1"),
        ((2, 2), (4, 4), {"clearance": 9.0}, "nowhere around the start"),
    ],
)
def test_where_there_is_no_way_it_is_said_why(
    start: tuple[int, int], goal: tuple[int, int], given: dict[str, float], words: str
) -> None:
    free = np.ones((20, 20), bool)
    free[10] = False
    with pytest.raises(PlanningError, match=words):
        plan_path(free, start, goal, **given)  # type: ignore[arg-type]


def test_on_request_it_goes_as_near_as_it_can() -> None:
    free = np.ones((20, 20), bool)
    free[10] = False
    assert tuple(plan_path(free, (2, 2), (17, 12), nearest=True)[-1]) == (9, 12)
    assert tuple(plan_path(free, (2, 2), (10, 5), nearest=True)[-1]) == (9, 5)
    assert tuple(plan_path(free, (2, 2), (3, 5), nearest=True)[-1]) == (3, 5)


@pytest.mark.parametrize("seed", range(4))
def test_a_descent_keeps_out_of_walls_on_every_kind_of_field(seed: int) -> None:
    free, goal = blocks(seed), (79, 79)
    cost = np.where(free, 1.0 + np.random.default_rng(seed).random(free.shape), np.inf)
    cost = np.where(free, cv2.GaussianBlur(np.where(free, cost, 2.0), (0, 0), 4), np.inf)
    exact = exact_field(free, goal)
    for field, prices in (
        (exact, None),
        (exact.distance, None),
        (connected_field(free, goal, 8), None),
        (cost_field(cost, goal), cost),
    ):
        way = descend(field, (0, 0), prices)
        assert tuple(way[0]) == (0, 0)
        assert tuple(way[-1]) == goal
        for (y0, x0), (y1, x1) in zip(
            *[np.rint(2 * part + 1).astype(int) for part in (way, way[1:])], strict=False
        ):
            assert is_straight_way(free, x0, y0, x1, y1)
        if prices is None:
            assert np.hypot(*np.diff(way, axis=0).T).sum() <= 1.02 * exact.distance[0, 0]


def test_a_field_with_a_hollow_is_no_distance_function() -> None:
    field = distance_field(np.ones((20, 20), bool), (0, 0))
    field[10, 10] = 1.0
    with pytest.raises(NoWayError, match=r"hollow at \(10, 10\)"):
        descend(field, (12, 12))


def test_no_way_down_from_outside_a_field() -> None:
    free = np.ones((5, 5), bool)
    free[2] = False
    with pytest.raises(NoWayError, match=r"no way leads from \(4, 4\)"):
        descend(distance_field(free, (0, 0)), (4, 4))
