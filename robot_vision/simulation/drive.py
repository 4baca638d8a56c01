# SPDX-License-Identifier: Apache-2.0
"""How a robot is driven while it records: smooth weaving and turning that a real unicycle could do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation.body import BodyState, Sway
from robot_vision.simulation.errors import SimulationError

STEPS_PER_SECOND = 600
"""Of the motion; a multiple of usual picture and odometry rates, so that each stamp falls on a step."""
VEHICLES = ("differential", "ackermann")
"""Kinds of vehicle that can be driven."""
_PERIOD_S = 15.0
"""The drive repeats: forward, a stop with a look around, forward."""
_STOP_S, _LOOK_S, _GO_S = 6.0, (6.8, 9.6), 10.4


@dataclass(frozen=True, eq=False)
class Motion:
    """Pose and twist of a robot on steps of 1 / STEPS_PER_SECOND, from time 0.

    Speed and turn rate hold from their step to the next, so the poses are their exact integral (arcs).

    Attributes:
        x: (N,) base_link in the world, metres.
        y: (N,) metres.
        yaw: (N,) radians, counter-clockwise from the world's x axis.
        speed: (N,) metres a second ahead.
        turn_rate: (N,) radians a second, counter-clockwise.
        roll: (N,) body roll on top of the camera's mounting, radians.
        pitch: (N,) body pitch on top of the camera's mounting, radians.
        rise: (N,) of the body above its usual height, metres; None: it keeps its height.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    yaw: NDArray[np.float64]
    speed: NDArray[np.float64]
    turn_rate: NDArray[np.float64]
    roll: NDArray[np.float64]
    pitch: NDArray[np.float64]
    rise: NDArray[np.float64] | None = None

    def state(self, step: int) -> BodyState:
        """Everything at one step."""
        rise = 0.0 if self.rise is None else float(self.rise[step])
        parts = (self.x, self.y, self.yaw, self.speed, self.turn_rate, self.roll, self.pitch)
        x, y, yaw, speed, turn_rate, roll, pitch = (float(values[step]) for values in parts)
        return BodyState(x, y, yaw, speed, turn_rate, roll, pitch, rise)

    @property
    def seconds(self) -> float:
        """Time from the first to the last step."""
        return (len(self.x) - 1) / STEPS_PER_SECOND


