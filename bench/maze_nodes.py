# SPDX-License-Identifier: Apache-2.0
"""The mazes of `maze_drives`, driven by the nodes themselves: simulator and maze_planner, over DDS, in lockstep.

`python -m bench.maze_nodes 16MM2013CX …` drives through the mazes named only.
"""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor

from bench.maze_drives import CELL_M, MAZES, MOST_S, Drive, contest_maze, planner_settings
from bench.report import Cell, Row, Table, at_least, at_most
from robot_vision.planning import Maze
from robot_vision.ros.diagnostics import TOPIC as DIAGNOSTICS
from robot_vision.ros.processes import Graph, NodeProcess, ProcessError
from robot_vision.ros.qos import EVERY
from robot_vision.ros.replays import START_S

PLANNER, SIMULATOR = "maze_planner", "simulator"
FRAME = "corridor"
"""Of the maze's truth."""
SUMMARY = "summary: "
ARRIVED = "arrived"
TOUCHED = 3
"""Exit code of a simulator whose vehicle has touched something."""
RATE = 15
PATIENCE_S = 1200.0
"""For one drive, on a busy machine."""
WAIT_S = 0.05
QUICK = 2
NOTES = (
    "touched: walls; room: the least to a wall; unanswered: pictures that no steering came to in time",
    "the floor between two walls is 168 mm wide, the vehicle 81 mm",
)


class Guide:
    """Says the goal, and hears when the planner has arrived there."""

    def __init__(self, context: Context) -> None:
        self._node = rclpy.create_node("guide", context=context)
        self._executor = SingleThreadedExecutor(context=context)
        self._executor.add_node(self._node)
        self._goals = self._node.create_publisher(PoseStamped, "goal_pose", 1)
        self._node.create_subscription(DiagnosticArray, DIAGNOSTICS, self._hear, EVERY)
        self.arrived = False

    def send_to(self, x: float, y: float) -> None:
        """Say the goal, m, once the planner listens.

        Raises:
            ProcessError: it does not.
        """
        end = time.monotonic() + START_S
        while not self._goals.get_subscription_count():
            if time.monotonic() > end:
                raise ProcessError(f"nobody listens to goal_pose within {START_S:g} s")
            self.look()
        goal = PoseStamped()
        goal.header.frame_id = FRAME
        goal.pose.position.x, goal.pose.position.y = x, y
        self._goals.publish(goal)
        if not self._goals.wait_for_all_acked(Duration(seconds=10)):
            raise ProcessError("the planner did not take the goal within 10 s")

    def look(self) -> None:
        """Hear what has come."""
        self._executor.spin_once(timeout_sec=WAIT_S)

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()

    def _hear(self, message: DiagnosticArray) -> None:
        said = [status.message for status in message.status if status.name.lstrip("/") == PLANNER]
        self.arrived = self.arrived or ARRIVED in said


def drive(maze: Maze, cell: float = CELL_M, rate: int = RATE, seed: int = 0) -> Drive:
    """Let the nodes drive from the start to a goal by the true map and the true place.

    Raises:
        ProcessError: a node failed, or the drive took too long.
    """
    with TemporaryDirectory() as folder, Graph() as graph, _guide(graph) as guide:
        file = Path(folder) / "given.maze"
        maze.write(file)
        planner = graph.start(
            PLANNER,
            {"use_sim_time": True, **planner_settings(cell)},
            {"map": "truth/map", "odom": "truth/odom"},
        )
        planner.wait_until_up(START_S)
        row, column = maze.goals[0]
        guide.send_to((column + 0.5) * cell, (row + 0.5) * cell)
        simulator = graph.start(SIMULATOR, _simulated(file, cell, rate, seed))
        _wait(guide, planner, simulator)
        if simulator.stop() not in (0, TOUCHED):
            raise ProcessError("\n".join(["the simulator failed; its log ends with:", *simulator.log[-20:]]))
    (line,) = (line for line in simulator.log if SUMMARY in line)
    said: dict[str, Any] = json.loads(line.partition(SUMMARY)[2])
    return Drive(
        guide.arrived,
        int(said["contacts"]),
        math.nan if said["closest_m"] is None else float(said["closest_m"]),
        float(said["time_s"]),
        float(said["way_m"]),
        int(said["without_steering"]),
    )


def _simulated(file: Path, cell: float, rate: int, seed: int) -> dict[str, Any]:
    return {
        "world": "maze",
        "settings": [f"file={file}", f"cell={cell}"],
        "seed": seed,
        "lockstep": True,
        "lockstep_timeout": 10.0,
        "noise": 0.0,
        "rate": rate,
        "seconds": MOST_S,
        "end_with_lane": False,
        "wait_for_nodes": [PLANNER],
        "wait_timeout": START_S,
    }


@contextmanager
def _guide(graph: Graph) -> Iterator[Guide]:
    context = Context()
    rclpy.init(context=context, domain_id=int(graph.environment["ROS_DOMAIN_ID"]))
    guide = Guide(context)
    try:
        yield guide
    finally:
        guide.close()
        rclpy.shutdown(context=context)


def _wait(guide: Guide, planner: NodeProcess, simulator: NodeProcess) -> None:
    """Wait until the robot is there, or the simulator has ended: a wall was touched, or time is over."""
    end = time.monotonic() + PATIENCE_S
    while simulator.running and not guide.arrived:
        if not planner.running or time.monotonic() > end:
            why = f"took longer than {PATIENCE_S:g} s" if planner.running else "ended by itself"
            raise ProcessError("\n".join([f"{PLANNER} {why}; its log ends with:", *planner.log[-20:]]))
        guide.look()


def run(quick: bool, names: tuple[str, ...] = MAZES) -> list[Table]:
    """Drive through ten mazes, through two when it is to be quick.

    Raises:
        MissingSetError: the mazes are not there.
        ProcessError: a node failed.
    """
    mazes = {name: contest_maze(name) for name in (names[:QUICK] if quick else names)}
    return [table({name: drive(maze) for name, maze in mazes.items()})]


def table(drives: dict[str, Drive]) -> Table:
    """The drives, one beneath the other."""
    columns = ["at goal", "touched", "room, mm", "way, m", "m/s", "unanswered"]
    rows = [
        Row(
            name,
            "",
            [
                Cell(float(one.arrived), at_least(1)),
                Cell(one.contacts, at_most(0)),
                Cell(1e3 * one.closest_m),
                Cell(one.way_m),
                Cell(one.way_m / one.time_s),
                Cell(one.unanswered),
            ],
            2,
        )
        for name, one in drives.items()
    ]
    title = f"{len(drives)} contest mazes of 16 x 16 cells of {CELL_M:g} m, driven by the nodes over DDS"
    return Table(title, columns, rows, NOTES)


if __name__ == "__main__":
    from rich.console import Console

    for told in run(False, tuple(sys.argv[1:]) or MAZES):
        told.print(Console(highlight=False))
