# SPDX-License-Identifier: Apache-2.0
"""A maze in the simulator, explored by one camera and odometry and then run the shortest way.

ros2 launch robot_vision maze_camera.launch.py rows:=4 columns:=4 seed:=5
ros2 launch robot_vision maze_camera.launch.py file:=contest.maze rows:=16 columns:=16 lockstep:=true
"""

from __future__ import annotations

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, RegisterEventHandler
from launch.conditions import IfCondition
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration, PythonExpression
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from ruamel.yaml import YAML

ARGUMENTS = (
    ("file", "", "drawing of the maze, for the simulator alone; empty: grown from the seed"),
    ("seed", "0", "of the maze"),
    ("rows", "4", "of the maze, from south to north"),
    ("columns", "4", "of the maze, from west to east"),
    ("goals", "['']", "goal cells, each row,column; empty: in the middle"),
    ("cell", "1.0", "side of a cell, m; robot and camera are in proportion; plans are drawn for 1 m"),
    ("rate", "6", "pictures a second of simulated time"),
    ("lockstep", "true", "wait for the steering to each picture"),
    ("seconds", "600.0", "end after so long, simulated s"),
    ("record", "", "a bag to record all topics into"),
)
HEIGHT, PITCH, AHEAD, WIDTH = 1 / 3, 0.2618, 1 / 9, 0.45
"""Of the simulated camera and robot, in cells and rad."""
SETTINGS = YAML(typ="safe").load(Path(__file__).resolve().parents[1] / "config" / "maze_camera.yaml")
IN_CELLS = ("speed", "lookahead", "most_acceleration")
"""Parameters of the runner that are told for cells of 1 m."""
PATIENCE_S = 60.0


def generate_launch_description() -> LaunchDescription:
    given = {name: LaunchConfiguration(name) for name, _, _ in ARGUMENTS}
    recorded = PythonExpression(["'", given["record"], "' != ''"])

    def node(executable: str, *parameters: dict[str, object], **more: object) -> Node:
        return Node(
            package="robot_vision",
            executable=executable,
            name=executable,
            parameters=[{"use_sim_time": executable != "simulator"}, *parameters],
            output="screen",
            **more,
        )

    def scaled(value: float) -> ParameterValue:
        return ParameterValue(PythonExpression([f"{value} * ", given["cell"]]), value_type=float)

    def whole(name: str) -> ParameterValue:
        return ParameterValue(given[name], value_type=int)

    place = {"camera.height": scaled(HEIGHT), "camera.pitch": PITCH, "camera.x": scaled(AHEAD)}
    mapping, driving = (
        SETTINGS[f"/**/{name}"]["ros__parameters"] for name in ("plan_view_mapper", "maze_runner")
    )
    runner = {
        **place,
        **driving,
        **{name: scaled(driving[name]) for name in IN_CELLS},
        "rows": whole("rows"),
        "columns": whole("columns"),
        "goals": ParameterValue(given["goals"], value_type=list[str]),
        "cell": ParameterValue(given["cell"], value_type=float),
    }
    simulator = node(
        "simulator",
        {
            "world": "maze",
            "seed": whole("seed"),
            "settings": ParameterValue(
                PythonExpression(
                    [
                        "['file=",
                        given["file"],
                        "', 'rows=",
                        given["rows"],
                        "', 'columns=",
                        given["columns"],
                        "', 'cell=",
                        given["cell"],
                        "']",
                    ]
                ),
                value_type=list[str],
            ),
            "rate": whole("rate"),
            "lockstep": ParameterValue(given["lockstep"], value_type=bool),
            "lockstep_timeout": 10.0,
            "end_with_lane": False,
            "seconds": ParameterValue(given["seconds"], value_type=float),
            "wait_for_nodes": ["line_detector", "vp_estimator", "plan_view_mapper", "maze_runner"],
            "wait_timeout": PATIENCE_S,
        },
    )
    end = OnProcessExit(
        target_action=simulator, on_exit=[EmitEvent(event=Shutdown(reason="the drive is over"))]
    )
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=value, description=text)
                for name, value, text in ARGUMENTS
            ),
            node("bag_recorder", {"output": given["record"]}, condition=IfCondition(recorded)),
            node("line_detector"),
            node("vp_estimator", place),
            node("plan_view_mapper", place, mapping, {"robot.width": scaled(WIDTH)}),
            node("maze_runner", runner),
            simulator,
            RegisterEventHandler(end),
        ]
    )
