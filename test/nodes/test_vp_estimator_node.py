# SPDX-License-Identifier: Apache-2.0
"""The estimator as a process: lines of a corridor in, the robot's way in it out, good lines after bad ones."""

from __future__ import annotations

import array
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry, Path
from node_bench import NodeBench
from sensor_msgs.msg import CameraInfo, Imu, PointCloud2, RegionOfInterest
from std_msgs.msg import Header

from robot_vision.geometry import Camera, rotation_from_rpy
from robot_vision.perception import LineSegments
from robot_vision.ros.messages import UNKNOWN, heading_from_message, lines_to_message, points_from_cloud

HEIGHT_M = 1.0
CAMERA = Camera(500.0, 500.0, 319.5, 239.5, 640, 480, height_m=HEIGHT_M)
WIDTH_M = 2.0
CEILING_M = 2.5


def corridor_edges() -> np.ndarray[Any, np.dtype[np.float64]]:
    """Ends of straight edges in the lane, (N, 2, 3) m: floor, ceiling, rails and door frames of both walls."""
    edges = []
    for side in (-WIDTH_M / 2, WIDTH_M / 2):
        for height in (0.0, 0.1, 1.2, 1.9, CEILING_M):
            edges += [[(near, side, height), (near + 4.0, side, height)] for near in (1.5, 4.0, 8.0)]
        edges += [[(x, side, 0.0), (x, side, 2.0)] for x in (2.5, 3.5, 5.0, 6.0, 8.0, 9.0)]
    return np.array(edges)


def seen_from(yaw: float, offset: float) -> LineSegments:
    """The corridor's edges as a robot sees them that stands `offset` left of the middle, turned by `yaw`."""
    points = corridor_edges().reshape(-1, 3) - (0.0, offset, HEIGHT_M)
    base = points @ rotation_from_rpy(0.0, 0.0, yaw)
    pixels = CAMERA.pixels(base @ CAMERA.optical_to_base).reshape(-1, 4)
    inside = (pixels[:, [0, 2]] > -200).all(1) & (pixels[:, [0, 2]] < 840).all(1)
    return LineSegments.from_endpoints(pixels[inside])


@pytest.fixture(scope="module")
def bench(ros_domain: int) -> Iterator[NodeBench]:
    bench = NodeBench(ros_domain, "vp_estimator", {"camera.height": HEIGHT_M, "ready_patience": 0.1})
    try:
        for kind, topic in ((PointCloud2, "lines"), (CameraInfo, "camera_info"), (Odometry, "odom")):
            bench.speaks(kind, topic)
        for kind, topic in (
            (PointCloud2, "vanishing_points"),
            (PoseWithCovarianceStamped, "heading"),
            (Imu, "attitude"),
            (Path, "path_ahead"),
            (RegionOfInterest, "attention"),
        ):
            bench.hears(kind, topic)
        bench.connect()
        yield bench
    finally:
        bench.close()


@pytest.fixture
def calibrated(bench: NodeBench) -> NodeBench:
    bench.say_surely("camera_info", CameraInfo(**CAMERA.camera_info()))
    return bench


def send(bench: NodeBench, lines: LineSegments) -> Header:
    message = lines_to_message(bench.header(), lines)
    bench.say("lines", message)
    answer = bench.answer("vanishing_points", message.header)
    assert answer.header == message.header
    return message.header


def drive(bench: NodeBench, yaw: float, offset: float, pictures: int = 5) -> Header:
    """Let the estimator see the same view a few times, anew; returns the header of the last one."""
    bench.next_stamp(-900_000_000)
    for _ in range(pictures):
        header = send(bench, seen_from(yaw, offset))
    return header


def test_without_calibration_it_says_nothing_wrong_and_what_is_missing(bench: NodeBench) -> None:
    header = send(bench, seen_from(0.1, 0.2))
    assert bench.answer("vanishing_points", header).width == 0
    bench.until(lambda: "without a calibration" in bench.state("message"), "it says what is missing")
    assert bench.state("level") == "1"
    info = CameraInfo(**CAMERA.camera_info())
    info.k[0] = 0.0
    bench.say_surely("camera_info", info)
    bench.log_line("/camera_info", "focal")
    assert bench.answer("vanishing_points", send(bench, seen_from(0.1, 0.2))).width == 0
    assert not bench.said("heading")


@pytest.mark.parametrize(("yaw", "offset"), [(0.0, 0.0), (0.12, 0.3), (-0.15, -0.25)])
def test_heading_and_offset_of_a_known_corridor(calibrated: NodeBench, yaw: float, offset: float) -> None:
    message = calibrated.answer("heading", drive(calibrated, yaw, offset))
    assert message.header.frame_id == "corridor"
    lane = heading_from_message(message)
    assert lane.yaw == pytest.approx(yaw, abs=math.radians(0.1))
    assert lane.offset == pytest.approx(offset, abs=0.02)
    covariance = np.reshape(message.pose.covariance, (6, 6))
    assert np.all(covariance[[0, 2, 3, 4], [0, 2, 3, 4]] == UNKNOWN)
    assert 0.0 < covariance[1, 1] < 0.1
    assert 0.0 < covariance[5, 5] < 0.01


