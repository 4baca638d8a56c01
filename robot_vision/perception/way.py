# SPDX-License-Identifier: Apache-2.0
"""The way ahead, whatever kind it is: a corridor between walls, read from vanishing points, or a road that bends."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import Enum
from importlib import import_module
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.perception.attention import Attention
from robot_vision.perception.attitude import Attitude
from robot_vision.perception.gaze import Gaze, GazePlanner
from robot_vision.perception.heading import HeadingEstimate, HeadingEstimator
from robot_vision.perception.lane import LaneHeading
from robot_vision.perception.region import Region
from robot_vision.perception.road.estimate import RoadEstimate
from robot_vision.perception.road.sequence import attitude_on, vanishing_sequence
from robot_vision.perception.road.tracker import RoadTracker
from robot_vision.perception.segments import LineSegments
from robot_vision.perception.vanishing import Role, VanishingPoints

Array = NDArray[np.float64]

#: Support of the vertical vanishing point that walls give at least: rooms and streets give 40 and more, trees and
#: posts beside a country road up to 20.
_WALLS = 30.0
#: How long walls must have been gone, or there, before the kind of way changes, s.
_SURE = 1.0
#: A lane as wide as the one between walls, give or take this share, is that one.
_SAME_WIDTH = 0.1
#: A road that was followed is waited for so long before vanishing points are asked instead, s.
_ROAD_COMES_BACK = 2.0
_PATH_STEP = 0.5


class Kind(str, Enum):
    """What kind of way is looked for; AUTO: a corridor where walls are seen, else a road if there is one."""

    AUTO = "auto"
    CORRIDOR = "corridor"
    ROAD = "road"


@dataclass(frozen=True)
class WayEstimate:
    """What one picture adds to the knowledge of the way.

    Attributes:
        frame: of `lane`: corridor or road.
        vanishing_points: the ones believed, primary first; on a road those of the road nearby, in the middle and far
            ahead.
        lane: the robot in its lane; None while no direction leads.
        path: (N, 2) centre line ahead in base_link, m, from beside the robot; None while its place is not known.
        attitude: lean of the camera; None while the picture says nothing of it.
        road: the road where it is one.
        reason: in plain words what is missing; empty when nothing is.
        attention: where to look in the next picture; None: everywhere.
    """

    frame: str
    vanishing_points: VanishingPoints
    lane: LaneHeading | None
    path: Array | None
    attitude: Attitude | None
    road: RoadEstimate | None
    reason: str
    attention: Region | None = None


class _Newest(NamedTuple):
    """The newest picture: what it told, its camera and time (s), how the robot moved (m/s, rad/s)."""

    found: WayEstimate
    camera: Camera
    stamp_s: float
    speed: float | None
    turn_rate: float | None


@dataclass
class WayEstimator:
    """Follows the way through successive pictures.

    Args:
        kind: of way.
        corridor: follows vanishing points and a lane between walls.
        road: follows a road.
        gaze: chooses where to look next.
        path_length: of the path given, m.
        attention: chooses where to look in the next picture; None: everywhere, always. With it, `update` takes lines
            to come from where it has asked for them.
    """

    kind: Kind = Kind.AUTO
    corridor: HeadingEstimator = field(default_factory=HeadingEstimator)
    road: RoadTracker = field(default_factory=RoadTracker)
    gaze: GazePlanner = field(default_factory=GazePlanner)
    path_length: float = 10.0
    attention: Attention | None = None
    _newest: _Newest | None = field(default=None, init=False, repr=False, compare=False)
    _walled: bool | None = field(default=None, init=False, repr=False, compare=False)
    _between_walls: float | None = field(default=None, init=False, repr=False, compare=False)
    _contrary_since: float | None = field(default=None, init=False, repr=False, compare=False)
    _road_seen: float | None = field(default=None, init=False, repr=False, compare=False)

    def set_lean(self, lean: float) -> None:
        """Set the standard deviation of the body's roll and pitch about the camera's mounting, rad."""
        self.corridor.lean = self.road.lean = lean

    def set_widths(self, narrowest: float, widest: float) -> None:
        """Set the widths that a lane or a road may have, m."""
        lanes = self.corridor.lane_filter
        lanes.narrowest, lanes.widest = narrowest, widest
        self.road.narrowest, self.road.widest = narrowest, widest

    def warm_up(self) -> None:
        """Load the compiled kernels and what the filters stand on."""
        import_module("filterpy.kalman")
        self.corridor.estimator.warm_up()

    def reset(self) -> None:
        """Forget everything earlier pictures told."""
        self.corridor.reset()
        self.road.reset()
        if self.attention is not None:
            self.attention.reset()
        self.gaze.reset()
        self._newest = None
        self._walled = self._between_walls = self._contrary_since = self._road_seen = None

    def update(
        self,
        lines: LineSegments,
        camera: Camera,
        stamp_s: float,
        speed: float | None = None,
        turn_rate: float | None = None,
    ) -> WayEstimate:
        """Take in the lines of the next picture.

        Args:
            lines: segments in rectified pixels.
            camera: with its place on the robot; a road and offsets need `height_m`.
            stamp_s: time of the picture, s.
            speed: of the robot, m/s, None when unknown.
            turn_rate: of the robot, rad/s counter-clockwise, None when unknown.
        """
        camera = camera.rectified()
        found = self._find(lines, camera, stamp_s, speed, turn_rate)
        if self.attention is not None:
            points, attitude = found.vanishing_points, found.attitude
            region = self.attention.update(lines, points, attitude, stamp_s, turn_rate)
            found = replace(found, attention=region)
        self._newest = _Newest(found, camera, stamp_s, speed, turn_rate)
        return found

    def look(self) -> Gaze | None:
        """Where a head that carries the camera should look next, after the newest picture.

        Asked after a picture or not at all: nobody pays for it where no head turns the camera. None before the first
        picture, and where height or focal length of the camera is not known.
        """
        if self._newest is None:
            return None
        found, camera, stamp_s, speed, turn_rate = self._newest
        return self.gaze.update(found.lane, found.road, camera, stamp_s, speed, turn_rate)

    def _find(
        self,
        lines: LineSegments,
        camera: Camera,
        stamp_s: float,
        speed: float | None,
        turn_rate: float | None,
    ) -> WayEstimate:
        seen = self.corridor.update(lines, camera, stamp_s, turn_rate)
        partly = self.attention is not None and self.attention.searched_in_part(lines)
        if not self._look_for_road(seen, stamp_s, partly):
            return self._in_corridor(seen)
        if camera.height_m is None or not camera.focal_known:
            if self.kind is Kind.AUTO:
                return self._in_corridor(seen)
            missing = "height" if camera.height_m is None else "focal length"
            reason = f"no road: the {missing} of the camera is not known"
            return WayEstimate("road", seen.vanishing_points, None, None, seen.attitude, None, reason)
        road = self.road.update(lines, camera, stamp_s, speed, turn_rate)
        if road is not None:
            self._road_seen = stamp_s
            return self._on_road(road, len(lines), camera)
        if self.kind is Kind.AUTO and not self._expects_road(stamp_s):
            return self._in_corridor(seen)
        reason = "no road: no two borders that run side by side are seen"
        return WayEstimate("road", VanishingPoints.none(camera, len(lines)), None, None, None, None, reason)

    def _expects_road(self, stamp_s: float) -> bool:
        return self._road_seen is not None and 0.0 <= stamp_s - self._road_seen <= _ROAD_COMES_BACK

    def _look_for_road(self, seen: HeadingEstimate, stamp_s: float, partly: bool) -> bool:
        """Whether the way may be a road: as told, or because no walls stand about."""
        if self.kind is not Kind.AUTO:
            return self.kind is Kind.ROAD
        vertical = seen.vanishing_points.of(Role.VERTICAL)
        walls = vertical is not None and bool(seen.vanishing_points.weight[vertical] >= _WALLS)
        width = seen.lane.width if seen.lane is not None and seen.lane.offset_known else None
        if walls:
            self._between_walls = width or self._between_walls
        elif self._walled:
            walls = self._is_between_them_still(width)
        if self._walled is None:
            self._walled = walls
        elif partly and not walls:
            # A part of a picture in which no walls are seen does not say that there are none.
            return not self._walled
        elif walls == self._walled:
            self._contrary_since = None
        elif self._contrary_since is None or stamp_s < self._contrary_since:
            self._contrary_since = stamp_s
        elif stamp_s - self._contrary_since >= _SURE:
            self._walled, self._contrary_since = walls, None
            self.road.reset()
        return not self._walled

    def _is_between_them_still(self, width: float | None) -> bool:
        """Whether a lane (width in m, None: no lane) is that between the walls which were seen last.

        Before the end of a corridor few uprights are left in the picture, but the feet of its walls go on.
        """
        before = self._between_walls
        return width is not None and before is not None and abs(width - before) <= _SAME_WIDTH * before

    def _in_corridor(self, seen: HeadingEstimate) -> WayEstimate:
        lane = seen.lane
        path = straight_path(lane, self.path_length) if lane is not None and lane.offset_known else None
        return WayEstimate("corridor", seen.vanishing_points, lane, path, seen.attitude, None, seen.reason)

    def _on_road(self, road: RoadEstimate, lines: int, camera: Camera) -> WayEstimate:
        along = np.arange(0.0, min(self.path_length, road.alignment.knots[-1]) + 0.5 * _PATH_STEP, _PATH_STEP)
        return WayEstimate(
            "road",
            vanishing_sequence(road, camera, lines),
            road.lane,
            road.path(along),
            attitude_on(road, camera),
            road,
            "",
        )


def straight_path(lane: LaneHeading, length: float) -> Array:
    """The straight centre line of a lane in base_link.

    Args:
        lane: with a known offset.
        length: of the line, from the point nearest to the robot, m.

    Returns:
        (N, 2) points, m.
    """
    way = np.arange(0.0, length + 0.5 * _PATH_STEP, _PATH_STEP)
    cos, sin = np.cos(lane.yaw), np.sin(lane.yaw)
    # The lane lies at -yaw seen from the robot; its nearest point is `offset` to the right of it.
    return np.stack([way * cos - lane.offset * sin, -way * sin - lane.offset * cos], axis=1)
