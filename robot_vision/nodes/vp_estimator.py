# SPDX-License-Identifier: Apache-2.0
"""Hears lines, says the vanishing points they lead to, and what these tell of the robot's way.

Every `lines` message is answered on `vanishing_points`, if need be by an empty cloud; the other topics only
when there is something to say.
"""

from __future__ import annotations

import math
import time
from typing import Any

from geometry_msgs.msg import PointStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Odometry, Path
from sensor_msgs.msg import CameraInfo, Imu, JointState, PointCloud2, RegionOfInterest
from std_msgs.msg import Header

from robot_vision.perception.attention import Attention
from robot_vision.perception.attitude import Lean, lean_from
from robot_vision.perception.odometry import MotionHistory
from robot_vision.perception.way import Kind, WayEstimate, WayEstimator
from robot_vision.ros import calibration, messages, qos
from robot_vision.ros.attention import region_to_message
from robot_vision.ros.calibration import Calibration
from robot_vision.ros.diagnostics import Level
from robot_vision.ros.head import Head, point_to_message
from robot_vision.ros.node import VisionNode, stamp_ns
from robot_vision.ros.parameters import CAMERA_PLACE, Setting, camera_place
from robot_vision.ros.run import run_node

FASTEST_TURN = 20.0
"""Turn rate beyond which odometry is not believed, rad/s: three turns a second."""
NO_WAY_ADVICE = "look whether the camera sees straight edges that lead ahead"


