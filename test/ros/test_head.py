# SPDX-License-Identifier: Apache-2.0
"""The joints of a head: between two words by proportion, never from too old ones, and nothing made up."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="messages cannot be read without rclpy")

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PointStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from robot_vision.geometry import Camera
from robot_vision.ros.head import Head, point_from_message, point_to_message
from robot_vision.ros.messages import MessageError

CAMERA = Camera(460.0, 460.0, 319.5, 239.5, 640, 480, height_m=0.6, pitch=0.1)


def joints(stamp_s: float, names: list[str], angles: list[float]) -> JointState:
    seconds, part = divmod(round(stamp_s * 1e9), 10**9)
    return JointState(header=Header(stamp=Time(sec=seconds, nanosec=part)), name=names, position=angles)


def head(*told: tuple[float, float, float]) -> Head:
    found = Head()
    for stamp_s, pan, tilt in told:
        found.take(joints(stamp_s, ["wheel", "camera_tilt", "camera_pan"], [9.0, tilt, pan]))
    return found


def test_between_two_words_the_angle_goes_by_proportion_and_a_little_beyond() -> None:
    turning = head((1.0, 0.1, 0.0), (1.05, 0.2, -0.1))
    for stamp_s, pan, tilt in (
        (1.0, 0.1, 0.0),
        (1.025, 0.15, -0.05),
        (1.05, 0.2, -0.1),
        (1.075, 0.25, -0.15),
    ):
        turned = turning.turned(CAMERA, stamp_s)
        assert (turned.pan, turned.tilt) == pytest.approx((pan, tilt), abs=1e-9)
    assert head((1.0, 0.3, 0.0)).turned(CAMERA, 1.08).pan == pytest.approx(0.3)


def test_joints_that_speak_each_for_itself_are_both_heard() -> None:
    """As two servo drivers do, each on its own message, at its own time and a little out of order."""
    apart = Head()
    for stamp_s, name, angle in (
        (1.00, "camera_pan", 0.4),
        (0.99, "camera_tilt", -0.1),
        (1.05, "camera_pan", 0.4),
        (1.04, "camera_tilt", -0.1),
        (1.02, "camera_pan", 0.4),
    ):
        apart.take(joints(stamp_s, [name], [angle]))
        apart.take(joints(stamp_s, ["wheel"], [9.0]))
    turned = apart.turned(CAMERA, 1.05)
    assert (turned.pan, turned.tilt) == pytest.approx((0.4, -0.1))
    apart.take(joints(1.3, ["camera_pan"], [0.4]))
    with pytest.raises(MessageError, match="of camera_tilt the newest is 0.26 s old"):
        apart.turned(CAMERA, 1.3)


def test_a_word_said_twice_and_one_that_comes_late_take_nothing_away() -> None:
    turning = head((1.0, 0.1, 0.0), (1.1, 0.3, 0.0), (1.1, 0.3, 0.0), (1.05, 0.2, 0.0))
    assert turning.turned(CAMERA, 1.025).pan == pytest.approx(0.15)
    assert turning.turned(CAMERA, 1.09).pan == pytest.approx(0.28)


def test_a_stamp_that_goes_far_back_forgets_what_was_said_before() -> None:
    turning = head((5.0, 0.1, 0.0), (5.05, 0.2, 0.0), (1.0, 0.5, 0.0))
    assert turning.turned(CAMERA, 1.0).pan == pytest.approx(0.5)
    with pytest.raises(MessageError, match="is 4.00 s old"):
        turning.turned(CAMERA, 5.0)


def test_words_that_are_too_old_say_nothing() -> None:
    told = head((1.0, 0.1, 0.0))
    with pytest.raises(MessageError, match="camera_pan the newest is 0.50 s old"):
        told.turned(CAMERA, 1.5)
    told.clear()
    with pytest.raises(MessageError, match="nothing usable"):
        told.turned(CAMERA, 1.0)


def test_without_a_head_the_camera_is_fixed() -> None:
    nobody = Head()
    nobody.take(joints(1.0, ["left_wheel", "right_wheel"], [1.0, 2.0]))
    assert nobody.turned(CAMERA, 50.0) == CAMERA
    nobody.check_straight(CAMERA, 50.0)


def test_a_camera_that_looks_aside_is_told_of() -> None:
    head((1.0, 0.005, 0.0)).check_straight(CAMERA, 1.0)
    with pytest.raises(MessageError, match=r"looks aside \(pan 0.20 rad"):
        head((1.0, 0.2, 0.0)).check_straight(CAMERA, 1.0)


@pytest.mark.parametrize(
    ("angles", "words"),
    [([math.nan], "camera_pan is nan"), ([], "no position"), ([57.3], "radians"), ([math.inf], "inf")],
)
def test_what_is_no_angle_is_refused(angles: list[float], words: str) -> None:
    with pytest.raises(MessageError, match=words):
        Head().take(joints(1.0, ["camera_pan"], angles))


def test_a_point_travels_in_base_link_alone() -> None:
    message = point_to_message(Header(frame_id="camera"), np.array([3.0, -1.0, 0.2]))
    assert point_from_message(message) == (3.0, -1.0, 0.2)
    with pytest.raises(MessageError, match="frame 'odom'"):
        point_from_message(PointStamped(header=Header(frame_id="odom")))