@dataclass(frozen=True)
class WeavingSettings:
    """How the robot wanders down its lane.

    Attributes:
        speed: usual speed, metres a second.
        sway: greatest distance from the centre line, metres.
        swing: greatest yaw, radians.
        shake: greatest roll and pitch of the body, radians.
        start: metres from the lane's beginning.
    """

    speed: float = 1.0
    sway: float = 0.35
    swing: float = np.radians(10.0)
    shake: float = np.radians(0.3)
    start: float = 1.2

    def __post_init__(self) -> None:
        for name, low, high, unit in (
            ("speed", 0.05, 3.0, "m/s"),
            ("sway", 0.0, 5.0, "m"),
            ("swing", 0.0, 0.6, "rad"),
            ("shake", 0.0, 0.2, "rad"),
            ("start", 0.0, 100.0, "m"),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise SimulationError(f"drive: {name} must be between {low} and {high} {unit}, not {value}")


@dataclass(frozen=True)
class FollowSettings:
    """How the robot follows a lane of any shape while it records (see `follow.following`).

    Attributes:
        speed: usual speed, metres a second; less where the lane bends sharply.
        sway: how far it weaves to both sides of the centre line, metres.
        wavelength: of the weaving, metres.
        start: metres from the lane's beginning.
        end: metres kept from the lane's end.
        stop_every: metres between stops; 0: it never stops.
        stop: how long a stop is, seconds.
        shake: greatest roll and pitch of the body while it drives, radians.
        roughness: standard deviation of the ground's height, metres: roll, pitch and bounce follow from it.
        vehicle: "differential" or "ackermann".
    """

    speed: float = 1.0
    sway: float = 0.2
    wavelength: float = 9.0
    start: float = 1.0
    end: float = 1.5
    stop_every: float = 0.0
    stop: float = 2.0
    shake: float = np.radians(0.3)
    roughness: float = 0.0
    vehicle: str = "differential"

    def __post_init__(self) -> None:
        for name, low, high, unit in (
            ("speed", 0.05, 15.0, "m/s"),
            ("sway", 0.0, 5.0, "m"),
            ("wavelength", 0.2, 200.0, "m"),
            ("start", 0.0, 1e4, "m"),
            ("end", 0.0, 100.0, "m"),
            ("stop_every", 0.0, 1e4, "m"),
            ("stop", 0.0, 60.0, "s"),
            ("shake", 0.0, 0.2, "rad"),
            ("roughness", 0.0, 0.2, "m"),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise SimulationError(f"drive: {name} must be between {low} and {high} {unit}, not {value}")
        if self.vehicle not in VEHICLES:
            raise SimulationError(
                f"drive: vehicle must be one of {', '.join(VEHICLES)}, not {self.vehicle!r}"
            )


def weaving(seconds: float, settings: WeavingSettings | None = None, seed: int = 0) -> Motion:
    """A drive along the world's x axis: S-curves about the centre line, stops, and looks to both sides.

    Yaw is a sum of two waves of the way gone; while the robot stands it turns to one side and the other.

    Raises:
        SimulationError: a time that is not positive.
    """
    if not 0 < seconds <= 3600:
        raise SimulationError(f"drive: seconds must be between 0 and 3600, not {seconds}")
    how = settings or WeavingSettings()
    random = np.random.default_rng((seed, 2))
    time = np.arange(int(np.ceil(seconds * STEPS_PER_SECOND)) + 1) / STEPS_PER_SECOND
    going, looking = _phases(time)
    speed = how.speed * going * (1 + 0.08 * np.sin(2 * np.pi * time / 4.1 + random.uniform(0, 2 * np.pi)))
    way = np.concatenate([[0.0], np.cumsum(speed)[:-1]]) / STEPS_PER_SECOND
    wavelength = 2 * np.pi * how.sway / ((0.8 + 0.2 / 2.6) * how.swing) if how.sway and how.swing else 1.0
    waves = random.uniform(0, 2 * np.pi, 2)
    wave = 2 * np.pi * way / wavelength
    course = how.swing * (0.8 * np.cos(wave + waves[0]) + 0.2 * np.cos(2.6 * wave + waves[1]))
    course *= how.sway > 0
    look = how.swing * np.sin(2 * np.pi * looking)
    ease = _ease(looking / 0.25) * _ease((1 - looking) / 0.25)
    planned = course * (1 - ease) + look * ease
    turn_rate = np.append(np.diff(planned), 0.0) * STEPS_PER_SECOND
    x, y, yaw = integrate(speed, turn_rate, (how.start, 0.0, float(planned[0])))
    y -= (y.max() + y.min()) / 2  # the waves about their own middle reach no further than the sway
    roll, pitch = (Sway.draw(random, how.shake).at(time) for _ in range(2))
    return Motion(x, y, yaw, speed, turn_rate, roll, pitch)


def integrate(
    speed: NDArray[np.float64],
    turn_rate: NDArray[np.float64],
    start: tuple[float, float, float],
    steps_per_second: float = STEPS_PER_SECOND,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Poses x, y (m), yaw (rad), each (N,), of a unicycle whose twist holds for one step at a time.

    Each step is the arc of constant twist: the chord has length v dt sinc(w dt / 2) and the mean direction.

    Args:
        speed: (N,) m/s.
        turn_rate: (N,) rad/s.
        start: x, y, yaw of the first pose.
        steps_per_second: of the motion.
    """
    turn = turn_rate[:-1] / steps_per_second
    yaw = start[2] + np.concatenate([[0.0], np.cumsum(turn)])
    chord = speed[:-1] / steps_per_second * np.sinc(turn / 2 / np.pi)
    middle = yaw[:-1] + turn / 2
    x = start[0] + np.concatenate([[0.0], np.cumsum(chord * np.cos(middle))])
    y = start[1] + np.concatenate([[0.0], np.cumsum(chord * np.sin(middle))])
    return x, y, yaw


def _phases(time: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Share of the speed (N,) at each time, and how far (0..1) the look around has come."""
    phase = np.mod(time, _PERIOD_S)
    going = 1 - _ease((phase - _STOP_S) / 0.7) + _ease((phase - _LOOK_S[1]) / (_GO_S - _LOOK_S[1]))
    looking = np.clip((phase - _LOOK_S[0]) / (_LOOK_S[1] - _LOOK_S[0]), 0.0, 1.0)
    return going * _ease(time / 0.6), looking


def _ease(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Step from 0 to 1 on [0, 1] without a jerk at its ends."""
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10 - 15 * x + 6 * x**2)
