# SPDX-License-Identifier: Apache-2.0
"""Problem 3 of the chapter: the two ways from flagstones to the vanishing line, and what each of them needs."""

from __future__ import annotations

import numpy as np
import pytest
from ground_scenes import garden, stone, views
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from random_cameras import numbers

from robot_vision.geometry import (
    Camera,
    CrossRatioError,
    GroundPlane,
    fit_spacings,
    fit_stones,
    fit_widths,
    vanishing_offset,
)

#: Rolled neither way and turned along the path: the joints across it are parallel to the picture.
CAMERA = Camera(500.0, 510.0, 320.0, 240.0, 640, 480, height_m=1.2, pitch=0.3)
HORIZON_ROW = 240.0 - 510.0 * np.tan(0.3)


def widths_of(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Row and width (px) of each stone's side from its first to its second corner."""
    return corners[:, :2, 1].mean(axis=1), np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)


@settings(max_examples=60, deadline=None)
@given(numbers(0.05, 1.2), st.lists(st.tuples(numbers(1.0, 8.0), numbers(-3.0, 3.0)), min_size=2, max_size=8))
def test_widths_of_equal_stones_shrink_to_nothing_at_the_vanishing_line(pitch, middles):
    camera = Camera(500.0, 510.0, 320.0, 240.0, 640, 480, height_m=1.2, pitch=pitch)
    ground = GroundPlane(camera)
    assume(np.ptp([ahead for ahead, _ in middles]) > 0.5)
    # Far apart and of any length: only the width, measured across the path, is common to them.
    lengths = np.linspace(0.3, 0.9, len(middles))
    stones = [stone(np.array(m), (0.4, b), np.pi / 2) for m, b in zip(middles, lengths, strict=True)]
    sides = np.array([ground.to_pixels(each[:2]) for each in stones])
    assert sides[:, 0, 1] == pytest.approx(sides[:, 1, 1])
    fit = fit_widths(sides[:, 0, 1], np.abs(sides[:, 1, 0] - sides[:, 0, 0]))
    assert fit.offset == pytest.approx(240.0 - 510.0 * np.tan(pitch), abs=1e-7)
    assert fit.misfit < 1e-12


def test_two_widths_obey_the_formula():
    fit = fit_widths([300.0, 400.0], [30.0, 50.0])
    assert fit.offset == pytest.approx((30.0 * 400.0 - 50.0 * 300.0) / (30.0 - 50.0))
    assert fit.freedom == 0


def test_the_sigma_of_widths_is_that_of_noisy_ones():
    random = np.random.default_rng(2)
    places = np.linspace(200.0, 460.0, 9)
    widths = 0.3 * (places - HORIZON_ROW)
    noisy = [fit_widths(places, widths + random.normal(0.0, 0.7, 9)) for _ in range(1000)]
    fit = fit_widths(places, widths)
    assert np.std([each.offset for each in noisy]) == pytest.approx(fit.sigma, rel=0.1)
    assert np.mean([each.misfit for each in noisy]) == pytest.approx(fit.freedom, rel=0.1)


