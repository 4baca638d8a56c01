# SPDX-License-Identifier: Apache-2.0
"""Hears plans of the floor, vanishing points and odometry; explores a maze it has never seen, then runs the best way.

The maze has square cells of known side; its size, the start and the goal cells are known, no wall is. Each plan is
answered by `steering` with its stamp. `maze` and `pose` tell what is known of the maze and where the robot believes to
be, in the frame `maze`: x to the east, y to the north, from the corner where the outer walls meet in the south-west.
The robot stands while plans show nothing, while they stay the same although it moves, and without odometry. What else
makes it stand is told in `ros/steering.py`.
"""

from __future__ import annotations

import time
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import CameraInfo, PointCloud2
from std_msgs.msg import Header

from robot_vision.control.pursuit import PathPursuit
from robot_vision.nodes.maze_planner import DRIVE_SETTINGS
from robot_vision.planning.maze_cells import cells_from_texts, middle_goals
from robot_vision.planning.maze_runner import MazeRunner
from robot_vision.ros import calibration, floor_messages, maps, messages, qos
from robot_vision.ros.calibration import Calibration
from robot_vision.ros.diagnostics import Level
from robot_vision.ros.node import stamp_ns
from robot_vision.ros.parameters import CAMERA_PLACE, Setting, camera_place
from robot_vision.ros.run import run_node
from robot_vision.ros.steering import STEERING_SETTINGS, SteeringNode

