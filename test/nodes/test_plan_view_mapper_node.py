# SPDX-License-Identifier: Apache-2.0
"""The mapper as a process: a drawn corridor in, plan, map and clearance out, good ones after every bad input."""

from __future__ import annotations

import array
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from nav_msgs.msg import OccupancyGrid, Odometry
from node_bench import NodeBench
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2, Range
from std_msgs.msg import Header

from robot_vision.ros.images import image_message
from robot_vision.ros.messages import lines_to_message, points_from_cloud, vanishing_points_to_message

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "mapping"))

from corridor_pictures import CAMERA, Box, feet, picture, vanishing_points  # noqa: E402  (drawn for the library)

NODE = "plan_view_mapper"
BOX = (Box(3.0, 0.0),)
STEP_NS = 100_000_000


@pytest.fixture(scope="module")
def bench(ros_domain: int) -> Iterator[NodeBench]:
    place = {"camera.height": float(CAMERA.height_m or 0.0), "camera.pitch": CAMERA.pitch}
    bench = NodeBench(ros_domain, NODE, {**place, "ready_patience": 0.1, "map.period": 0.0})
    try:
        for kind, topic in (
            (Image, "image"),
            (PointCloud2, "lines"),
            (PointCloud2, "vanishing_points"),
            (CameraInfo, "camera_info"),
            (Odometry, "odom"),
            (JointState, "joint_states"),
        ):
            bench.speaks(kind, topic)
        for kind, topic in (
            (OccupancyGrid, "plan_view"),
            (OccupancyGrid, "map"),
            (PointCloud2, "ground_points"),
            (Range, "clearance"),
            (Image, "plan_view/overlay"),
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


def odometry(header: Header, x: float) -> Odometry:
    message = Odometry(header=Header(stamp=header.stamp, frame_id="odom"), child_frame_id="base_link")
    message.pose.pose.position.x = x
    message.pose.pose.orientation.w = 1.0
    return message


def show(
    bench: NodeBench,
    shown: np.ndarray[Any, np.dtype[np.uint8]],
    x: float | None = None,
    lines: PointCloud2 | None = None,
    points: PointCloud2 | None = None,
) -> Header:
    """Send a picture with what belongs to it."""
    header = bench.header(step_ns=STEP_NS)
    if x is not None:
        bench.say_surely("odom", odometry(header, x))
    bench.say("image", image_message(header, shown))
    lines = lines or lines_to_message(header, feet())
    points = points or vanishing_points_to_message(header, vanishing_points())
    lines.header = points.header = header
    bench.say("lines", lines)
    bench.say("vanishing_points", points)
    return header


def at(grid: OccupancyGrid, x: float, y: float) -> int:
    info = grid.info
    column, row = (
        int((value - start) / info.resolution)
        for value, start in ((x, info.origin.position.x), (y, info.origin.position.y))
    )
    return int(grid.data[row * info.width + column])


def test_the_first_picture_gives_plan_and_clearance_without_odometry(calibrated: NodeBench) -> None:
    header = show(calibrated, picture(0.0, BOX))
    clearance = calibrated.answer("clearance", header)
    assert clearance.header.frame_id == "base_link"
    assert clearance.range == pytest.approx(2.7, rel=0.04)
    plan = calibrated.answer("plan_view", header)
    assert plan.header.frame_id == "base_link"
    assert (at(plan, 2.0, 0.0), at(plan, 3.07, 0.0), at(plan, 4.0, 0.0)) == (0, 100, -1)
    calibrated.until(lambda: "no odometry" in calibrated.state("message"), "it says what is missing")
    cloud = points_from_cloud(calibrated.answer("ground_points", header), ("x", "y", "z", "kind", "sigma_x"))
    assert {0, 1} <= set(cloud["kind"].tolist())
    overlay = calibrated.answer("plan_view/overlay", header)
    assert (overlay.width, overlay.height) == (640, 480)


def test_with_odometry_there_is_a_map_for_those_who_come_late_too(calibrated: NodeBench) -> None:
    for number in range(8):
        header = show(calibrated, picture(0.1 * number, BOX), 0.1 * number)
        calibrated.answer("plan_view", header)
    said = calibrated.answer("map", header)
    assert said.header.frame_id == "odom"
    assert (at(said, 2.2, 0.0), at(said, 3.07, 0.0)) == (0, 100)
    late: list[OccupancyGrid] = []
    lasting = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    subscription = calibrated.node.create_subscription(OccupancyGrid, "map", late.append, lasting)
    calibrated.until(lambda: late, "the last map comes to a late listener")
    calibrated.node.destroy_subscription(subscription)
    assert late[0].header.stamp == header.stamp
    calibrated.until(lambda: calibrated.state("message") == "maps the floor", "all is well")


def good(bench: NodeBench) -> None:
    """The next good picture, another one than the last, is answered as ever."""
    clearance = bench.answer("clearance", show(bench, picture(0.02, BOX)))
    assert clearance.range == pytest.approx(2.7, rel=0.04)


@pytest.mark.parametrize("topic", ["lines", "vanishing_points"])
def test_a_cloud_that_is_none_costs_only_what_it_would_have_told(calibrated: NodeBench, topic: str) -> None:
    name = "lines" if topic == "lines" else "points"
    header = show(calibrated, picture(0.0, BOX), **{name: PointCloud2(point_step=4)})
    calibrated.log_line(f"/{topic}", "lacks the fields")
    assert calibrated.answer("plan_view", header)
    good(calibrated)


def test_vanishing_points_that_are_no_numbers_are_refused(calibrated: NodeBench) -> None:
    cloud = vanishing_points_to_message(Header(), vanishing_points())
    values = np.frombuffer(cloud.data, np.float32).copy()
    values[0] = np.nan
    cloud.data = array.array("B", values.tobytes())
    show(calibrated, picture(0.0, BOX), points=cloud)
    calibrated.log_line("/vanishing_points", "x of vanishing point 0 is nan")
    good(calibrated)


def test_a_picture_of_another_size_is_refused(calibrated: NodeBench) -> None:
    show(calibrated, np.ascontiguousarray(picture(0.0, BOX)[::2, ::2]))
    calibrated.log_line("the picture is 320 x 240, but camera_info is for 640 x 480")
    good(calibrated)


@pytest.mark.parametrize(
    "spoil, words", [("position", "pose.position.x is nan"), ("orientation", "names no direction")]
)
def test_odometry_that_is_none_is_refused(calibrated: NodeBench, spoil: str, words: str) -> None:
    message = odometry(calibrated.header(), 0.0)
    if spoil == "position":
        message.pose.pose.position.x = math.nan
    else:
        message.pose.pose.orientation.w = 0.0
    calibrated.say_surely("odom", message)
    calibrated.log_line("/odom", words)
    good(calibrated)


def test_a_calibration_that_is_none_is_refused_and_the_last_good_one_stays(calibrated: NodeBench) -> None:
    info = CameraInfo(**CAMERA.camera_info())
    info.k = np.zeros(9)
    calibrated.say_surely("camera_info", info)
    calibrated.log_line("/camera_info", "k")
    good(calibrated)


def test_in_the_dark_clearance_is_silent_and_nothing_is_free(calibrated: NodeBench) -> None:
    header = show(calibrated, np.full((480, 640, 3), 3, np.uint8))
    plan = calibrated.answer("plan_view", header)
    assert set(plan.data) == {-1}
    calibrated.until(lambda: "dark" in calibrated.state("message"), "it says why")
    assert all(message.header.stamp != header.stamp for message in calibrated.said("clearance"))
    good(calibrated)


def test_without_the_height_of_the_camera_nothing_is_said_but_why(calibrated: NodeBench) -> None:
    assert calibrated.set_parameter("camera.height", 0.0).successful
    header = show(calibrated, picture(0.0, BOX))
    calibrated.until(lambda: "camera.height is not known" in calibrated.state("message"), "it says so")
    assert all(message.header.stamp != header.stamp for message in calibrated.said("clearance"))
    assert not calibrated.set_parameter("robot.width", -1.0).successful
    assert calibrated.set_parameter("camera.height", 0.6).successful
    good(calibrated)


def test_behind_it_takes_the_newest_picture_and_counts_the_others(calibrated: NodeBench) -> None:
    headers = [show(calibrated, picture(0.0, BOX)) for _ in range(12)]
    calibrated.answer("clearance", headers[-1])
    calibrated.until(lambda: int(calibrated.state("skipped")) > 0, "it says how many it has skipped")


def test_a_clock_that_jumps_back_starts_anew(calibrated: NodeBench) -> None:
    calibrated.next_stamp(-500_000_000)
    header = show(calibrated, picture(0.0, BOX))
    calibrated.log_line("/image", "went back")
    assert calibrated.answer("clearance", header).range == pytest.approx(2.7, rel=0.04)


def test_a_camera_on_a_head_that_looks_aside_gives_no_plan(calibrated: NodeBench) -> None:
    """Of a head that turns back the plan goes on."""
    for pan, aside in ((0.3, True), (0.0, False)):
        joints = JointState(header=calibrated.header(step_ns=STEP_NS), name=["camera_pan"], position=[pan])
        calibrated.say_surely("joint_states", joints)
        calibrated.next_stamp(-STEP_NS)
        header = show(calibrated, picture(0.0, BOX))
        if aside:
            calibrated.log_line("/joint_states", "looks aside (pan 0.30 rad")
        else:
            calibrated.answer("clearance", header)
    assert calibrated.log_count("looks aside") == 1
