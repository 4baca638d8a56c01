# SPDX-License-Identifier: Apache-2.0
"""Steering down a corridor: the vanishing point to the centre of view and the robot to the middle of the floor."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from robot_vision.control.limits import Steering, approach, speed_to_stop_within
from robot_vision.perception import LaneHeading

_FIRST_STEP = 0.05
_LONGEST_STEP = 0.25


@dataclass
class CorridorSteering:
    """Pure pursuit of the lane's centre line, within limits of speed, turn rate and acceleration.

    The robot aims at the point of the centre line `lookahead` metres ahead (Coulter 1992); without a lateral offset
    and a bend that is the vanishing point itself. It slows for a large angle, for an answer it cannot trust, and for
    what stands in the way.

    Args:
        speed: on a free, straight way, m/s.
        lookahead: distance of the point aimed at, m; shorter is brisker.
        most_turn_rate: rad/s.
        most_acceleration: of the speed, m/s^2; also how hard it brakes before an obstacle.
        most_turn_acceleration: rad/s^2.
        stop_distance: what is left between robot and obstacle when it has stopped, m.
        yaw_trusted: standard deviation of the yaw beyond which the robot stops, rad.
        offset_trusted: standard deviation of the offset beyond which it is not used, m.

    Raises:
        ValueError: naming the setting that is not a positive number.
    """

    speed: float = 0.5
    lookahead: float = 1.2
    most_turn_rate: float = 1.0
    most_acceleration: float = 0.5
    most_turn_acceleration: float = 3.0
    stop_distance: float = 0.5
    yaw_trusted: float = float(np.deg2rad(10.0))
    offset_trusted: float = 0.3
    _last: Steering = field(default_factory=lambda: Steering(0.0, 0.0), init=False, repr=False, compare=False)
    _stamp: float | None = field(default=None, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not name.startswith("_") and not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a positive number, not {value}")

    def reset(self) -> None:
        """Stand still, as after a stop from outside or a clock that jumped."""
        self._last = Steering(0.0, 0.0)
        self._stamp = None

    def update(self, lane: LaneHeading | None, stamp_s: float, clearance_m: float | None = None) -> Steering:
        """The command for one picture.

        Whatever is heard, the command is finite and within the limits: a yaw that is no number, or whose variance is
        negative or none, stops the robot, such an offset is not used, and a clearance that is no number is none.

        Args:
            lane: where the robot stands and heads in its lane; None stops at once.
            stamp_s: time of the picture, s.
            clearance_m: free floor ahead, m; None when nobody looks.
        """
        if lane is None:
            self.reset()
            return Steering(0.0, 0.0, "no heading")
        if not _trusted(lane.yaw, lane.yaw_variance, self.yaw_trusted):
            self.reset()
            return Steering(0.0, 0.0, "the heading is too uncertain to drive by")
        known = _trusted(lane.offset, lane.offset_variance, self.offset_trusted)
        offset = lane.offset if known else 0.0
        # On a bend the centre line has moved aside where it is aimed at
        bend = lane.curvature if np.isfinite(lane.curvature) else 0.0
        aside = 0.5 * float(np.clip(bend * self.lookahead, -1.0, 1.0)) * self.lookahead - offset
        distance = float(np.hypot(self.lookahead, aside))
        bearing = -lane.yaw + float(np.arctan2(aside, self.lookahead))
        wanted = self._cruising_speed(bearing, lane)
        allowed = self._allowed_speed(clearance_m)
        obstructed = allowed < wanted
        wanted = min(wanted, allowed)
        reason = _obstruction(clearance_m) if obstructed and clearance_m is not None else ""
        seconds = self._seconds_since(stamp_s)
        # Braking for an obstacle is not softened: the wanted speed then follows the braking curve already.
        speed = wanted if obstructed else approach(self._last.speed, wanted, self.most_acceleration * seconds)
        speed = min(speed, self._last.speed + self.most_acceleration * seconds)
        turn = speed * 2.0 * float(np.sin(bearing)) / distance
        turn = float(np.clip(turn, -self.most_turn_rate, self.most_turn_rate))
        turn = approach(self._last.turn_rate, turn, self.most_turn_acceleration * seconds)
        self._last = Steering(speed, turn, reason)
        return self._last

    def _cruising_speed(self, bearing: float, lane: LaneHeading) -> float:
        # Full speed straight ahead, about a third of it when the point aimed at is 60 degrees or more to the side;
        # half when the yaw is only just trusted.
        speed = self.speed * float(np.cos(1.25 * min(abs(bearing), 1.0)))
        return speed * (1.0 - 0.5 * float(np.sqrt(lane.yaw_variance)) / self.yaw_trusted)

    def _allowed_speed(self, clearance_m: float | None) -> float:
        if clearance_m is None:
            return float("inf")
        return speed_to_stop_within(clearance_m - self.stop_distance, self.most_acceleration)

    def _seconds_since(self, stamp_s: float) -> float:
        """Time since the last command, s; after a gap or a jump of the clock, a short step."""
        seconds = _FIRST_STEP if self._stamp is None else stamp_s - self._stamp
        self._stamp = stamp_s
        return seconds if 0.0 <= seconds <= _LONGEST_STEP else _FIRST_STEP


def _trusted(value: float, variance: float, most_sigma: float) -> bool:
    """Whether a number is one, and sure enough; a negative variance vouches for nothing."""
    return bool(np.isfinite(value) and 0.0 <= variance <= most_sigma**2)


def _obstruction(clearance_m: float) -> str:
    if np.isnan(clearance_m):
        return "the clearance ahead is not a number"
    return f"something stands {clearance_m:.1f} m ahead"
