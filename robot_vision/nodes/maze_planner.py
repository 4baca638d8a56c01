# SPDX-License-Identifier: Apache-2.0
"""Hears a map as it grows, where the robot is and where it shall be; says the way there, and how to steer along it.

Modes, each by a service (std_srvs/Trigger) of its name or the parameter `mode`: `go` to the goal, `explore` what
the map does not know yet, `hold`. Steering answers odometry, stamp by stamp. Without a way the robot stands; it drives
only over floor the map knows to be free. When else it tells the robot to stand still, is told in `ros/steering.py`.
"""

from __future__ import annotations

import time
from typing import Any

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Image
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from robot_vision.control.pursuit import PathPursuit
from robot_vision.planning import path as planning
from robot_vision.planning.navigator import MODES, Mode, Navigator, Route
from robot_vision.ros import maps, messages, qos
from robot_vision.ros.diagnostics import Level
from robot_vision.ros.node import stamp_ns
from robot_vision.ros.parameters import Setting
from robot_vision.ros.run import run_node
from robot_vision.ros.steering import STEERING_SETTINGS, SteeringNode

ROUTE_SETTINGS = (
    Setting("radius", 0.25, "of the robot: its way keeps so far from every wall, m", 0.0, 10.0),
    Setting("middle", 0.0, "so near to walls the way is drawn to the middle, m; 0: shortest", 0.0, 10.0),
    Setting("frontier", 0.3, "narrowest piece of unknown border worth exploring, m", 0.0, 10.0),
    Setting("astray", 0.3, "distance from its way at which the robot plans anew, m", 0.001, 10.0),
    Setting("arrival", 0.1, "distance from the goal at which the robot is there, m", 0.001, 10.0),
)
DRIVE_SETTINGS = (
    Setting("speed", 0.4, "speed on a straight way, m/s", 0.01, 20.0),
    Setting("lookahead", 0.35, "distance of the point aimed at, m; shorter follows closer", 0.01, 50.0),
    Setting("most_turn_rate", 1.0, "limit of the turn rate, rad/s", 0.01, 20.0),
    Setting("most_acceleration", 0.5, "limit of the acceleration and of braking, m/s^2", 0.01, 20.0),
    Setting("most_turn_acceleration", 3.0, "limit of the change of the turn rate, rad/s^2", 0.01, 100.0),
    Setting("turn_on_spot", 0.7, "angle to the way from which the robot turns standing, rad", 0.05, 3.1),
    Setting("latency", 0.1, "from a place told to the robot moving as told, s", 0.001, 2.0),
)
#: What holds until it is said anew is kept by who says it, for those who come later.
LASTING = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
#: A bad map must not push out the good one before it.
MAPS = QoSProfile(
    depth=5, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)


