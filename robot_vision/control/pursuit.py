# SPDX-License-Identifier: Apache-2.0
"""Steering along a way of straight pieces: aim a little ahead on it, slow down for what is tight, stop at its end."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot_vision.control.limits import CommandClock, Steering, approach, speed_to_stop_within

_LOOKS_AT = 0.15
"""Radians to the side at which a robot still looks at the way before it."""


@dataclass
class PathPursuit:
    """Pure pursuit of a way (Coulter 1992), within limits of speed, turn rate and acceleration.

    The robot aims at the point of the way `lookahead` metres on from the point of it that is nearest to the robot.
    When that lies more than `turn_on_spot` to the side, it stands and turns first. Where its way leads over what nobody
    has seen it stands and turns to look there. What was said last is still under way when the next pose comes: the
    pose is carried on by `latency` seconds of it before the robot aims.

    Args:
        speed: on a straight way, m/s.
        lookahead: metres; shorter follows bends more closely.
        most_turn_rate: rad/s.
        most_acceleration: of the speed and of braking, m/s^2.
        most_turn_acceleration: rad/s^2.
        turn_on_spot: rad.
        slowing: share of the speed lost for each radian that the point aimed at lies to the side.
        latency: from a pose to the moment the robot moves as told, s.

    Raises:
        ValueError: naming the setting that is not a positive number.
    """

    speed: float = 0.4
    lookahead: float = 0.35
    most_turn_rate: float = 1.0
    most_acceleration: float = 0.5
    most_turn_acceleration: float = 3.0
    turn_on_spot: float = 0.7
    slowing: float = 1.2
    latency: float = 0.1
    _last: Steering = field(default_factory=lambda: Steering(0.0, 0.0), init=False, repr=False, compare=False)
    _clock: CommandClock = field(default_factory=CommandClock, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not name.startswith("_") and not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a positive number, not {value}")

    def reset(self) -> None:
        """Stand still, as after a stop from outside or a clock that jumped."""
        self._last = Steering(0.0, 0.0)
        self._clock.reset()

    def update(
        self,
        points: NDArray[np.float64],
        pose: tuple[float, float, float],
        stamp_s: float,
        seen: float = np.inf,
    ) -> Steering:
        """The command for one moment; finite and within the limits.

        Args:
            points: the way, (M, 2) x, y in metres; empty: stand.
            pose: x, y (m) and yaw (rad) of the robot in the same frame.
            stamp_s: time of the pose, s.
            seen: metres of the way, from its beginning, that are known to be free.
        """
        if len(points) == 0 or not np.isfinite(pose).all():
            self.reset()
            return Steering(0.0, 0.0, "no way" if len(points) == 0 else "the robot's place is no number")
        seconds = self._clock.step(stamp_s)
        x, y, yaw = self._carried_on(pose)
        along, target, left = _ahead(points, (x, y), self.lookahead)
        away = target - (x, y)
        distance = float(np.hypot(*away))
        hidden = left > max(seen - along, self.lookahead)
        left = min(left, seen - along)
        room = min(left, distance) if left <= self.lookahead else left
        bearing = float((np.arctan2(away[1], away[0]) - yaw + np.pi) % (2 * np.pi) - np.pi)
        looks = room <= 1e-3 and hidden and abs(bearing) > _LOOKS_AT
        if room <= 1e-3 and not looks:
            self.reset()
            return Steering(0.0, 0.0)
        most = speed_to_stop_within(room, self.most_acceleration)
        if looks or abs(bearing) > self.turn_on_spot:
            wanted, turn = 0.0, self._turn_towards(bearing)
        else:
            wanted = min(self.speed * max(0.15, 1.0 - self.slowing * abs(bearing)), most)
            speed_now = max(self._last.speed, 0.3 * self.speed)
            turn = 2.0 * speed_now * float(np.sin(bearing)) / max(distance, 0.5 * self.lookahead)
            if abs(turn) > self.most_turn_rate:
                wanted *= self.most_turn_rate / abs(turn)
                turn = float(np.clip(turn, -self.most_turn_rate, self.most_turn_rate))
        speed = approach(self._last.speed, wanted, self.most_acceleration * seconds)
        turn = approach(self._last.turn_rate, turn, self.most_turn_acceleration * seconds)
        self._last = Steering(max(speed, 0.0), turn)
        return self._last

    def _carried_on(self, pose: tuple[float, float, float]) -> tuple[float, float, float]:
        way, turn = self._last.speed * self.latency, self._last.turn_rate * self.latency
        middle = pose[2] + turn / 2
        return pose[0] + way * float(np.cos(middle)), pose[1] + way * float(np.sin(middle)), pose[2] + turn

    def _turn_towards(self, bearing: float) -> float:
        """Turn rate on the spot, from which the robot can stop in time when it looks there."""
        most = min(self.most_turn_rate, float(np.sqrt(self.most_turn_acceleration * abs(bearing))))
        return float(np.copysign(most, bearing))


def _ahead(
    points: NDArray[np.float64], place: tuple[float, float], lookahead: float
) -> tuple[float, NDArray[np.float64], float]:
    """Where on the way the robot is (m from its beginning), the point `lookahead` further on, and metres left."""
    pieces = np.diff(points, axis=0)
    lengths = np.hypot(pieces[:, 0], pieces[:, 1])
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    if ends[-1] < 1e-9:
        return 0.0, points[-1], float(np.hypot(*(points[-1] - place)))
    squares = np.maximum(lengths**2, 1e-12)
    shares = np.clip(((place - points[:-1]) * pieces).sum(axis=1) / squares, 0.0, 1.0)
    nearest = points[:-1] + shares[:, None] * pieces
    number = int(np.argmin(np.hypot(*(nearest - place).T)))
    along = float(ends[number] + shares[number] * lengths[number])
    aimed = min(along + lookahead, float(ends[-1]))
    target = np.array([np.interp(aimed, ends, points[:, axis]) for axis in (0, 1)])
    return along, target, float(ends[-1]) - along
