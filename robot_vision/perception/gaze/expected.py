# SPDX-License-Identifier: Apache-2.0
"""What a picture would tell of the way, before it is taken: how far it would make its directions ahead surer.

The covariance of a Kalman filter does not depend on what is measured, only on what can be: for each direction of the
camera, the borders that would be in its picture are measured in thought, and the variance of the way's direction at
places ahead before and after is compared (greedy sensor selection by mutual information, Krause and Guestrin 2007).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera, rotation_from_rpy
from robot_vision.geometry.rotation import BODY_FROM_OPTICAL
from robot_vision.perception.lane import LaneHeading
from robot_vision.perception.road.borders import beside
from robot_vision.perception.road.curve import Alignment, RoadCurve
from robot_vision.perception.road.estimate import BENDS, OFFSET, PAINT, PITCH, ROLL, WIDTH, YAW, RoadEstimate
from robot_vision.perception.road.road_filter import leaning_on_ground

Array = NDArray[np.float64]

#: How well an edge is placed across it in a picture, px, and on the ground, m, at 10 m twice as badly.
_PIXEL, _ROUGHNESS, _TWICE = 0.7, 0.02, 10.0
#: What a straight lane does not say: its width (m) and its standard deviation, how it may bend (1/m).
_USUAL_WIDTH, _WIDTH_SIGMA, _LANE_BEND = 2.0, 0.1, 0.01
_OFFSET_SIGMA = 0.5
#: What becomes unsure in 1 s: yaw (rad), offset (m); the curvature in 1 m of way, 1/m; a lean, rad.
_YAW_DRIFT, _OFFSET_DRIFT, _BEND_DRIFT, _LEAN = 0.05, 0.1, 0.004, 0.02
#: Distance of the places at which borders would be measured, m, how far ahead the last, and those the way is told for.
_STEP, _FARTHEST, _TOLD_EVERY = 1.0, 30.0, 3.0
#: A way is known by both its borders, this much of each within this distance, m: of one alone it is not believed.
_BOTH, _NEARBY = 6.0, 20.0


@dataclass(frozen=True)
class WayBelief:
    """The way ahead as it is believed now, a road or a straight lane.

    Attributes:
        alignment: knots of its curvature.
        state, covariance: (S,) and (S, S), in the order that `road.estimate` tells.
    """

    alignment: Alignment
    state: Array
    covariance: Array

    @classmethod
    def of_road(cls, road: RoadEstimate) -> WayBelief:
        """A road that is followed."""
        return cls(road.alignment, road.state, road.covariance)

    @classmethod
    def of_lane(cls, lane: LaneHeading, camera: Camera, alignment: Alignment) -> WayBelief:
        """A lane of which a vanishing point tells the direction, straight as far as anybody knows."""
        state = np.zeros(BENDS + len(alignment.knots))
        state[[OFFSET, YAW, WIDTH]] = lane.offset, lane.yaw, lane.width or _USUAL_WIDTH
        state[[ROLL, PITCH]] = camera.roll, camera.pitch
        variance = np.full(len(state), _LANE_BEND**2)
        offset = lane.offset_variance if lane.offset_known else _OFFSET_SIGMA**2
        variance[[OFFSET, YAW, WIDTH]] = offset, lane.yaw_variance, _WIDTH_SIGMA**2
        variance[[ROLL, PITCH, PAINT]] = _LEAN**2, _LEAN**2, 1e-6
        return cls(alignment, state, np.diag(variance))

    def yaw_after(self, rolled: float, turned: float) -> float:
        """Yaw relative to the way (rad) of a robot that has rolled so far along it (m) and turned by so much (rad)."""
        along = RoadCurve(self.alignment, self.state[BENDS:]).heading([rolled])
        return float(self.state[YAW] + turned - along[0])

    def path(self, along: Array) -> Array:
        """The middle in base_link at distances (N,) from beside the robot, (N, 2) m."""
        return self._in_base(along, 0.0)

    def bearings(self, along: Array) -> tuple[Array, Array]:
        """Where the middle at distances (N,) m lies as seen from the robot, and its direction's deviation, rad."""
        path = self.path(along)
        slopes = self._slopes_of_direction(along)
        variance = np.einsum("ni,ij,nj->n", slopes, self.covariance, slopes)
        return np.arctan2(path[:, 1], path[:, 0]), np.sqrt(variance)

    def _slopes_of_direction(self, along: Array) -> Array:
        slopes = np.zeros((len(along), len(self.state)))
        slopes[:, YAW] = -1.0
        slopes[:, BENDS:] = RoadCurve(self.alignment, self.state[BENDS:]).turning(along)
        return slopes

    def _in_base(self, along: Array, share: float) -> Array:
        """A line beside the middle, `share` of the width to its left."""
        curve = RoadCurve(self.alignment, self.state[BENDS:])
        heading = curve.heading(along)
        left = share * self.state[WIDTH] * np.stack([-np.sin(heading), np.cos(heading)], axis=1)
        away = curve.points(along) + left - [0.0, self.state[OFFSET]]
        cos, sin = np.cos(self.state[YAW]), np.sin(self.state[YAW])
        return np.stack([cos * away[:, 0] + sin * away[:, 1], cos * away[:, 1] - sin * away[:, 0]], axis=1)


