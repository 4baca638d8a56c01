# SPDX-License-Identifier: Apache-2.0
"""Lanes: the curves that heading, offset and the scripted drives are measured against."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_vision.geometry.rotation import wrap_angle
from robot_vision.simulation.errors import SimulationError

SAMPLE_M = 0.05
"""Distance of the samples among which the nearest point of a curve is first looked for."""


class LanePose(NamedTuple):
    """Where a robot is in its lane.

    Attributes:
        offset: of the robot to the LEFT of the centre line, metres.
        yaw: of the robot relative to the lane, radians, counter-clockwise positive.
        curvature: of the centre line beside the robot, 1/m, positive where it bends to the left.
        width: between the lane's borders there, metres.
        along: way along the centre line from its beginning, metres.
    """

    offset: float
    yaw: float
    curvature: float
    width: float
    along: float


class LanePoint(NamedTuple):
    """A point of a centre line: x, y (m) and yaw (rad) in the world, curvature (1/m)."""

    x: float
    y: float
    yaw: float
    curvature: float


class Lane(Protocol):
    """A centre line with a width, known to the millimetre."""

    @property
    def length(self) -> float:
        """Metres from the beginning of the centre line to its end."""
        ...

    def locate(self, x: float, y: float, yaw: float) -> LanePose:
        """Where a robot at x, y (m), yaw (rad) of the world is in the lane."""
        ...

    def point(self, along: float) -> LanePoint:
        """The centre line `along` metres from its beginning, straight on beyond both ends."""
        ...


@dataclass(frozen=True)
class StraightLane:
    """A straight lane, by default along the world's x axis from x = 0.

    Attributes:
        length: metres that are free to drive.
        width: metres between its borders.
        x: where its centre line begins, metres.
        y: where its centre line begins, metres.
        yaw: its direction, radians, counter-clockwise from the world's x axis.
    """

    length: float
    width: float
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    def __post_init__(self) -> None:
        _check_extent(self.length, self.width)

    def locate(self, x: float, y: float, yaw: float) -> LanePose:
        """See `Lane.locate`."""
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        along = cos * (x - self.x) + sin * (y - self.y)
        offset = cos * (y - self.y) - sin * (x - self.x)
        return LanePose(float(offset), float(wrap_angle(yaw - self.yaw)), 0.0, self.width, float(along))

    def point(self, along: float) -> LanePoint:
        """See `Lane.point`."""
        x, y = self.x + along * np.cos(self.yaw), self.y + along * np.sin(self.yaw)
        return LanePoint(float(x), float(y), self.yaw, 0.0)


class PolyLane:
    """A lane whose centre line is a smooth curve (cubic spline: the curvature has no jumps) through points.

    Args:
        points: (N, 2) with N >= 2, in driving order, metres.
        width: between the borders, metres; one number or (N,), one a point.

    Raises:
        SimulationError: too few points, two successive ones that coincide, a width that is not positive.
    """

    def __init__(self, points: ArrayLike, width: ArrayLike) -> None:
        from scipy.interpolate import CubicSpline
        from scipy.spatial import cKDTree

        knots = np.asarray(points, np.float64)
        if knots.ndim != 2 or knots.shape[1] != 2 or len(knots) < 2 or not np.isfinite(knots).all():
            raise SimulationError(f"lane: points must be finite (N, 2) with N >= 2, not {knots.shape}")
        steps = np.linalg.norm(np.diff(knots, axis=0), axis=1)
        if steps.min() < 1e-6:
            raise SimulationError(f"lane: points {steps.argmin()} and {steps.argmin() + 1} coincide")
        widths = np.broadcast_to(np.asarray(width, np.float64), (len(knots),))
        chords = np.concatenate([[0.0], np.cumsum(steps)])
        self._curve = CubicSpline(chords, knots, bc_type="not-a-knot")
        parameters, ways = self._measure(chords)
        _check_extent(float(ways[-1]), float(widths.min()))
        count = int(np.ceil(ways[-1] / SAMPLE_M)) + 1
        self._ways = np.linspace(0.0, ways[-1], count)
        self._parameters = np.interp(self._ways, ways, parameters)
        self._widths = np.interp(self._parameters, chords, widths)
        self._tree = cKDTree(self._curve(self._parameters))

    def _measure(self, chords: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Spline parameters, fine enough for arc lengths to 0.1 mm in 100 m, and the way up to each."""
        pieces = np.maximum(np.ceil(np.diff(chords) / (SAMPLE_M / 5)).astype(int), 8)
        parts = [
            np.linspace(a, b, n, endpoint=False) for a, b, n in zip(chords, chords[1:], pieces, strict=False)
        ]
        parameters = np.append(np.concatenate(parts), chords[-1])
        middle = (parameters[1:] + parameters[:-1]) / 2
        speed, between = (np.linalg.norm(self._curve(t, 1), axis=1) for t in (parameters, middle))
        simpson = np.diff(parameters) * (speed[:-1] + 4 * between + speed[1:]) / 6
        return parameters, np.concatenate([[0.0], np.cumsum(simpson)])

    @property
    def length(self) -> float:
        """See `Lane.length`."""
        return float(self._ways[-1])

    def locate(self, x: float, y: float, yaw: float) -> LanePose:
        """See `Lane.locate`; beyond an end the lane goes straight on."""
        place = np.array([x, y])
        _, nearest = self._tree.query(place)
        low, high = (
            self._parameters[max(nearest - 1, 0)],
            self._parameters[min(nearest + 1, len(self._ways) - 1)],
        )
        at = float(self._parameters[nearest])
        for _ in range(4):  # Newton for (curve - place) . tangent = 0; two do for a micrometre
            away, first, second = self._curve(at) - place, self._curve(at, 1), self._curve(at, 2)
            slope = first @ first + away @ second
            at = float(np.clip(at - (away @ first) / max(slope, 1e-9), low, high))
        along = float(np.interp(at, self._parameters, self._ways))
        start = self._at(at)
        ahead, left = _in_frame(place, start)
        if ahead * (1 if along > 0 else -1) > 0:  # only beyond an end is anything left over along the lane
            along += ahead
        width = float(np.interp(along, self._ways, self._widths))
        return LanePose(left, float(wrap_angle(yaw - start.yaw)), start.curvature, width, along)

    def point(self, along: float) -> LanePoint:
        """See `Lane.point`."""
        inside = min(max(along, 0.0), self.length)
        point = self._at(float(np.interp(inside, self._ways, self._parameters)))
        beyond = along - inside
        if beyond == 0.0:
            return point
        x, y = point.x + beyond * np.cos(point.yaw), point.y + beyond * np.sin(point.yaw)
        return LanePoint(float(x), float(y), point.yaw, 0.0)

    def _at(self, parameter: float) -> LanePoint:
        (x, y), (dx, dy), (ddx, ddy) = (self._curve(parameter, order) for order in range(3))
        curvature = (dx * ddy - dy * ddx) / np.hypot(dx, dy) ** 3
        return LanePoint(float(x), float(y), float(np.arctan2(dy, dx)), float(curvature))


def _in_frame(place: NDArray[np.float64], point: LanePoint) -> tuple[float, float]:
    """How far a place lies ahead of and to the left of a point of a centre line (m)."""
    cos, sin = np.cos(point.yaw), np.sin(point.yaw)
    dx, dy = place[0] - point.x, place[1] - point.y
    return float(cos * dx + sin * dy), float(cos * dy - sin * dx)


def _check_extent(length: float, width: float) -> None:
    if not (0 < length < np.inf and 0 < width < np.inf):
        raise SimulationError(f"lane: length and width must be positive, not {length} and {width} m")