class VpEstimatorNode(VisionNode):
    """`lines`, `camera_info`, `odom`, `joint_states` to what they tell of the way, and where to look next."""

    SETTINGS = (
        *CAMERA_PLACE,
        Setting("lean", 0.035, "usual roll and pitch of the body about its mounting, rad", 0.001, 1.0),
        Setting("lane.narrowest", 0.5, "least width a lane may have, m", 0.05, 100.0),
        Setting("lane.widest", 12.0, "greatest width a lane may have, m", 0.05, 100.0),
        Setting("lean_warning", 0.2, "lean of the body at which to warn of tipping over, rad", 0.01, 3.2),
        Setting(
            "way", "auto", "auto: a corridor where walls are seen", choices=tuple(kind.value for kind in Kind)
        ),
        Setting("attention.enabled", False, "say on attention where lines are to be looked for next"),
        Setting("attention.every", 25, "pictures from one look at the whole picture to the next", 1, 10_000),
        Setting("path_length", 10.0, "length of path_ahead, m; on a road at most 36", 1.0, 100.0),
        Setting("look_at.most_pan", 1.0, "how far to either side look_at may lead, rad", 0.05, 1.5),
        Setting("look_at.rate", 1.5, "how fast look_at may turn, rad/s", 0.05, 20.0),
        Setting("look_at.ahead", 15.0, "how far the way counts for look_at, m", 1.0, 30.0),
    )

    def __init__(self) -> None:
        super().__init__("vp_estimator")
        self._estimator = WayEstimator()
        self._calibration = Calibration(camera_place(self.settings))
        self._motion = MotionHistory()
        self._head = Head()
        self._last_s: float | None = None
        self._vanishing_points = self.say(PointCloud2, "vanishing_points", qos.ANSWER)
        self._heading = self.say(PoseWithCovarianceStamped, "heading", qos.ANSWER, awaited=True)
        self._attitude = self.say(Imu, "attitude", qos.ANSWER)
        self._path = self.say(Path, "path_ahead", qos.ANSWER)
        self._attention = self.say(RegionOfInterest, "attention", qos.ANSWER)
        self._look_at = self.say(PointStamped, "look_at", qos.ANSWER)
        self._camera_info = self.hear(CameraInfo, "camera_info", self._hear_camera_info, qos.SENSOR)
        self._odom = self.hear(Odometry, "odom", self._hear_odom, qos.ODOMETRY)
        self._joints = self.hear(JointState, "joint_states", self._head.take, qos.ODOMETRY)
        self.hear(PointCloud2, "lines", self._hear_lines, qos.NEWEST, required=True, picture=True)
        self.use_settings()

    def configure(self, values: dict[str, Any]) -> None:
        """Put the camera where it sits; what earlier pictures told stays."""
        if values["lane.narrowest"] >= values["lane.widest"]:
            raise ValueError("lane.narrowest must be less than lane.widest")
        self._calibration.move(camera_place(values))
        self._estimator.kind = Kind(values["way"])
        self._estimator.path_length = values["path_length"]
        self._attend(values["attention.enabled"], values["attention.every"])
        gaze = self._estimator.gaze
        gaze.most_pan, gaze.rate = values["look_at.most_pan"], values["look_at.rate"]
        gaze.ahead = values["look_at.ahead"]
        self._estimator.set_lean(values["lean"])
        self._estimator.set_widths(values["lane.narrowest"], values["lane.widest"])

    def _attend(self, enabled: bool, every: int) -> None:
        """Begin or cease to say where to look, or change how often everywhere."""
        attention = self._estimator.attention
        if not enabled:
            self._estimator.attention = None
        elif attention is None:
            self._estimator.attention = Attention(every=every)
        else:
            attention.every = every

    def warm_up(self) -> None:
        """Load the compiled kernels."""
        self._estimator.warm_up()

    def on_clock_jump_back(self) -> None:
        """Forget what earlier pictures and odometry told."""
        self._estimator.reset()
        self._motion.clear()
        self._head.clear()
        self._last_s = None

    def _hear_camera_info(self, message: CameraInfo) -> None:
        self._calibration.take(message)

    def _hear_odom(self, message: Odometry) -> None:
        speed, turn_rate = message.twist.twist.linear.x, message.twist.twist.angular.z
        messages.check_finite({"twist.linear.x": speed, "twist.angular.z": turn_rate})
        if abs(turn_rate) > FASTEST_TURN:
            raise ValueError(f"twist.angular.z is {turn_rate:g} rad/s: no robot turns so fast")
        self._motion.add(1e-9 * stamp_ns(message.header.stamp), speed, turn_rate)

    def _hear_lines(self, message: PointCloud2) -> None:
        began = time.perf_counter()
        self.follow_time("lines", message.header.stamp)
        self.catch_up(self._camera_info)
        self.catch_up(self._odom)
        self.catch_up(self._joints)
        try:
            lines = messages.lines_from_message(message)
        except messages.MessageError as cause:
            self.complain("lines", str(cause))
            self._say_vanishing_points(message.header, None)
            return
        camera = self._calibration.camera
        if camera is None:
            missing = f"lines mean no direction without a calibration: {self._calibration.fault}"
            self.complain("camera_info", missing, calibration.ADVICE)
            self._say_vanishing_points(message.header, None)
            return
        now_s = 1e-9 * stamp_ns(message.header.stamp)
        try:
            camera = self._head.turned(camera, now_s)
        except messages.MessageError as cause:
            self.complain("joint_states", str(cause), "publish joint_states with every picture, or at 20 Hz")
            self._say_vanishing_points(message.header, None)
            return
        since_s = now_s if self._last_s is None else self._last_s
        speed, turn_rate = self._motion.mean(since_s, now_s)
        self._last_s = now_s
        try:
            estimate = self._estimator.update(lines, camera, now_s, speed, turn_rate)
        except Exception:
            # whoever waits for this picture must not wait in vain
            self._say_vanishing_points(message.header, None)
            raise
        self._say(message.header, estimate)
        self._say_where_to_look(message.header)
        self.answered(message.header.stamp, began)

    def _say(self, header: Header, estimate: WayEstimate) -> None:
        lane = estimate.lane
        # Before anything that may lead to the next picture.
        if self._estimator.attention is not None:
            self._attention.publish(region_to_message(estimate.attention))
        # Before the heading, which whoever steers takes as the word to go.
        if estimate.path is not None and self._path.get_subscription_count():
            self._path.publish(messages.path_to_message(header, estimate.path))
        if lane is not None:
            self._heading.publish(messages.heading_to_message(header, lane, estimate.frame))
        self._say_vanishing_points(header, estimate)
        if estimate.attitude is not None and estimate.attitude.seen:
            self._attitude.publish(messages.attitude_to_message(header, estimate.attitude))
        lean = self._lean(estimate)
        if lane is None:
            self.diagnostics.report(Level.WARN, estimate.reason, NO_WAY_ADVICE)
        elif lean is not None and lean.angle >= self.settings["lean_warning"]:
            tipping = f"may tip over: leans {math.degrees(lean.angle):.0f} degrees ({lean.towards})"
            self.diagnostics.report(Level.WARN, tipping, "slow down, or look whether camera.pitch is right")
        else:
            known = f"knows heading and offset in a {estimate.frame}"
            self.diagnostics.report(Level.OK, estimate.reason or known)

    def _say_where_to_look(self, header: Header) -> None:
        """After all else: nobody who steers waits for it."""
        gaze = self._estimator.look() if self._look_at.get_subscription_count() else None
        if gaze is not None:
            self._look_at.publish(point_to_message(header, gaze.point))

    def _lean(self, estimate: WayEstimate) -> Lean | None:
        """Lean of the robot, where the picture tells of it."""
        attitude, camera = estimate.attitude, self._calibration.camera
        if attitude is None or not attitude.seen or camera is None:
            return None
        return lean_from(attitude.roll, attitude.pitch, camera.roll, camera.pitch)

    def _say_vanishing_points(self, header: Header, estimate: WayEstimate | None) -> None:
        found = None if estimate is None else estimate.vanishing_points
        self._vanishing_points.publish(messages.vanishing_points_to_message(header, found))


def main(args: list[str] | None = None) -> None:
    """Run the node."""
    run_node(VpEstimatorNode, args)


if __name__ == "__main__":
    main()
