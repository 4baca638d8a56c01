# SPDX-License-Identifier: Apache-2.0
"""The planner drives through a maze in the simulator by the maze's true plan and its true place.

ros2 launch robot_vision maze.launch.py file:=contest.maze goal_x:=1.35 goal_y:=1.35
ros2 launch robot_vision maze.launch.py cell:=1.0 seed:=3 lockstep:=false
"""

from __future__ import annotations

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, ExecuteProcess, RegisterEventHandler
from launch.conditions import IfCondition
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration, PythonExpression
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

ARGUMENTS = (
    ("file", "", "drawing of the maze; empty: grown from the seed"),
    ("seed", "0", "of the maze"),
    ("cell", "0.18", "side of a cell, m; robot and planner are in proportion"),
    ("goal_x", "0.81", "metres to the east of the south-western corner"),
    ("goal_y", "0.81", "metres to the north of it"),
    ("lockstep", "true", "wait for the steering to each picture"),
    ("seconds", "0.0", "end after so long, s; 0: with the lane"),
    ("record", "", "a bag to record all topics into"),
)
IN_CELLS = {
    "radius": 0.37,
    "middle": 0.47,
    "astray": 0.28,
    "arrival": 0.11,
    "speed": 1.4,
    "lookahead": 0.33,
    "most_acceleration": 3.3,
}
"""Parameters of the planner for cells of 1 m."""
PATIENCE_S = 60.0


def generate_launch_description() -> LaunchDescription:
    given = {name: LaunchConfiguration(name) for name, _, _ in ARGUMENTS}
    recorded = PythonExpression(["'", given["record"], "' != ''"])

    def node(executable: str, *parameters: dict[str, object], **more: object) -> Node:
        return Node(
            package="robot_vision",
            executable=executable,
            name=executable,
            parameters=list(parameters),
            output="screen",
            **more,
        )

    def scaled(value: float) -> ParameterValue:
        return ParameterValue(PythonExpression([f"{value} * ", given["cell"]]), value_type=float)

    planner = node(
        "maze_planner",
        {
            "use_sim_time": True,
            "most_turn_rate": 2.0,
            "most_turn_acceleration": 6.0,
            "latency": 0.18,
            **{name: scaled(value) for name, value in IN_CELLS.items()},
        },
        remappings=[("map", "truth/map"), ("odom", "truth/odom")],
    )
    simulator = node(
        "simulator",
        {
            "world": "maze",
            "seed": ParameterValue(given["seed"], value_type=int),
            "settings": ParameterValue(
                PythonExpression(["['file=", given["file"], "', 'cell=", given["cell"], "']"]),
                value_type=list[str],
            ),
            "lockstep": ParameterValue(given["lockstep"], value_type=bool),
            "seconds": ParameterValue(given["seconds"], value_type=float),
            "noise": 0.0,
            "wait_for_nodes": ["maze_planner"],
            "wait_timeout": PATIENCE_S,
        },
    )
    place = ["{pose: {position: {x: ", given["goal_x"], ", y: ", given["goal_y"], "}}}"]
    goal = ExecuteProcess(
        cmd=["ros2", "topic", "pub", "--once", "-w", "1", "goal_pose", "geometry_msgs/msg/PoseStamped", place]
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
            planner,
            goal,
            simulator,
            RegisterEventHandler(end),
        ]
    )
