# SPDX-License-Identifier: Apache-2.0
"""A maze nobody has told the graph is explored and run by its camera: lines, vanishing points, plan, runner."""

from __future__ import annotations

import json
from pathlib import Path

from robot_vision.demo.maze_drive import drive_settings
from robot_vision.planning import Maze, MazeExplorer
from robot_vision.ros.processes import Graph
from robot_vision.ros.replays import START_S

RUNNER, SIMULATOR = "maze_runner", "simulator"
SUMMARY = "summary: "
OVER = "the run is over"
DRIVE_S = 150.0
CORNER = """
+---+---+
|     G |
+   +---+
| S |   |
+---+---+
"""


def test_the_graph_explores_a_maze_by_its_camera_and_runs_the_shortest_way(tmp_path: Path) -> None:
    maze = Maze.parse(CORNER.lstrip())
    file = tmp_path / "corner.maze"
    maze.write(file)
    place = {"camera.height": 1 / 3, "camera.pitch": 0.2618, "camera.x": 1 / 9}
    mapper = {**place, **drive_settings("plan_view_mapper"), "robot.width": 0.45}
    goal = ",".join(str(part) for part in maze.goals[0])
    runner_settings = {
        **place,
        **drive_settings(RUNNER),
        "rows": 2,
        "columns": 2,
        "goals": [goal],
    }
    with Graph() as graph:
        nodes = [
            graph.start(node, {"use_sim_time": True, **settings})
            for node, settings in (
                ("line_detector", {}),
                ("vp_estimator", place),
                ("plan_view_mapper", mapper),
                (RUNNER, runner_settings),
            )
        ]
        simulator = graph.start(
            SIMULATOR,
            {
                "world": "maze",
                "settings": [f"file={file}", "cell=1.0"],
                "lockstep": True,
                "lockstep_timeout": 10.0,
                "rate": 6,
                "end_with_lane": False,
                "seconds": 60.0,
                "wait_for_nodes": ["line_detector", "vp_estimator", "plan_view_mapper", RUNNER],
                "wait_timeout": START_S,
            },
        )
        line = nodes[-1].wait_for_line(OVER, START_S + DRIVE_S)
        simulator.stop()
    (told,) = (line for line in simulator.log if SUMMARY in line)
    driven = json.loads(told.partition(SUMMARY)[2])
    perfect = MazeExplorer(maze).explore()
    steps = dict(part.split() for part in line.partition("steps: ")[2].split(", "))
    assert driven["contacts"] == 0
    assert int(steps["run"]) == len(perfect.shortest_path) - 1
    assert (
        sum(int(steps[stage]) for stage in ("goal", "proof", "home") if stage in steps)
        <= 1.3 * perfect.steps_home
    )
    assert driven["way_m"] > 4.0
    assert driven["without_steering"] <= 1
