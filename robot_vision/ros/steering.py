# SPDX-License-Identifier: Apache-2.0
"""What every node that steers has in common: it may be disabled, and it never leaves a robot driving by old words.

Before it has been asked for anything it says nothing. When what it steers by stops for `timeout`, and when it is
disabled, it says once that the robot shall stand still, with the stamp of the last picture, so that a replay gives
the same answers again. The service `enable` (std_srvs/SetBool) sets the parameter `enabled`; `~/enable` does so
where several nodes steer in one namespace.
"""

from __future__ import annotations

from typing import Any, ClassVar

from geometry_msgs.msg import TwistStamped
from rclpy.clock import Clock
from rclpy.parameter import Parameter
from rclpy.timer import Timer
from std_msgs.msg import Header
from std_srvs.srv import SetBool

from robot_vision.ros import messages, qos
from robot_vision.ros.diagnostics import Level
from robot_vision.ros.node import VisionNode
from robot_vision.ros.parameters import Setting

STEERING_SETTINGS = (
    Setting("enabled", True, "whether to steer; the service enable sets it"),
    Setting("timeout", 0.5, "stand still after so long without anything to steer by, s", 0.05, 60.0),
    Setting("max_age", 0.0, "oldest input to steer by, s; 0: any, as for replays", 0.0, 60.0),
)


class SteeringNode(VisionNode):
    """Says `steering`; a subclass calls `obey` for what it decides, and `stand_still` where it must not drive.

    Its `SETTINGS` hold `STEERING_SETTINGS`, and its `configure` calls that of this class.

    Args:
        name: of the node unless remapped.
    """

    #: In words: what the node steers by, and what to try when it stops coming.
    STEERS_BY: ClassVar[str] = "input"
    ADVICE: ClassVar[str] = ""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._enabled = True
        self._timeout_s = 0.5
        self._max_age_s = 0.0
        self._header: Header | None = None
        self._drives = False
        self._steering = self.say(TwistStamped, "steering", qos.ANSWER)
        for service in ("enable", "~/enable"):
            self.create_service(SetBool, service, self._enable)
        timeout = self.settings["timeout"]
        self._watch: Timer = self.create_timer(timeout, self._stop_after_silence, clock=self._watch_clock())
        self._watch.cancel()
        self._clock_watch = self.create_timer(timeout, self._stop_without_clock, clock=self.steady_clock)

    def configure(self, values: dict[str, Any]) -> None:
        """Take over what all nodes that steer have; call it when nothing can be refused any more."""
        self._timeout_s = values["timeout"]
        self._max_age_s = values["max_age"]
        self._watch.timer_period_ns = round(1e9 * self._timeout_s)
        enabled, self._enabled = self._enabled, values["enabled"]
        if enabled and not self._enabled:
            self.stand_still()
            self.diagnostics.report(Level.WARN, "disabled", "call the service enable with true")
        elif self._enabled and not enabled:
            self.diagnostics.report(Level.OK, f"enabled; waits for the next {self.STEERS_BY}")

    def reset_steering(self) -> None:
        """Begin from standing: called whenever the robot is told to stand still."""

    def stand_still(self) -> None:
        """Say that the robot shall stand."""
        self._watch.cancel()
        self.reset_steering()
        self.obey(0.0, 0.0)

    def obey(self, speed: float, turn_rate: float) -> None:
        """Say how to drive, with the header of what it answers."""
        if self._header is None:
            return
        self._drives = speed != 0.0 or turn_rate != 0.0
        self._steering.publish(messages.steering_to_message(self._header, speed, turn_rate))

    def refusal_of_age(self, now_ns: int) -> str:
        """Say why what has this stamp is nothing to steer by; empty when it is."""
        age_s = 1e-9 * (self.get_clock().now().nanoseconds - now_ns)
        if self._max_age_s and age_s > self._max_age_s:
            return f"the {self.STEERS_BY} is {age_s:.2f} s old"
        return ""

    def stop(self) -> None:
        """Leave no robot driving by the last word of a node that is gone; a replay drives none."""
        if self._drives and not self.get_parameter("use_sim_time").value:
            self.stand_still()

    def _watch_clock(self) -> Clock:
        """Give the time by which silence is measured: that of the replay, if there is one."""
        return self.get_clock() if self.get_parameter("use_sim_time").value else self.steady_clock

    def _stop_without_clock(self) -> None:
        """Stop where the time of a replay has ended for good: silence cannot be measured by it any more."""
        if self._drives and self.get_parameter("use_sim_time").value and not self.count_publishers("/clock"):
            self.stand_still()
            self.diagnostics.report(Level.WARN, "stands still: nobody publishes /clock any more")

    def _stop_after_silence(self) -> None:
        self.stand_still()
        self.diagnostics.report(
            Level.WARN, f"stands still: no {self.STEERS_BY} for {self._timeout_s:g} s", self.ADVICE
        )

    def _enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        result = self.set_parameters([Parameter("enabled", value=request.data)])[0]
        response.success = result.successful
        response.message = result.reason or ("steers" if request.data else "stands still")
        return response