def expected_gain(
    way: WayBelief, camera: Camera, pans: Array, ahead: float, seconds: float, speed: float, turn_rate: float
) -> Array:
    """What a picture along each of `pans` would tell of the way's direction ahead, (C, T) nats at T places.

    Args:
        way: as it is believed.
        camera: with its height; where it looks now does not count.
        pans: (C,) directions of the camera, rad.
        ahead: how far the way counts, m.
        seconds: until that picture.
        speed: of the robot, m/s.
        turn_rate: of the robot, rad/s counter-clockwise.
    """
    assert camera.height_m is not None
    rolled = abs(speed) * seconds
    along = rolled + np.arange(_STEP, _FARTHEST + 0.5 * _STEP, _STEP)
    points = np.concatenate([way._in_base(along, 0.5), way._in_base(along, -0.5)])
    share = np.repeat([0.5, -0.5], len(along))
    slopes = _slopes_of_borders(way, points, share, camera)
    ready = way.covariance + np.diag(_drift(way, rolled, seconds))
    # The picture is taken from where the robot will be.
    turn = turn_rate * seconds
    reached = rolled * np.sinc(turn / 2.0 / np.pi) * np.array([np.cos(turn / 2.0), np.sin(turn / 2.0)])
    cos, sin = np.cos(turn), np.sin(turn)
    there = (points - reached) @ np.array([[cos, -sin], [sin, cos]])
    distance = np.hypot(there[:, 0] - camera.x_m, there[:, 1])
    slant = np.hypot(1.0, (share * way.state[WIDTH]) / camera.height_m)
    noise = (_PIXEL * slant * distance / camera.fx) ** 2 + (_ROUGHNESS * (1.0 + distance / _TWICE)) ** 2
    shown = shown_on_ground(there, camera, pans)
    shown = shown * _with_both(shown, share, distance)[:, None]
    size = len(ready)
    squares = (slopes[:, :, None] * slopes[:, None, :]).reshape(len(slopes), size * size)
    told = ((shown / noise) @ squares).reshape(len(pans), size, size)
    after = np.linalg.solve(np.eye(size) + ready @ told, np.broadcast_to(ready, told.shape))
    direction = way._slopes_of_direction(rolled + np.arange(0.0, ahead + 0.5 * _TOLD_EVERY, _TOLD_EVERY))
    before = np.sum((direction @ ready) * direction, axis=1)
    left = np.sum((direction @ after) * direction, axis=2)
    return np.asarray(0.5 * np.log(before / np.maximum(left, 1e-12)))


def shown_on_ground(points: Array, camera: Camera, pans: Array) -> Array:
    """Which ground points (N, 2) of base_link are in the picture along each of `pans` (C,): (C, N) of 0 and 1."""
    assert camera.height_m is not None
    x, y = points[:, 0] - camera.x_m, points[:, 1]
    cos, sin = np.cos(pans)[:, None], np.sin(pans)[:, None]
    body = np.stack(
        [cos * x + sin * y, cos * y - sin * x, np.full((len(pans), len(x)), -camera.height_m)], axis=-1
    )
    optical = body @ (rotation_from_rpy(camera.roll, camera.pitch, 0.0) @ BODY_FROM_OPTICAL)
    depth = np.where(optical[..., 2] > 0.05, optical[..., 2], np.nan)
    u = camera.cx + camera.fx * optical[..., 0] / depth
    v = camera.cy + camera.fy * optical[..., 1] / depth
    with np.errstate(invalid="ignore"):
        inside = (u >= 0.0) & (u <= camera.width - 1.0) & (v >= 0.0) & (v <= camera.height - 1.0)
    return np.asarray(inside, np.float64)


def _with_both(shown: Array, share: Array, distance: Array) -> Array:
    """How far (C,), 0 to 1, pictures that show border points (C, N) show enough of the left and of the right border."""
    near = shown * (distance < _NEARBY)
    less = np.minimum(near @ (share > 0.0), near @ (share < 0.0))
    return np.asarray(np.clip(less * _STEP / _BOTH, 0.0, 1.0) ** 2)


def _slopes_of_borders(way: WayBelief, points: Array, share: Array, camera: Camera) -> Array:
    """How far border points (N, 2) lie beside their border changes with the state, (N, S)."""
    assert camera.height_m is not None
    feet, slopes, turn = beside(way.alignment, way.state, points)
    slopes[:, WIDTH] = -share
    leaning = leaning_on_ground(points - [camera.x_m, 0.0], camera.height_m)
    slopes[:, ROLL : PITCH + 1] = np.einsum("ni,ij,njk->nk", feet.normal, turn, leaning)
    return slopes


def _drift(way: WayBelief, rolled: float, seconds: float) -> Array:
    """Variances (S,) that come on top until the next picture."""
    drift = np.full(len(way.state), _BEND_DRIFT**2 * rolled)
    drift[:BENDS] = 0.0
    drift[OFFSET], drift[YAW] = (_OFFSET_DRIFT * seconds) ** 2, (_YAW_DRIFT * seconds) ** 2
    drift[[ROLL, PITCH]] = _LEAN**2
    return drift
