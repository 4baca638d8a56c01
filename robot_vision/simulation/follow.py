# SPDX-License-Identifier: Apache-2.0
"""Drives a vehicle along any lane by pure pursuit of the truth, so that every world can record itself."""

from __future__ import annotations

import numpy as np

from robot_vision.simulation.body import RoughGround, Sway
from robot_vision.simulation.drive import STEPS_PER_SECOND, FollowSettings, Motion
from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.lane import Lane
from robot_vision.simulation.vehicle import Vehicle, VehicleSettings
from robot_vision.simulation.world import World

_CONTROL_STEPS = 10
"""The driver looks 60 times a second."""
_LOOKAHEAD_S, _SHORTEST_LOOKAHEAD_M = 0.7, 0.04
_SIDE_ACCELERATION = 0.8
"""m/s², in bends: what does not throw the load."""
_BRAKING = 0.6
"""m/s² before stops and the end."""
_LONGEST_STAND_S = 4.0
"""At the end of the lane; whoever asks for more time than that has asked for too much."""


def following(world: World, seconds: float, settings: FollowSettings, seed: int = 0) -> Motion:
    """A drive along the lane of a world; where there is none the robot stands at the start and looks.

    Raises:
        SimulationError: a time that is not positive, or a lane that is over long before the time is.
    """
    if not 0 < seconds <= 3600:
        raise SimulationError(f"drive: seconds must be between 0 and 3600, not {seconds}")
    count = int(np.ceil(seconds * STEPS_PER_SECOND)) + 1
    random = np.random.default_rng((seed, 5))
    driver = _Driver(world.lane, settings, random) if world.lane is not None else None
    able = VehicleSettings(kind=settings.vehicle, most_speed=max(3.0, 1.5 * settings.speed))
    vehicle = Vehicle(able, *_start(world, settings, driver))
    states = np.empty((count, 6))
    command = (0.0, 0.0)
    for step in range(count):
        if driver is not None and step % _CONTROL_STEPS == 0:
            command = driver.command(vehicle, step / STEPS_PER_SECOND)
        before = vehicle.x, vehicle.y, vehicle.yaw, vehicle.way
        vehicle.step(*command, 1 / STEPS_PER_SECOND)
        states[step] = (*before, vehicle.speed, vehicle.turn_rate)
    x, y, yaw, way, speed, turn_rate = states.T.copy()
    time = np.arange(count) / STEPS_PER_SECOND
    sways = [Sway.draw(random, settings.shake).at(time) for _ in range(2)]
    ground = RoughGround(settings.roughness, seed).lean(way)
    return Motion(x, y, yaw, speed, turn_rate, sways[0] + ground[0], sways[1] + ground[1], ground[2])


def _start(world: World, settings: FollowSettings, driver: _Driver | None) -> tuple[float, float, float]:
    """The world's start if it has one, else on the weave at the beginning of the lane."""
    if world.start is not None or driver is None or world.lane is None:
        return world.beginning
    x, y, yaw, _ = world.lane.point(settings.start)
    offset, slope = driver.weave(settings.start)
    return x - offset * np.sin(yaw), y + offset * np.cos(yaw), yaw + slope


class _Driver:
    """Sees the truth and steers by it."""

    def __init__(self, lane: Lane, settings: FollowSettings, random: np.random.Generator) -> None:
        self._lane, self._how = lane, settings
        self._phases = random.uniform(0, 2 * np.pi, 2)
        self._next_stop = settings.start + settings.stop_every if settings.stop_every else np.inf
        self._stand_until: float | None = None
        self._arrived: float | None = None

    def weave(self, along: float) -> tuple[float, float]:
        """Wanted offset to the left (m) and direction relative to the lane (rad) at a way along it."""
        rate = 2 * np.pi / self._how.wavelength
        phase = rate * along + self._phases[0]
        return self._how.sway * float(np.sin(phase)), float(np.arctan(self._how.sway * rate * np.cos(phase)))

    def command(self, vehicle: Vehicle, time: float) -> tuple[float, float]:
        """Speed (m/s) and turn rate (rad/s) towards the point of the weave ahead."""
        pose = self._lane.locate(vehicle.x, vehicle.y, vehicle.yaw)
        speed = self._speed(pose.along, vehicle, time)
        lookahead = max(_LOOKAHEAD_S * max(vehicle.speed, 0.3 * self._how.speed), _SHORTEST_LOOKAHEAD_M)
        x, y, yaw, _ = self._lane.point(pose.along + lookahead)
        offset, _ = self.weave(pose.along + lookahead)
        dx, dy = x - offset * np.sin(yaw) - vehicle.x, y + offset * np.cos(yaw) - vehicle.y
        bearing = np.arctan2(dy, dx) - vehicle.yaw
        return speed, float(speed * 2 * np.sin(bearing) / max(np.hypot(dx, dy), _SHORTEST_LOOKAHEAD_M))

    def _speed(self, along: float, vehicle: Vehicle, time: float) -> float:
        how = self._how
        left = self._lane.length - how.end - along
        self._look_at_the_end(left, vehicle, time)
        if self._stand_until is not None:
            if time < self._stand_until:
                return 0.0
            self._stand_until = None
        left = min(left, self._next_stop - along)
        if self._next_stop - along < 0.05 and vehicle.speed < 0.1:
            self._next_stop += how.stop_every
            self._stand_until = time + how.stop
            return 0.0
        ahead = along + np.linspace(0.0, 1.5 * _LOOKAHEAD_S * how.speed, 4)
        bend = max(abs(self._lane.point(float(place)).curvature) for place in ahead)
        speed = how.speed * (1 + 0.08 * np.sin(2 * np.pi * time / 4.1 + self._phases[1]))
        speed = min(speed, np.sqrt(_SIDE_ACCELERATION / max(bend, 1e-6)))
        return float(min(speed, np.sqrt(2 * _BRAKING * max(left - 0.02, 0.0))))

    def _look_at_the_end(self, left: float, vehicle: Vehicle, time: float) -> None:
        if left > 0.1 or vehicle.speed > 0.05:
            return
        self._arrived = time if self._arrived is None else self._arrived
        if time - self._arrived > _LONGEST_STAND_S:
            raise SimulationError(
                f"drive: the lane of {self._lane.length:.1f} m is over after {self._arrived:.0f} s: "
                "give less time, less speed or a longer way"
            )
