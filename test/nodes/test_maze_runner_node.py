# SPDX-License-Identifier: Apache-2.0
"""The runner as a process, without pictures: it steers by plans of the floor, and by nothing else."""

from __future__ import annotations

import array
import math
import sys
from collections.abc import Iterator
from pathlib import Path as FilePath

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped, TwistStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from node_bench import NodeBench
from sensor_msgs.msg import CameraInfo, PointCloud2
from std_msgs.msg import Header
from std_srvs.srv import SetBool

from robot_vision.mapping import PlanView, Pose
from robot_vision.planning import Maze
from robot_vision.ros import floor_messages, messages

sys.path.insert(0, str(FilePath(__file__).resolve().parents[1] / "planning"))

from seen_mazes import CAMERA, plan_from  # noqa: E402  (drawn for the library)

HALL = Maze.parse("+---+---+---+\n| S       G |\n+---+---+---+\n")
STEP_NS = 200_000_000
SETTINGS = {
    "rows": 1,
    "columns": 3,
    "goals": ["0,2"],
    "heading": "east",
    "camera.height": CAMERA.height_m,
    "camera.pitch": CAMERA.pitch,
    "camera.x": CAMERA.x_m,
    "timeout": 20.0,
}


class Robot:
    """What the runner hears of a robot that stands somewhere in the hall."""

    def __init__(self, bench: NodeBench) -> None:
        self.bench = bench
        self.header = Header()
        self.x = 0.5

    def look(self, plan: PlanView | None = None, calibrated: bool = True) -> TwistStamped:
        """Say where it is and what it sees, by default all of the hall, and wait for the steering to that."""
        header = self.header = self.bench.header("base_link", STEP_NS)
        if calibrated:
            self.bench.say_surely("camera_info", camera_info(header))
        self.bench.say_surely("odom", odometry(header, self.x - 0.5))
        self.bench.say_surely("vanishing_points", messages.vanishing_points_to_message(header, None))
        seen = plan or plan_from(HALL, Pose(self.x, 0.5, 0.0))
        self.bench.say_surely("plan_view", floor_messages.plan_to_message(header, seen, "base_link"))
        answer: TwistStamped = self.bench.answer("steering", header)
        return answer

    def watch(self) -> None:
        """The same, from a place farther on, for a runner that steers nothing: it says where the robot is."""
        self.x += 0.02
        header = self.header = self.bench.header("base_link", STEP_NS)
        self.bench.say_surely("odom", odometry(header, self.x - 0.5))
        self.bench.say_surely("vanishing_points", messages.vanishing_points_to_message(header, None))
        seen = plan_from(HALL, Pose(self.x, 0.5, 0.0))
        self.bench.say_surely("plan_view", floor_messages.plan_to_message(header, seen, "base_link"))
        self.bench.answer("pose", header)

    def drive(self) -> TwistStamped:
        """Go on in steps, in each a picture of its own, until the runner says to drive."""
        for _ in range(20):
            self.x += 0.02
            answer = self.look()
            if answer.twist.linear.x > 0.0:
                return answer
        raise AssertionError(f"it does not drive: {self.bench.state('message')}")


@pytest.fixture(scope="module")
def bench(ros_domain: int) -> Iterator[NodeBench]:
    bench = NodeBench(ros_domain, "maze_runner", SETTINGS)
    try:
        for kind, topic in (
            (CameraInfo, "camera_info"),
            (Odometry, "odom"),
            (PointCloud2, "vanishing_points"),
            (OccupancyGrid, "plan_view"),
        ):
            bench.speaks(kind, topic)
        bench.hears(TwistStamped, "steering")
        bench.hears(PoseWithCovarianceStamped, "pose")
        bench.connect()
        yield bench
    finally:
        bench.close()


@pytest.fixture
def robot(bench: NodeBench) -> Iterator[Robot]:
    """A robot in the start cell; the clock goes back afterwards, so that the next one starts anew."""
    yield Robot(bench)
    bench.header(step_ns=-STEP_NS * 100)


def camera_info(header: Header) -> CameraInfo:
    info = CameraInfo(header=header, width=CAMERA.width, height=CAMERA.height, distortion_model="plumb_bob")
    info.d = [0.0] * 5
    info.k = [CAMERA.fx, 0.0, CAMERA.cx, 0.0, CAMERA.fy, CAMERA.cy, 0.0, 0.0, 1.0]
    info.r = np.eye(3).ravel().tolist()
    info.p = [CAMERA.fx, 0.0, CAMERA.cx, 0.0, 0.0, CAMERA.fy, CAMERA.cy, 0.0, 0.0, 0.0, 1.0, 0.0]
    return info


def odometry(header: Header, x: float) -> Odometry:
    message = Odometry(header=Header(stamp=header.stamp, frame_id="odom"))
    message.pose.pose.position.x = x
    message.pose.pose.orientation.w = 1.0
    return message


def is_still(message: TwistStamped) -> bool:
    return message.twist.linear.x == 0.0 and message.twist.angular.z == 0.0


