# SPDX-License-Identifier: Apache-2.0
"""The four ways of saying an attitude agree with one another and with the directions they name."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_cameras import angles, numbers

from robot_vision.geometry import (
    BODY_FROM_OPTICAL,
    attitude_from_up,
    quaternion_from_rotation,
    quaternion_to_rotation,
    rotation_from_rpy,
    rpy_from_rotation,
    up_from_attitude,
    wrap_angle,
)

quaternions = st.tuples(*[numbers(-1, 1)] * 4).map(np.array).filter(lambda q: np.linalg.norm(q) > 0.1)


def test_optical_axes_in_the_body():
    assert (BODY_FROM_OPTICAL @ [0, 0, 1]).tolist() == [1, 0, 0]  # forward
    assert (BODY_FROM_OPTICAL @ [-1, 0, 0]).tolist() == [0, 1, 0]  # left
    assert (BODY_FROM_OPTICAL @ [0, -1, 0]).tolist() == [0, 0, 1]  # up


def test_signs_of_roll_pitch_and_yaw():
    assert (rotation_from_rpy(0, 0.1, 0) @ [1, 0, 0])[2] < 0  # pitch looks down
    assert (rotation_from_rpy(0.1, 0, 0) @ [0, 1, 0])[2] > 0  # roll lifts the left side
    assert (rotation_from_rpy(0, 0, 0.1) @ [1, 0, 0])[1] > 0  # yaw turns counter-clockwise


@given(angles, numbers(-1.57, 1.57), angles)
def test_angles_come_back_from_the_rotation(roll, pitch, yaw):
    rotation = rotation_from_rpy(roll, pitch, yaw)
    assert rotation @ rotation.T == pytest.approx(np.eye(3), abs=1e-14)
    assert rotation_from_rpy(*rpy_from_rotation(rotation)) == pytest.approx(rotation, abs=1e-12)
    if abs(pitch) < 1.5:
        back = np.array(rpy_from_rotation(rotation))
        assert wrap_angle(back - [roll, pitch, yaw]) == pytest.approx(np.zeros(3), abs=1e-12)


@pytest.mark.parametrize("pitch", [math.pi / 2, -math.pi / 2])
@given(roll=angles, yaw=angles)
def test_straight_up_and_down_keep_the_rotation(pitch, roll, yaw):
    rotation = rotation_from_rpy(roll, pitch, yaw)
    assert rotation_from_rpy(*rpy_from_rotation(rotation)) == pytest.approx(rotation, abs=1e-9)


@given(quaternions)
def test_quaternion_round_trip(q):
    back = quaternion_from_rotation(quaternion_to_rotation(q))
    unit = q / np.linalg.norm(q)
    assert np.linalg.norm(back) == pytest.approx(1.0, abs=1e-14)
    assert back[3] >= 0.0
    assert min(np.abs(back - unit).max(), np.abs(back + unit).max()) < 1e-12


def test_quaternion_of_a_quarter_turn_left():
    half = math.sqrt(0.5)
    assert quaternion_from_rotation(rotation_from_rpy(0, 0, math.pi / 2)) == pytest.approx([0, 0, half, half])


@pytest.mark.parametrize("bad", [[0, 0, 0, 0], [np.nan, 0, 0, 1], [np.inf, 0, 0, 1], [0, 0, 1]])
def test_quaternion_that_names_no_rotation_is_refused(bad):
    with pytest.raises(ValueError, match=r"quaternion .* must be finite and not all zero"):
        quaternion_to_rotation(bad)


@given(angles, numbers(-1.57, 1.57), numbers(0.01, 100.0))
def test_up_is_the_vertical_of_the_camera_body(roll, pitch, length):
    up = up_from_attitude(roll, pitch)
    assert rotation_from_rpy(roll, pitch, 0) @ BODY_FROM_OPTICAL @ up == pytest.approx([0, 0, 1], abs=1e-14)
    found_roll, found_pitch = attitude_from_up(length * up)
    assert up_from_attitude(found_roll, found_pitch) == pytest.approx(up, abs=1e-12)
    if abs(pitch) < 1.5:
        assert wrap_angle(found_roll - roll) == pytest.approx(0, abs=1e-12)
        assert found_pitch == pytest.approx(pitch, abs=1e-12)


def test_camera_that_looks_straight_down_has_no_roll():
    assert attitude_from_up([0, 0, -1]) == pytest.approx((0.0, math.pi / 2))


@pytest.mark.parametrize("bad", [[0, 0, 0], [np.nan, 0, 1], [0, 1]])
def test_up_that_points_nowhere_is_refused(bad):
    with pytest.raises(ValueError, match="up must be three finite numbers, not all zero"):
        attitude_from_up(bad)


@given(numbers(-1000, 1000))
def test_wrapped_angle_points_the_same_way_within_one_turn(angle):
    wrapped = wrap_angle(angle)
    assert isinstance(wrapped, float)
    assert -math.pi - 1e-12 < wrapped <= math.pi + 1e-12
    assert (math.cos(wrapped), math.sin(wrapped)) == pytest.approx(
        (math.cos(angle), math.sin(angle)), abs=1e-11
    )


def test_wrapping_leaves_small_angles_to_the_last_bit_and_half_turns_positive():
    tiny = np.array([1e-18, -1e-18, 0.1, -3.1])
    assert (wrap_angle(tiny) == tiny).all()
    assert wrap_angle(math.pi) == wrap_angle(-math.pi) == math.pi
