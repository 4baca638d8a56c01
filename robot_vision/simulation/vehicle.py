# SPDX-License-Identifier: Apache-2.0
"""Vehicles that obey a command as machines do: late, within limits, and each kind in its own way."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robot_vision.simulation.drive import VEHICLES
from robot_vision.simulation.errors import SimulationError


@dataclass(frozen=True)
class VehicleSettings:
    """What a vehicle can do.

    Attributes:
        kind: "differential" (wheels left and right, turns on the spot) or "ackermann" (steered front
            wheels; base_link is on the ground in the middle of the rear axle).
        lag: time constant of the drives and of the steering gear, seconds.
        most_speed: metres a second, ahead and back.
        most_acceleration: also of braking, m/s².
        most_turn_rate: radians a second; of the differential kind.
        most_turn_acceleration: rad/s²; of the differential kind.
        wheelbase: from rear to front axle, metres; of the Ackermann kind, as are the following.
        most_steering_angle: of the front wheels, radians.
        most_steering_rate: of the front wheels, radians a second.
    """

    kind: str = "differential"
    lag: float = 0.12
    most_speed: float = 3.0
    most_acceleration: float = 2.0
    most_turn_rate: float = 2.5
    most_turn_acceleration: float = 8.0
    wheelbase: float = 0.45
    most_steering_angle: float = 0.55
    most_steering_rate: float = 1.5

    def __post_init__(self) -> None:
        if self.kind not in VEHICLES:
            raise SimulationError(f"vehicle: kind must be one of {', '.join(VEHICLES)}, not {self.kind!r}")
        for name in (
            "most_speed",
            "most_acceleration",
            "most_turn_rate",
            "most_turn_acceleration",
            "wheelbase",
            "most_steering_angle",
            "most_steering_rate",
        ):
            value = getattr(self, name)
            if not 0 < value < np.inf:
                raise SimulationError(f"vehicle: {name} must be positive, not {value}")
        if not 0 <= self.lag <= 5:
            raise SimulationError(f"vehicle: lag must be between 0 and 5 s, not {self.lag}")
        if self.most_steering_angle >= np.pi / 2:
            raise SimulationError("vehicle: most_steering_angle must be less than a right angle")


class Vehicle:
    """A vehicle on a plane.

    Args:
        settings: what it can do.
        x: of base_link, metres.
        y: of base_link, metres.
        yaw: radians, counter-clockwise.

    Attributes:
        x, y, yaw: where it is now.
        speed, turn_rate: how it moves now (m/s ahead, rad/s counter-clockwise).
        steering_angle: of the front wheels, radians, left positive; 0 for the differential kind.
        way: metres it has rolled, ahead or back.
    """

    def __init__(
        self,
        settings: VehicleSettings | None = None,
        x: float = 0.0,
        y: float = 0.0,
        yaw: float = 0.0,
    ) -> None:
        self.settings = settings or VehicleSettings()
        self.x, self.y, self.yaw = float(x), float(y), float(yaw)
        self.speed = self.turn_rate = self.steering_angle = self.way = 0.0

    def step(self, speed: float, turn_rate: float, seconds: float) -> None:
        """Obey a command for a short time (at most about 10 ms), in which speed and turn rate hold.

        Args:
            speed: wanted, m/s.
            turn_rate: wanted, rad/s.
            seconds: length of the step.

        Raises:
            SimulationError: a command that is not finite.
        """
        if not (math.isfinite(speed) and math.isfinite(turn_rate)):
            raise SimulationError(f"vehicle: cannot drive {speed} m/s and turn {turn_rate} rad/s")
        able = self.settings
        wanted = _within(speed, able.most_speed)
        self.speed = self._towards(self.speed, wanted, able.most_acceleration, seconds)
        if able.kind == "ackermann":
            self._steer(wanted, turn_rate, seconds)
        else:
            turn = _within(turn_rate, able.most_turn_rate)
            self.turn_rate = self._towards(self.turn_rate, turn, able.most_turn_acceleration, seconds)
        self._roll(seconds)

    def halt(self) -> None:
        """Stand at once, as against a wall."""
        self.speed = self.turn_rate = 0.0

    def _steer(self, speed: float, turn_rate: float, seconds: float) -> None:
        """Turn the front wheels to where the wanted speed and turn rate have their common circle."""
        able = self.settings
        angle = float(np.arctan2(able.wheelbase * turn_rate * np.sign(speed or 1.0), max(abs(speed), 1e-6)))
        if speed == 0.0:
            angle = self.steering_angle  # who stands has no reason to turn the wheels
        angle = _within(angle, able.most_steering_angle)
        self.steering_angle = self._towards(self.steering_angle, angle, able.most_steering_rate, seconds)
        self.turn_rate = self.speed * float(np.tan(self.steering_angle)) / able.wheelbase

    def _towards(self, value: float, wanted: float, most_rate: float, seconds: float) -> float:
        """First-order lag with a limited rate of change."""
        share = 1.0 if self.settings.lag == 0 else -math.expm1(-seconds / self.settings.lag)
        change = (wanted - value) * share
        return value + _within(change, most_rate * seconds)

    def _roll(self, seconds: float) -> None:
        """Move along the arc of constant twist: its chord has length v dt sinc(w dt / 2)."""
        turn = self.turn_rate * seconds
        shorter = math.sin(turn / 2) / (turn / 2) if turn else 1.0
        chord = self.speed * seconds * shorter
        self.x += chord * math.cos(self.yaw + turn / 2)
        self.y += chord * math.sin(self.yaw + turn / 2)
        self.yaw += turn
        self.way += abs(self.speed) * seconds


def _within(value: float, most: float) -> float:
    """A number, or the nearest one whose amount is at most `most`."""
    return min(max(value, -most), most)