class MazePlannerNode(SteeringNode):
    """`map`, `odom` and `goal_pose` to `path`, `distance_field` and `steering`."""

    SETTINGS = (
        Setting("mode", "go", "go, explore or hold; the services of these names set it", choices=MODES),
        *ROUTE_SETTINGS,
        *DRIVE_SETTINGS,
        *STEERING_SETTINGS,
    )
    STEERS_BY = "odometry"
    ADVICE = "look what says odom"

    def __init__(self) -> None:
        super().__init__("maze_planner")
        self._navigator = Navigator()
        self._pursuit = PathPursuit()
        self._frame = ""
        self._told = -1
        self._map_is_new = False
        self._path = self.say(Path, "path", LASTING)
        self._field = self.say(Image, "distance_field", LASTING)
        self._maps = self.hear(OccupancyGrid, "map", self._hear_map, MAPS, required=True)
        self._goals = self.hear(PoseStamped, "goal_pose", self._hear_goal, qos.EVERY)
        self.hear(Odometry, "odom", self._hear_odometry, qos.SENSOR, required=True, picture=True)
        for mode in MODES:
            self.create_service(Trigger, mode, self._mode_service(mode))
        self.use_settings()

    def warm_up(self) -> None:
        """Compile what plans."""
        planning.warm_up()

    def configure(self, values: dict[str, Any]) -> None:
        """Set mode, room and limits; a robot that drives goes on from the speed it has."""
        route = {setting.name: values[setting.name] for setting in ROUTE_SETTINGS}
        drive = {setting.name: values[setting.name] for setting in DRIVE_SETTINGS}
        Navigator(**route), PathPursuit(**drive)  # refuse what makes no sense
        self._navigator.use(**route)
        for name, value in drive.items():
            setattr(self._pursuit, name, value)
        held = self._navigator.mode == "hold"
        self._navigator.set_mode(values["mode"])
        super().configure(values)
        if self._enabled and not held and values["mode"] == "hold":
            self.stand_still()
            self.diagnostics.report(Level.OK, "holds", "call the service go or explore")

    def on_clock_jump_back(self) -> None:
        """Forget the last command; map and goal stay, they are no matter of time."""
        self._pursuit.reset()

    def reset_steering(self) -> None:
        """Begin from standing."""
        self._pursuit.reset()

    def _hear_map(self, message: OccupancyGrid) -> None:
        floor = maps.floor_map_from_message(message)
        self._navigator.see_map(floor)
        self._frame = message.header.frame_id
        self._map_is_new = True

    def _hear_goal(self, message: PoseStamped) -> None:
        goal = maps.goal_from_message(message)
        self._check_frame(message.header)
        self._navigator.set_goal(*goal)

    def _hear_odometry(self, message: Odometry) -> None:
        began = time.perf_counter()
        x, y, yaw = maps.place_from_odometry(message)
        self.follow_time("odom", message.header.stamp)
        self.catch_up(self._maps)
        self.catch_up(self._goals)
        self._header = message.header
        if not self._enabled or self._navigator.mode == "hold":
            return
        self._watch.reset()
        if self._frame:
            self._check_frame(message.header)
        old = self.refusal_of_age(stamp_ns(message.header.stamp))
        if old:
            self.stand_still()
            self.diagnostics.report(Level.WARN, f"stands still: {old}", self.ADVICE)
            return
        route = self._navigator.route(x, y)
        self._tell(route, message.header)
        if not len(route.points):
            self.stand_still()
            level, state = (Level.OK, "") if route.done else (Level.WARN, "stands still: ")
            self.diagnostics.report(level, f"{state}{route.reason}", route.advice)
            return
        if self._navigator.has_arrived(x, y):
            self.stand_still()
            self.diagnostics.report(Level.OK, "arrived")
            return
        steering = self._pursuit.update(
            route.points, (x, y, yaw), 1e-9 * stamp_ns(message.header.stamp), route.seen
        )
        self.obey(steering.speed, steering.turn_rate)
        self.answered(message.header.stamp, began)
        if steering.speed == 0.0 and steering.turn_rate == 0.0 and route.reason:
            advice = "let the map grow, or give another goal"
            self.diagnostics.report(Level.WARN, f"stands still: the way {route.reason}", advice)
            return
        self.diagnostics.report(Level.OK, route.reason or "drives")

    def _check_frame(self, header: Header) -> None:
        if self._frame and header.frame_id and header.frame_id != self._frame:
            self.stand_still()
            raise messages.MessageError(
                f"it is in the frame {header.frame_id}, the map in {self._frame}: nothing joins the two; "
                "let both be said in one frame"
            )

    def _tell(self, route: Route, header: Header) -> None:
        """Publish a new way, and the distance function it descends if it or the map is new and somebody hears it."""
        is_new = route.number != self._told
        if is_new:
            self._told = route.number
            frame = self._frame or header.frame_id
            self._path.publish(messages.path_to_message(header, route.points, frame))
        if (is_new or self._map_is_new) and self._field.get_subscription_count():
            field = self._navigator.field()
            if field is not None:
                own = Header(stamp=header.stamp, frame_id=self._frame)
                self._field.publish(maps.field_to_message(own, field))
        self._map_is_new = False

    def _mode_service(self, mode: Mode) -> Any:
        def change(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            result = self.set_parameters([Parameter("mode", value=mode)])[0]
            response.success = result.successful
            response.message = result.reason or f"mode {mode}"
            return response

        return change


def main(args: list[str] | None = None) -> None:
    """Run the node."""
    run_node(MazePlannerNode, args)


if __name__ == "__main__":
    main()
