# SPDX-License-Identifier: Apache-2.0
"""The brute force that the planner is held to on large maps, held to the planner's on small ones; and the floors."""

from __future__ import annotations

import numpy as np
import pytest

from bench.floors import FLOORS, middle_cell
from bench.paths import is_drivable
from bench.visibility import VisibilityGraph
from robot_vision.planning import distance_field, plan_path


def test_brute_force_over_corners_and_the_field_agree() -> None:
    random = np.random.default_rng(0)
    for _ in range(80):
        free = random.random(random.integers(3, 14, 2)) > 0.3
        cells = np.argwhere(free)
        if len(cells) < 2:
            continue
        a, b = (tuple(int(part) for part in cells[k]) for k in random.integers(len(cells), size=2))
        assert VisibilityGraph(free).distance(a, b) == pytest.approx(distance_field(free, a)[b], abs=1e-9)


@pytest.mark.parametrize("kind", FLOORS)
def test_floors_hang_together_and_are_the_same_again(kind: str) -> None:
    free = FLOORS[kind](200, seed=3)
    assert free.shape == (200, 200)
    assert np.array_equal(free, FLOORS[kind](200, seed=3))
    assert np.isfinite(distance_field(free, middle_cell(free))[free]).mean() > 0.9


def test_a_way_through_a_wall_is_found_out() -> None:
    free = np.ones((9, 9), bool)
    free[4, :8] = False
    assert is_drivable(free, plan_path(free, (0, 0), (8, 0)))
    assert not is_drivable(free, np.array([(0.0, 0.0), (8.0, 0.0)]))
    assert not is_drivable(free, np.array([(0.0, 0.0), (8.0, 9.0)]))
