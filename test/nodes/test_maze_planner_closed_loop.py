# SPDX-License-Identifier: Apache-2.0
"""The planner drives through mazes in the simulator by the true map: one through the real nodes, more without DDS."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import pytest
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor

from robot_vision.planning import Maze
from robot_vision.ros.processes import Graph
from robot_vision.ros.replays import START_S, wait_for_end
from robot_vision.simulation.maze import grown

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from bench.maze_drives import CELL_M, contest_maze, drive, planner_settings  # noqa: E402  (not installed)
from bench.sources import MissingSetError  # noqa: E402

PLANNER, SIMULATOR = "maze_planner", "simulator"
SUMMARY = "summary: "
FRAME = "corridor"
"""Of the maze's truth."""


def test_the_nodes_drive_through_a_maze_without_touching_a_wall(tmp_path: Path) -> None:
    maze, cell = grown(3, 3, 0.0, 0), 1.0
    file = tmp_path / "small.maze"
    maze.write(file)
    with Graph() as graph:
        context = Context()
        rclpy.init(context=context, domain_id=int(graph.environment["ROS_DOMAIN_ID"]))
        node = rclpy.create_node("goal", context=context)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        goals = node.create_publisher(PoseStamped, "goal_pose", 1)
        planner = graph.start(
            PLANNER,
            {"use_sim_time": True, **planner_settings(cell)},
            {"map": "truth/map", "odom": "truth/odom"},
        )
        try:
            planner.wait_until_up(START_S)
            end = time.monotonic() + START_S
            while not goals.get_subscription_count():
                assert time.monotonic() < end, "the planner does not hear goal_pose"
                executor.spin_once(timeout_sec=0.05)
            goal = PoseStamped()
            goal.header.frame_id = FRAME
            row, column = maze.goals[0]
            goal.pose.position.x, goal.pose.position.y = (column + 0.5) * cell, (row + 0.5) * cell
            goals.publish(goal)
            assert goals.wait_for_all_acked(Duration(seconds=10))
            simulator = graph.start(
                SIMULATOR,
                {
                    "world": "maze",
                    "settings": [f"file={file}", f"cell={cell}"],
                    "lockstep": True,
                    "noise": 0.0,
                    "rate": 10,
                    "wait_for_nodes": [PLANNER],
                    "wait_timeout": START_S,
                },
            )
            wait_for_end(simulator, [planner])
        finally:
            node.destroy_node()
            executor.shutdown()
            rclpy.shutdown(context=context)
    (line,) = (line for line in simulator.log if SUMMARY in line)
    driven = json.loads(line.partition(SUMMARY)[2])
    assert driven["contacts"] == 0
    assert driven["closest_m"] > 0.05
    assert driven["way_m"] > 3.0
    assert driven["without_steering"] <= 1


@pytest.mark.parametrize("seed", range(3))
def test_grown_mazes_are_driven_without_touching_a_wall(seed: int) -> None:
    driven = drive(grown(6, 6, 0.1, 20 + seed), CELL_M, seed=seed)
    assert driven.arrived
    assert driven.contacts == 0


def test_a_contest_maze_is_driven_without_touching_a_wall() -> None:
    try:
        maze: Maze = contest_maze("16MM2016H_Kansai")
    except MissingSetError as missing:
        pytest.skip(str(missing))
    driven = drive(maze)
    assert driven.arrived
    assert driven.contacts == 0
    assert driven.closest_m > 0.01
