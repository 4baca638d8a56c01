# SPDX-License-Identifier: Apache-2.0
"""Hears pictures with their lines and vanishing points, says what of the floor is free, and how far ahead.

Every picture whose lines and vanishing points have come is answered on `plan_view`, if need be by a plan of which all
is unknown. `clearance` is silent where nobody can tell, so that whoever steers by it stops. When pictures come faster
than they can be examined, the newest is taken and the others are counted as skipped.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, JointState, PointCloud2, Range
from std_msgs.msg import Header

from robot_vision.geometry import Camera
from robot_vision.mapping import OccupancyMap, PlanViewEstimate, PlanViewMapper, PoseHistory
from robot_vision.mapping.clearance import Clearance
from robot_vision.mapping.plan_view import PlanViewMaker
from robot_vision.perception import LineSegments, VanishingPoints
from robot_vision.ros import calibration, floor_messages, messages, qos
from robot_vision.ros.calibration import Calibration
from robot_vision.ros.diagnostics import Level
from robot_vision.ros.head import Head
from robot_vision.ros.images import MESSAGES, TOPICS, Rectifier, image_message
from robot_vision.ros.join import ExactJoin
from robot_vision.ros.node import VisionNode, stamp_ns
from robot_vision.ros.parameters import CAMERA_PLACE, Setting, camera_place
from robot_vision.ros.run import run_node

LASTING = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
KNOCK_ADVICE = "put the camera back, or set camera.pitch and camera.roll anew"
HEIGHT_ADVICE = "measure how high the camera sits over the ground and set camera.height"
SMALLEST_PITCH = 1e-5
"""Pitch (rad) that odometry must once have told before it is believed to know of any."""


@dataclass(frozen=True)
class Task:
    """A picture with what belongs to it."""

    picture: Image | CompressedImage
    lines: PointCloud2
    points: PointCloud2


class PlanViewMapperNode(VisionNode):
    """`image`, `lines`, `vanishing_points`, `camera_info`, `odom` to a plan, a map and the clearance."""

    SETTINGS = (
        Setting("transport", "raw", "how pictures come", choices=tuple(MESSAGES), live=False),
        *CAMERA_PLACE,
        Setting("robot.width", 0.5, "width of the robot, m", 0.05, 10.0),
        Setting("robot.front", 0.3, "how far the robot's front lies ahead of base_link, m", -10.0, 10.0),
        Setting("robot.margin", 0.05, "kept free on both sides of it, m", 0.0, 5.0),
        Setting("reach", 7.0, "farthest floor spoken of, m", 0.5, 100.0),
        Setting(
            "kerbs", True, "whether floor of one colour may end at a line: not where all that stands is tall"
        ),
        Setting("resolution", 0.05, "side of a cell of plan and map, m", 0.01, 1.0, live=False),
        Setting(
            "map.size",
            40.0,
            "side of the window of the map that goes with the robot, m",
            5.0,
            200.0,
            live=False,
        ),
        Setting("map.period", 0.5, "least time between two maps, s of the pictures", 0.0, 60.0),
    )

    def __init__(self) -> None:
        super().__init__("plan_view_mapper")
        cell = self.settings["resolution"]
        self._mapper = PlanViewMapper(
            maker=PlanViewMaker(resolution=cell),
            map=OccupancyMap(size=max(self.settings["map.size"], 20 * cell), resolution=cell),
        )
        self._calibration = Calibration(camera_place(self.settings))
        self._rectifier = Rectifier()
        self._poses = PoseHistory()
        self._head = Head()
        self._odom_frame, self._pitches = "odom", False
        self._last: tuple[float, float | None] = (0.0, None)
        self._map_said_ns: int | None = None
        self._waiting: Task | None = None
        self._plan = self.say(OccupancyGrid, "plan_view", qos.ANSWER)
        self._map = self.say(OccupancyGrid, "map", LASTING)
        self._points = self.say(PointCloud2, "ground_points", qos.ANSWER)
        self._clearance = self.say(Range, "clearance", qos.ANSWER, awaited=True)
        self._overlay = self.say(Image, "plan_view/overlay", qos.ANSWER)
        self._camera_info = self.hear(CameraInfo, "camera_info", self._calibration.take, qos.SENSOR)
        self._odom = self.hear(Odometry, "odom", self._hear_odom, qos.ODOMETRY)
        self._joints = self.hear(JointState, "joint_states", self._head.take, qos.ODOMETRY)
        transport = self.settings["transport"]
        self._topic = TOPICS[transport]
        self._join: ExactJoin[Any] = ExactJoin((self._topic, "lines", "vanishing_points"), self._keep_newest)
        self.hear(
            MESSAGES[transport], self._topic, self._hear_picture, qos.PICTURE, required=True, picture=True
        )
        self._lines_heard = self.hear(PointCloud2, "lines", self._hear_lines, qos.ANSWER, required=True)
        self._points_heard = self.hear(
            PointCloud2, "vanishing_points", self._hear_vanishing_points, qos.ANSWER, required=True
        )
        self.use_settings()

    def configure(self, values: dict[str, Any]) -> None:
        """Put the camera where it sits and give the robot its size; the map stays."""
        width = values["robot.width"] + 2.0 * values["robot.margin"]
        clearance = Clearance(width=width, front=values["robot.front"])
        self._calibration.move(camera_place(values))
        self._mapper.clearance = clearance
        self._mapper.reach = values["reach"]
        self._mapper.low_borders = values["kerbs"]

    def warm_up(self) -> None:
        """Go once through all stages."""
        self._mapper.warm_up()

    def on_clock_jump_back(self) -> None:
        """Forget what earlier pictures and odometry told, the map too."""
        self._mapper.reset()
        self._poses.clear()
        self._head.clear()
        self._join.reset()
        self._waiting = None
        self._last, self._map_said_ns = (0.0, None), None

    def nobody_publishes(self, topic: str) -> str:
        """Name the other transport where pictures come by that."""
        for transport, name in TOPICS.items():
            if name != self._topic and topic == self.resolve_topic_name(self._topic):
                if self.count_publishers(self.resolve_topic_name(name)):
                    return (
                        f"nobody publishes {topic}, but pictures come {transport}: set transport:={transport}"
                    )
        return super().nobody_publishes(topic)

    def _hear_odom(self, message: Odometry) -> None:
        pose, pitch = floor_messages.pose_from_odometry(message)
        self._pitches |= abs(pitch) > SMALLEST_PITCH
        self._odom_frame = message.header.frame_id or "odom"
        self._poses.add(1e-9 * stamp_ns(message.header.stamp), pose, pitch)

    def _hear_picture(self, message: Image | CompressedImage) -> None:
        self._take(self._topic, message)

    def _hear_lines(self, message: PointCloud2) -> None:
        self._join.add("lines", stamp_ns(message.header.stamp), message)
        self._work()

    def _hear_vanishing_points(self, message: PointCloud2) -> None:
        self._join.add("vanishing_points", stamp_ns(message.header.stamp), message)
        self._work()

    def _take(self, topic: str, message: Any) -> None:
        self.follow_time(topic, message.header.stamp)
        self._join.add(topic, stamp_ns(message.header.stamp), message)
        self._work()

    def _keep_newest(self, picture: Any, lines: PointCloud2, points: PointCloud2) -> None:
        if self._waiting is not None:
            self.diagnostics.skipped += 1
        self._waiting = Task(picture, lines, points)

    def _work(self) -> None:
        """Examine the newest picture of which everything is there; what else waits is taken in first."""
        if self._waiting is None or self._busy:
            return
        self._busy = True
        try:
            told = (self._lines_heard, self._points_heard, self._odom, self._camera_info, self._joints)
            for subscription in told:
                self.catch_up(subscription)
            task, self._waiting = self._waiting, None
            if task is not None:
                self._examine(task)
        finally:
            self._busy = False

    _busy = False

    def _examine(self, task: Task) -> None:
        began = time.perf_counter()
        header = task.picture.header
        camera = self._usable_camera()
        if camera is None:
            return
        try:
            self._head.check_straight(camera, 1e-9 * stamp_ns(header.stamp))
        except messages.MessageError as cause:
            self.complain("joint_states", str(cause), "give the plan a camera that is fixed to the robot")
            return
        self._rectifier.use(camera)
        picture = self._rectifier.colour(task.picture)
        flat = replace(camera.rectified(), height_m=camera.height_m)
        lines, points = self._read(task, flat)
        now_s = 1e-9 * stamp_ns(header.stamp)
        told = self._poses.at(now_s)
        pose, pitch = (None, None) if told is None else told
        estimate = self._mapper.update(
            picture, lines, points, flat, now_s, pose, self._pitch_rate(now_s, pitch)
        )
        self._say(header, estimate)
        if self._overlay.get_subscription_count():
            self._draw(header, picture, lines, estimate)
        self.answered(header.stamp, began)
        self._tell(estimate)

    def _usable_camera(self) -> Camera | None:
        camera = self._calibration.camera
        if camera is None:
            cause = f"no distance on the floor without a calibration: {self._calibration.fault}"
            self.complain("camera_info", cause, calibration.ADVICE)
        elif camera.height_m is None:
            self.diagnostics.report(Level.ERROR, "camera.height is not known", HEIGHT_ADVICE)
            return None
        return camera

    def _read(self, task: Task, camera: Camera) -> tuple[LineSegments, VanishingPoints | None]:
        """Lines and vanishing points of a picture; a message that is none costs only what it would have told."""
        lines, points = LineSegments.empty(), None
        try:
            lines = messages.lines_from_message(task.lines)
        except messages.MessageError as cause:
            self.complain("lines", str(cause))
        try:
            points = messages.vanishing_points_from_message(task.points, camera)
        except messages.MessageError as cause:
            self.complain("vanishing_points", str(cause))
        return lines, points

    def _pitch_rate(self, now_s: float, pitch: float | None) -> float | None:
        """How fast the body pitches by odometry, rad/s; None where it knows only the plane."""
        (before_s, before), self._last = self._last, (now_s, pitch)
        if not self._pitches or pitch is None or before is None or not 0.0 < now_s - before_s < 1.0:
            return None
        return (pitch - before) / (now_s - before_s)

    def _say(self, header: Header, estimate: PlanViewEstimate) -> None:
        clearance = self._mapper.clearance
        if estimate.clearance is not None:
            self._clearance.publish(
                floor_messages.clearance_to_message(
                    header, estimate.clearance, clearance.width, self._mapper.reach
                )
            )
        self._plan.publish(floor_messages.plan_to_message(header, estimate.plan_view, "base_link"))
        if self._points.get_subscription_count():
            points = self._mapper.ground_points(estimate)
            self._points.publish(floor_messages.ground_points_to_message(header, points))
        if estimate.mapped:
            self._say_map(header)

    def _say_map(self, header: Header) -> None:
        now_ns = stamp_ns(header.stamp)
        if self._map_said_ns is not None and now_ns - self._map_said_ns < 1e9 * self.settings["map.period"]:
            return
        grid = self._mapper.map.grid()
        if grid is not None:
            self._map.publish(floor_messages.plan_to_message(header, grid, self._odom_frame))
            self._map_said_ns = now_ns

    def _draw(self, header: Header, picture: Any, lines: LineSegments, estimate: PlanViewEstimate) -> None:
        from robot_vision.mapping.overlay import draw_plan_view

        self._overlay.publish(image_message(header, draw_plan_view(picture, lines, estimate)))

    def _tell(self, estimate: PlanViewEstimate) -> None:
        if estimate.horizon.knock:
            # Certain in one picture and corrected in the next: who asks later must still find it.
            self.complain(self._topic, estimate.horizon.knock, KNOCK_ADVICE)
        if estimate.layers is None:
            self.diagnostics.report(Level.ERROR, estimate.reason, "nothing is called free until this is over")
        elif estimate.reason:
            self.diagnostics.report(Level.WARN, estimate.reason)
        else:
            self.diagnostics.report(Level.OK, "maps the floor")


def main(args: list[str] | None = None) -> None:
    """Run the node."""
    run_node(PlanViewMapperNode, args)


if __name__ == "__main__":
    main()
