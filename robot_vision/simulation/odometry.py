# SPDX-License-Identifier: Apache-2.0
"""Wheel odometry reading by reading, for a drive whose way nobody knows beforehand."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot_vision.simulation.sensors import WheelOdometry


class Reading(NamedTuple):
    """What the wheels say: x, y (m), yaw (rad) since the start, speed (m/s) and turn rate (rad/s)."""

    x: float
    y: float
    yaw: float
    speed: float
    turn_rate: float


class Odometer:
    """Dead reckoning with the errors of `WheelOdometry`, which makes all readings of a known motion at once.

    Args:
        wheels: how wrong they are, and the seed.
    """

    def __init__(self, wheels: WheelOdometry) -> None:
        self._wheels = wheels
        self._random = np.random.default_rng((wheels.seed, 4))
        self._scales = 1 + self._random.standard_normal(2) * (wheels.speed_scale, wheels.turn_scale)
        self._last = Reading(0.0, 0.0, 0.0, 0.0, 0.0)

    def read(self, speed: float, turn_rate: float, seconds: float) -> Reading:
        """Take a reading.

        Args:
            speed: true mean since the reading before, m/s.
            turn_rate: true mean since then, rad/s.
            seconds: since then.
        """
        noise = self._random.standard_normal(2) * (self._wheels.speed_noise, self._wheels.turn_noise)
        if abs(speed) + abs(turn_rate) < 1e-6:
            noise[:] = 0.0  # wheels that stand do not count
        told, turning = (
            float(value * scale + error)
            for value, scale, error in zip((speed, turn_rate), self._scales, noise, strict=True)
        )
        x, y, yaw = self._last[:3]
        turn = turning * seconds
        chord = told * seconds * float(np.sinc(turn / 2 / np.pi))
        x, y = x + chord * float(np.cos(yaw + turn / 2)), y + chord * float(np.sin(yaw + turn / 2))
        self._last = Reading(x, y, yaw + turn, told, turning)
        return self._last
