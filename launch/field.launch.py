# SPDX-License-Identifier: Apache-2.0
"""From pictures to steering along crop rows; with `bag` a replay, with `record` recorded.

ros2 launch robot_vision field.launch.py transport:=compressed camera_height:=1.4 camera_pitch:=0.61 spacing:=0.5
ros2 launch robot_vision field.launch.py transport:=compressed bag:=field.mcap camera_height:=1.4 camera_pitch:=0.61
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
    ("transport", "raw", "how pictures come: raw or compressed"),
    ("camera_height", "0.0", "of the camera over the ground, m"),
    ("camera_pitch", "0.0", "of the camera, rad; down is positive"),
    ("spacing", "0.5", "between rows, m"),
    ("sensitivity", "medium", "low, medium or high"),
    ("speed", "1.0", "along the rows, m/s"),
    ("bag", "", "a bag to replay; the graph ends with it"),
    ("rate", "1.0", "seconds of the bag in a second"),
    ("record", "", "a bag to record all topics into"),
)


def generate_launch_description() -> LaunchDescription:
    given = {name: LaunchConfiguration(name) for name, _, _ in ARGUMENTS}
    replayed = PythonExpression(["'", given["bag"], "' != ''"])
    recorded = PythonExpression(["'", given["record"], "' != ''"])

    def number(name: str) -> ParameterValue:
        return ParameterValue(given[name], value_type=float)

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

    steering = {
        "use_sim_time": ParameterValue(replayed, value_type=bool),
        "transport": given["transport"],
        "camera.height": number("camera_height"),
        "camera.pitch": number("camera_pitch"),
        "row.spacing": number("spacing"),
        "sensitivity": given["sensitivity"],
        "speed": number("speed"),
    }
    bag = {
        "bag": ParameterValue(given["bag"], value_type=str),
        "rate": number("rate"),
        "wait_for_nodes": ["crop_row_steering"],
        "wait_timeout": 60.0,
    }
    player = node("bag_player", bag, condition=IfCondition(replayed))
    end = OnProcessExit(target_action=player, on_exit=[EmitEvent(event=Shutdown(reason="the bag is over"))])
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=value, description=text)
                for name, value, text in ARGUMENTS
            ),
            node(
                "bag_recorder",
                {"output": given["record"], "exclude": ["rows/overlay"]},
                condition=IfCondition(recorded),
            ),
            node("crop_row_steering", steering),
            player,
            RegisterEventHandler(end),
        ]
    )
