# SPDX-License-Identifier: Apache-2.0
"""Chooses where the camera looks next: of a few directions the one whose picture is expected to tell most."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.perception.gaze.bearings import LostWay, SeenFloor, in_view
from robot_vision.perception.gaze.expected import WayBelief, expected_gain
from robot_vision.perception.lane import LaneHeading
from robot_vision.perception.road.curve import Alignment
from robot_vision.perception.road.estimate import RoadEstimate

Array = NDArray[np.float64]

#: Angle between the directions compared, rad.
_STEP = np.deg2rad(4.0)
#: Until the picture that a choice is for: what a head takes to turn and settle, s.
_HORIZON = 0.4
#: What they are worth: a lost way found again, floor ahead seen that had not been of late, or that comes next, nats.
_FOUND, _FLOOR = 4.0, 0.8
#: Share of the view's half that counts as in view: what is at the rim is not measured.
_CORE = 0.85
#: What turning the head costs, and looking aside, where what nobody reckons with comes from straight ahead, nats a rad;
#: by how much another direction must be better to be chosen instead, nats.
_EFFORT, _ASIDE, _BETTER = 0.1, 0.4, 0.05
#: A direction within this of straight ahead is called ahead, rad.
_AHEAD = 0.5 * _STEP
#: A robot that will head so far off a lane leaves it (rad, and how gradually): what the lane tells then is of no use.
_LEAVES, _GRADUALLY = 0.35, 0.35
#: Where the robot turns to within this time (s) is looked at, in turns of more than this (rad); places in it.
_TURNS_TO, _TURN, _SWEPT = 1.0, 0.2, 9
#: Pictures farther apart than this start afresh, s.
_LONGEST_STEP = 2.0
#: Directions along the way that a lost one may lie in, every so far, m; no better known than this, rad.
_ALONG, _VAGUE = 5.0, 0.1


@dataclass(frozen=True)
class Gaze:
    """Where to look next.

    Attributes:
        pan: of the head, rad, left positive.
        point: (3,) in base_link, m: where the lens's axis shall meet the floor, or the farthest way that counts.
        reason: ahead, bend, floor, turn or lost: what most of the expected gain over looking straight ahead is.
        gain: expected of a picture along it, nats.
    """

    pan: float
    point: Array
    reason: str
    gain: float


@dataclass
class GazePlanner:
    """Chooses where a head looks, from picture to picture.

    For each of a few directions gains are added up: how much surer the direction of the way at places ahead
    would become (`expected`), the chance that a way out of sight lies there, and how much floor would be seen that
    lies on the way and was not seen of late, or that the robot turns to. From that goes what it costs to turn and to
    look aside. Another direction is chosen only when it is clearly better, so that the head does not swing; and what
    is said turns no faster than `rate`.

    Args:
        most_pan: to either side, rad.
        rate: of the direction said, rad/s.
        ahead: how far the way counts, m.

    Raises:
        ValueError: for settings without meaning, naming the setting.
    """

    most_pan: float = 1.0
    rate: float = 1.5
    ahead: float = 15.0
    _lost: LostWay = field(default_factory=LostWay, init=False, repr=False, compare=False)
    _floor: SeenFloor = field(default_factory=SeenFloor, init=False, repr=False, compare=False)
    _alignment: Alignment = field(default_factory=Alignment, init=False, repr=False, compare=False)
    _stamp: float | None = field(default=None, init=False, repr=False, compare=False)
    _chosen: float = field(default=0.0, init=False, repr=False, compare=False)
    _said: float = field(default=0.0, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in ("most_pan", "rate", "ahead"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a positive number, not {value}")

    def reset(self) -> None:
        """Forget what earlier pictures told."""
        self._lost, self._floor = LostWay(), SeenFloor()
        self._stamp = None
        self._chosen = self._said = 0.0

    def update(
        self,
        lane: LaneHeading | None,
        road: RoadEstimate | None,
        camera: Camera,
        stamp_s: float,
        speed: float | None = None,
        turn_rate: float | None = None,
    ) -> Gaze | None:
        """Take in what a picture told of the way.

        Args:
            lane: the robot in its lane; None while no direction leads.
            road: the road where it is one.
            camera: rectified, of the picture, with the pan of its head.
            stamp_s: time of the picture, s.
            speed: of the robot, m/s, None when unknown.
            turn_rate: of the robot, rad/s counter-clockwise, None when unknown.

        Returns:
            Where to look; None where the camera's height or focal length is not known.
        """
        if camera.height_m is None or not camera.focal_known:
            return None
        seconds = 0.0 if self._stamp is None else stamp_s - self._stamp
        if not 0.0 <= seconds <= _LONGEST_STEP:
            self.reset()
            seconds = 0.0
        if self._stamp is None:
            self._chosen = self._said = float(np.clip(camera.pan, -self.most_pan, self.most_pan))
        self._stamp = stamp_s
        way = self._way(lane, road, camera)
        half_view = _CORE * float(np.arctan2(0.5 * camera.width, camera.fx))
        turn = (turn_rate or 0.0) * seconds
        self._floor.look(camera.pan, half_view, seconds, turn)
        heads = (turn_rate or 0.0) * _TURNS_TO
        if way is None:
            self._lost.unseen(camera.pan, half_view, seconds, turn, heads)
        elif _use(way, speed or 0.0, turn_rate or 0.0) == 0.0:
            self._lost.left(heads)
        else:
            bearings, sigmas = way.bearings(np.arange(_ALONG, self.ahead + 0.5 * _ALONG, _ALONG))
            self._lost.seen(bearings, np.maximum(sigmas, _VAGUE))
        pans = self._candidates()
        parts = self._gains(way, camera, pans, half_view, speed or 0.0, turn_rate or 0.0)
        gains = sum(parts.values(), np.zeros(len(pans)))
        value = gains - _EFFORT * np.abs(pans - camera.pan) - _ASIDE * np.abs(pans)
        self._choose(pans, value)
        most = self.rate * seconds
        self._said += float(np.clip(self._chosen - self._said, -most, most))
        chosen = int(np.argmin(np.abs(pans - self._chosen)))
        reason = _reason(parts, chosen, len(pans) // 2, self._chosen)
        return Gaze(self._said, _point(camera, self._said, self.ahead), reason, float(gains[chosen]))

    def _way(self, lane: LaneHeading | None, road: RoadEstimate | None, camera: Camera) -> WayBelief | None:
        if road is not None:
            return WayBelief.of_road(road)
        return None if lane is None else WayBelief.of_lane(lane, camera, self._alignment)

    def _candidates(self) -> Array:
        """Directions compared, (C,) rad: an odd number, the middle one straight ahead."""
        side = max(int(self.most_pan / _STEP), 1)
        return np.linspace(-self.most_pan, self.most_pan, 2 * side + 1)

    def _gains(
        self,
        way: WayBelief | None,
        camera: Camera,
        pans: Array,
        half_view: float,
        speed: float,
        turn_rate: float,
    ) -> dict[str, Array]:
        """Expected gain (C,) of a picture along each direction, nats, by what it would tell of."""
        gains: dict[str, Array] = {}
        if abs(turn_rate) * _TURNS_TO > _TURN:
            coming = np.linspace(0.0, turn_rate * _TURNS_TO, _SWEPT)
            gains["turn"] = _FLOOR * in_view(coming, pans, half_view).mean(axis=1)
        if way is None:
            gains["lost"] = _FOUND * self._lost.chance(pans, half_view)
        else:
            use = _use(way, speed, turn_rate)
            told = expected_gain(way, camera, pans, self.ahead, _HORIZON, speed, turn_rate)
            gains["bend"] = use * told.mean(axis=1)
            path = way.bearings(np.arange(1.0, self.ahead + 0.5))[0]
            gains["floor"] = use * _FLOOR * self._floor.news(path, pans, half_view)
        return gains

    def _choose(self, pans: Array, value: Array) -> None:
        best = int(np.argmax(value))
        kept = float(np.interp(self._chosen, pans, value))
        if value[best] > kept + _BETTER:
            self._chosen = float(pans[best])


def _use(way: WayBelief, speed: float, turn_rate: float) -> float:
    """How far, 0 to 1, a robot that turns so goes on along the way."""
    off = abs(way.yaw_after(speed * _TURNS_TO, turn_rate * _TURNS_TO)) - _LEAVES
    return float(np.clip(1.0 - off / _GRADUALLY, 0.0, 1.0))


def _reason(parts: dict[str, Array], chosen: int, ahead: int, pan: float) -> str:
    """What speaks most for a direction against straight ahead."""
    if "lost" in parts:
        return "lost"
    if abs(pan) < _AHEAD:
        return "ahead"
    return max(parts, key=lambda name: float(parts[name][chosen] - parts[name][ahead]))


def _point(camera: Camera, pan: float, ahead: float) -> Array:
    """Where the lens's axis meets the floor with the head at `pan` and its tilt at rest; at most `ahead` m away."""
    assert camera.height_m is not None
    fall = float(np.tan(camera.pitch))
    away = min(camera.height_m / fall, ahead) if fall > 0.0 else ahead
    return np.array([camera.x_m + away * np.cos(pan), away * np.sin(pan), camera.height_m - away * fall])
