# SPDX-License-Identifier: Apache-2.0
"""Hears where the robot stands in its lane and how that goes on, says how to drive: to the middle, and on along it.

A heading in the frame `road` is steered by only together with the `path_ahead` of the same picture: a road bends.
When it says nothing, and when it tells the robot to stand still, is told in `ros/steering.py`.
"""

from __future__ import annotations

import time
from collections import deque
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Path
from numpy.typing import NDArray
from sensor_msgs.msg import Imu, Range
from std_msgs.msg import Header

from robot_vision.control import CorridorSteering
from robot_vision.perception import LaneHeading
from robot_vision.perception.attitude import Lean, lean_from
from robot_vision.ros import messages, qos
from robot_vision.ros.diagnostics import Level
from robot_vision.ros.join import ExactJoin
from robot_vision.ros.node import stamp_ns
from robot_vision.ros.parameters import CAMERA_PLACE, Setting
from robot_vision.ros.run import run_node
from robot_vision.ros.steering import STEERING_SETTINGS, SteeringNode

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


class CorridorSteeringNode(SteeringNode):
    """`heading`, `path_ahead`, `attitude` and `clearance` to `steering`."""

    SETTINGS = (
        *LIBRARY_SETTINGS,
        *UPRIGHT,
        Setting("mind_lean", False, "slow when the body leans; camera.pitch and camera.roll must be right"),
        *STEERING_SETTINGS,
    )
    STEERS_BY = "heading"
    ADVICE = "look what vp_estimator says on /diagnostics"

    def __init__(self) -> None:
        super().__init__("corridor_steering")
        self._corridor = CorridorSteering()
        self._clearance: tuple[int, float] | None = None
        self._upright = (0.0, 0.0)
        self._leans: deque[tuple[int, Lean]] = deque(maxlen=2)
        self._on_bends: ExactJoin[Any] = ExactJoin(("heading", "path_ahead"), self._drive)
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
        self.use_settings()

    def configure(self, values: dict[str, Any]) -> None:
        """Set gains and limits; a robot that drives goes on from the speed it has."""
        own = {setting.name: values[setting.name] for setting in LIBRARY_SETTINGS}
        CorridorSteering(**own)  # refuses what makes no sense
        for name, value in own.items():
            setattr(self._corridor, name, value)
        self._upright = values["camera.roll"], values["camera.pitch"]
        super().configure(values)

    def on_clock_jump_back(self) -> None:
        """Forget the last command and what stands ahead."""
        self._corridor.reset()
        self._on_bends.reset()
        self._clearance = None
        self._leans.clear()

    def reset_steering(self) -> None:
        """Begin from standing."""
        self._corridor.reset()

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
            self.stand_still()
            self.diagnostics.report(Level.WARN, f"stands still: {refusal}")
            return
        clearance = self._clearance and self._clearance[1]
        lean = self._lean_before(now_ns)
        steering = self._corridor.update(lane, 1e-9 * now_ns, clearance, path, lean)
        self.obey(steering.speed, steering.turn_rate)
        self.answered(header.stamp, began)
        if steering.reason:
            self.diagnostics.report(Level.WARN, steering.reason)
        else:
            self.diagnostics.report(Level.OK, "steers")

    def _refusal(self, now_ns: int) -> str:
        """Say why the picture with this stamp is none to steer by; empty when it is."""
        old = self.refusal_of_age(now_ns)
        if not old and self._clearance is not None and now_ns - self._clearance[0] > 1e9 * self._timeout_s:
            return "clearance has fallen silent, so nobody looks at what is ahead"
        return old


def main(args: list[str] | None = None) -> None:
    """Run the node."""
    run_node(CorridorSteeringNode, args)


if __name__ == "__main__":
    main()
