# SPDX-License-Identifier: Apache-2.0
"""Marks at known distances along a line lead to its vanishing point, before any camera, and honestly so."""

from __future__ import annotations

import numpy as np
import pytest
from ground_scenes import rails
from hypothesis import given, settings

from robot_vision.geometry import Camera, CrossRatioError, GroundPlane, fit_spacings, vanishing_offset
from robot_vision.geometry.sphere import angle_between, local_coordinates

CAMERA = Camera(500.0, 510.0, 320.0, 240.0, 640, 480, height_m=1.2, pitch=0.3, roll=0.1)
STONES = 0.5 * np.arange(7.0)


def joints(azimuth: float = 0.3, camera: Camera = CAMERA) -> np.ndarray:
    """Joints of a row of stones that begins 2 m ahead, px."""
    along = np.array([np.cos(azimuth), np.sin(azimuth)])
    return GroundPlane(camera).to_pixels((2.0, -0.8) + STONES[:, None] * along)


@settings(max_examples=60)
@given(rails(most=3))
def test_two_spacings_of_any_ratio_give_the_direction_of_any_line_before_any_camera(rail):
    direction, _ = fit_spacings(rail.marks, rail.distances).direction(rail.camera)
    assert angle_between(direction, rail.direction) < 1e-9


@settings(max_examples=60)
@given(rails())
def test_many_spacings_give_the_direction_and_agree(rail):
    fit = fit_spacings(rail.marks, rail.distances)
    assert angle_between(fit.direction(rail.camera)[0], rail.direction) < 1e-9
    assert fit.misfit < 1e-15
    assert fit.freedom == 2 * len(rail.distances) - 5


@settings(max_examples=60)
@given(rails())
def test_origin_unit_and_order_of_the_distances_do_not_matter(rail):
    one = fit_spacings(rail.marks, rail.distances).direction(rail.camera)[0]
    other = fit_spacings(rail.marks[::-1], 7.0 - 3.0 * rail.distances[::-1]).direction(rail.camera)[0]
    assert angle_between(one, other) < 1e-9


def test_the_formula_of_the_chapter_is_the_case_of_three_marks():
    marks = joints()[[0, 2, 3]]
    away = np.linalg.norm(marks - marks[0], axis=1)
    expected = marks[0] + (marks[2] - marks[0]) / away[2] * vanishing_offset(away[1], away[2], 1.0, 0.5)
    assert fit_spacings(marks, STONES[[0, 2, 3]]).pixel == pytest.approx(expected, rel=1e-9)


def test_the_covariance_is_that_of_noisy_marks():
    random = np.random.default_rng(1)
    marks = joints()
    fit = fit_spacings(marks, STONES, 0.1)
    direction, covariance = fit.direction(CAMERA)
    noisy = [fit_spacings(marks + random.normal(0.0, 0.1, marks.shape), STONES, 0.1) for _ in range(1000)]
    errors = np.array([local_coordinates(direction, each.direction(CAMERA)[0]) for each in noisy])
    normalised = np.einsum("ni,ij,nj->n", errors, np.linalg.inv(covariance), errors)
    assert normalised.mean() == pytest.approx(2.0, rel=0.1)
    assert np.mean([each.misfit for each in noisy]) == pytest.approx(fit.freedom, rel=0.1)
    pixels = np.array([each.pixel for each in noisy]) - fit.pixel
    assert np.cov(pixels.T) == pytest.approx(fit.pixel_covariance, rel=0.25)


def test_more_marks_are_surer():
    few = fit_spacings(joints()[:3], STONES[:3]).direction(CAMERA)[1]
    many = fit_spacings(joints(), STONES).direction(CAMERA)[1]
    assert np.linalg.eigvalsh(few - many).min() > 0.0


def test_a_bad_mark_counts_as_little_as_it_is_said_to():
    marks = joints()
    marks[3] += 5.0
    sigma = np.full(len(marks), 0.1)
    sigma[3] = 50.0
    bad, good = fit_spacings(marks, STONES, 0.1), fit_spacings(marks, STONES, sigma)
    truth = CAMERA.optical_to_base.T @ (np.cos(0.3), np.sin(0.3), 0.0)
    assert bad.misfit > 100.0 * bad.freedom
    assert angle_between(good.direction(CAMERA)[0], truth) < 1e-5


def test_a_line_parallel_to_the_picture_has_a_direction_but_no_pixel():
    level = Camera(500.0, 510.0, 320.0, 240.0, 640, 480, height_m=1.2)
    fit = fit_spacings(joints(np.pi / 2, level), STONES)
    direction, covariance = fit.direction(level)
    assert abs(direction) == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)
    assert np.isfinite(covariance).all()
    with pytest.raises(CrossRatioError, match=r"parallel to the picture.*at infinity"):
        assert fit.pixel is None
    with pytest.raises(CrossRatioError, match="at infinity"):
        assert fit.pixel_covariance is None


@pytest.mark.parametrize(
    ("marks", "distances", "sigma", "reason"),
    [
        ([[0, 0], [1, 1]], [0, 1], 1.0, "three marks or more, not 2"),
        ([[5, 5], [5, 5], [5, 5]], [0, 1, 2], 1.0, "one point of the picture"),
        ([[0, 0], [5, 5], [5, 5]], [0, 1, 2], 1.0, "one point of the picture"),
        ([[0, 0], [3, 3], [5, 5]], [0, 1, 1], 1.0, "a spacing, and so their ratio, is zero"),
        ([[0, 0], [3, 3], [5, 5]], [2, 2, 2], 1.0, "ratio, is zero"),
        ([[0, 0], [5, 5], [3, 3]], [0, 1, 2], 1.0, "do not follow each other"),
        ([[0, 0], [3, np.nan], [5, 5]], [0, 1, 2], 1.0, "must be finite"),
        ([[0, 0], [3, 3], [5, 5]], [0, 1, np.inf], 1.0, "must be finite"),
        ([[0, 0], [3, 3], [5, 5]], [0, 1, 2], 0.0, "sigma must be positive"),
    ],
)
def test_what_names_no_vanishing_point_is_refused_with_its_reason(marks, distances, sigma, reason):
    with pytest.raises(CrossRatioError, match=reason):
        fit_spacings(marks, distances, sigma)


def test_wrong_shapes_are_named():
    with pytest.raises(ValueError, match=r"distances must have shape \(3,\)"):
        fit_spacings([[0, 0], [3, 3], [5, 5]], [0, 1])


def test_marks_that_leave_the_vanishing_point_open_are_refused() -> None:
    with pytest.raises(CrossRatioError):
        fit_spacings([[0.0, 0.0], [3.0, 2.0], [3.0, 0.0]], [0.0, 1.0, 2.0])