def says(bench: NodeBench, words: str) -> None:
    bench.until(lambda: words in bench.state("message"), f"it says {words!r}, not {bench.state('message')!r}")


def test_without_a_calibration_it_stands_and_says_so_in_a_line(robot: Robot) -> None:
    assert is_still(robot.look(calibrated=False))
    robot.bench.log_line("camera_info", "no direction without a calibration")


def test_it_tells_where_it_is_and_drives(robot: Robot) -> None:
    robot.look()  # the clock goes back with it: it may be forgotten with all before
    robot.look()
    robot.drive()
    pose = robot.bench.answer("pose", robot.header)
    assert pose.header.frame_id == "maze"
    assert pose.pose.pose.position.x == pytest.approx(robot.x, abs=0.03)


def test_a_frozen_camera_makes_it_stand_whatever_stamps_its_pictures_have(robot: Robot) -> None:
    robot.drive()
    frozen = plan_from(HALL, Pose(robot.x, 0.5, 0.0))
    robot.x += 0.05
    for _ in range(3):
        assert is_still(robot.look(frozen))
    says(robot.bench, "stands still: the plan of the floor stays the same while the robot moves")
    robot.drive()


def test_plans_that_show_nothing_make_it_stand(robot: Robot) -> None:
    robot.drive()
    dark = plan_from(HALL, Pose(robot.x, 0.5, 0.0))
    dark = PlanView(np.full_like(dark.cells, -1), dark.resolution, dark.origin)
    assert is_still(robot.look(dark))
    says(robot.bench, "stands still: the plan of the floor shows nothing")
    robot.drive()


def test_stamps_that_stand_still_are_not_steered_by(robot: Robot) -> None:
    robot.drive()
    count = len(robot.bench.said("steering"))
    again = plan_from(HALL, Pose(robot.x + 0.05, 0.5, 0.0))
    robot.bench.say_surely("plan_view", floor_messages.plan_to_message(robot.header, again, "base_link"))
    robot.bench.log_line("plan_view", "its stamp does not advance")
    assert len(robot.bench.said("steering")) == count


def test_disabled_it_stands_and_enabled_it_goes_on(robot: Robot) -> None:
    robot.drive()
    bench = robot.bench
    assert bench.call(SetBool, "enable", SetBool.Request(data=False)).success
    bench.until(lambda: is_still(bench.said("steering")[-1]), "it stands still")
    count = len(bench.said("steering"))
    for _ in range(3):
        robot.watch()
    assert len(bench.said("steering")) == count, "whoever drives it by hand would be stopped"
    assert bench.call(SetBool, "maze_runner/enable", SetBool.Request(data=True)).success
    robot.drive()


def test_old_pictures_are_not_steered_by(robot: Robot) -> None:
    bench = robot.bench
    assert bench.set_parameter("max_age", 0.5).successful  # stamps of this bench are as old as the clock
    assert is_still(robot.look())
    says(bench, "stands still: the plan of the floor is ")
    assert bench.set_parameter("max_age", 0.0).successful
    robot.drive()


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("frame", "in the frame 'odom'; base_link is understood"),
        ("turned", "turned against base_link"),
        ("cells", "as its info says"),
        ("value", "is 101, neither -1 nor 0 to 100"),
    ],
)
def test_a_bad_plan_gets_a_line_and_no_steering(robot: Robot, fault: str, words: str) -> None:
    plan = plan_from(HALL, Pose(robot.x, 0.5, 0.0))
    message = floor_messages.plan_to_message(robot.bench.header("base_link", STEP_NS), plan, "base_link")
    if fault == "frame":
        message.header.frame_id = "odom"
    elif fault == "turned":
        turn = message.info.origin.orientation
        turn.z = turn.w = math.sqrt(0.5)
    elif fault == "cells":
        message.info.height += 1
    else:
        message.data = array.array("b", np.full(plan.cells.size, 101, np.int8).tobytes())
    robot.bench.say_surely("plan_view", message)
    robot.bench.log_line("plan_view", words)
    robot.drive()
    assert not any(said.header.stamp == message.header.stamp for said in robot.bench.said("steering"))


def test_odometry_that_is_no_number_gets_a_line(robot: Robot) -> None:
    robot.bench.say_surely("odom", odometry(robot.bench.header("base_link", STEP_NS), math.nan))
    robot.bench.log_line("odom", "is nan")
    robot.drive()


def test_a_clock_that_jumps_back_makes_it_start_anew(robot: Robot) -> None:
    robot.drive()
    robot.bench.header(step_ns=-10 * STEP_NS)
    robot.look()
    robot.bench.log_line("plan_view", "went back")
    robot.drive()


def test_silence_makes_it_stand(robot: Robot) -> None:
    bench = robot.bench
    assert bench.set_parameter("timeout", 0.5).successful
    last = robot.drive()
    bench.until(lambda: is_still(bench.said("steering")[-1]), "it stands still")
    assert bench.said("steering")[-1].header.stamp == last.header.stamp
    says(bench, "no plan of the floor for 0.5 s")
