# SPDX-License-Identifier: Apache-2.0
"""The mean turn rate between two pictures is the integral of what odometry said, over its time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_vision.perception.odometry import RateHistory

rates = st.floats(-5, 5, allow_nan=False)
steps = st.floats(0.001, 0.2)


@given(rates, st.lists(steps, min_size=1, max_size=40), st.floats(0.0, 3.0), st.floats(0.0, 0.4))
def test_a_constant_rate_is_its_own_mean(rate, gaps, since, further):
    history = RateHistory()
    stamps = np.cumsum(gaps)
    for stamp in stamps:
        history.add(float(stamp), rate)
    until = float(stamps[-1]) + further
    assert history.mean(min(since, until), until) == pytest.approx(rate, abs=1e-12)


@given(st.lists(st.tuples(steps, rates), min_size=1, max_size=40), st.floats(0, 1), st.floats(0, 1))
def test_the_mean_is_the_integral_over_the_time(samples, early, late):
    history, stamps = RateHistory(), np.cumsum([gap for gap, _ in samples])
    values = np.array([rate for _, rate in samples])
    for stamp, rate in zip(stamps, values, strict=True):
        history.add(float(stamp), float(rate))
    end = float(stamps[-1]) + 0.3
    since, until = sorted((early * end, late * end))
    heard = stamps <= until
    mean = history.mean(since, until)
    if not heard.any() or until - stamps[heard][-1] > 0.5:
        assert mean is None
        return
    # Each rate holds up to its stamp, the last one heard until the picture.
    fine = since + (np.arange(20000) + 0.5) / 20000 * (until - since)
    at = np.minimum(np.searchsorted(stamps[heard], fine), heard.sum() - 1)
    assert mean == pytest.approx(float(values[at].mean()), abs=0.02)


def test_what_comes_after_the_picture_does_not_count():
    history = RateHistory()
    history.add(1.0, 0.2)
    history.add(1.1, 9.0)
    assert history.mean(0.9, 1.05) == pytest.approx(0.2)


def test_missing_or_old_odometry_says_nothing():
    history = RateHistory(longest=0.5)
    assert history.mean(0.0, 1.0) is None
    history.add(1.0, 0.3)
    assert history.mean(0.5, 0.9) is None
    assert history.mean(1.0, 1.5) == pytest.approx(0.3)
    assert history.mean(1.0, 1.51) is None


def test_a_clock_set_back_forgets_what_was_before():
    history = RateHistory()
    history.add(10.0, 1.0)
    history.add(2.0, -1.0)
    assert history.mean(1.9, 2.0) == pytest.approx(-1.0)
    assert history.mean(9.9, 10.0) is None


def test_one_picture_alone_has_the_last_rate():
    history = RateHistory()
    history.add(1.0, 0.1)
    history.add(1.2, 0.4)
    assert history.mean(1.25, 1.25) == pytest.approx(0.4)


def test_clear_and_the_most_kept():
    history = RateHistory(most=3)
    for k in range(10):
        history.add(0.1 * k, float(k))
    assert history.mean(0.0, 0.9) == pytest.approx((7 * 0.7 + 8 * 0.1 + 9 * 0.1) / 0.9)
    history.clear()
    assert history.mean(0.0, 0.9) is None
