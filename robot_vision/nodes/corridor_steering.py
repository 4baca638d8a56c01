# SPDX-License-Identifier: Apache-2.0
"""Hears where the robot stands in its lane and how that goes on, says how to drive: to the middle, and on along it.

A heading in the frame `road` is steered by only together with the `path_ahead` of the same picture: a road bends.
Before any heading it says nothing. When headings stop for `timeout`, and when it is disabled, it says once that the
robot shall stand still, with the stamp of the last picture, so that a replay gives the same answers again. The service
`enable` (std_srvs/SetBool) sets the parameter `enabled`; `~/enable` does so where several nodes steer in one namespace.
"""

from __future__ import annotations

import time
from collections import deque
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped, TwistStamped
from nav_msgs.msg import Path
from numpy.typing import NDArray
from rclpy.clock import Clock
from rclpy.parameter import Parameter
from rclpy.timer import Timer
from sensor_msgs.msg import Imu, Range
from std_msgs.msg import Header
from std_srvs.srv import SetBool

from robot_vision.control import CorridorSteering
from robot_vision.perception import LaneHeading
from robot_vision.perception.attitude import Lean, lean_from
from robot_vision.ros import messages, qos
from robot_vision.ros.diagnostics import Level
from robot_vision.ros.join import ExactJoin
from robot_vision.ros.node import VisionNode, stamp_ns
from robot_vision.ros.parameters import CAMERA_PLACE, Setting
from robot_vision.ros.run import run_node

LIBRARY_SETTINGS = (
    Setting("speed", 0.5, "speed on a free, straight way, m/s", 0.01, 20.0),
    Setting("lookahead", 1.2, "distance of the point aimed at, m; shorter is brisker", 0.05, 50.0),
    Setting("lookahead_time", 0.8, "at speed, so far ahead, s", 0.01, 10.0),
    Setting("keep", 0.0, "how far to the left of the centre line to drive, m", -50.0, 50.0),
    Setting("most_turn_rate", 1.0, "limit of the turn rate, rad/s", 0.01, 20.0),
    Setting("most_acceleration", 0.5, "limit of the acceleration and of braking, m/s^2", 0.01, 20.0),
    Setting("most_turn_acceleration", 3.0, "limit of the change of the turn rate, rad/s^2", 0.01, 100.0),
    Setting("most_side_acceleration", 1.5, "limit in bends, m/s^2", 0.01, 20.0),
    Setting("stop_distance", 0.5, "what is left before an obstacle, m", 0.01, 50.0),
    Setting("yaw_trusted", 0.175, "standard deviation of the yaw beyond which to stop, rad", 0.001, 3.2),
    Setting("offset_trusted", 0.3, "standard deviation beyond which the offset is not used, m", 0.001, 50.0),
    Setting("lean_slow", 0.14, "lean of the body from which on to slow, rad", 0.01, 3.0),
    Setting("lean_stop", 0.35, "lean at which to stand still, rad", 0.02, 3.2),
)
#: How the camera looks when the robot stands upright: what `attitude` says beyond it is the robot's lean.
UPRIGHT = tuple(setting for setting in CAMERA_PLACE if setting.name in ("camera.pitch", "camera.roll"))


