# SPDX-License-Identifier: Apache-2.0
"""A camera keeps what it is told, projects as OpenCV does, and comes back from every round trip."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from random_cameras import cameras, grid

from robot_vision.geometry import Camera, rotation_from_rpy

PLAIN = Camera(500.0, 510.0, 320.0, 240.0, 640, 480)
BARREL = replace(PLAIN, distortion=(-0.3, 0.1, 0.001, -0.002, 0.01))
RATIONAL = replace(
    PLAIN, distortion_model="rational_polynomial", distortion=(0.5, -0.2, 1e-4, -2e-4, 0.01, 0.8, -0.1, 0.02)
)
FISHEYE = replace(PLAIN, distortion_model="equidistant", distortion=(0.05, -0.02, 0.01, -0.003))
TURNED = {
    "rectification": rotation_from_rpy(0.01, -0.02, 0.03),
    "projection": [[450.0, 0.0, 310.0, -30.0], [0.0, 455.0, 250.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
}


@given(cameras())
def test_pixel_to_ray_and_back(camera):
    pixels = grid(camera)
    rays = camera.rays(pixels)
    seen = np.isfinite(rays).all(axis=1)
    assert np.linalg.norm(rays[seen], axis=1) == pytest.approx(1.0, abs=1e-14)
    back = camera.pixels(rays)
    inside = np.isfinite(back).all(axis=1)  # rounding may push the very edge of a field out of it
    assert np.abs(back[inside] - pixels[inside]).max() < 1e-9
    assert (inside == seen).mean() > 0.95


@given(cameras())
def test_raw_and_rectified_camera_see_the_same_ray(camera):
    pixels = grid(camera)
    rectified = camera.rectified()
    assert rectified.is_rectified
    assert rectified.rectified() == rectified
    rays = camera.rays(pixels)
    through = rectified.rays(camera.rectified_pixels(pixels))
    both = np.isfinite(through).all(axis=1)
    assert np.abs(through - rays)[both].max() < 1e-12
    assert (both == (rays[:, 2] > 0)).all()


@pytest.mark.parametrize("camera", [BARREL, RATIONAL, replace(BARREL, distortion=BARREL.distortion[:4])])
def test_pinhole_lenses_project_as_opencv_does(camera):
    points = np.random.default_rng(1).uniform([-1, -1, 2], [1, 1, 5], (200, 3))
    theirs, _ = cv2.projectPoints(
        points, np.zeros(3), np.zeros(3), camera.matrix, np.array(camera.distortion)
    )
    assert camera.pixels(points) == pytest.approx(theirs.reshape(-1, 2), abs=1e-9)


def test_fisheye_projects_as_opencv_does():
    points = np.random.default_rng(2).uniform([-2, -2, 0.5], [2, 2, 5], (200, 3))
    theirs, _ = cv2.fisheye.projectPoints(
        points[:, None, :], np.zeros(3), np.zeros(3), FISHEYE.matrix, np.array(FISHEYE.distortion)
    )
    assert FISHEYE.pixels(points) == pytest.approx(theirs.reshape(-1, 2), abs=1e-9)


@pytest.mark.parametrize("camera", [BARREL, RATIONAL, FISHEYE])
@pytest.mark.parametrize("turn", [{}, TURNED], ids=["plain", "turned"])
def test_rectification_maps_are_those_of_opencv(camera, turn):
    camera = replace(camera, **turn)
    rotation = np.eye(3) if camera.rectification is None else np.array(camera.rectification)
    fisheye = camera.distortion_model == "equidistant"
    theirs = (cv2.fisheye if fisheye else cv2).initUndistortRectifyMap(
        camera.matrix,
        np.array(camera.distortion),
        rotation,
        camera.rectified().matrix,
        (camera.width, camera.height),
        cv2.CV_32FC1,
    )
    for our_map, their_map in zip(camera.rectification_maps(), theirs, strict=True):
        assert our_map.dtype == np.float32
        assert our_map.shape == (480, 640)
        assert np.abs(our_map - their_map).max() < 1e-4  # float32 at 640 px carries 6e-5


def test_rectified_pixels_are_those_of_opencv():
    pixels = grid(BARREL)
    theirs = cv2.undistortPoints(
        pixels[:, None, :],
        BARREL.matrix,
        np.array(BARREL.distortion),
        P=BARREL.matrix,
        criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12),
    )
    assert BARREL.rectified_pixels(pixels) == pytest.approx(theirs.reshape(-1, 2), abs=1e-6)


def test_maps_of_a_rectified_camera_change_nothing():
    map_x, map_y = PLAIN.rectification_maps()
    assert map_x == pytest.approx(np.broadcast_to(np.arange(640), (480, 640)), abs=1e-4)
    assert map_y == pytest.approx(np.broadcast_to(np.arange(480)[:, None], (480, 640)), abs=1e-4)


def test_maps_lead_out_of_the_picture_where_the_lens_shows_nothing():
    wide = [[150, 0, 320, 0], [0, 150, 240, 0], [0, 0, 1, 0]]
    camera = Camera(300.0, 300.0, 320.0, 240.0, 640, 480, distortion=(-0.4, 0, 0, 0), projection=wide)
    map_x, map_y = camera.rectification_maps()
    assert np.isfinite(map_x).all()
    assert np.isnan(camera.pixels(camera.rectified().rays([[0.0, 0.0]]))).all()
    assert (map_x[0, 0], map_y[0, 0]) == (-16.0, -16.0)
    white = cv2.remap(np.full((480, 640), 255, np.uint8), map_x, map_y, cv2.INTER_LANCZOS4)
    assert white[0, 0] == 0
    assert white[240, 320] == 255


def test_behind_the_camera_there_is_no_pixel():
    for camera in (PLAIN, BARREL, FISHEYE):
        assert np.isnan(camera.pixels([[0.1, 0.1, -1.0], [1.0, 0.0, 0.0], [np.nan, 0.0, 1.0]])).all()


def test_attitude_turns_the_optical_axis():
    down = replace(PLAIN, pitch=0.3).optical_to_base @ [0, 0, 1]
    assert down == pytest.approx([np.cos(0.3), 0.0, -np.sin(0.3)])
    left = replace(PLAIN, roll=0.3).optical_to_base @ [-1, 0, 0]
    assert left == pytest.approx([0.0, np.cos(0.3), np.sin(0.3)])


@settings(max_examples=40)
@given(cameras())
def test_resized_and_cropped_cameras_see_the_same_rays(camera):
    pixels = grid(camera)
    rays = camera.rays(pixels)
    twice = camera.resized(2 * camera.width, 2 * camera.height)
    assert twice.rays(2 * pixels + 0.5) == pytest.approx(rays, abs=1e-9, nan_ok=True)
    window = camera.cropped(5, 7, camera.width - 10, camera.height - 10)
    assert window.rays(pixels - [5, 7]) == pytest.approx(rays, abs=1e-9, nan_ok=True)
    assert window.rectified_pixels(pixels - [5, 7]) == pytest.approx(
        camera.rectified_pixels(pixels) - [5, 7], abs=1e-6, rel=1e-9, nan_ok=True
    )


def test_resizing_agrees_with_the_picture_opencv_resizes():
    # A dot twice the size of a new pixel: its centre must be where the resized camera says.
    picture = np.zeros((480, 640), np.float32)
    picture[200:204, 300:304] = 1.0  # centre (301.5, 201.5)
    small = cv2.resize(picture, (320, 240), interpolation=cv2.INTER_AREA)
    v, u = np.indices(small.shape)
    centre = [[(small * u).sum() / small.sum(), (small * v).sum() / small.sum()]]
    assert PLAIN.resized(320, 240).rays(centre) == pytest.approx(PLAIN.rays([[301.5, 201.5]]), abs=1e-6)


def test_corner_window_of_a_large_picture_is_still_a_camera():
    large = Camera(1000.0, 1000.0, 960.0, 540.0, 1920, 1080)
    corner = large.cropped(1900, 1060, 20, 20)
    assert corner.rays([[0.0, 0.0]]) == pytest.approx(large.rays([[1900.0, 1060.0]]))


def test_uncalibrated_camera_says_so():
    camera = Camera.uncalibrated(640, 480)
    assert not camera.focal_known
    assert (camera.cx, camera.cy) == (319.5, 239.5)
    assert camera.fx == camera.fy > 0


def test_cameras_compare_and_hash_whatever_they_were_built_from():
    lists = replace(PLAIN, distortion=[0.1, 0, 0, 0], rectification=rotation_from_rpy(0, 0, 0.1))
    arrays = replace(
        PLAIN, distortion=np.array([0.1, 0, 0, 0]), rectification=rotation_from_rpy(0, 0, 0.1).tolist()
    )
    assert lists == arrays
    assert hash(lists) == hash(arrays)
    assert replace(PLAIN, distortion=(0.0,) * 5, rectification=np.eye(3)) == PLAIN


@pytest.mark.parametrize("length", [8, 12, 14])
def test_rational_model_takes_every_length_opencv_writes(length):
    padded = (*RATIONAL.distortion, *[0.0] * (length - 8))
    assert replace(RATIONAL, distortion=padded) == RATIONAL


def test_the_room_needs_numpy_alone():
    code = (
        "import sys; import robot_vision.geometry; "
        "print([m for m in ('cv2', 'scipy', 'rclpy', 'numba', 'rosbags', 'matplotlib') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
