# SPDX-License-Identifier: Apache-2.0
"""Steering down a corridor or a road: the vanishing point to the centre of view, the robot to the middle of the way."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot_vision.control.limits import CommandClock, Steering, approach, speed_to_stop_within, way_to_stop
from robot_vision.perception import LaneHeading
from robot_vision.perception.attitude import Lean

Array = NDArray[np.float64]

_TOWARDS = {"left": "to the left", "right": "to the right", "forward": "forward", "back": "back"}


@dataclass
class CorridorSteering:
    """Pure pursuit of the lane's centre line, within limits of speed, turn rate and acceleration.

    The robot aims at the point of the centre line `lookahead` metres ahead (Coulter 1992); without a lateral offset
    that is the vanishing point itself. On a path that bends it aims at the point of the path, and drives no faster than
    the bends ahead allow. It slows for a large angle, for an answer it cannot trust, and for what stands in the way.

    Args:
        speed: on a free, straight way, m/s.
        lookahead: distance of the point aimed at, m; shorter is brisker.
        lookahead_time: the same as a time, s: at speed the point lies so much farther ahead.
        keep: how far to the left of the centre line to drive, m; negative: to the right.
        most_turn_rate: rad/s.
        most_side_acceleration: in bends, m/s^2.
        most_acceleration: of the speed, m/s^2; also how hard it brakes before an obstacle.
        most_turn_acceleration: rad/s^2.
        stop_distance: what is left between robot and obstacle when it has stopped, m.
        yaw_trusted: standard deviation of the yaw beyond which the robot stops, rad.
        offset_trusted: standard deviation of the offset beyond which it is not used, m.
        lean_slow: lean of the body from which on it slows, rad.
        lean_stop: lean at which it stands still, so as not to tip over, rad.

    Raises:
        ValueError: naming the setting that is not a positive number, a `keep` that is none, or a `lean_slow` that is
            not less than `lean_stop`.
    """

    speed: float = 0.5
    lookahead: float = 1.2
    lookahead_time: float = 0.8
    keep: float = 0.0
    most_turn_rate: float = 1.0
    most_side_acceleration: float = 1.5
    most_acceleration: float = 0.5
    most_turn_acceleration: float = 3.0
    stop_distance: float = 0.5
    yaw_trusted: float = float(np.deg2rad(10.0))
    offset_trusted: float = 0.3
    lean_slow: float = float(np.deg2rad(8.0))
    lean_stop: float = float(np.deg2rad(20.0))
    _last: Steering = field(default_factory=lambda: Steering(0.0, 0.0), init=False, repr=False, compare=False)
    _clock: CommandClock = field(default_factory=CommandClock, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if name == "keep":
                if not np.isfinite(value):
                    raise ValueError(f"keep must be a number, not {value}")
            elif not name.startswith("_") and not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a positive number, not {value}")
        if self.lean_slow >= self.lean_stop:
            raise ValueError(
                f"lean_slow must be less than lean_stop, {self.lean_stop} rad, not {self.lean_slow}"
            )

    @property
    def braking_way(self) -> float:
        """Way before an obstacle at which to hear of it, m: from full speed, within the limit of braking."""
        return self.stop_distance + way_to_stop(self.speed, self.most_acceleration)

    def reset(self) -> None:
        """Stand still, as after a stop from outside or a clock that jumped."""
        self._last = Steering(0.0, 0.0)
        self._clock.reset()

    def update(
        self,
        lane: LaneHeading | None,
        stamp_s: float,
        clearance_m: float | None = None,
        path: Array | None = None,
        lean: Lean | None = None,
    ) -> Steering:
        """The command for one picture.

        Whatever is heard, the command is finite and within the limits: a yaw that is no number, or whose variance is
        negative or none, stops the robot, such an offset is not used, and a clearance that is no number is none.

        Args:
            lane: where the robot stands and heads in its lane; None stops at once.
            stamp_s: time of the picture, s.
            clearance_m: free floor ahead, m; None when nobody looks.
            lean: of the body; None when unknown.
            path: (N, 2) the centre line ahead in base_link, m; None where it is straight, or has fewer than 2 points.
        """
        if lane is None:
            self.reset()
            return Steering(0.0, 0.0, "no heading")
        if not _trusted(lane.yaw, lane.yaw_variance, self.yaw_trusted):
            self.reset()
            return Steering(0.0, 0.0, "the heading is too uncertain to drive by")
        known = _trusted(lane.offset, lane.offset_variance, self.offset_trusted)
        reach = max(self.lookahead, self.lookahead_time * self._last.speed)
        if path is not None and known and len(path) > 1 and np.isfinite(path).all():
            bearing, distance = self._aim_along(path, reach)
            wanted = min(self._cruising_speed(bearing, lane), self._speed_in_bends(path))
        else:
            # On a bend the centre line has moved aside where it is aimed at
            bend = lane.curvature if np.isfinite(lane.curvature) else 0.0
            offset = lane.offset - self.keep if known else 0.0
            aside = 0.5 * float(np.clip(bend * reach, -1.0, 1.0)) * reach - offset
            distance = float(np.hypot(reach, aside))
            bearing = -lane.yaw + float(np.arctan2(aside, reach))
            wanted = self._cruising_speed(bearing, lane)
        steady = 1.0 if lean is None else self._share_when_leaning(lean)
        wanted *= steady
        allowed = self._allowed_speed(clearance_m)
        obstructed = allowed < wanted
        wanted = min(wanted, allowed)
        reason = _obstruction(clearance_m) if obstructed and clearance_m is not None else ""
        if lean is not None and steady < 1.0 and not reason:
            reason = (
                f"leans {np.degrees(lean.angle):.0f} degrees {_TOWARDS[lean.towards]}: slows not to tip over"
            )
        seconds = self._clock.step(stamp_s)
        # Braking for an obstacle is not softened: the wanted speed then follows the braking curve already.
        speed = wanted if obstructed else approach(self._last.speed, wanted, self.most_acceleration * seconds)
        speed = min(speed, self._last.speed + self.most_acceleration * seconds)
        turn = speed * 2.0 * float(np.sin(bearing)) / distance
        turn = float(np.clip(turn, -self.most_turn_rate, self.most_turn_rate))
        turn = approach(self._last.turn_rate, turn, self.most_turn_acceleration * seconds)
        self._last = Steering(speed, turn, reason)
        return self._last

    def _aim_along(self, path: Array, reach: float) -> tuple[float, float]:
        """Bearing (rad) and distance (m) of the first point of the path that lies `reach` away, or of its end."""
        steps = np.diff(path, axis=0)
        ways = np.hypot(steps[:, 0], steps[:, 1])
        left = np.stack([-steps[:, 1], steps[:, 0]], axis=1) / np.maximum(ways, 1e-9)[:, None]
        driven = path + self.keep * np.concatenate([left, left[-1:]])
        away = np.hypot(driven[:, 0], driven[:, 1])
        far = np.flatnonzero((away >= reach) & (driven[:, 0] > 0.0))
        end = int(far[0]) if len(far) else len(path) - 1
        begin = max(end - 1, 0)
        share = (reach - away[begin]) / max(float(away[end] - away[begin]), 1e-9)
        aim = driven[begin] + float(np.clip(share, 0.0, 1.0)) * (driven[end] - driven[begin])
        return float(np.arctan2(aim[1], aim[0])), max(float(np.hypot(*aim)), 0.1)

    def _speed_in_bends(self, path: Array) -> float:
        """Highest speed now from which each bend ahead is reached at the speed it allows, m/s."""
        steps = np.diff(path, axis=0)
        ways = np.hypot(steps[:, 0], steps[:, 1])
        turned = np.abs(np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))))
        bend = np.maximum(turned / np.maximum(0.5 * (ways[1:] + ways[:-1]), 1e-9), 1e-6)
        until = np.cumsum(ways)[:-1] - ways[0]  # a bend begins a step before the point where it shows
        allowed = self.most_side_acceleration / bend + 2.0 * self.most_acceleration * until
        return float(np.sqrt(allowed.min())) if len(allowed) else float("inf")

    def _cruising_speed(self, bearing: float, lane: LaneHeading) -> float:
        # Full speed straight ahead, about a third of it when the point aimed at is 60 degrees or more to the side;
        # half when the yaw is only just trusted.
        speed = self.speed * float(np.cos(1.25 * min(abs(bearing), 1.0)))
        return speed * (1.0 - 0.5 * float(np.sqrt(lane.yaw_variance)) / self.yaw_trusted)

    def _share_when_leaning(self, lean: Lean) -> float:
        """Share of the speed that is left; a lean that is no number leaves none."""
        if np.isnan(lean.angle):
            return 0.0
        return float(np.clip((self.lean_stop - lean.angle) / (self.lean_stop - self.lean_slow), 0.0, 1.0))

    def _allowed_speed(self, clearance_m: float | None) -> float:
        if clearance_m is None:
            return float("inf")
        return speed_to_stop_within(clearance_m - self.stop_distance, self.most_acceleration)


def _trusted(value: float, variance: float, most_sigma: float) -> bool:
    """Whether a number is one, and sure enough; a negative variance vouches for nothing."""
    return bool(np.isfinite(value) and 0.0 <= variance <= most_sigma**2)


def _obstruction(clearance_m: float) -> str:
    if np.isnan(clearance_m):
        return "the clearance ahead is not a number"
    return f"something stands {clearance_m:.1f} m ahead"
