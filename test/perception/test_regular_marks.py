# SPDX-License-Identifier: Apache-2.0
"""Marks at regular spacings are numbered, whatever else lies between them; marks at random have no period."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_vision.perception.regular_marks import find_regular


@given(
    seed=st.integers(0, 10_000),
    period=st.floats(0.2, 1.2),
    start=st.floats(-3.0, 3.0),
    width=st.floats(0.02, 0.3),
    count=st.integers(7, 12),
    others=st.integers(0, 2),
)
def test_both_edges_of_regular_joints_are_numbered(seed, period, start, width, count, others):
    random = np.random.default_rng(seed)
    number = np.arange(count)
    edges = [start + period * (number + side * width / 2) for side in (-1, 1)]
    strays = random.uniform(start, start + count * period, others)
    places = np.concatenate([*edges, strays])
    places = places + random.normal(0.0, 0.002 * period, len(places))
    kinds = np.concatenate([np.zeros(count), np.ones(count), random.integers(0, 2, others)]).astype(np.intp)
    order = random.permutation(len(places))
    found = find_regular(places[order], np.full(len(places), 0.002), kinds[order], 0.15, 2.0)
    assert found is not None
    # The longest period is meant, never a part of it.
    assert found.period == pytest.approx(period, rel=0.01)
    true = order[found.chosen]
    mine = true < 2 * count
    assert mine.sum() >= 2 * count - others - 2
    steps = np.unique((true % count)[mine] - found.number[mine])
    assert len(steps) == 1
    predicted = found.start[kinds[true]] + found.period * found.number
    assert np.abs(places[true] - predicted).max() < 0.03 * period


def test_marks_at_random_are_no_row():
    random = np.random.default_rng(3)
    found = 0
    for _ in range(200):
        places = random.uniform(-3.0, 3.0, 20)
        row = find_regular(places, np.full(20, 0.003), random.integers(0, 2, 20), 0.15, 2.0)
        found += row is not None
    assert found <= 4


def test_marks_less_sure_than_the_period_is_long_tell_nothing():
    places = 0.3 * np.arange(12.0)
    assert find_regular(places, np.full(12, 0.1), np.zeros(12, np.intp), 0.15, 1.0) is None
    assert find_regular(places, np.full(12, 0.01), np.zeros(12, np.intp), 0.15, 1.0) is not None


@pytest.mark.parametrize("count", [0, 1, 3])
def test_too_few_marks_are_no_row(count):
    assert (
        find_regular(np.arange(float(count)), np.full(count, 0.01), np.zeros(count, np.intp), 0.2, 2.0)
        is None
    )


def test_a_range_of_periods_without_length_has_no_period():
    assert find_regular(np.arange(9.0), np.full(9, 0.01), np.zeros(9, np.intp), 1.0, 1.0) is None
