# SPDX-License-Identifier: Apache-2.0
"""Lens models against OpenCV and against themselves, inside the field and at its edge."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_cameras import fisheye, numbers, plumb_bob, rational

from robot_vision.geometry.distortion import distortion_of

models = st.one_of(
    plumb_bob.map(lambda k: distortion_of("plumb_bob", k)),
    rational.map(lambda k: distortion_of("rational_polynomial", k)),
    fisheye.map(lambda k: distortion_of("equidistant", k)),
).filter(lambda model: model is not None)


def ring(radius, count=36):
    phi = np.linspace(0, 2 * math.pi, count, endpoint=False)
    return np.column_stack([radius * np.cos(phi), radius * np.sin(phi)])


@given(models, numbers(0.0, 0.98))
def test_what_is_bent_inside_the_field_is_straightened_again(model, part):
    points = ring(math.tan(part * min(math.atan(model.field_radius), 1.3)))
    bent = model.distort(points)
    straight = model.undistort(bent)
    assert np.abs(model.distort(straight) - bent).max() < 1e-13 * (1 + np.abs(bent).max())
    assert np.abs(straight - points).max() < 1e-9 * (1 + np.abs(points).max())


@given(models)
def test_outside_the_field_there_is_no_answer(model):
    assert np.isnan(model.distort(ring(model.field_radius * 1.0001))).all()
    edge = np.hypot(*model.distort(ring(model.field_radius * (1 - 1e-12))).T).max()
    assert np.isfinite(edge)
    assert np.isnan(model.undistort(ring(edge * 1.0001))).all()
    assert np.isnan(model.distort(np.array([[np.nan, 0.0]]))).all()
    assert np.isnan(model.undistort(np.array([[0.0, np.nan]]))).all()


@given(models)
def test_along_any_direction_of_the_field_the_bent_point_moves_on(model):
    for phi in np.linspace(0, 2 * math.pi, 8, endpoint=False):
        way = np.tan(np.linspace(0, math.atan(model.field_radius) * 0.999, 400))[:, None]
        bent = model.distort(way * [math.cos(phi), math.sin(phi)])
        assert (np.diff(bent @ [math.cos(phi), math.sin(phi)]) > 0).all()


def test_field_of_a_barrel_lens_ends_where_its_radius_stops_growing():
    # d/dr (r - 0.3 r³) = 1 - 0.9 r² = 0
    model = distortion_of("plumb_bob", (-0.3, 0.0, 0.0, 0.0))
    assert model.field_radius == pytest.approx(1 / math.sqrt(0.9), abs=1e-12)


def test_field_of_a_rational_lens_ends_before_its_pole():
    # 1 - 0.5 r² = 0 at r = √2, and the gain grows towards it
    model = distortion_of("rational_polynomial", (0.0, 0.0, 0.0, 0.0, 0.0, -0.5, 0.0, 0.0))
    assert math.sqrt(2.0) - 1e-2 < model.field_radius < math.sqrt(2.0)
    assert np.isfinite(model.distort(ring(model.field_radius * (1 - 1e-12)))).all()


def test_field_of_a_fisheye_ends_where_its_angle_stops_growing():
    # d/dθ (θ - 0.5 θ³) = 1 - 1.5 θ² = 0
    model = distortion_of("equidistant", (-0.5, 0.0, 0.0, 0.0))
    assert model.field_radius == pytest.approx(math.tan(math.sqrt(1 / 1.5)), abs=1e-12)


def test_strong_tangential_terms_narrow_the_field_but_not_the_answer():
    model = distortion_of("plumb_bob", (-0.3, 0.05, 0.05, -0.04))
    assert 0.5 < model.field_radius < distortion_of("plumb_bob", (-0.3, 0.05, 0.0, 0.0)).field_radius - 0.1
    points = np.vstack([ring(radius) for radius in np.linspace(0, 0.99 * model.field_radius, 25)])
    assert np.abs(model.undistort(model.distort(points)) - points).max() < 1e-9


@settings(max_examples=60)
@given(st.one_of(plumb_bob, rational), numbers(0.0, 0.9))
def test_pinhole_models_bend_as_opencv_does(coefficients, part):
    name = "plumb_bob" if len(coefficients) == 5 else "rational_polynomial"
    model = distortion_of(name, coefficients)
    points = ring(part * min(model.field_radius, 1.0))
    theirs, _ = cv2.projectPoints(
        np.column_stack([points, np.ones(len(points))]),
        np.zeros(3),
        np.zeros(3),
        np.eye(3),
        np.array(coefficients),
    )
    assert np.abs(model.distort(points) - theirs.reshape(-1, 2)).max() < 1e-12


@settings(max_examples=60)
@given(fisheye, numbers(0.0, 0.9))
def test_fisheye_bends_as_opencv_does(coefficients, part):
    model = distortion_of("equidistant", coefficients)
    points = ring(part * min(model.field_radius, 10.0))
    theirs, _ = cv2.fisheye.projectPoints(
        np.column_stack([points, np.ones(len(points))])[:, None, :],
        np.zeros(3),
        np.zeros(3),
        np.eye(3),
        np.array(coefficients),
    )
    assert np.abs(model.distort(points) - theirs.reshape(-1, 2)).max() < 1e-12
