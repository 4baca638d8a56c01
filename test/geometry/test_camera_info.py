# SPDX-License-Identifier: Apache-2.0
"""CameraInfo in and out, through the messages of rosbags and of rclpy, and every refusal with its words."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from random_cameras import cameras
from rosbags.typesys import Stores, get_typestore

from robot_vision.geometry import Camera, CameraError, rotation_from_rpy

K = [500.0, 0.0, 320.0, 0.0, 510.0, 240.0, 0.0, 0.0, 1.0]
EYE = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
STORE = get_typestore(Stores.ROS2_JAZZY)


def info(**changes):
    fields = {
        "width": 640,
        "height": 480,
        "distortion_model": "plumb_bob",
        "d": [0.0] * 5,
        "k": K,
        "r": EYE,
        "p": [0.0] * 12,
        "binning_x": 0,
        "binning_y": 0,
        "roi": roi(),
    }
    return SimpleNamespace(**{**fields, **changes})


def roi(x_offset=0, y_offset=0, width=0, height=0):
    return SimpleNamespace(x_offset=x_offset, y_offset=y_offset, width=width, height=height, do_rectify=False)


def place(camera):
    return {"height_m": camera.height_m, "pitch": camera.pitch, "roll": camera.roll, "x_m": camera.x_m}


@settings(max_examples=50)
@given(cameras())
def test_round_trip_through_rosbags(camera):
    fields = camera.camera_info()
    types = STORE.types
    message = types["sensor_msgs/msg/CameraInfo"](
        header=types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](1, 2), "camera"),
        height=fields["height"],
        width=fields["width"],
        distortion_model=fields["distortion_model"],
        **{name: np.array(fields[name]) for name in "dkrp"},
        binning_x=0,
        binning_y=0,
        roi=types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False),
    )
    read = STORE.deserialize_cdr(STORE.serialize_cdr(message, message.__msgtype__), message.__msgtype__)
    assert Camera.from_camera_info(read, **place(camera)) == camera


@settings(max_examples=50)
@given(cameras())
def test_round_trip_through_rclpy(camera):
    messages = pytest.importorskip("sensor_msgs.msg", reason="ROS 2 Python messages are not installed here")
    message = messages.CameraInfo()
    for name, value in camera.camera_info().items():
        setattr(message, name, value)
    assert Camera.from_camera_info(message, **place(camera)) == camera


def test_projection_of_zeros_means_the_raw_matrix():
    camera = Camera.from_camera_info(info(d=[-0.3, 0.1, 0.0, 0.0, 0.0]))
    assert (camera.rectified().matrix == camera.matrix).all()
    assert camera.matrix.ravel().tolist() == K


def test_projection_given_is_the_rectified_matrix():
    p = [400.0, 0.0, 300.0, -20.0, 0.0, 410.0, 250.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    camera = Camera.from_camera_info(info(p=p))
    assert not camera.is_rectified
    assert camera.rectified().matrix.ravel().tolist() == [400.0, 0.0, 300.0, 0.0, 410.0, 250.0, 0.0, 0.0, 1.0]
    assert camera.rectified().camera_info()["p"] == p  # the baseline of a stereo pair is not lost


def test_rotation_turns_rays_into_the_rectified_frame():
    rotation = rotation_from_rpy(0.01, -0.02, 0.03)
    turned = Camera.from_camera_info(info(r=rotation.ravel().tolist()))
    straight = Camera.from_camera_info(info())
    assert turned.rays([[100.0, 50.0]]) == pytest.approx(
        straight.rays([[100.0, 50.0]]) @ rotation.T, abs=1e-15
    )


def test_rotation_of_zeros_means_none():
    assert Camera.from_camera_info(info(r=[0.0] * 9)) == Camera.from_camera_info(info())


def test_no_model_and_no_coefficients_is_a_rectified_picture():
    assert Camera.from_camera_info(info(distortion_model="", d=[])).is_rectified


def test_region_of_interest_moves_the_picture():
    camera = Camera.from_camera_info(info(roi=roi(100, 50, 200, 150)))
    assert (camera.width, camera.height, camera.cx, camera.cy) == (200, 150, 220.0, 190.0)
    assert Camera.from_camera_info(info(roi=roi(100, 50))).width == 540
    assert Camera.from_camera_info(info(roi=roi(0, 0, 640, 480))) == Camera.from_camera_info(info())


def test_binning_joins_pixels():
    # The first joined pixel covers columns 0 and 1, so its centre lies at 0.5 of the full picture.
    full = Camera.from_camera_info(info(d=[-0.2, 0.0, 0.0, 0.0, 0.0]))
    camera = Camera.from_camera_info(info(d=[-0.2, 0.0, 0.0, 0.0, 0.0], binning_x=2, binning_y=4))
    assert (camera.width, camera.height) == (320, 120)
    assert camera.rays([[0.0, 0.0]]) == pytest.approx(full.rays([[0.5, 1.5]]), abs=1e-12)


def test_window_and_binning_together_also_move_the_projection():
    p = [400.0, 0.0, 300.0, -20.0, 0.0, 410.0, 250.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    camera = Camera.from_camera_info(info(p=p, roi=roi(100, 50, 301, 203), binning_x=2, binning_y=2))
    assert (camera.width, camera.height) == (150, 101)
    assert camera.rectified().matrix == pytest.approx(np.array([[200, 0, 99.75], [0, 205, 99.75], [0, 0, 1]]))
    assert np.array(camera.camera_info()["p"])[3] == pytest.approx(-10.0)


nan, inf = math.nan, math.inf
REFUSED_INFOS = [
    ({"k": [0.0] * 9}, "k", "not calibrated; calibrate it or use Camera.uncalibrated"),
    ({"k": [nan, *K[1:]]}, "k", "finite"),
    ({"k": K[:6]}, "k", "must hold 9 numbers, got 6"),
    ({"k": [500.0, 2.0, *K[2:]]}, "k", "without skew"),
    ({"k": [*K[:8], 0.0]}, "k", "0 0 1"),
    ({"k": [0.0, *K[1:]]}, "fx", "focal length must be positive, got 0 px"),
    ({"k": [*K[:4], -510.0, *K[5:]]}, "fy", "focal length must be positive, got -510 px"),
    ({"k": [500.0, 0.0, 9000.0, *K[3:]]}, "cx", "lies 8360.5 px outside the picture"),
    ({"k": [*K[:5], -2000.0, *K[6:]]}, "cy", "lies 1999.5 px outside the picture"),
    ({"width": 0}, "width", "above zero"),
    ({"height": 0}, "height", "above zero"),
    ({"height": -480}, "height", "above zero"),
    (
        {"distortion_model": "brown_conrady"},
        "distortion_model",
        "'brown_conrady' is not known; known are plumb_bob",
    ),
    ({"distortion_model": "", "d": [0.1] * 5}, "distortion_model", "'' is not known"),
    ({"d": [0.1] * 3}, "distortion", "plumb_bob takes 4 or 5 coefficients, got 3"),
    ({"d": [0.1] * 8}, "distortion", "got 8; 8 belong to rational_polynomial"),
    ({"d": [0.1, nan, 0.0, 0.0, 0.0]}, "distortion", "finite"),
    ({"distortion_model": "rational_polynomial"}, "distortion", "takes 8 or 12 or 14 coefficients, got 5"),
    ({"distortion_model": "equidistant", "d": []}, "distortion", "equidistant takes 4 coefficients, got 0"),
    ({"distortion_model": "rational_polynomial", "d": [0.1] * 12}, "distortion", "thin prism terms s1..s4"),
    (
        {"distortion_model": "rational_polynomial", "d": [*[0.1] * 8, *[0.0] * 4, 0.1, 0.0]},
        "distortion",
        "sensor tilt terms",
    ),
    ({"r": [2.0, *EYE[1:]]}, "rectification", "must be a rotation: R Rᵀ is off by 3"),
    ({"r": [-1.0, *EYE[1:]]}, "rectification", "determinant -1"),
    ({"r": [inf, *EYE[1:]]}, "r", "finite"),
    ({"p": [-1.0, *[0.0] * 11]}, "projection", "focal lengths must be positive"),
    ({"p": [nan] * 12}, "p", "finite"),
    ({"roi": roi(600, 0, 100, 100)}, "roi", "100x100 at (600, 0) is not inside the picture 640x480"),
    ({"roi": roi(700, 0)}, "roi", "is not inside"),
    ({"binning_x": 1000}, "binning_x, binning_y", "leaves nothing"),
]


@pytest.mark.parametrize(
    ("changes", "field", "reason"), REFUSED_INFOS, ids=[f"{c[1]}: {c[2]}" for c in REFUSED_INFOS]
)
def test_nonsense_in_a_camera_info_is_refused_with_field_and_reason(changes, field, reason):
    with pytest.raises(CameraError) as caught:
        Camera.from_camera_info(info(**changes))
    assert caught.value.field == field
    assert reason in caught.value.reason
    assert str(caught.value) == f"camera {field}: {caught.value.reason}"


GOOD = Camera(500.0, 510.0, 320.0, 240.0, 640, 480, height_m=1.0)
REFUSED_FIELDS = [
    ("fx", nan, "finite"),
    ("fy", inf, "finite"),
    ("cx", nan, "finite"),
    ("fx", "wide", "must be a number, got 'wide'"),
    ("fx", 10**400, "greater than any"),
    ("fx", 1e-9, "at least 0.001 px"),
    ("pitch", 15.0, "is it in degrees?"),
    ("width", 10**12, "at most 1000000 px"),
    ("distortion", 5, "sequence of numbers, got 5"),
    ("distortion", None, "sequence of numbers"),
    ("distortion", "abcde", "sequence of numbers"),
    ("width", 640.5, "whole number"),
    ("width", nan, "finite"),
    ("height", -1, "above zero"),
    ("height_m", nan, "finite"),
    ("height_m", 0.0, "above the ground (> 0 m), got 0 m"),
    ("height_m", -1.0, "above the ground"),
    ("pitch", nan, "finite"),
    ("roll", inf, "finite"),
    ("x_m", nan, "finite"),
    ("rectification", [[1.0, 0.0], [0.0, 1.0]], "3x3"),
    ("projection", np.eye(3), "3x4"),
    ("rectification", "abc", "3x3"),
    ("rectification", [[1.0, 0.0], [1.0]], "3x3"),
    ("projection", "abc", "3x4"),
]


@pytest.mark.parametrize(("field", "value", "reason"), REFUSED_FIELDS)
def test_nonsense_in_a_field_is_refused_with_its_reason(field, value, reason):
    with pytest.raises(CameraError) as caught:
        replace(GOOD, **{field: value})
    assert caught.value.field == field
    assert reason in caught.value.reason


@pytest.mark.parametrize("window", [(-1, 0, 10, 10), (0, 0, 641, 10), (635, 470, 10, 10)])
def test_window_outside_the_picture_is_refused(window):
    with pytest.raises(CameraError, match=r"window: .* is not inside the picture 640x480"):
        GOOD.cropped(*window)
