# SPDX-License-Identifier: Apache-2.0
"""The runner of mazes as a process: it drives by plans of the floor, and stands, and says why, where there is none."""

from __future__ import annotations

import array
import math
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped, TwistStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from node_bench import NodeBench
from sensor_msgs.msg import CameraInfo, PointCloud2
from std_srvs.srv import SetBool

from robot_vision.mapping import Pose
from robot_vision.planning import Maze
from robot_vision.ros.floor_messages import plan_to_message
from robot_vision.ros.messages import vanishing_points_to_message

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "planning"))

from seen_mazes import CAMERA, EYE, plan_from  # noqa: E402  (beside the tests of the library)

AISLE = Maze.parse("+---+\n| G |\n+   +\n|   |\n+   +\n| S |\n+---+\n")
START = Pose(0.5, 0.5, math.pi / 2)
PLAN = plan_from(AISLE, START)
STEP_NS = 200_000_000


@pytest.fixture(scope="module")
def bench(ros_domain: int) -> Iterator[NodeBench]:
    place = {"camera.height": CAMERA.height_m, "camera.pitch": CAMERA.pitch, "camera.x": EYE}
    maze = {"rows": 3, "columns": 1, "goals": ["2,0"]}
    bench = NodeBench(ros_domain, "maze_runner", {**place, **maze, "timeout": 20.0})
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


def odometry(bench: NodeBench) -> Odometry:
    message = Odometry(header=bench.header("odom", STEP_NS))
    message.pose.pose.orientation.w = 1.0
    return message


def look(bench: NodeBench) -> TwistStamped:
    """Tell where the robot is and what it sees from its start, and wait for the steering to that."""
    told = odometry(bench)
    bench.say("odom", told)
    bench.say_surely("vanishing_points", vanishing_points_to_message(told.header, None))
    bench.say_surely("plan_view", plan_to_message(told.header, PLAN, "base_link"))
    answer: TwistStamped = bench.answer("steering", told.header)
    assert answer.header.frame_id == "base_link"
    return answer


def is_still(message: TwistStamped) -> bool:
    return message.twist.linear.x == 0.0 and message.twist.angular.z == 0.0


def says(bench: NodeBench, words: str) -> None:
    bench.until(lambda: words in bench.state("message"), f"it says {words!r}, not {bench.state('message')!r}")


def drives(bench: NodeBench) -> None:
    bench.until(lambda: look(bench).twist.linear.x > 0.05, "it drives on")


def calibrate(bench: NodeBench) -> None:
    bench.say_surely("camera_info", CameraInfo(**CAMERA.camera_info()))


def test_without_a_calibration_it_stands_and_says_so_in_a_line(bench: NodeBench) -> None:
    assert is_still(look(bench))
    bench.log_line("/camera_info", "no direction without a calibration")


def test_it_drives_towards_the_goal_from_where_it_believes_to_be(bench: NodeBench) -> None:
    calibrate(bench)
    drives(bench)
    pose = bench.said("pose")[-1]
    assert pose.header.frame_id == "maze"
    assert (pose.pose.pose.position.x, pose.pose.pose.position.y) == pytest.approx((0.5, 0.5), abs=0.1)
    says(bench, "in the cell (0, 0)")


def test_plans_that_are_too_old_are_not_steered_by(bench: NodeBench) -> None:
    calibrate(bench)
    drives(bench)
    assert bench.set_parameter("max_age", 2.0).successful  # the stamps here are of 1970
    assert is_still(look(bench))
    says(bench, "stands still: the plan of the floor is ")
    assert bench.set_parameter("max_age", 0.0).successful
    drives(bench)


def test_disabled_it_stands_and_enabled_it_goes_on(bench: NodeBench) -> None:
    calibrate(bench)
    drives(bench)
    assert bench.call(SetBool, "enable", SetBool.Request(data=False)).success
    bench.until(lambda: is_still(bench.said("steering")[-1]), "it stands still")
    assert bench.call(SetBool, "maze_runner/enable", SetBool.Request(data=True)).success
    drives(bench)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("frame", "in the frame 'odom'; base_link is understood"),
        ("turned", "turned against base_link"),
        ("cells", "as its info says"),
        ("value", "is 101, neither -1 nor 0 to 100"),
    ],
)
def test_a_bad_plan_gets_a_line_and_no_steering(bench: NodeBench, fault: str, words: str) -> None:
    calibrate(bench)
    message = plan_to_message(bench.header("odom", STEP_NS), PLAN, "base_link")
    if fault == "frame":
        message.header.frame_id = "odom"
    elif fault == "turned":
        turn = message.info.origin.orientation
        turn.z = turn.w = math.sqrt(0.5)
    elif fault == "cells":
        message.info.height += 1
    else:
        message.data = array.array("b", np.full(PLAN.cells.size, 101, np.int8).tobytes())
    bench.say_surely("plan_view", message)
    bench.log_line("/plan_view", words)
    drives(bench)
    assert not any(said.header.stamp == message.header.stamp for said in bench.said("steering"))


def test_odometry_that_is_no_number_gets_a_line(bench: NodeBench) -> None:
    calibrate(bench)
    message = odometry(bench)
    message.pose.pose.position.x = math.nan
    bench.say("odom", message)
    bench.say_surely("plan_view", plan_to_message(message.header, PLAN, "base_link"))
    bench.log_line("/odom", "is nan")
    drives(bench)


def test_a_clock_that_jumps_back_makes_it_start_anew(bench: NodeBench) -> None:
    calibrate(bench)
    drives(bench)
    bench.next_stamp(-10_000_000_000)
    look(bench)
    bench.log_line("/plan_view", "went back")
    drives(bench)


def test_silence_makes_it_stand(bench: NodeBench) -> None:
    calibrate(bench)
    drives(bench)
    assert bench.set_parameter("timeout", 0.5).successful
    drives(bench)
    bench.until(lambda: is_still(bench.said("steering")[-1]), "it stands still")
    says(bench, "stands still: no plan of the floor for 0.5 s")
