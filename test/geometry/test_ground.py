# SPDX-License-Identifier: Apache-2.0
"""Ground points against the chapter's formulas, against themselves, and against the horizon."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_cameras import cameras, grid, numbers

from robot_vision.geometry import (
    AboveHorizonError,
    Camera,
    GroundPlane,
    GroundPlaneError,
    up_from_attitude,
    vanishing_line,
)
from robot_vision.geometry.sphere import tangent_basis

LEVEL = Camera(500.0, 510.0, 320.0, 240.0, 640, 480, height_m=1.2)


def test_level_camera_obeys_the_chapter():
    # (20.2) Z = H f / y, (20.3) X = H x / y; y is below the vanishing line, in units of f
    pixels = np.array([[320.0, 300.0], [100.0, 400.0], [600.0, 250.0]])
    x, y = (pixels[:, 0] - 320.0) / 500.0, (pixels[:, 1] - 240.0) / 510.0
    expected = np.column_stack([1.2 / y, -1.2 * x / y])
    assert GroundPlane(LEVEL).from_pixels(pixels) == pytest.approx(expected, rel=1e-12)


@given(numbers(-0.6, 0.0) | numbers(1e-6, 1.2))
def test_axis_of_a_pitched_camera_meets_the_ground_at_h_over_tan_pitch(pitch):
    camera = replace(LEVEL, pitch=pitch, x_m=0.3)
    point = GroundPlane(camera).from_pixels([[320.0, 240.0]])[0]
    if pitch <= 0.0:
        assert np.isnan(point).all()
    else:
        assert point == pytest.approx([0.3 + 1.2 / math.tan(pitch), 0.0], rel=1e-9)


def test_roll_lifts_the_left_side():
    # The left end of the robot's own horizontal rises: the horizon in the picture sinks on the left.
    left, right = GroundPlane(replace(LEVEL, roll=0.1)).horizon @ np.array([[0, 639], [240, 240], [1, 1]])
    assert left > 0 > right


@given(cameras())
def test_pixel_to_ground_and_back(camera):
    ground = GroundPlane(camera)
    pixels = grid(camera)
    points = ground.from_pixels(pixels)
    seen = np.isfinite(points).all(axis=1)
    back = ground.to_pixels(points[seen])
    # A point next to the horizon is so far away that its own rounding is all that is left of the pixel.
    near = np.hypot(*points[seen].T) < 1e4 * camera.height_m
    assert np.abs(back - pixels[seen])[near].max(initial=0.0) < 1e-9


@given(cameras(), numbers(0.5, 50.0), numbers(-1.0, 1.0))
def test_ground_to_pixel_and_back(camera, ahead, aside):
    point = np.array([[camera.x_m + ahead, aside * ahead]])
    ground = GroundPlane(camera.rectified())
    pixel = ground.to_pixels(point)
    if np.isfinite(pixel).all():
        digits = 1e-9 * (1 + ahead**2 / camera.height_m)  # one px is worth Z² / (H f) metres
        assert ground.from_pixels(pixel) == pytest.approx(point, rel=1e-9, abs=digits)


@given(cameras())
def test_horizon_holds_every_horizontal_direction(camera):
    azimuths = np.linspace(-math.pi, math.pi, 73)
    directions = np.column_stack([np.cos(azimuths), np.sin(azimuths), np.zeros_like(azimuths)])
    pixels = camera.rectified().pixels(directions @ camera.optical_to_base)
    ahead = np.isfinite(pixels).all(axis=1)
    assert ahead.any()
    pixels = pixels[ahead]
    distance = GroundPlane(camera).horizon @ np.column_stack([pixels, np.ones(len(pixels))]).T
    assert np.abs(distance / (1.0 + np.hypot(*pixels.T))).max() < 1e-9


@given(cameras())
def test_ground_is_below_the_horizon_and_nowhere_else(camera):
    rectified = camera.rectified()
    pixels = grid(rectified)
    above = GroundPlane(camera).horizon @ np.column_stack([pixels, np.ones(len(pixels))]).T
    on_ground = np.isfinite(GroundPlane(rectified).from_pixels(pixels)).all(axis=1)
    assert on_ground[above < -1e-6].all()
    assert not on_ground[above > 1e-6].any()


def test_horizon_of_a_camera_that_looks_straight_down_is_at_infinity():
    assert GroundPlane(replace(LEVEL, pitch=math.pi / 2)).horizon == pytest.approx([0.0, 0.0, -1.0])


@given(cameras(), numbers(-0.3, 0.3), numbers(-0.3, 0.3))
def test_live_attitude_replaces_the_cameras_own(camera, roll, pitch):
    live = GroundPlane.from_up(camera, 3.0 * up_from_attitude(roll, pitch))
    fixed = GroundPlane(replace(camera, roll=roll, pitch=pitch))
    assert live.up == pytest.approx(fixed.up, abs=1e-14)
    assert live.base_from_optical == pytest.approx(fixed.base_from_optical, abs=1e-12)


def test_transform_takes_the_camera_centre_to_its_place_on_the_robot():
    camera = replace(LEVEL, pitch=0.2, roll=-0.1, x_m=0.4)
    assert GroundPlane(camera).base_from_optical @ [0, 0, 0, 1] == pytest.approx([0.4, 0.0, 1.2, 1.0])


@pytest.mark.parametrize("question", ["from_pixels", "to_pixels"])
def test_unknown_height_is_refused_but_the_horizon_is_not(question):
    ground = GroundPlane(replace(LEVEL, height_m=None))
    with pytest.raises(GroundPlaneError, match=r"height of the camera is not known.*camera\.height"):
        getattr(ground, question)([[1.0, 2.0]])
    assert ground.horizon == pytest.approx([0.0, -1.0, 240.0])


def test_guessed_focal_length_gives_no_metres():
    camera = replace(Camera.uncalibrated(640, 480), height_m=1.0)
    with pytest.raises(GroundPlaneError, match="focal length of the camera is only a guess"):
        GroundPlane(camera).from_pixels([[320.0, 400.0]])


def test_wrong_shape_is_named():
    with pytest.raises(ValueError, match=r"pixels must have shape \(N, 2\), got \(1, 3\)"):
        GroundPlane(LEVEL).from_pixels([[1.0, 2.0, 3.0]])
    assert GroundPlane(LEVEL).from_pixels([]).shape == (0, 2)


def test_one_pixel_of_horizon_costs_z_over_h_f():
    pixel = [[320.0, 300.0]]
    measured = GroundPlane(LEVEL).measure(pixel, 0.0, np.diag([0.0, (1.0 / 510.0) ** 2]))
    distance = measured.points[0, 0]
    sigma = math.sqrt(measured.covariance[0, 0, 0])
    # Z / (H f), and to the cosine squared of the ray's own fall: pitch turns, a row only shifts
    assert sigma / distance == pytest.approx(distance / (1.2 * 510.0) * (1.0 + (60.0 / 510.0) ** 2), rel=1e-9)


@settings(max_examples=40, deadline=None)
@given(cameras(), numbers(0.0, 1.0), numbers(0.0, 0.01), numbers(0.0, 0.01), numbers(0.0, 0.1))
def test_covariance_is_what_small_changes_of_pixel_attitude_and_height_do(camera, pixel, roll, pitch, height):
    ground = GroundPlane(camera)
    pixels = grid(camera, 5, 4)
    points = ground.from_pixels(pixels)
    near = np.hypot(*(points - (camera.x_m, 0.0)).T) < 50.0 * camera.height_m  # nan: not seen
    pixels, points = pixels[near], points[near]
    measured = ground.measure(pixels, pixel, np.diag([roll**2, pitch**2]), height * camera.height_m)
    assert measured.points == pytest.approx(points, rel=1e-12, abs=1e-12)

    def moved(**changes: float) -> np.ndarray:
        other = replace(camera, **{name: getattr(camera, name) + by for name, by in changes.items()})
        return GroundPlane(other).from_pixels(pixels)

    step = 1e-5
    slopes = [(roll, moved(roll=step) - moved(roll=-step)), (pitch, moved(pitch=step) - moved(pitch=-step))]
    slopes += [(height * camera.height_m, moved(height_m=step) - moved(height_m=-step))]
    for shift in step * np.eye(2):
        slopes.append((pixel, ground.from_pixels(pixels + shift) - ground.from_pixels(pixels - shift)))
    expected = sum(
        sigma**2 * slope[:, :, None] * slope[:, None, :] / (2.0 * step) ** 2 for sigma, slope in slopes
    )
    scale = np.trace(measured.covariance, axis1=1, axis2=2)[:, None, None] + 1e-30
    assert np.abs((measured.covariance - expected) / scale).max(initial=0.0) < 1e-4


@settings(max_examples=60, deadline=None)
@given(cameras())
def test_measuring_above_the_horizon_is_refused_by_number(camera):
    rectified = replace(camera.rectified(), pitch=0.2)
    line = GroundPlane(rectified).horizon
    on_it = -line[2] * line[:2]
    below, above = on_it - 20.0 * line[:2], on_it + 20.0 * line[:2]
    with pytest.raises(AboveHorizonError, match=r"at or above the horizon.*index 1, 3") as refused:
        GroundPlane(rectified).measure([below, above, below, above])
    assert refused.value.indices == (1, 3)
    assert isinstance(refused.value, GroundPlaneError)


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        ({"pixel_sigma": -1.0}, "must not be negative"),
        ({"height_sigma": -1.0}, "must not be negative"),
        ({"attitude_covariance": np.diag([1.0, -1.0])}, "must be a covariance"),
        ({"attitude_covariance": np.eye(3)}, "must be a covariance"),
    ],
)
def test_a_spread_that_is_none_is_refused(arguments, reason):
    with pytest.raises(GroundPlaneError, match=reason):
        GroundPlane(LEVEL).measure([[320.0, 300.0]], **arguments)


@settings(max_examples=60, deadline=None)
@given(cameras(), st.tuples(*[numbers(-1.0, 1.0)] * 3).filter(lambda n: np.linalg.norm(n) > 0.05))
def test_every_direction_in_a_plane_vanishes_on_its_line(camera, normal):
    normal = np.array(normal)
    basis = tangent_basis(normal / np.linalg.norm(normal))
    turns = np.linspace(0.0, math.pi, 37)
    directions = np.column_stack([np.cos(turns), np.sin(turns)]) @ basis
    directions = directions[np.abs(directions[:, 2]) > 1e-6]
    pixels = camera.rectified().pixels(directions * np.sign(directions[:, 2:]))
    distance = np.column_stack([pixels, np.ones(len(pixels))]) @ vanishing_line(camera, 3.0 * normal)
    assert np.abs(distance / (1.0 + np.hypot(*pixels.T))).max(initial=0.0) < 1e-9


@pytest.mark.parametrize("normal", [(0, 0, 0), (1, 2), (1, 2, math.nan)])
def test_a_normal_that_is_none_is_refused(normal):
    with pytest.raises(ValueError, match="normal must be three finite numbers"):
        vanishing_line(LEVEL, normal)
