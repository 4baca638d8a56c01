# SPDX-License-Identifier: Apache-2.0
"""Messages mean what DESIGN's table says, survive the way there and back, and are refused when they are broken."""

from __future__ import annotations

import array
import math

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2, PointField, Range
from std_msgs.msg import Header

from robot_vision.geometry import Camera
from robot_vision.perception import LaneHeading, LineSegments, Role, VanishingPoints
from robot_vision.perception.attitude import Attitude
from robot_vision.perception.way import straight_path
from robot_vision.ros import messages
from robot_vision.ros.messages import MessageError, lines_from_message, lines_to_message

HEADER = Header(stamp=Time(sec=12, nanosec=345), frame_id="camera")
CAMERA = Camera(500.0, 500.0, 319.5, 239.5, 640, 480)
PIXELS = st.floats(-1e4, 1e4, width=32)
ANGLES = st.floats(-3.1, 3.1)
FIELDS = ["x1", "y1", "x2", "y2", "strength"]


@st.composite
def segments(draw: st.DrawFn) -> LineSegments:
    count = draw(st.integers(0, 12))
    ends = draw(hnp.arrays(np.float64, (count, 4), elements=PIXELS))
    strength = draw(hnp.arrays(np.float64, count, elements=st.floats(0.0, 255.0, width=32)))
    return LineSegments(ends, strength, np.full(count, 0.3))


def cloud_of(points: NDArray[np.void], big_endian: bool = False) -> PointCloud2:
    """A cloud built by hand, so that the reader is not judged by the writer."""
    formats = {"f4": PointField.FLOAT32, "f8": PointField.FLOAT64}
    layout = points.dtype.fields or {}
    return PointCloud2(
        header=HEADER,
        height=1,
        width=len(points),
        fields=[
            PointField(name=name, offset=int(offset), datatype=formats[kind.str[1:]], count=1)
            for name, (kind, offset, *_) in layout.items()
        ],
        is_bigendian=big_endian,
        point_step=points.dtype.itemsize,
        row_step=points.nbytes,
        data=array.array("B", points.tobytes()),
    )


@given(segments())
def test_lines_come_back_as_they_went(lines: LineSegments) -> None:
    message = lines_to_message(HEADER, lines)
    back = lines_from_message(message)
    assert message.header == HEADER
    np.testing.assert_array_equal(back.endpoints, lines.endpoints)
    np.testing.assert_array_equal(back.strength, lines.strength)
    np.testing.assert_array_equal(back.sigma, lines.sigma)  # usual for all: the cloud does not hold it


def test_lines_stand_in_the_cloud_as_the_contract_says() -> None:
    message = lines_to_message(
        HEADER, LineSegments(np.array([[1.0, 2.0, 3.0, 4.0]]), np.array([5.0]), np.array([0.5]))
    )
    assert [field.name for field in message.fields] == FIELDS
    assert {field.datatype for field in message.fields} == {PointField.FLOAT32}
    assert [field.offset for field in message.fields] == [0, 4, 8, 12, 16]
    assert (message.height, message.width, message.row_step, message.point_step) == (1, 1, 20, 20)
    np.testing.assert_array_equal(np.frombuffer(message.data, "<f4"), [1, 2, 3, 4, 5])


@pytest.mark.parametrize("order", ["<", ">"])
def test_lines_of_others_are_read_by_name_in_any_order_type_and_padding(order: str) -> None:
    layout = np.dtype(
        {
            "names": ["strength", "y2", "x2", "y1", "x1"],
            "formats": [order + kind for kind in ("f4", "f8", "f4", "f4", "f8")],
            "offsets": [0, 8, 16, 20, 24],
            "itemsize": 40,
        }
    )
    points = np.zeros(2, layout)
    points["x1"], points["y1"], points["x2"], points["y2"] = (1, 11), (2, 12), (3, 13), (4, 14)
    points["strength"] = 7
    lines = lines_from_message(cloud_of(points, order == ">"))
    np.testing.assert_array_equal(lines.endpoints, [[1, 2, 3, 4], [11, 12, 13, 14]])
    np.testing.assert_array_equal(lines.strength, [7, 7])
    assert (lines.sigma > 0.0).all(), "a line without sigma still has one"