def test_the_first_vanishing_point_is_the_primary_one(calibrated: NodeBench) -> None:
    yaw = 0.1
    cloud = calibrated.answer("vanishing_points", drive(calibrated, yaw, 0.0))
    points = points_from_cloud(cloud, ("x", "y", "z", "u", "v", "sigma", "weight", "id", "role"))
    assert points["role"][0] == 1
    assert 2 in points["role"]
    # the lane lies at -yaw: to the right of a robot turned to the left
    assert math.atan2(points["x"][0], points["z"][0]) == pytest.approx(yaw, abs=2e-3)
    assert points["u"][0] == pytest.approx(CAMERA.cx + CAMERA.fx * math.tan(yaw), abs=1.0)
    np.testing.assert_allclose(np.linalg.norm([points[k] for k in "xyz"], axis=0), 1.0, atol=1e-6)


def test_attitude_and_the_way_ahead(calibrated: NodeBench) -> None:
    yaw, offset = 0.1, 0.3
    header = drive(calibrated, yaw, offset)
    attitude = calibrated.answer("attitude", header)
    assert (attitude.header.stamp, attitude.header.frame_id) == (header.stamp, "camera_link")
    assert abs(attitude.orientation.x) < 0.01 and abs(attitude.orientation.y) < 0.01
    assert attitude.orientation_covariance[8] == UNKNOWN
    assert attitude.angular_velocity_covariance[0] == attitude.linear_acceleration_covariance[0] == -1.0
    path = calibrated.answer("path_ahead", header)
    assert path.header.frame_id == "base_link"
    points = np.array([(pose.pose.position.x, pose.pose.position.y) for pose in path.poses])
    # in the lane's own frame the path is its middle
    lane = points @ rotation_from_rpy(0.0, 0.0, yaw)[:2, :2].T + (0.0, offset)
    np.testing.assert_allclose(lane[:, 1], 0.0, atol=0.03)
    np.testing.assert_allclose(np.diff(lane[:, 0]), 0.5, atol=1e-3)


def spoilt(fault: str) -> tuple[PointCloud2, str]:
    cloud = lines_to_message(Header(), seen_from(0.0, 0.0))
    if fault == "missing fields":
        cloud.fields = cloud.fields[2:]
        return cloud, "lacks the fields x1, y1"
    if fault == "too few bytes":
        cloud.data = cloud.data[:40]
        return cloud, "contradicts itself"
    if fault == "strange type":
        cloud.fields[0].datatype = 99
        return cloud, "type 99"
    values = np.frombuffer(cloud.data, np.float32).copy()
    values[5] = np.nan
    cloud.data = array.array("B", values.tobytes())
    return cloud, "x1 of line 1 is nan"


@pytest.mark.parametrize("fault", ["missing fields", "too few bytes", "strange type", "NaN"])
def test_bad_lines_get_a_line_and_the_next_good_ones_a_heading(calibrated: NodeBench, fault: str) -> None:
    drive(calibrated, 0.1, 0.0)
    cloud, words = spoilt(fault)
    cloud.header = calibrated.header()
    calibrated.say("lines", cloud)
    calibrated.log_line("/lines", words)
    assert calibrated.answer("vanishing_points", cloud.header).width == 0
    header = send(calibrated, seen_from(0.1, 0.0))
    assert heading_from_message(calibrated.answer("heading", header)).yaw == pytest.approx(0.1, abs=0.01)


def test_no_lines_are_no_heading_and_said_so(calibrated: NodeBench) -> None:
    calibrated.next_stamp(-900_000_000)
    header = send(calibrated, LineSegments.empty())
    calibrated.until(lambda: "no vanishing point" in calibrated.state("message"), "it says so")
    assert calibrated.state("what to try")
    assert all(message.header.stamp != header.stamp for message in calibrated.said("heading"))


def test_a_clock_that_jumps_back_starts_anew(calibrated: NodeBench) -> None:
    drive(calibrated, 0.15, 0.3)
    header = drive(calibrated, -0.15, -0.3)
    calibrated.log_line("/lines", "went back")
    lane = heading_from_message(calibrated.answer("heading", header))
    assert (lane.yaw, lane.offset) == pytest.approx((-0.15, -0.3), abs=0.03)


def test_odometry_that_is_no_number_is_refused_and_the_heading_goes_on(calibrated: NodeBench) -> None:
    odom = Odometry(header=calibrated.header("odom"))
    odom.twist.twist.angular.z = float("nan")
    calibrated.say_surely("odom", odom)
    calibrated.log_line("/odom", "twist.angular.z is nan")
    header = drive(calibrated, 0.1, 0.0)
    assert heading_from_message(calibrated.answer("heading", header)).yaw == pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize("rate", [1e3, -1e300])
