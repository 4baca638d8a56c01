# SPDX-License-Identifier: Apache-2.0
"""Messages survive the way to bytes and back, and mean the same."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_vision.bags import BagError, clouds, decode, encode, messages
from robot_vision.bags.schema import has_header, typestore
from robot_vision.geometry import Camera

STAMPS = st.integers(0, 2**31 * 10**9 - 1)


@given(STAMPS, STAMPS, st.booleans())
def test_the_stamp_is_read_and_changed_in_the_bytes(stamp: int, other: int, little: bool) -> None:
    message = messages.twist_stamped(stamp, "base_link", 0.5, 0.1)
    cdr = bytes(typestore().serialize_cdr(message, message.__msgtype__, little_endian=little))
    assert messages.header_stamp_ns(cdr) == stamp
    changed = messages.with_header_stamp(cdr, other)
    assert messages.header_stamp_ns(changed) == other
    again = decode(changed, message.__msgtype__)
    assert messages.stamp_ns(again) == other and again.header.frame_id == "base_link"
    assert messages.with_header_stamp(changed, stamp) == cdr


@pytest.mark.parametrize("cdr", [b"", bytes(11), b"\0\2" + bytes(20), b"\1\1" + bytes(20)])
def test_bytes_without_a_header_are_refused(cdr: bytes) -> None:
    with pytest.raises(BagError):
        messages.header_stamp_ns(cdr)


def test_types_that_begin_with_a_header_are_known() -> None:
    assert has_header("sensor_msgs/msg/Image") and has_header("nav_msgs/msg/OccupancyGrid")
    assert not has_header("rosgraph_msgs/msg/Clock") and not has_header("geometry_msgs/msg/Pose")
    assert not has_header("my_msgs/msg/Thing") and not has_header("std_msgs/msg/Empty")


def test_the_camera_comes_back() -> None:
    camera = Camera(fx=500, fy=510, cx=320, cy=240, width=640, height=480, distortion=(-0.1, 0.01, 0, 0, 0))
    info = messages.camera_info(7, "camera", camera)
    again = Camera.from_camera_info(decode(encode(info), info.__msgtype__))
    assert (again.fx, again.fy, again.cx, again.cy) == (500, 510, 320, 240)
    assert np.allclose(again.distortion[:5], camera.distortion)


@pytest.mark.parametrize("shape", [(4, 5), (4, 5, 3)])
def test_pictures_come_back(shape: tuple[int, ...]) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, shape, np.uint8)
    for message in (
        messages.image(1, "c", pixels),
        messages.compressed_image(1, "c", pixels, "png"),
    ):
        assert np.array_equal(messages.picture(decode(encode(message), message.__msgtype__)), pixels)


@given(st.floats(-math.pi, math.pi), st.floats(-5, 5))
def test_a_heading_keeps_yaw_and_offset(yaw: float, offset: float) -> None:
    message = messages.lane_heading(3, "corridor", yaw, offset, 0.01, 0.04)
    again = decode(encode(message), message.__msgtype__)
    assert math.isclose(
        math.remainder(messages.yaw_of(again.pose.pose.orientation) - yaw, math.tau), 0, abs_tol=1e-9
    )
    assert again.pose.pose.position.y == offset
    assert (again.pose.covariance[7], again.pose.covariance[35]) == (0.04, 0.01)
    unknown = messages.lane_heading(3, "corridor", yaw, None)
    assert unknown.pose.covariance[7] == messages.UNKNOWN_VARIANCE


def test_an_imu_marks_what_it_does_not_measure() -> None:
    message = messages.imu(1, "base_link", (0, 0, 0, 1), np.diag([0.1, 0.2, 0.3]))
    assert message.angular_velocity_covariance[0] == message.linear_acceleration_covariance[0] == -1
    assert decode(encode(message), message.__msgtype__).orientation_covariance[4] == 0.2


def test_point_clouds_come_back() -> None:
    layout = np.dtype([("x", "<f4"), ("y", "<f4"), ("id", "<u4"), ("kind", "u1")])
    points = np.array([(1.5, -2, 7, 1), (0, np.inf, 8, 2)], layout)
    message = clouds.point_cloud(5, "base_link", points)
    again = clouds.points(decode(encode(message), message.__msgtype__))
    assert again.tolist() == points.tolist() and again.dtype.names == layout.names
    assert len(clouds.points(clouds.point_cloud(5, "base_link", points[:0]))) == 0
    message.width = 3
    with pytest.raises(BagError, match="contradicts"):
        clouds.points(message)


def test_an_occupancy_grid_has_row_zero_first() -> None:
    cells = np.array([[0, 100, -1], [1, 2, 3]], np.int8)
    message = clouds.occupancy_grid(1, "odom", cells, 0.1, (-1.0, 2.0))
    again = decode(encode(message), message.__msgtype__)
    assert (again.info.width, again.info.height) == (3, 2) and list(again.data) == [0, 100, -1, 1, 2, 3]
    assert (again.info.origin.position.x, again.info.origin.position.y) == (-1.0, 2.0)


def test_wrong_bytes_and_fields_are_refused_with_the_type() -> None:
    with pytest.raises(BagError, match="not a geometry_msgs/msg/TwistStamped"):
        decode(b"\0\1\0\0abc", "geometry_msgs/msg/TwistStamped")
    with pytest.raises(BagError, match="my_msgs/msg/Thing"):
        decode(b"\0\1\0\0", "my_msgs/msg/Thing")
    broken = messages.twist_stamped(1, "f", 0, 0)
    broken.header.frame_id = 3
    with pytest.raises(BagError, match="TwistStamped"):
        encode(broken)