@pytest.mark.parametrize("missing", FIELDS)
def test_lines_without_a_field_are_refused_by_its_name(missing: str) -> None:
    points = np.zeros(3, [(name, "<f4") for name in FIELDS if name != missing])
    with pytest.raises(MessageError, match=missing):
        lines_from_message(cloud_of(points))


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_lines_with_what_is_no_number_are_refused_by_name_and_place(name: str, value: float) -> None:
    points = np.ones(4, [(field, "<f4") for field in FIELDS])
    points[name][2] = value
    with pytest.raises(MessageError, match=f"{name} of line 2 is {value}"):
        lines_from_message(cloud_of(points))


def test_clouds_that_contradict_themselves_are_refused() -> None:
    good = lines_to_message(HEADER, LineSegments.from_endpoints(np.ones((3, 4))))
    for field, value in {"data": good.data[:-1], "point_step": 3, "width": 4}.items():
        cloud = lines_to_message(HEADER, LineSegments.from_endpoints(np.ones((3, 4))))
        setattr(cloud, field, value)
        with pytest.raises(MessageError):
            lines_from_message(cloud)
    good.fields[0].datatype = 99
    with pytest.raises(MessageError, match="x1"):
        lines_from_message(good)


def found(directions: list[list[float]]) -> VanishingPoints:
    count = len(directions)
    unit = np.array(directions) / np.linalg.norm(directions, axis=1, keepdims=True)
    return VanishingPoints(
        directions=unit,
        covariance=np.broadcast_to(np.eye(2) * 4e-6, (count, 2, 2)),
        weight=np.arange(count, 0, -1.0),
        roles=np.array([Role.PRIMARY, Role.VERTICAL, Role.HORIZONTAL][:count], np.uint32),
        ids=np.arange(7, 7 + count, dtype=np.uint32),
        labels=np.zeros(0, np.intp),
        camera=CAMERA,
    )


