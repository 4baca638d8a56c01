# SPDX-License-Identifier: Apache-2.0
"""The graph drives through a simulated world; with `record` recorded.

ros2 launch robot_vision simulator.launch.py
ros2 launch robot_vision simulator.launch.py world:=corridor seed:=3 settings:="['width=1.8']" lockstep:=true
"""

from __future__ import annotations

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, RegisterEventHandler
from launch.conditions import IfCondition
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration, PythonExpression
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

ARGUMENTS = (
    ("namespace", "", "of all names"),
    ("world", "corridor", "which world"),
    ("seed", "0", "of the world and of all noise"),
    ("settings", "['']", "of the world, each as name=value"),
    ("vehicle", "differential", "differential or ackermann"),
    ("rate", "15", "pictures a second"),
    ("lockstep", "false", "wait for the steering to each picture"),
    ("seconds", "0.0", "end after so long, s; 0: with the lane"),
    ("offset", "0.0", "start so far left of the middle, m"),
    ("yaw", "0.0", "start turned by so much, rad"),
    ("lean", "0.0", "greatest roll and pitch of the body, rad"),
    ("speed", "0.5", "of the steering, m/s"),
    ("head", "false", "whether the camera sits on a head that look_at turns"),
    ("camera_height", "0.6", "of the world's camera, m: the simulator's log tells it"),
    ("camera_pitch", "0.0873", "of the world's camera, rad: the simulator's log tells it"),
    ("record", "", "a bag to record all topics into"),
)
PATIENCE_S = 60.0


def generate_launch_description() -> LaunchDescription:
    given = {name: LaunchConfiguration(name) for name, _, _ in ARGUMENTS}
    recorded = PythonExpression(["'", given["record"], "' != ''"])

    def given_as(name: str, kind: type = float) -> ParameterValue:
        return ParameterValue(given[name], value_type=kind)

    def node(executable: str, *parameters: dict[str, object], **more: object) -> Node:
        return Node(
            package="robot_vision",
            executable=executable,
            name=executable,
            namespace=given["namespace"],
            parameters=list(parameters),
            output="screen",
            **more,
        )

    simulated_time = {"use_sim_time": True}
    place = {"camera.height": given_as("camera_height"), "camera.pitch": given_as("camera_pitch")}
    upright = {"mind_lean": True, "camera.pitch": place["camera.pitch"]}
    simulator = node(
        "simulator",
        {
            "world": given_as("world", str),
            "seed": given_as("seed", int),
            "settings": given_as("settings", list[str]),
            "vehicle": given_as("vehicle", str),
            "rate": given_as("rate", int),
            "lockstep": given_as("lockstep", bool),
            "seconds": given_as("seconds"),
            "start.offset": given_as("offset"),
            "start.yaw": given_as("yaw"),
            "lean": given_as("lean"),
            "head.on": given_as("head", bool),
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
            node(
                "bag_recorder",
                {"output": given["record"], "exclude": ["lines/overlay"]},
                condition=IfCondition(recorded),
            ),
            node("line_detector", simulated_time),
            node("vp_estimator", place, simulated_time),
            node("corridor_steering", {"speed": given_as("speed")}, upright, simulated_time),
            node("plan_view_mapper", place, simulated_time),
            simulator,
            RegisterEventHandler(end),
        ]
    )
