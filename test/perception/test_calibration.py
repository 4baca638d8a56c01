# SPDX-License-Identifier: Apache-2.0
"""A camera is found from its own drive where the scene tells of it, and where not, that is said and nothing else."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from corridor_lines import Corridor, seen_lines
from line_scenes import clutter, lines_to, scene, upright_axes

from robot_vision.geometry import Camera, rotation_from_rpy
from robot_vision.perception import LineSegments
from robot_vision.perception.calibration import (
    CalibrationError,
    CameraCalibration,
    CameraCalibrator,
    KnownLengths,
)
from robot_vision.perception.calibration.lens import with_focal_length
from robot_vision.perception.calibration.robust import block_sigma

BLIND = Camera.uncalibrated(640, 480)
WIDTH_M = 2.2
USUAL = Camera(460.0, 460.0, 319.5, 239.5, 640, 480, height_m=0.6, pitch=math.radians(5.0))


@dataclass(frozen=True)
class Drive:
    """A drive down a corridor: lines of each picture, and the camera that saw them."""

    camera: Camera
    pictures: list[LineSegments]
    stamps_s: list[float]


def drive(camera: Camera, pictures: int = 24, lean_deg: float = 0.3, seed: int = 0) -> Drive:
    """The robot weaves and looks to both sides, its body leans."""
    random = np.random.default_rng(seed)
    corridor = Corridor(width=WIDTH_M)
    lines, stamps = [], []
    for k in range(pictures):
        roll, pitch = np.deg2rad(random.normal(0.0, lean_deg, 2))
        leaning = replace(camera, roll=camera.roll + roll, pitch=camera.pitch + pitch)
        yaw, offset = 0.17 * math.sin(0.31 * k), 0.25 * math.sin(0.21 * k)
        lines.append(seen_lines(corridor, offset, yaw, random, leaning, along=0.25 * k))
        stamps.append(0.1 * k)
    return Drive(camera, lines, stamps)


@cache
def calibrated_blind() -> CameraCalibration:
    """The usual drive, nothing given."""
    return calibrated(drive(USUAL))


def calibrated(made: Drive, given: Camera = BLIND, **lengths: float) -> CameraCalibration:
    return CameraCalibrator().calibrate(made.pictures, given, made.stamps_s, KnownLengths(**lengths))


@pytest.fixture(scope="module")
def usual() -> Drive:
    return drive(USUAL)


@pytest.mark.parametrize(
    ("focal", "roll_deg", "pitch_deg", "height"),
    [(460.0, 0.0, 5.0, 0.6), (380.0, 1.5, 12.0, 1.1), (560.0, -2.0, 8.0, 0.4)],
)
def test_a_corridor_tells_everything(focal, roll_deg, pitch_deg, height):
    camera = Camera(
        focal,
        focal,
        319.5,
        239.5,
        640,
        480,
        height_m=height,
        roll=math.radians(roll_deg),
        pitch=math.radians(pitch_deg),
    )
    found = calibrated(drive(camera), corridor_width=WIDTH_M)
    for finding, truth in (
        (found.focal, focal),
        (found.roll, camera.roll),
        (found.pitch, camera.pitch),
        (found.height, height),
    ):
        assert finding.value is not None, finding.reason
        assert abs(finding.value - truth) < 3.0 * finding.sigma
    assert found.focal.value == pytest.approx(focal, rel=0.02)
    assert found.roll.value == pytest.approx(camera.roll, abs=math.radians(0.1))
    # A focal length off by 2 % puts the horizon of a camera that looks 12 degrees down off by 0.23.
    assert found.pitch.value == pytest.approx(camera.pitch, abs=math.radians(0.3))
    assert found.height.value == pytest.approx(height, rel=0.02)
    assert found.camera.fx == found.camera.fy == found.focal.value
    assert found.camera.height_m == found.height.value
    assert found.camera.focal_known


@pytest.mark.parametrize("count", [1, 2, 5])
def test_few_pictures_tell_less_surely(usual, count):
    few = Drive(usual.camera, usual.pictures[:count], usual.stamps_s[:count])
    found = calibrated(few, usual.camera)
    if found.focal.value is not None:
        assert abs(found.focal.value - 460.0) < 3.0 * found.focal.sigma
    assert found.pitch.value is not None, found.pitch.reason
    assert abs(found.pitch.value - usual.camera.pitch) < 3.0 * found.pitch.sigma
    assert found.pitch.sigma > calibrated_blind().pitch.sigma


def test_the_focal_length_given_is_not_asked(usual):
    blind = calibrated_blind()
    wrong = calibrated(usual, replace(usual.camera, fx=900.0, fy=900.0, pitch=0.0))
    assert wrong.focal.value == pytest.approx(blind.focal.value, rel=1e-9)


def test_the_mounting_is_the_mean_about_which_the_body_leans(usual):
    steep = calibrated(drive(usual.camera, lean_deg=1.0, seed=4))
    assert steep.pitch.value == pytest.approx(usual.camera.pitch, abs=3.0 * steep.pitch.sigma)
    # A body that leans more leaves it less sure.
    assert steep.roll.sigma > calibrated_blind().roll.sigma


def test_some_pictures_of_something_else_do_not_matter(usual):
    random = np.random.default_rng(2)
    others = [LineSegments.from_endpoints(clutter(random, 60)) for _ in range(8)]
    mixed = Drive(usual.camera, [*usual.pictures, *others], [*usual.stamps_s, *[9.0 + k for k in range(8)]])
    found = calibrated(mixed)
    assert found.focal.value == pytest.approx(460.0, rel=0.02)
    assert found.pitch.value == pytest.approx(usual.camera.pitch, abs=math.radians(0.15))


def one_direction(pictures: int, yaw: float = 0.0) -> list[LineSegments]:
    """A straight road over open land: one vanishing point and clutter."""
    random = np.random.default_rng(1)
    camera = Camera(460.0, 460.0, 319.5, 239.5, 640, 480)
    found = []
    for k in range(pictures):
        ahead = rotation_from_rpy(0.0, 0.0, yaw * math.sin(k)).T @ [1.0, 0.0, 0.0]
        direction = camera.optical_to_base.T @ ahead
        lines = lines_to(random, camera, direction, 40)
        found.append(LineSegments.from_endpoints(np.concatenate([lines, clutter(random, 15)])))
    return found


def test_one_vanishing_point_says_nothing_of_the_focal_length_and_keeps_the_one_given():
    pictures = one_direction(20, yaw=0.1)
    blind = CameraCalibrator().calibrate(pictures, BLIND)
    assert not any(finding.known for finding in (blind.focal, blind.roll, blind.pitch, blind.height))
    assert "one vanishing point alone" in blind.focal.reason
    assert "focal length" in blind.pitch.reason
    assert blind.camera == BLIND
    given = Camera(460.0, 460.0, 319.5, 239.5, 640, 480)
    found = CameraCalibrator().calibrate(pictures, given, lengths=KnownLengths(corridor_width=2.0))
    assert not found.focal.known
    assert found.camera.fx == 460.0


def test_a_level_vanishing_point_ahead_tells_the_pitch_but_standing_still_no_roll():
    camera = Camera(460.0, 460.0, 319.5, 239.5, 640, 480)
    found = CameraCalibrator().calibrate(one_direction(20), camera)
    assert found.pitch.value == pytest.approx(0.0, abs=math.radians(0.2))
    assert not found.roll.known
    assert "upright lines" in found.roll.reason


def test_pictures_that_contradict_each_other_are_not_averaged():
    pictures = []
    for seed in range(24):
        random = np.random.default_rng(seed)
        focal = 640.0 * math.exp(random.uniform(math.log(0.6), math.log(2.0)))
        camera = Camera(focal, focal, 319.5, 239.5, 640, 480)
        pictures.append(scene(random, camera, upright_axes(random, 0.3), [35] * 3).lines)
    found = CameraCalibrator().calibrate(pictures, BLIND)
    assert not found.focal.known
    assert "contradict" in found.focal.reason


def test_level_directions_that_are_not_square_give_a_right_horizon_or_none():
    """A field laid out askew: nothing stands upright, and no right angle tells the focal length."""
    camera = Camera(460.0, 460.0, 319.5, 239.5, 640, 480, pitch=math.radians(30.0))
    pictures = []
    for seed in range(24):
        random = np.random.default_rng(seed)
        yaw, angle = random.uniform(-0.6, 0.6), math.radians(random.uniform(40.0, 75.0))
        level = [[math.cos(turn), math.sin(turn), 0.0] for turn in (yaw, yaw + angle)]
        pictures.append(scene(random, camera, np.array(level) @ camera.optical_to_base, [40] * 2, 0.2).lines)
    found = CameraCalibrator().calibrate(pictures, replace(camera, pitch=0.0))
    assert not found.focal.known and "right angles" in found.focal.reason
    for finding, truth in ((found.roll, 0.0), (found.pitch, camera.pitch)):
        assert finding.value is None or abs(finding.value - truth) < math.radians(0.5)


def test_a_camera_held_by_hand_has_a_focal_length_but_no_mounting():
    pictures = []
    for seed in range(24):
        random = np.random.default_rng(seed)
        camera = Camera(560.0, 560.0, 319.5, 239.5, 640, 480)
        pictures.append(scene(random, camera, upright_axes(random, 0.3), [35] * 3).lines)
    found = CameraCalibrator().calibrate(pictures, BLIND)
    assert found.focal.value == pytest.approx(560.0, rel=0.02)
    assert not found.pitch.known and "contradict" in found.pitch.reason


def test_without_a_known_length_there_is_no_height():
    found = calibrated_blind()
    assert not found.height.known
    assert "no scale" in found.height.reason
    assert found.camera.height_m is None


def test_a_length_that_is_not_seen_gives_no_height(usual):
    found = calibrated(usual, stone_width=0.4)
    assert not found.height.known
    assert "regular joints" in found.height.reason


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
@pytest.mark.parametrize("name", ["corridor_width", "stone_width", "stone_length", "row_spacing"])
def test_lengths_without_meaning_are_refused(name, value):
    with pytest.raises(CalibrationError, match=name):
        KnownLengths(**{name: value})


def test_no_pictures_and_missing_stamps_are_refused(usual):
    with pytest.raises(CalibrationError, match="no picture"):
        CameraCalibrator().calibrate([], BLIND)
    with pytest.raises(CalibrationError, match="1 stamps for 24 pictures"):
        CameraCalibrator().calibrate(usual.pictures, BLIND, [0.0])


@pytest.mark.parametrize("count", [0, 1, 5])
def test_pictures_of_hardly_any_lines_tell_nothing(count):
    lines = LineSegments.from_endpoints(clutter(np.random.default_rng(0), count))
    found = CameraCalibrator().calibrate([lines] * 4, BLIND)
    assert not found.focal.known and found.focal.told_by == 0


def test_pictures_alike_do_not_count_as_many():
    random = np.random.default_rng(0)
    fresh = random.normal(size=200)
    alike = np.repeat(random.normal(size=10), 20)
    ones = np.ones(200)
    assert block_sigma(fresh, ones) == pytest.approx(1.0 / math.sqrt(200), rel=0.5)
    assert block_sigma(alike, ones) > 2.0 * block_sigma(fresh, ones)


@pytest.mark.parametrize(
    ("model", "coefficients"),
    [
        ("plumb_bob", (-0.3, 0.1, 0.001, -0.002, 0.01)),
        ("rational_polynomial", (-0.3, 0.1, 0.001, -0.002, 0.01, 0.1, 0.05, 0.01)),
    ],
)
def test_a_lens_keeps_its_pictures_when_its_focal_length_changes(model, coefficients):
    raw = Camera(460.0, 470.0, 310.0, 235.0, 640, 480, distortion=coefficients, distortion_model=model)
    longer = with_focal_length(raw, 1.3)
    pixels = np.array([[100.0, 80.0], [320.0, 240.0], [600.0, 450.0], [20.0, 400.0]])
    straight = raw.rectified_pixels(pixels)
    np.testing.assert_allclose(longer.rectified_pixels(pixels), straight, atol=1e-6)
    assert longer.fx == pytest.approx(1.3 * 460.0)


def test_a_fisheye_keeps_its_focal_length():
    raw = Camera(
        300.0, 300.0, 319.5, 239.5, 640, 480, distortion=(0.1, 0.0, 0.0, 0.0), distortion_model="equidistant"
    )
    assert with_focal_length(raw, 1.1) is None