def test_vanishing_points_stand_in_the_cloud_as_the_contract_says() -> None:
    points = found([[0.1, -0.2, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    cloud = messages.vanishing_points_to_message(HEADER, points)
    assert cloud.header == HEADER
    floats = [field.name for field in cloud.fields if field.datatype == PointField.FLOAT32]
    whole = [field.name for field in cloud.fields if field.datatype == PointField.UINT32]
    assert floats == ["x", "y", "z", "u", "v", "sigma", "weight"]
    assert sorted(whole) == ["id", "role"]
    read = messages.points_from_cloud(cloud, [*floats, *whole])
    np.testing.assert_allclose(
        np.column_stack([read["x"], read["y"], read["z"]]), points.directions, atol=1e-7
    )
    np.testing.assert_allclose([read["u"][0], read["v"][0]], [319.5 + 50.0, 239.5 - 100.0], rtol=1e-6)
    assert read["v"][1] == math.inf
    assert read["u"][2] == math.inf
    np.testing.assert_allclose(read["sigma"], 2e-3, rtol=1e-6)
    np.testing.assert_array_equal(read["id"], [7, 8, 9])
    np.testing.assert_array_equal(read["role"], [1, 2, 3])


def test_no_vanishing_point_is_an_empty_cloud_with_all_fields() -> None:
    cloud = messages.vanishing_points_to_message(HEADER, None)
    assert (cloud.width, len(cloud.data), len(cloud.fields)) == (0, 0, 9)


@given(ANGLES, st.floats(1e-9, 9.0), st.floats(-20.0, 20.0), st.floats(1e-9, 9.0))
def test_heading_comes_back_as_it_went(
    yaw: float, yaw_variance: float, offset: float, offset_variance: float
) -> None:
    message = messages.heading_to_message(HEADER, LaneHeading(yaw, yaw_variance, offset, offset_variance))
    assert (message.header.stamp, message.header.frame_id) == (HEADER.stamp, "corridor")
    back = messages.heading_from_message(message)
    assert back.yaw == pytest.approx(yaw, abs=1e-12)
    assert (back.yaw_variance, back.offset, back.offset_variance) == (yaw_variance, offset, offset_variance)


def test_heading_marks_what_is_not_known() -> None:
    message = messages.heading_to_message(HEADER, LaneHeading(0.1, 1e-4))
    variances = np.asarray(message.pose.covariance)[::7]
    np.testing.assert_allclose(variances, [1e6, 1e6, 1e6, 1e6, 1e6, 1e-4])
    assert not messages.heading_from_message(message).offset_known


@pytest.mark.parametrize("value", [math.nan, math.inf])
@pytest.mark.parametrize("part", ["orientation.z", "position.y", "covariance 7", "covariance 35"])
def test_heading_with_what_is_no_number_is_refused(part: str, value: float) -> None:
    message: PoseWithCovarianceStamped = messages.heading_to_message(
        HEADER, LaneHeading(0.1, 1e-4, 0.2, 1e-3)
    )
    if part == "orientation.z":
        message.pose.pose.orientation.z = value
    elif part == "position.y":
        message.pose.pose.position.y = value
    else:
        message.pose.covariance[int(part.split()[1])] = value
    if (part, value) == ("covariance 7", math.inf):
        assert not messages.heading_from_message(message).offset_known, "boundless doubt is a clear word"
        return
    with pytest.raises(MessageError):
        messages.heading_from_message(message)


def test_heading_that_is_nothing_to_steer_by_is_refused() -> None:
    message = messages.heading_to_message(HEADER, LaneHeading(0.1, 1e6))
    with pytest.raises(MessageError, match="unknown"):
        messages.heading_from_message(message)
    message = messages.heading_to_message(HEADER, LaneHeading(0.1, 1e-4))
    message.pose.pose.orientation.z = message.pose.pose.orientation.w = 0.0
    with pytest.raises(MessageError, match="orientation"):
        messages.heading_from_message(message)


@given(st.floats(-1.2, 1.2), st.floats(-3.0, 3.0))
def test_path_ahead_lies_on_the_centre_line(yaw: float, offset: float) -> None:
    """Moved from base_link to the lane's frame by the robot's own pose, every point has y = 0."""
    points = straight_path(LaneHeading(yaw, 1e-4, offset, 1e-4), length=5.0)
    path = messages.path_to_message(HEADER, points)
    np.testing.assert_allclose(messages.path_from_message(path), points)
    x, y = np.array([(pose.pose.position.x, pose.pose.position.y) for pose in path.poses]).T
    in_lane_x = math.cos(yaw) * x - math.sin(yaw) * y
    in_lane_y = math.sin(yaw) * x + math.cos(yaw) * y + offset
    np.testing.assert_allclose(in_lane_y, 0.0, atol=1e-9)
    assert in_lane_x[-1] - in_lane_x[0] == pytest.approx(5.0)
    assert (path.header.frame_id, path.header.stamp) == ("base_link", HEADER.stamp)


def test_a_path_elsewhere_or_nowhere_is_refused() -> None:
    path = messages.path_to_message(HEADER, [(0.0, 0.0), (1.0, 0.5)])
    path.poses[1].pose.position.y = math.nan
    with pytest.raises(MessageError, match="point 1"):
        messages.path_from_message(path)
    path.header.frame_id = "map"
    with pytest.raises(MessageError, match="map"):
        messages.path_from_message(path)


def test_attitude_marks_what_a_camera_cannot_tell() -> None:
    own = np.array([[1e-4, 2e-5], [2e-5, 3e-4]])
    up = np.array([0.0, -1.0, 0.0])
    message = messages.attitude_to_message(HEADER, Attitude(0.0, 0.2, own, up, own, True))
    assert message.orientation.y == pytest.approx(math.sin(0.1))
    assert message.orientation.w == pytest.approx(math.cos(0.1))
    covariance = np.asarray(message.orientation_covariance).reshape(3, 3)
    np.testing.assert_array_equal(covariance[:2, :2], own)
    assert covariance[2, 2] == 1e6
    assert message.angular_velocity_covariance[0] == -1.0
    assert message.linear_acceleration_covariance[0] == -1.0


def test_clearance_is_a_distance_or_refused() -> None:
    assert messages.clearance_from_message(Range(range=2.5)) == 2.5
    assert messages.clearance_from_message(Range(range=math.inf)) == math.inf
    assert messages.clearance_from_message(Range(range=-math.inf)) == 0.0
    for value in (math.nan, -1.0):
        with pytest.raises(MessageError, match="range"):
            messages.clearance_from_message(Range(range=value))