def test_odometry_that_no_robot_has_is_refused_and_every_picture_answered(
    calibrated: NodeBench, rate: float
) -> None:
    drive(calibrated, 0.1, 0.0)
    odometry = Odometry(header=calibrated.header())
    odometry.twist.twist.angular.z = rate
    calibrated.say("odom", odometry)
    calibrated.log_line("/odom", "no robot turns so fast")
    header = send(calibrated, seen_from(0.1, 0.0))
    assert heading_from_message(calibrated.answer("heading", header)).yaw == pytest.approx(0.1, abs=0.01)


def test_without_the_camera_height_the_offset_is_marked_unknown(calibrated: NodeBench) -> None:
    assert calibrated.set_parameter("camera.height", 0.0).successful
    message = calibrated.answer("heading", drive(calibrated, 0.1, 0.3))
    assert message.pose.covariance[7] == UNKNOWN
    assert message.pose.pose.position.y == 0.0
    assert not calibrated.set_parameter("camera.height", -1.0).successful
    assert calibrated.set_parameter("camera.height", HEIGHT_M).successful
    header = drive(calibrated, 0.1, 0.3)
    assert heading_from_message(calibrated.answer("heading", header)).offset == pytest.approx(0.3, abs=0.02)


def painted_road(yaw: float, offset: float) -> LineSegments:
    """Both edges of two painted lines 5 m apart as a robot sees them, the paint brighter than the road."""
    ends = []
    for place in (2.56, 2.44, -2.44, -2.56):
        bright_left = place in (2.44, -2.56)
        for near in (2.5, 5.0, 7.5, 10.0, 12.5):
            piece = [(near, place, 0.0), (near + 2.5, place, 0.0)]
            ends.append(piece if bright_left else piece[::-1])
    points = np.array(ends).reshape(-1, 3) - (0.0, offset, HEIGHT_M)
    base = points @ rotation_from_rpy(0.0, 0.0, yaw)
    pixels = CAMERA.pixels(base @ CAMERA.optical_to_base).reshape(-1, 4)
    inside = ((pixels >= 0) & (pixels <= np.tile([639, 479], 2))).all(axis=1)
    return LineSegments.from_endpoints(pixels[inside])


def test_a_road_is_said_in_its_own_frame_with_the_path_along_it(calibrated: NodeBench) -> None:
    assert calibrated.set_parameter("way", "road").successful
    assert calibrated.set_parameter("lane.widest", 9.0).successful
    calibrated.next_stamp(-900_000_000)
    for _ in range(8):
        header = send(calibrated, painted_road(0.05, -0.4))
    message = calibrated.answer("heading", header)
    assert message.header.frame_id == "road"
    lane = heading_from_message(message)
    assert (lane.yaw, lane.offset) == pytest.approx((0.05, -0.4), abs=0.05)
    path = calibrated.answer("path_ahead", header)
    points = np.array([(pose.pose.position.x, pose.pose.position.y) for pose in path.poses])
    on_road = points @ rotation_from_rpy(0.0, 0.0, 0.05)[:2, :2].T + (0.0, -0.4)
    np.testing.assert_allclose(on_road[:, 1], 0.0, atol=0.3)
    points = points_from_cloud(calibrated.answer("vanishing_points", header), ("u", "role"))
    assert points["role"].tolist()[0] == 1 and len(points) >= 2
    header = send(calibrated, LineSegments.empty())
    calibrated.until(lambda: "no road" in calibrated.state("message"), "it says that there is none")
    assert calibrated.set_parameter("way", "auto").successful


def test_a_robot_that_leans_is_warned_of(calibrated: NodeBench) -> None:
    assert calibrated.set_parameter("camera.roll", 0.3).successful  # so the upright camera leans by as much
    drive(calibrated, 0.1, 0.0)
    calibrated.until(lambda: "may tip over" in calibrated.state("message"), "it warns")
    assert calibrated.set_parameter("camera.roll", 0.0).successful
    drive(calibrated, 0.1, 0.0)
    calibrated.until(lambda: "knows heading" in calibrated.state("message"), "it is well again")


def test_where_to_look_is_said_only_when_it_is_asked_for(calibrated: NodeBench) -> None:
    drive(calibrated, 0.0, 0.0)
    assert not calibrated.said("attention")
    assert calibrated.set_parameter("attention.enabled", True).successful
    header = drive(calibrated, 0.0, 0.0, 3)
    calibrated.until(
        lambda: len(calibrated.said("attention")) == 3, "each picture has told where to look next"
    )
    assert calibrated.answer("vanishing_points", header).width
    region = calibrated.said("attention")[-1]
    assert 0 < region.width <= CAMERA.width - region.x_offset
    assert region.y_offset + region.height == CAMERA.height
    assert region.y_offset > 0
    send(calibrated, LineSegments.empty())
    calibrated.until(lambda: len(calibrated.said("attention")) == 4, "it says where to look after a surprise")
    everywhere = calibrated.said("attention")[-1]
    assert (everywhere.x_offset, everywhere.y_offset, everywhere.width, everywhere.height) == (0, 0, 0, 0)
    assert calibrated.set_parameter("attention.enabled", False).successful
    drive(calibrated, 0.0, 0.0, 2)
    assert len(calibrated.said("attention")) == 4
