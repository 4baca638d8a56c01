# SPDX-License-Identifier: Apache-2.0
"""Ellipses through points and in drawn pictures: found where they are, and nowhere else."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_vision.geometry import ImageEllipse
from robot_vision.perception import EllipseDetector
from robot_vision.perception.edge_light import light_exponent
from robot_vision.perception.ellipse_fit import fit_ellipse


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


shapes = st.builds(
    lambda u, v, major, narrow, angle: ImageEllipse(u, v, major, narrow * major, angle),
    numbers(0.0, 640.0),
    numbers(0.0, 480.0),
    numbers(5.0, 80.0),
    numbers(0.25, 1.0),
    numbers(-1.5, 1.5),
)


@settings(max_examples=60)
@given(shapes, st.integers(10, 200))
def test_points_on_an_ellipse_give_it_back(ellipse, count):
    fit = fit_ellipse(ellipse.points(count))
    assert fit is not None
    assert fit.ellipse.centre == pytest.approx(ellipse.centre, abs=1e-6)
    assert fit.ellipse.points(8) @ np.eye(2) == pytest.approx(fit.ellipse.points(8))
    assert (fit.ellipse.major, fit.ellipse.minor) == pytest.approx((ellipse.major, ellipse.minor), abs=1e-6)
    assert np.abs(fit.distances).max() < 1e-6


@settings(max_examples=30)
@given(shapes, st.integers(0, 1000))
def test_points_of_other_edges_do_not_pull_it_away(ellipse, seed):
    random = np.random.default_rng(seed)
    border = ellipse.points(120) + random.normal(0.0, 0.05, (120, 2))
    # An inner rim, as of a thick plate: an arc of an eighth of the border, a fifth of the size further in.
    inner = ellipse.centre + 0.8 * (ellipse.points(160)[:20] - ellipse.centre)
    fit = fit_ellipse(np.vstack([border, inner]))
    assert fit is not None
    assert np.hypot(*(fit.ellipse.centre - ellipse.centre)) < 0.05
    assert fit.weights[120:].max() == 0.0


def test_the_covariance_is_that_of_noisy_points():
    random = np.random.default_rng(5)
    ellipse = ImageEllipse(100.0, 80.0, 30.0, 18.0, 0.5)
    fits = [fit_ellipse(ellipse.points(90) + random.normal(0.0, 0.1, (90, 2))) for _ in range(300)]
    errors = np.array([fit.ellipse.centre - ellipse.centre for fit in fits])
    normalised = [e @ np.linalg.solve(fit.covariance, e) for e, fit in zip(errors, fits, strict=True)]
    assert np.mean(normalised) == pytest.approx(2.0, rel=0.25)


@pytest.mark.parametrize(
    "points",
    [
        np.zeros((0, 2)),
        np.zeros((30, 2)),
        ImageEllipse(5.0, 5.0, 4.0, 3.0).points(9),
        np.column_stack([np.arange(30.0), np.arange(30.0)]),
    ],
    ids=["none", "one place", "too few", "a line"],
)
def test_points_on_no_ellipse_give_none(points):
    assert fit_ellipse(points) is None


def drawn(
    ellipses: list[ImageEllipse],
    inside: int = 30,
    outside: int = 200,
    gamma: float = 2.2,
    blur: float = 0.6,
) -> np.ndarray:
    """A picture of filled ellipses, 16 samples a pixel, as a lens would blur it, in grey levels of that gamma."""
    big = np.full((960, 1280), (outside / 255.0) ** gamma, np.float32)
    for each in ellipses:
        border = np.rint(((each.points(720) + 0.5) * 4.0 - 0.5) * 16).astype(np.int32)
        cv2.fillPoly(big, [border], (inside / 255.0) ** gamma, cv2.LINE_8, 4)
    light = cv2.GaussianBlur(cv2.resize(big, (320, 240), interpolation=cv2.INTER_AREA), (0, 0), blur)
    return np.rint(255.0 * light ** (1.0 / gamma)).astype(np.uint8)


ELLIPSES = [
    ImageEllipse(60.3, 50.8, 30.0, 20.0, 0.4),
    ImageEllipse(170.1, 60.2, 12.0, 11.9, 0.0),
    ImageEllipse(240.7, 170.4, 40.0, 15.0, -1.1),
    ImageEllipse(90.5, 180.5, 8.0, 6.0, 1.5),
]


@pytest.mark.parametrize(("inside", "outside"), [(30, 200), (220, 60)])
def test_ellipses_are_found_to_hundredths_of_a_pixel(inside, outside):
    seen = EllipseDetector().detect(drawn(ELLIPSES, inside, outside))
    assert len(seen) == len(ELLIPSES)
    for each, ellipse in zip(seen, sorted(ELLIPSES, key=lambda e: e.v), strict=True):
        assert each.ellipse.centre == pytest.approx(ellipse.centre, abs=0.03)
        # The crest of a blurred curve lies a little inside it.
        assert (each.ellipse.major, each.ellipse.minor) == pytest.approx(
            (ellipse.major, ellipse.minor), abs=0.25
        )
        assert each.dark == (inside < outside)
        assert each.coverage > 0.95


@pytest.mark.parametrize("gamma", [1.0, 1.5, 2.2])
@pytest.mark.parametrize("blur", [0.6, 1.5])
@pytest.mark.parametrize(("inside", "outside"), [(30, 200), (220, 60)])
def test_borders_tell_the_gamma_of_a_picture(gamma, blur, inside, outside):
    assert light_exponent(drawn(ELLIPSES, inside, outside, gamma, blur), ELLIPSES) == pytest.approx(
        gamma, abs=0.3
    )


def test_borders_on_uneven_ground_or_none_tell_no_gamma():
    assert light_exponent(drawn(ELLIPSES), []) is None
    assert light_exponent(np.full((240, 320), 77, np.uint8), ELLIPSES) is None
    rows, columns = np.indices((240, 320))
    stripes = np.where((rows + columns) % 5 < 2, 200, 40).astype(np.uint8)
    assert light_exponent(stripes, ELLIPSES) is None


def test_a_gamma_that_is_given_is_kept():
    raw = drawn(ELLIPSES, gamma=1.0)
    told, given, wrong = (EllipseDetector(gamma=gamma).detect(raw)[0].ellipse for gamma in (None, 1.0, 2.2))
    assert told.minor == pytest.approx(given.minor, abs=0.03)
    assert abs(wrong.minor - given.minor) > 0.05


def test_a_hole_beside_a_border_is_told_from_it():
    picture = drawn([ImageEllipse(100.0, 100.0, 30.0, 24.0, 1.57)])
    picture[:, 127:] = 60
    (seen,) = EllipseDetector().detect(picture)
    assert seen.ellipse.centre == pytest.approx((100.0, 100.0), abs=0.1)


def test_what_is_no_whole_ellipse_is_left_out():
    picture = np.full((240, 320), 200, np.uint8)
    cv2.rectangle(picture, (30, 30), (90, 80), 30, -1)
    cv2.circle(picture, (0, 160), 40, 30, -1, cv2.LINE_AA)  # cut off
    cv2.ellipse(picture, (200, 160), (50, 30), 0, 0, 180, 30, 2, cv2.LINE_AA)
    cv2.line(picture, (150, 20), (300, 90), 30, 2, cv2.LINE_AA)
    cv2.circle(picture, (300, 200), 2, 30, -1, cv2.LINE_AA)  # too small
    assert EllipseDetector().detect(picture) == []


def test_noise_and_nothing_show_no_ellipse():
    noise = np.random.default_rng(1).integers(0, 255, (240, 320)).astype(np.uint8)
    assert EllipseDetector().detect(noise) == []
    assert EllipseDetector().detect(np.full((240, 320), 77, np.uint8)) == []
    assert EllipseDetector().detect(np.zeros((3, 3), np.uint8)) == []


@pytest.mark.parametrize(
    "setting",
    [
        {"contrast": 0.0},
        {"blur": -1.0},
        {"smallest": 0.0},
        {"coverage": 1.5},
        {"misfit": 0.0},
        {"gamma": 0.0},
    ],
)
def test_a_setting_out_of_range_is_refused_by_name(setting):
    with pytest.raises(ValueError, match=next(iter(setting))):
        EllipseDetector(**setting)


@pytest.mark.parametrize(
    "picture", [np.zeros((4, 4, 3), np.uint8), np.zeros((4, 4)), np.zeros((0, 4), np.uint8)]
)
def test_what_is_no_grey_picture_is_refused(picture):
    with pytest.raises(ValueError, match=r"gray must be uint8 \(H, W\)"):
        EllipseDetector().detect(picture)
