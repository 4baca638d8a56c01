# SPDX-License-Identifier: Apache-2.0
"""Rows of plants as a ruler: drawn fields give back the pitch and height from which they were drawn."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from robot_vision.geometry import Camera, GroundPlane
from robot_vision.perception import LineSegments
from robot_vision.perception.calibration import CalibrationError, CameraCalibrator, KnownLengths, green_of
from robot_vision.perception.calibration.rows import RowFinder, pitch_and_height_from_rows

SPACING_M = 0.5


def camera_at(pitch_deg: float, height: float, roll_deg: float = 0.0) -> Camera:
    return Camera(
        460.0,
        460.0,
        319.5,
        239.5,
        640,
        480,
        height_m=height,
        pitch=math.radians(pitch_deg),
        roll=math.radians(roll_deg),
    )


def field_seen(camera: Camera, yaw: float, seed: int = 0, spacing: float = SPACING_M) -> np.ndarray:
    """A picture (H, W, 3) of flat round plants in rows on brown soil; `yaw` of the rows to the left."""
    random = np.random.default_rng(seed)
    picture = np.full((480, 640, 3), (60, 80, 100), np.uint8)
    along, across = np.meshgrid(np.arange(0.3, 9.0, 0.23), spacing * np.arange(-12, 13))
    places = np.column_stack([along.ravel(), across.ravel() + 0.17]) + random.normal(
        0.0, 0.02, (along.size, 2)
    )
    turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    ring = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    for place in places[random.random(len(places)) < 0.85]:
        outline = place + 0.07 * np.column_stack([np.cos(ring), np.sin(ring)])
        pixels = GroundPlane(camera).to_pixels(outline @ turn.T)
        if np.isfinite(pixels).all() and np.abs(pixels).max() < 2000.0:
            cv2.fillPoly(picture, [np.rint(pixels).astype(np.int32)], (50, 160, 60))
    noise = random.normal(0.0, 6.0, picture.shape)
    return np.clip(picture + noise, 0, 255).astype(np.uint8)


@pytest.mark.parametrize(
    ("pitch_deg", "height", "yaw", "roll_deg"),
    [(35.0, 1.4, 0.0, 0.0), (25.0, 1.1, 0.15, 0.0), (45.0, 1.8, -0.2, 3.0), (18.0, 0.9, 0.05, -2.0)],
)
def test_rows_tell_pitch_and_height(pitch_deg, height, yaw, roll_deg):
    camera = camera_at(pitch_deg, height, roll_deg)
    seen = RowFinder().find(green_of(field_seen(camera, yaw)), camera)
    assert seen is not None
    assert seen.pitch == pytest.approx(camera.pitch, abs=math.radians(1.0))
    assert seen.yaw == pytest.approx(yaw, abs=math.radians(1.0))
    # The spacing is measured in heights of the camera.
    assert SPACING_M / seen.spacing == pytest.approx(height, rel=0.03)


def test_pictures_together_say_how_sure_they_are():
    camera = camera_at(30.0, 1.2)
    plants = [green_of(field_seen(camera, 0.02 * k, seed=k)) for k in range(5)]
    pitch, height = pitch_and_height_from_rows([*plants, None], camera, SPACING_M, RowFinder())
    assert abs(pitch.value - camera.pitch) < 3.0 * pitch.sigma
    assert abs(height.value - 1.2) < 3.0 * height.sigma
    assert pitch.told_by == height.told_by == 5
    assert np.isnan(height.own[5])


def test_fields_of_other_spacings_contradict_each_other():
    camera = camera_at(30.0, 1.2)
    plants = [green_of(field_seen(camera, 0.0, spacing=s)) for s in (0.3, 0.42, 0.55, 0.7)]
    pitch, height = pitch_and_height_from_rows(plants, camera, SPACING_M, RowFinder())
    assert not pitch.known and not height.known
    assert "contradict" in height.reason


def test_where_nothing_is_green_there_are_no_rows():
    soil = np.full((480, 640, 3), (60, 80, 100), np.uint8)
    assert RowFinder().find(green_of(soil), camera_at(30.0, 1.2)) is None
    pitch, height = pitch_and_height_from_rows([green_of(soil)], camera_at(30.0, 1.2), SPACING_M, RowFinder())
    assert not pitch.known and "no rows" in height.reason


def test_the_calibrator_takes_pitch_and_height_from_rows():
    camera = camera_at(32.0, 1.3)
    plants = [green_of(field_seen(camera, 0.03 * k, seed=k)) for k in range(4)]
    nothing = [LineSegments.empty()] * 4
    blind = Camera(460.0, 460.0, 319.5, 239.5, 640, 480)
    lengths = KnownLengths(row_spacing=SPACING_M)
    found = CameraCalibrator().calibrate(nothing, blind, lengths=lengths, plants=plants)
    assert found.camera.pitch == pytest.approx(camera.pitch, abs=math.radians(1.0))
    assert found.camera.height_m == pytest.approx(1.3, rel=0.03)
    without = CameraCalibrator().calibrate(nothing, blind, lengths=lengths)
    assert not without.height.known and "plants" in without.height.reason
    with pytest.raises(CalibrationError, match="plants of 3 pictures"):
        CameraCalibrator().calibrate(nothing, blind, lengths=lengths, plants=plants[:3])