class CorridorSteeringNode(VisionNode):
    """`heading`, `path_ahead`, `attitude` and `clearance` to `steering`."""

    SETTINGS = (
        *LIBRARY_SETTINGS,
        *UPRIGHT,
        Setting("mind_lean", False, "slow when the body leans; camera.pitch and camera.roll must be right"),
        Setting("enabled", True, "whether to steer; the service enable sets it"),
        Setting("timeout", 0.5, "stand still after so long without a heading, s", 0.05, 60.0),
        Setting("max_age", 0.0, "oldest picture to steer by, s; 0: any, as for replays", 0.0, 60.0),
    )

    def __init__(self) -> None:
        super().__init__("corridor_steering")
        self._corridor = CorridorSteering()
        self._enabled = True
        self._timeout_s = 0.5
        self._header: Header | None = None
        self._drives = False
        self._max_age_s = 0.0
        self._clearance: tuple[int, float] | None = None
        self._upright = (0.0, 0.0)
        self._leans: deque[tuple[int, Lean]] = deque(maxlen=2)
        self._on_bends: ExactJoin[Any] = ExactJoin(("heading", "path_ahead"), self._drive)
        self._steering = self.say(TwistStamped, "steering", qos.ANSWER)
        self._clearances = self.hear(Range, "clearance", self._hear_clearance, qos.NEWEST)
        self._attitudes = self.hear(Imu, "attitude", self._hear_attitude, qos.NEWEST)
        self.hear(Path, "path_ahead", self._hear_path, qos.NEWEST)
        self.hear(
            PoseWithCovarianceStamped,
            "heading",
            self._hear_heading,
            qos.NEWEST,
            required=True,
            picture=True,
        )
        for name in ("enable", "~/enable"):
            self.create_service(SetBool, name, self._enable)
        self._watch: Timer = self.create_timer(
            self.settings["timeout"], self._stop_after_silence, clock=self._watch_clock()
        )
        self._watch.cancel()
        self._clock_watch = self.create_timer(
            self.settings["timeout"], self._stop_without_clock, clock=self.steady_clock
        )
        self.use_settings()

    def configure(self, values: dict[str, Any]) -> None:
        """Set gains and limits; a robot that drives goes on from the speed it has."""
        own = {setting.name: values[setting.name] for setting in LIBRARY_SETTINGS}
        CorridorSteering(**own)  # refuses what makes no sense
        for name, value in own.items():
            setattr(self._corridor, name, value)
        self._upright = values["camera.roll"], values["camera.pitch"]
        self._timeout_s = values["timeout"]
        self._max_age_s = values["max_age"]
        self._watch.timer_period_ns = round(1e9 * self._timeout_s)
        enabled, self._enabled = self._enabled, values["enabled"]
        if enabled and not self._enabled:
            self._stand_still()
            self.diagnostics.report(Level.WARN, "disabled", "call the service enable with true")
        elif self._enabled and not enabled:
            self.diagnostics.report(Level.OK, "enabled; waits for the next heading")

    def on_clock_jump_back(self) -> None:
        """Forget the last command and what stands ahead."""
        self._corridor.reset()
        self._on_bends.reset()
        self._clearance = None
        self._leans.clear()

    def _watch_clock(self) -> Clock:
        """Give the time by which silence is measured: that of the replay, if there is one."""
        return self.get_clock() if self.get_parameter("use_sim_time").value else self.steady_clock

    def _hear_clearance(self, message: Range) -> None:
        self._clearance = (stamp_ns(message.header.stamp), messages.clearance_from_message(message))

    def _hear_attitude(self, message: Imu) -> None:
        lean = lean_from(*messages.attitude_from_message(message), *self._upright)
        self._leans.append((stamp_ns(message.header.stamp), lean))

    def _lean_before(self, now_ns: int) -> Lean | None:
        """Lean in the picture before the one steered by: that of this one may come before or after its heading."""
        if not self.settings["mind_lean"]:
            return None
        oldest = now_ns - round(1e9 * self._timeout_s)
        earlier = [lean for stamp, lean in self._leans if oldest <= stamp < now_ns]
        return earlier[-1] if earlier else None

    def _hear_heading(self, message: PoseWithCovarianceStamped) -> None:
        began = time.perf_counter()
        lane = messages.heading_from_message(message)
        self.follow_time("heading", message.header.stamp)
        self.catch_up(self._clearances)
        self.catch_up(self._attitudes)
        self._header = message.header
        if not self._enabled:
            return
        now_ns = stamp_ns(message.header.stamp)
        if message.header.frame_id == "road":
            self._on_bends.add("heading", now_ns, (message.header, lane, began))
        else:
            self._drive((message.header, lane, began), None)

    def _hear_path(self, message: Path) -> None:
        self._on_bends.add("path_ahead", stamp_ns(message.header.stamp), messages.path_from_message(message))

    def _drive(self, heading: tuple[Header, LaneHeading, float], path: NDArray[np.float64] | None) -> None:
        """Steer by a heading, on a road by the path that belongs to it."""
        header, lane, began = heading
        if not self._enabled:
            return
        self._watch.reset()
        now_ns = stamp_ns(header.stamp)
        refusal = self._refusal(now_ns)
        if refusal:
            self._stand_still()
            self.diagnostics.report(Level.WARN, f"stands still: {refusal}")
            return
        clearance = self._clearance and self._clearance[1]
        lean = self._lean_before(now_ns)
        steering = self._corridor.update(lane, 1e-9 * now_ns, clearance, path, lean)
        self._say(steering.speed, steering.turn_rate)
        self.answered(header.stamp, began)
        if steering.reason:
            self.diagnostics.report(Level.WARN, steering.reason)
        else:
            self.diagnostics.report(Level.OK, "steers")

    def _refusal(self, now_ns: int) -> str:
        """Say why the picture with this stamp is none to steer by; empty when it is."""
        age_s = 1e-9 * (self.get_clock().now().nanoseconds - now_ns)
        if self._max_age_s and age_s > self._max_age_s:
            return f"the picture is {age_s:.2f} s old"
        if self._clearance is not None and now_ns - self._clearance[0] > 1e9 * self._timeout_s:
            return "clearance has fallen silent, so nobody looks at what is ahead"
        return ""

    def _stop_without_clock(self) -> None:
        """Stop where the time of a replay has ended for good: silence cannot be measured by it any more."""
        if self._drives and self.get_parameter("use_sim_time").value and not self.count_publishers("/clock"):
            self._stand_still()
            self.diagnostics.report(Level.WARN, "stands still: nobody publishes /clock any more")

    def _stop_after_silence(self) -> None:
        self._stand_still()
        self.diagnostics.report(
            Level.WARN,
            f"stands still: no heading for {self._timeout_s:g} s",
            "look what vp_estimator says on /diagnostics",
        )

    def _stand_still(self) -> None:
        self._watch.cancel()
        self._corridor.reset()
        self._say(0.0, 0.0)

    def _say(self, speed: float, turn_rate: float) -> None:
        if self._header is None:
            return
        self._drives = speed != 0.0 or turn_rate != 0.0
        self._steering.publish(messages.steering_to_message(self._header, speed, turn_rate))

    def stop(self) -> None:
        """Leave no robot driving by the last word of a node that is gone; a replay drives none."""
        if self._drives and not self.get_parameter("use_sim_time").value:
            self._stand_still()

    def _enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        result = self.set_parameters([Parameter("enabled", value=request.data)])[0]
        response.success = result.successful
        response.message = result.reason or ("steers" if request.data else "stands still")
        return response


def main(args: list[str] | None = None) -> None:
    """Run the node."""
    run_node(CorridorSteeringNode, args)


if __name__ == "__main__":
    main()
