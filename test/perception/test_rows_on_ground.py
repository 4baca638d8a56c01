# SPDX-License-Identifier: Apache-2.0
"""Rows drawn at a known place are found there in metres, leaning camera or not, with a covariance to match."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from drawn_fields import CAMERA, Sown, drawn

from robot_vision.geometry import Camera, GroundPlane
from robot_vision.perception.crop_rows.ground_fit import (
    Curvature,
    GroundFit,
    RowsOnGround,
    ground_places,
    lateral,
    nearest_row,
    pieces_of,
)
from robot_vision.perception.crop_rows.overlay import row_pixels
from robot_vision.perception.vegetation import VegetationMask

FLAT = (0.0, 0.03)


def fitted(sown: Sown, seed: int = 0, roll: float = 0.0, pitch: float = 0.0) -> RowsOnGround:
    """Fit from a start that is some centimetres and a degree off."""
    pieces = pieces_of(VegetationMask().of(drawn(sown, CAMERA, seed, roll, pitch)), CAMERA, 8)
    start = np.array([sown.offset + 0.04, sown.yaw - 0.015, 0.0, 0.0, 0.0, 0.0])
    rows = GroundFit().fit(pieces, CAMERA, sown.spacing, start, Curvature(), FLAT)
    assert rows is not None
    return rows


@pytest.mark.parametrize(("roll", "pitch"), [(0.0, 0.0), (0.035, 0.0), (0.0, -0.035), (-0.03, 0.03)])
def test_offset_yaw_and_lean_are_told_together(roll: float, pitch: float) -> None:
    rows = fitted(Sown(offset=0.06, yaw=0.05, missing=0.0, scatter=0.0), 1, roll, pitch)
    assert rows.values[0] == pytest.approx(0.06, abs=0.008)
    assert rows.values[1] == pytest.approx(0.05, abs=math.radians(0.35))
    assert rows.values[3] == pytest.approx(roll, abs=math.radians(0.3))
    assert rows.values[4] == pytest.approx(pitch, abs=math.radians(0.3))
    assert rows.share > 0.7


@pytest.mark.parametrize("curvature", [0.03, -0.02])
def test_curvature_is_not_drawn_towards_straight_rows(curvature: float) -> None:
    errors = []
    for seed in range(4):
        rows = fitted(Sown(curvature=curvature), seed)
        errors.append((rows.values[2] - curvature, rows.values[0]))
    mean = np.mean(errors, axis=0)
    assert abs(mean[0]) < 0.1 * abs(curvature)
    assert abs(mean[1]) < 0.012


@pytest.mark.parametrize(
    ("curvature", "expected"), [(0.02, 0.0), (0.04, 0.0), (-0.02, 0.0), (0.0, 0.01), (0.015, 0.01)]
)
def test_the_curvature_expected_is_no_part_of_the_answer(curvature: float, expected: float) -> None:
    for seed in range(3):
        pieces = pieces_of(VegetationMask().of(drawn(Sown(curvature=curvature), CAMERA, seed)), CAMERA, 8)
        start = np.array([0.02, -0.01, expected, 0.0, 0.0, 0.0])
        rows = GroundFit().fit(pieces, CAMERA, 0.5, start, Curvature(expected, 5e-4), FLAT)
        assert rows is not None
        assert rows.values[2] == pytest.approx(curvature, abs=0.002)
        assert abs(rows.values[0] - Sown().offset) < 0.012


def test_the_curvature_expected_steadies_what_few_metres_of_weedy_rows_tell() -> None:
    errors = []
    for seed in range(12):
        sown = Sown(offset=0.03, yaw=-0.02, weeds=0.5, end=4.0)
        pieces = pieces_of(VegetationMask().of(drawn(sown, CAMERA, seed)), CAMERA, 8)
        start = np.array([sown.offset + 0.02, sown.yaw - 0.01, 0.0, 0.0, 0.0, 0.0])
        rows = GroundFit().fit(pieces, CAMERA, sown.spacing, start, Curvature(0.0, 5e-4), FLAT)
        assert rows is not None
        # What it says of the offset to those who know that the rows are straight
        toward = rows.covariance[0, 2] / rows.covariance[2, 2]
        errors.append(rows.values[0] - toward * rows.values[2] - sown.offset)
    assert float(np.sqrt(np.mean(np.square(errors)))) < 0.012


def test_the_covariance_is_honest_with_weeds_and_missing_plants() -> None:
    squares = []
    for seed in range(12):
        sown = Sown(offset=0.03, yaw=-0.02, weeds=1.0)
        rows = fitted(sown, seed)
        error = rows.values[:2] - (sown.offset, sown.yaw)
        squares.append(error**2 / np.diag(rows.covariance)[:2])
    assert 0.1 < float(np.mean(squares)) < 2.5


def test_too_few_plants_are_no_rows() -> None:
    pieces = pieces_of(VegetationMask().of(drawn(Sown(missing=1.0))), CAMERA, 8)
    assert GroundFit().fit(pieces, CAMERA, 0.5, np.zeros(6), Curvature(), FLAT) is None


def test_places_agree_with_the_ground_plane_of_a_leaning_camera() -> None:
    leaning = replace(CAMERA, pitch=CAMERA.pitch + 0.03)
    pixels = np.array([[100.0, 300.0], [320.0, 200.0], [600.0, 470.0]])
    rays = CAMERA.rays(pixels) @ CAMERA.optical_to_base.T
    x, y = ground_places(rays, CAMERA, np.array([0.0, 0.0, 0.0, 0.0, 0.03, 0.0]))
    assert np.column_stack([x, y]) == pytest.approx(GroundPlane(leaning).from_pixels(pixels), abs=1e-9)


@pytest.mark.parametrize("bend", [0.03, -0.05, 1e-9])
def test_the_distance_to_a_row_is_that_to_its_circle(bend: float) -> None:
    x, y = np.array([2.0, 6.0, 8.0]), np.array([0.5, -1.0, 2.0])
    left, _ = lateral(x, y, np.array([0.1, 0.0, bend, 0.0, 0.0, 0.0]))
    radius = 1.0 / bend
    exact = np.sign(radius) * (abs(radius) - np.hypot(x, radius - (y + 0.1)))
    assert left == pytest.approx(exact, abs=1e-5)


def test_rows_are_drawn_where_they_were_fitted() -> None:
    sown = Sown(offset=0.1, yaw=0.05, curvature=0.02)
    values = np.array([sown.offset, sown.yaw, sown.curvature, 0.01, 0.02, 0.0])
    rows = RowsOnGround(values, np.eye(6), sown.spacing, 1.0, 10)
    for row in (-1, 0, 2):
        pixels = row_pixels(rows, CAMERA, row, 6.0)
        rays = CAMERA.rays(pixels) @ CAMERA.optical_to_base.T
        left, _ = lateral(*ground_places(rays, CAMERA, values), values)
        assert left == pytest.approx(np.full(len(pixels), row * sown.spacing), abs=1e-6)


def test_the_nearest_row_is_the_one_before() -> None:
    rows = RowsOnGround(np.array([0.22, 0.0, 0.0, 0.0, 0.0, 0.0]), np.eye(6), 0.5, 1.0, 10)
    assert nearest_row(rows, -0.26).values[0] == pytest.approx(-0.28)
    assert nearest_row(rows, 1.2).values[0] == pytest.approx(1.22)


def test_settings_without_meaning_are_refused() -> None:
    for name in ("lean", "narrow", "far"):
        with pytest.raises(ValueError, match=name):
            GroundFit(**{name: 0.0})


def test_pieces_cover_as_much_ground_as_the_plants() -> None:
    camera = Camera(400.0, 400.0, 199.5, 199.5, 400, 400, height_m=2.0, pitch=math.radians(89.0))
    mask = np.ones((400, 400), bool)
    pieces = pieces_of(mask, camera, 8)
    assert pieces.weight.sum() == pytest.approx(4.0, rel=0.02)
