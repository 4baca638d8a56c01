# SPDX-License-Identifier: Apache-2.0
"""From pictures to steering down a corridor; with `bag` a replay, with `record` recorded.

ros2 launch robot_vision corridor.launch.py transport:=compressed camera_height:=0.6 camera_pitch:=0.087
ros2 launch robot_vision corridor.launch.py transport:=compressed bag:=corridor.mcap record:=answers.mcap
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
    ("camera_height", "0.0", "of the camera over the ground, m; 0: not known"),
    ("camera_pitch", "0.0", "of the camera, rad; down is positive"),
    ("map", "false", "whether to map the floor, so that the robot stops before what stands in the way"),
    ("bag", "", "a bag to replay; the graph ends with it"),
    ("rate", "1.0", "seconds of the bag in a second"),
    ("record", "", "a bag to record all topics into"),
)


def generate_launch_description() -> LaunchDescription:
    given = {name: LaunchConfiguration(name) for name, _, _ in ARGUMENTS}
    replayed = PythonExpression(["'", given["bag"], "' != ''"])
    recorded = PythonExpression(["'", given["record"], "' != ''"])
    replay_time = {"use_sim_time": ParameterValue(replayed, value_type=bool)}

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

    place = {
        "camera.height": ParameterValue(given["camera_height"], value_type=float),
        "camera.pitch": ParameterValue(given["camera_pitch"], value_type=float),
    }
    upright = {"mind_lean": True, "camera.pitch": place["camera.pitch"]}
    bag = {
        "bag": ParameterValue(given["bag"], value_type=str),
        "rate": ParameterValue(given["rate"], value_type=float),
        "wait_for_nodes": ["line_detector", "vp_estimator", "corridor_steering"],
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
                {"output": given["record"], "exclude": ["lines/overlay"]},
                condition=IfCondition(recorded),
            ),
            node("line_detector", {"transport": given["transport"]}, replay_time),
            node("vp_estimator", place, replay_time),
            node("corridor_steering", upright, replay_time),
            node(
                "plan_view_mapper",
                {"transport": given["transport"]},
                place,
                replay_time,
                condition=IfCondition(given["map"]),
            ),
            player,
            RegisterEventHandler(end),
        ]
    )