def test_both_ways_agree_on_a_laid_path():
    rows = 2.0 + 0.5 * np.arange(6.0)
    left = GroundPlane(CAMERA).to_pixels(np.column_stack([rows, np.full(6, 0.2)]))
    right = GroundPlane(CAMERA).to_pixels(np.column_stack([rows, np.full(6, -0.2)]))
    by_widths = fit_widths(left[:, 1], right[:, 0] - left[:, 0]).offset
    by_lengths = fit_spacings(left, rows).pixel[1]
    y1, y2 = left[0, 1] - left[1, 1], left[0, 1] - left[2, 1]
    assert by_widths == pytest.approx(HORIZON_ROW, abs=1e-9)
    assert by_lengths == pytest.approx(HORIZON_ROW, abs=1e-8)
    # Rows measured from O obey (20.8) although the line runs obliquely: the same factor is in all of them.
    assert left[0, 1] - vanishing_offset(y1, y2) == pytest.approx(HORIZON_ROW, abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(views(), st.integers(0, 1000), st.integers(1, 8))
def test_stones_laid_anyhow_give_the_vanishing_line(camera, seed, count):
    fit = fit_stones(garden(camera, count, seed))
    horizon = GroundPlane(camera).horizon
    reach = np.array([1.0, 1.0, np.hypot(camera.width, camera.height)])
    assert fit.line / reach == pytest.approx(horizon / reach, rel=1e-9, abs=1e-9)
    assert fit.misfit < 1e-12


@pytest.mark.parametrize("seed", range(5))
def test_of_the_two_ways_only_that_by_lengths_still_works_for_stones_laid_anyhow(seed):
    stones = garden(CAMERA, 30, seed, width=0.4)
    by_widths = fit_widths(*widths_of(stones)).offset
    assert abs(by_widths - HORIZON_ROW) > 5.0
    assert fit_stones(stones).line == pytest.approx([0.0, -1.0, HORIZON_ROW], abs=1e-9)
    # The same in the words of (20.8): on each diagonal, its middle and its end from its beginning.
    for corners in stones:
        sides = np.diff(corners[[0, 2, 1, 3]].reshape(2, 2, 2), axis=1)[:, 0]
        share = np.linalg.solve(sides.T * (1.0, -1.0), corners[1] - corners[0])[0]
        vanishing = vanishing_offset(share, 1.0)
        assert (corners[0] + vanishing * sides[0])[1] == pytest.approx(HORIZON_ROW, abs=1e-6)


def test_the_covariance_of_the_line_is_that_of_noisy_corners():
    random = np.random.default_rng(3)
    stones = garden(CAMERA, 8, seed=1)
    fit = fit_stones(stones, 0.1)
    noisy = [fit_stones(stones + random.normal(0.0, 0.1, stones.shape), 0.1) for _ in range(600)]
    # A line has two degrees of freedom: its heights at two columns.
    heights = np.array([[0.0, 0.0, 1.0], [640.0, 0.0, 1.0]])
    errors = np.array([(each.line - fit.line) @ heights.T for each in noisy])
    covariance = heights @ fit.covariance @ heights.T
    normalised = np.einsum("ni,ij,nj->n", errors, np.linalg.inv(covariance), errors)
    assert normalised.mean() == pytest.approx(2.0, rel=0.1)
    assert np.mean([each.misfit for each in noisy]) == pytest.approx(fit.freedom, rel=0.1)


@pytest.mark.parametrize(
    ("places", "widths", "reason"),
    [
        ([300.0], [30.0], "two places or more, not 1"),
        ([300.0, 400.0], [30.0, 30.0], "all equal.*parallel in the picture.*at infinity"),
        ([300.0, 300.0], [30.0, 40.0], "spacing is zero"),
        ([300.0, 400.0], [0.0, 40.0], "positive"),
        ([300.0, np.nan], [30.0, 40.0], "finite"),
    ],
)
def test_widths_that_tell_nothing_are_refused_with_their_reason(places, widths, reason):
    with pytest.raises(CrossRatioError, match=reason):
        fit_widths(places, widths)


SQUARE = np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0]])


@pytest.mark.parametrize(
    ("corners", "reason"),
    [
        (np.zeros((0, 4, 2)), "one stone or more"),
        ([SQUARE[[0, 2, 1, 3]]], "stone 0 are not in order"),
        ([SQUARE, [[0, 0], [1, 1], [2, 2], [0, 2]]], "stone 1 .* three of them lie on a line"),
        ([np.zeros((4, 2))], "three of them lie on a line"),
        ([SQUARE], "straight above.*at infinity"),
        ([SQUARE * np.nan], "finite"),
    ],
)
def test_stones_that_tell_nothing_are_refused_with_their_reason(corners, reason):
    with pytest.raises(CrossRatioError, match=reason):
        fit_stones(corners)
