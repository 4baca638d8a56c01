# SPDX-License-Identifier: Apache-2.0
"""A replay or a simulator that is gone: no silence can be measured by its clock, and no robot may drive on by it."""

from __future__ import annotations

import array
from collections.abc import Iterator

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from node_bench import NodeBench
from rosgraph_msgs.msg import Clock

from robot_vision.nodes.maze_planner import LASTING

PERIOD_NS = 100_000_000


@pytest.fixture(scope="module")
def bench(ros_domain: int) -> Iterator[NodeBench]:
    bench = NodeBench(ros_domain, "maze_planner", {"use_sim_time": True})
    try:
        bench.speaks(Clock, "/clock")
        bench.speaks(OccupancyGrid, "map", LASTING)
        bench.speaks(Odometry, "odom")
        bench.speaks(PoseStamped, "goal_pose")
        bench.hears(TwistStamped, "steering")
        bench.connect()
        yield bench
    finally:
        bench.close()


def tell_the_planner_where_to_go(bench: NodeBench) -> None:
    floor = OccupancyGrid(header=bench.header("odom"))
    floor.info.height, floor.info.width, floor.info.resolution = 40, 60, 0.1
    floor.info.origin.orientation.w = 1.0
    floor.data = array.array("b", np.zeros(2400, np.int8).tobytes())
    bench.say_surely("map", floor)
    goal = PoseStamped(header=bench.header("odom"))
    goal.pose.position.x, goal.pose.position.y = 5.05, 1.05
    bench.say_surely("goal_pose", goal)


def drive_a_step(bench: NodeBench) -> TwistStamped:
    """Tell the time and the place, and hear how to drive on; odometry promises no delivery."""
    answers: list[TwistStamped] = []

    def drives() -> bool:
        odometry = Odometry(header=bench.header("odom", PERIOD_NS))
        odometry.pose.pose.position.x = odometry.pose.pose.position.y = 1.05
        odometry.pose.pose.orientation.w = 1.0
        bench.say_surely("/clock", Clock(clock=odometry.header.stamp))
        bench.say_surely("odom", odometry)
        answers[:] = [said for said in bench.said("steering") if said.twist.linear.x > 0.0]
        return bool(answers)

    bench.until(drives, "it drives")
    return answers[-1]


def is_still(message: TwistStamped) -> bool:
    return message.twist.linear.x == 0.0 and message.twist.angular.z == 0.0


def test_where_nobody_says_the_time_any_more_the_robot_is_told_to_stand(bench: NodeBench) -> None:
    tell_the_planner_where_to_go(bench)
    drive_a_step(bench)
    bench.falls_silent("/clock")
    bench.until(lambda: "nobody publishes /clock any more" in bench.state("message"), "it says why it stands")
    bench.until(lambda: is_still(bench.said("steering")[-1]), "it tells the robot to stand")