FRAME = "maze"
HEADINGS = ("north", "east", "south", "west")
LASTING = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class MazeRunnerNode(SteeringNode):
    """`plan_view`, `vanishing_points`, `camera_info` and `odom` to `maze`, `pose`, `path` and `steering`."""

    SETTINGS = (
        Setting("rows", 16, "of the maze, from south to north", 1, 1000, live=False),
        Setting("columns", 16, "of the maze, from west to east", 1, 1000, live=False),
        Setting("goals", [""], "goal cells, each row,column; empty: in the middle of the maze", live=False),
        Setting("start", "0,0", "cell where the robot stands at first, row,column", live=False),
        Setting("heading", "north", "to where it looks there", choices=HEADINGS, live=False),
        Setting("cell", 1.0, "side of a cell, m", 0.05, 10.0, live=False),
        Setting("wall", 0.067, "thickness of the walls, cells", 0.001, 0.5, live=False),
        *CAMERA_PLACE,
        *DRIVE_SETTINGS,
        *STEERING_SETTINGS,
    )
    STEERS_BY = "plan of the floor"
    ADVICE = "look what plan_view_mapper says on /diagnostics"

    def __init__(self) -> None:
        super().__init__("maze_runner")
        self._runner = self._new_runner()
        self._pursuit = PathPursuit()
        self._calibration = Calibration(camera_place(self.settings))
        self._told = -1
        self._stage = self._runner.stage
        self._maze = self.say(OccupancyGrid, "maze", LASTING)
        self._pose = self.say(PoseWithCovarianceStamped, "pose", qos.ANSWER)
        self._path = self.say(Path, "path", LASTING)
        self._camera_info = self.hear(CameraInfo, "camera_info", self._calibration.take, qos.SENSOR)
        self._odom = self.hear(Odometry, "odom", self._hear_odometry, qos.ODOMETRY, required=True)
        self._points = self.hear(
            PointCloud2, "vanishing_points", self._hear_vanishing_points, qos.ANSWER, required=True
        )
        self.hear(OccupancyGrid, "plan_view", self._hear_plan, qos.ANSWER, required=True, picture=True)
        self.use_settings()

    def warm_up(self) -> None:
        """Compile what explores."""
        self._new_runner().warm_up()

    def configure(self, values: dict[str, Any]) -> None:
        """Set camera and limits; a robot that drives goes on from the speed it has."""
        drive = {setting.name: values[setting.name] for setting in DRIVE_SETTINGS}
        PathPursuit(**drive)  # refuse what makes no sense
        self._calibration.move(camera_place(values))
        for name, value in drive.items():
            setattr(self._pursuit, name, value)
        super().configure(values)

    def on_clock_jump_back(self) -> None:
        """Start anew, in the start cell."""
        self._runner = self._new_runner()
        self._told, self._stage = -1, self._runner.stage
        self._pursuit.reset()

    def reset_steering(self) -> None:
        """Begin from standing."""
        self._pursuit.reset()

    def _new_runner(self) -> MazeRunner:
        given = self.settings
        size = given["rows"], given["columns"]
        start = cells_from_texts([given["start"]]) or ((0, 0),)
        return MazeRunner(
            size,
            cells_from_texts(given["goals"]) or middle_goals(size),
            start[0],
            HEADINGS.index(given["heading"]),
            given["cell"],
            given["wall"],
        )

    def _hear_odometry(self, message: Odometry) -> None:
        pose, _ = floor_messages.pose_from_odometry(message)
        self._runner.move(1e-9 * stamp_ns(message.header.stamp), pose)

    def _hear_vanishing_points(self, message: PointCloud2) -> None:
        camera = self._calibration.camera
        if camera is None:
            return
        points = messages.vanishing_points_from_message(message, camera)
        seen = points.weight > 0.0
        stamp_s = 1e-9 * stamp_ns(message.header.stamp)
        self._runner.see_directions(stamp_s, points.directions[seen], points.sigma[seen], camera)

    def _hear_plan(self, message: OccupancyGrid) -> None:
        began = time.perf_counter()
        plan = floor_messages.plan_from_message(message)
        self.follow_time("plan_view", message.header.stamp)
        for subscription in (self._camera_info, self._odom, self._points):
            self.catch_up(subscription)
        self._header = message.header
        camera = self._calibration.camera
        if camera is None:
            if self._enabled:
                self.stand_still()
            cause = f"no direction without a calibration: {self._calibration.fault}"
            self.complain("camera_info", cause, calibration.ADVICE)
            return
        now_ns = stamp_ns(message.header.stamp)
        self._runner.see_plan(1e-9 * now_ns, plan, camera.x_m)
        self._tell(message.header)
        if self._enabled:
            self._watch.reset()
            self._drive(message.header, now_ns)
        self.answered(message.header.stamp, began)

    def _tell(self, header: Header) -> None:
        """Publish where the robot is, and way and maze where they are not what they were."""
        route, pose = self._runner.route(), self._runner.pose
        if pose is not None:
            self._pose.publish(maps.place_to_message(header, pose, self._runner.sigma, FRAME))
        if route.number != self._told:
            self._told = route.number
            self._path.publish(messages.path_to_message(header, route.points, FRAME))
            seen = maps.maze_to_message(header, self._runner.seen, self.settings["cell"], FRAME)
            self._maze.publish(seen)

    def _drive(self, header: Header, now_ns: int) -> None:
        route, pose = self._runner.route(), self._runner.pose
        old = self.refusal_of_age(now_ns)
        if old or pose is None:
            self.stand_still()
            advice = self.ADVICE if old else "look what says odom"
            self.diagnostics.report(Level.WARN, f"stands still: {old or route.reason}", advice)
            return
        place = pose.x, pose.y, pose.yaw
        steering = self._pursuit.update(route.points, place, 1e-9 * now_ns, route.seen)
        self.obey(steering.speed, steering.turn_rate)
        if not len(route.points):
            level = Level.OK if route.done else Level.WARN
            self.diagnostics.report(level, f"stands still: {route.reason}", f"{self.ADVICE}, or start anew")
            return
        self.diagnostics.report(Level.OK, self._runner.summary)
        if self._runner.stage != self._stage:
            self._stage = self._runner.stage
            self.get_logger().info(self._runner.summary)


def main(args: list[str] | None = None) -> None:
    """Run the node."""
    run_node(MazeRunnerNode, args)


if __name__ == "__main__":
    main()
