# SPDX-License-Identifier: Apache-2.0
"""How a robot's body leans and bounces: sway of its own, and what rough ground does to four wheels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_vision.geometry import Camera
from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.renderer import optical_pose

_WAVES = 24
_SHORTEST_M, _LONGEST_M = 0.5, 8.0
"""Wavelengths of rough ground: shorter ones a wheel rolls over, longer ones are hills."""


class BodyState(NamedTuple):
    """Where a robot is, how it moves and how its body leans.

    Attributes:
        x: of base_link in the world, metres.
        y: of base_link in the world, metres.
        yaw: radians, counter-clockwise from the world's x axis.
        speed: metres a second ahead.
        turn_rate: radians a second, counter-clockwise.
        roll: of the body on top of the camera's mounting, radians, positive lifts the left side.
        pitch: likewise, positive looks down.
        rise: of the body above its usual height, metres.
    """

    x: float
    y: float
    yaw: float
    speed: float = 0.0
    turn_rate: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    rise: float = 0.0

    def camera_pose(self, camera: Camera) -> NDArray[np.float64]:
        """Pose (4, 4) of the optical frame in the world (see `optical_pose`), risen with the body."""
        pose = optical_pose(camera, self.x, self.y, self.yaw, self.roll, self.pitch)
        pose[2, 3] += self.rise
        return pose


@dataclass(frozen=True, eq=False)
class Sway:
    """Smooth swaying of a body on wheels between 0.3 and 2.5 Hz, never more than a limit.

    Attributes:
        limit: greatest angle, radians.
        frequencies: (6,) Hz.
        phases: (6,) radians.
        sizes: (6,) of the waves, relative to each other.
    """

    limit: float
    frequencies: NDArray[np.float64]
    phases: NDArray[np.float64]
    sizes: NDArray[np.float64]

    @classmethod
    def draw(cls, random: np.random.Generator, limit: float) -> Sway:
        """Draw one by chance."""
        frequencies = random.uniform(0.3, 2.5, 6)
        return cls(limit, frequencies, random.uniform(0, 2 * np.pi, 6), random.uniform(0.4, 1.0, 6))

    def at(self, time: ArrayLike) -> NDArray[np.float64]:
        """Angles (N,) in radians at times (N,) in seconds."""
        turns = 2 * np.pi * self.frequencies[:, None] * np.atleast_1d(np.asarray(time, np.float64))
        waves = self.sizes[:, None] * np.sin(turns + self.phases[:, None])
        swayed = self.limit * waves.sum(axis=0) / (0.75 * self.sizes.sum())
        return np.asarray(swayed.clip(-self.limit, self.limit))


class RoughGround:
    """Ground under the left and the right wheels: two random smooth profiles along the way travelled.

    Sums of waves whose amplitude grows with their length, as profiles of tracks and fields do.

    Args:
        roughness: standard deviation of the height, metres.
        seed: the same seed gives the same ground.
        track: distance of left and right wheels, metres.
        wheelbase: distance of front and rear wheels, metres.

    Raises:
        SimulationError: a roughness that is negative.
    """

    def __init__(self, roughness: float, seed: int = 0, track: float = 0.45, wheelbase: float = 0.45) -> None:
        if not 0 <= roughness <= 0.2:
            raise SimulationError(f"ground: roughness must be between 0 and 0.2 m, not {roughness}")
        random = np.random.default_rng((seed, 6))
        wavelengths = np.geomspace(_SHORTEST_M, _LONGEST_M, _WAVES)
        self._rates = 2 * np.pi / wavelengths
        self._sizes = roughness * wavelengths * np.sqrt(2 / np.sum(wavelengths**2))
        self._phases = random.uniform(0, 2 * np.pi, (2, _WAVES))
        self._track, self._wheelbase = track, wheelbase

    def heights(self, way: ArrayLike) -> NDArray[np.float64]:
        """Heights (2, N) in metres of the left and the right track after ways (N,) in metres."""
        turns = self._rates[:, None] * np.atleast_1d(np.asarray(way, np.float64))
        return np.asarray((self._sizes[:, None] * np.sin(turns + self._phases[:, :, None])).sum(axis=1))

    def lean(self, way: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Roll and pitch (rad) and rise (m), each (N,), of a body on four wheels after ways (N,)."""
        middle = np.atleast_1d(np.asarray(way, np.float64))
        front = self.heights(middle + self._wheelbase / 2)
        rear = self.heights(middle - self._wheelbase / 2)
        left, right = (front + rear) / 2
        roll = np.arctan((left - right) / self._track)
        pitch = np.arctan((rear - front).mean(axis=0) / self._wheelbase)
        return roll, pitch, (left + right) / 2
