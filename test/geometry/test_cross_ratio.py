# SPDX-License-Identifier: Apache-2.0
"""The chapter's formulas of the cross ratio against projected lines, and against each other."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from random_cameras import numbers

from robot_vision.geometry import CrossRatioError, length_ratio, vanishing_offset

lengths = numbers(0.01, 100.0)


def seen(distance: float, vanishing: float, nearness: float) -> float:
    """Where a point at `distance` along a line appears: y = y3 s / (s + k) is every projection that keeps O."""
    return vanishing * distance / (distance + nearness)


@settings(max_examples=60)
@given(lengths, lengths, numbers(1.0, 1e4), numbers(0.1, 100.0))
def test_projected_spacings_give_the_vanishing_point_back(a, b, vanishing, nearness):
    y1, y2 = seen(a, vanishing, nearness), seen(a + b, vanishing, nearness)
    # What is left of the slant after the subtraction carries the digits.
    slant = abs((a + b) * y1 - a * y2) / ((a + b) * y1)
    assert vanishing_offset(y1, y2, a, b) == pytest.approx(vanishing, rel=1e-9 + 1e-14 / slant)


@settings(max_examples=60)
@given(numbers(0.5, 100.0), numbers(0.5, 100.0), numbers(1.0, 1e4), numbers(0.1, 100.0))
def test_the_vanishing_point_gives_the_ratio_of_lengths_back(a, b, vanishing, nearness):
    y1, y2 = seen(a, vanishing, nearness), seen(a + b, vanishing, nearness)
    assert length_ratio(y1, y2, vanishing) == pytest.approx((a + b) / a, rel=1e-9)


@settings(max_examples=60)
@given(numbers(1.0, 500.0), numbers(1.02, 1.98))
def test_equal_spacings_obey_both_forms_of_the_chapter(y1, growth):
    y2 = growth * y1
    y3 = vanishing_offset(y1, y2)
    assert y3 == pytest.approx(y1 * y2 / (2.0 * y1 - y2), rel=1e-12)  # (20.8)
    assert 2.0 / y2 == pytest.approx(1.0 / y1 + 1.0 / y3, rel=1e-12)  # (20.9)


@settings(max_examples=60)
@given(numbers(1.0, 500.0), numbers(1.02, 1.5), lengths, lengths, numbers(0.01, 100.0))
def test_only_the_ratio_of_the_lengths_counts(y1, growth, a, b, unit):
    assume(abs((a + b) - a * growth) > 1e-3 * (a + b))
    same = vanishing_offset(y1, growth * y1, unit * a, unit * b)
    assert same == pytest.approx(vanishing_offset(y1, growth * y1, a, b), rel=1e-9)


def test_a_line_that_comes_nearer_vanishes_behind_its_origin():
    assert vanishing_offset(1.0, 3.0) == pytest.approx(-3.0)


def test_many_spacings_are_answered_at_once():
    near, far = np.array([1.0, 2.0]), np.array([1.5, 3.5])
    assert vanishing_offset(near, far) == pytest.approx(
        [vanishing_offset(1.0, 1.5), vanishing_offset(2.0, 3.5)]
    )


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ((1.0, 2.0), "parallel to the picture"),
        ((2.0, 6.0, 1.0, 2.0), "parallel to the picture"),
        ((0.1, 0.3, 0.1, 0.2), "parallel to the picture"),
        ((5.0, 5.0), "y1 and y2 are one point"),
        ((0.0, 5.0), "O and y1 are one point"),
        ((5.0, 0.0), "O and y2 are one point"),
        ((0.0, 0.0), "one point of the picture"),
        ((1.0, 1.5, 1.0, 0.0), "b must be positive, got 0.*ratio of spacings that is zero"),
        ((1.0, 1.5, 0.0, 1.0), "a must be positive"),
        ((1.0, 1.5, -1.0, 1.0), "a must be positive"),
        ((float("nan"), 1.5), "y1 must be finite"),
        ((1.0, float("inf")), "y2 must be finite"),
    ],
)
def test_what_names_no_vanishing_point_is_refused_with_its_reason(arguments, reason):
    with pytest.raises(CrossRatioError, match=reason):
        vanishing_offset(*arguments)


@pytest.mark.parametrize(
    ("arguments", "reason"), [((0.0, 1.0, 3.0), "O and y1"), ((1.0, 3.0, 3.0), "y2 and y3")]
)
def test_a_point_at_infinity_has_no_length(arguments, reason):
    with pytest.raises(CrossRatioError, match=reason):
        length_ratio(*arguments)


def test_a_line_parallel_to_the_picture_is_refused_whatever_its_rounding() -> None:
    random = np.random.default_rng(4)
    for _ in range(300):
        start, way = random.uniform(-2.0, 2.0, 2), random.uniform(-1.0, 1.0, 2)
        depth, first, second = random.uniform(1.0, 9.0), *random.uniform(0.2, 3.0, 2)
        marks = [700.0 * (start + s * way) / depth for s in (0.0, first, first + second)]
        y1, y2 = (float(np.linalg.norm(mark - marks[0])) for mark in marks[1:])
        with pytest.raises(CrossRatioError, match="at infinity"):
            vanishing_offset(y1, y2, first, second)
