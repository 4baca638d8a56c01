# SPDX-License-Identifier: Apache-2.0
"""Where a robot is among walls that stand on a square grid: odometry, put right by vanishing points and by walls."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.mapping.hypotheses import Hypothesis, reduced, whole
from robot_vision.mapping.plan_view import PlanView
from robot_vision.mapping.pose import Pose, PoseHistory
from robot_vision.mapping.wall_faces import Face, faces

Array = NDArray[np.float64]

_QUARTER = np.pi / 2
_YAW, _WAY, _SHADOW = 2, 3, 4
"""Places in the state: x, y (m), yaw (rad), share by which ways are longer than odometry tells, tip of shadows (m)."""
_PLACE = slice(0, _SHADOW)
_FOOT, _EDGE, _NEITHER = 0.45, 0.45, 0.1
"""How often floor ends at the foot of a wall, at the edge of its shadow, and anywhere within a cell. Foot and edge are
as likely as each other: pictures of one wall err alike, and what is told again and again would decide which it is."""
_SPREAD = 0.025
"""Standard deviation of where floor is seen to end, cells. It tells foot from edge. Pictures one after the other err
alike, which is why a face puts the place right by less than this would have it (`face_sigma`)."""
_SHADOW_LENGTH, _SHADOW_SIGMA, _SHADOW_SPREAD = 0.12, 0.08, 0.03
"""Cells: how far shadows reach to one side or the other before any is seen, standard deviation of that, and of where
their soft edge is taken to be."""
_SIDEWAYS = 0.01
"""Standard deviation of what a way goes astray beside its length, share of it."""
_MOST, _UNLIKELY, _ALIKE = 8, 1e-3, 1.0
"""Hypotheses kept, the least weight of one, and the Mahalanobis distance, squared, at which two are one."""
_LOST = 0.3
"""Standard deviation of place (cells) and yaw (rad) beyond which the grid tells nothing more."""


@dataclass
class GridPose:
    """Follows a robot through a maze of square cells: extended Kalman filters, for faces of walls are ambiguous.

    Vanishing points of the walls tell the yaw up to quarter turns. Where a plan of the floor shows faces of walls,
    these lie half a wall's thickness beside a line of the grid, which tells the place across them up to whole cells.
    Odometry, which drifts, tells which quarter and which cell.

    Floor may seem to end at the edge of a wall's shadow. Walls of one height in one light cast shadows that reach
    equally far, on the same side of all of them: how far is learnt with the place. Each face is weighed as the foot of
    a wall, as the edge of a shadow and as neither. At the end of a long corridor odometry may have gone astray by as
    much as a shadow is long: which of them it was shows in later pictures only. So the likeliest answers are kept as
    hypotheses of their own, and the pose is their mean (Reid 1979, "An algorithm for tracking multiple targets").

    Args:
        start: where the robot is at its first odometry: x to the east, y to the north, m; yaw from east, rad.
        cell: side of a cell, m.
        wall: thickness of the walls, m.
        reach: how far walls are used, m; None: two cells.
        way_drift: standard deviation of odometry's way, share of it; it is learnt, too.
        turn_drift: standard deviation of its turns, share of them.
        direction_floor: what the vanishing points of one picture can tell of the yaw at best, rad.
        face_sigma: standard deviation of the place of a face in one plan, share of the cell.

    Raises:
        ValueError: naming the setting that is not a positive number.
    """

    start: Pose
    cell: float
    wall: float
    reach: float | None = None
    way_drift: float = 0.02
    turn_drift: float = 0.03
    direction_floor: float = 0.006
    face_sigma: float = 0.08
    _odometry: PoseHistory = field(default_factory=PoseHistory, init=False, repr=False)
    _last: Pose | None = field(default=None, init=False, repr=False)
    _rolled: Pose = field(default=Pose(0.0, 0.0, 0.0), init=False, repr=False)
    _origin: Pose = field(init=False, repr=False)
    _way: float = field(default=0.0, init=False, repr=False)
    _shadow: Array = field(init=False, repr=False)
    _hypotheses: list[Hypothesis] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("cell", "wall", "way_drift", "turn_drift", "direction_floor", "face_sigma"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a positive number, not {value}")
        self._origin, self._shadow = self.start, np.zeros(2)
        place, length, shadow = 0.02 * self.cell, _SHADOW_LENGTH * self.cell, _SHADOW_SIGMA * self.cell
        covariance = np.diag(np.square([place, place, 0.05, self.way_drift, shadow, shadow]))
        self._hypotheses = [
            Hypothesis(0.25, np.array([0.0, 0.0, 0.0, 0.0, east, north]), covariance)
            for east in (-length, length)
            for north in (-length, length)
        ]

    @property
    def sigma(self) -> Array:
        """Standard deviations (3,) of x and y (m) and yaw (rad)."""
        return np.sqrt(np.diag(whole(self._hypotheses).covariance)[:3])

    @property
    def shadow(self) -> Array:
        """From a wall to the edge of its shadow: (2,) m to the east and to the north, as learnt by now."""
        return self._shadow.copy()

    @property
    def pose(self) -> Pose | None:
        """Where the robot is by its latest odometry, in the maze; None before there is any."""
        return None if self._last is None else self._origin.then(self._rolled)

    def move(self, stamp_s: float, odometry: Pose) -> None:
        """Take in a pose that odometry tells."""
        if self._last is not None:
            step = self._last.inverse.then(odometry)
            longer = 1.0 + self._way
            self._grow(step)
            self._rolled = self._rolled.then(Pose(longer * step.x, longer * step.y, step.yaw))
        self._last = odometry
        self._odometry.add(stamp_s, self._rolled)

    def at(self, stamp_s: float) -> Pose | None:
        """Where the robot was at a time; None where odometry is missing."""
        told = self._odometry.at(stamp_s)
        return None if told is None else self._origin.then(told[0])

    def see_directions(self, stamp_s: float, directions: Array, sigma: Array, camera: Camera) -> None:
        """Put the yaw right by vanishing points.

        Args:
            stamp_s: of the picture, s.
            directions: (M, 3) unit vectors in the optical frame.
            sigma: (M,) their standard deviations, rad.
            camera: as it is mounted.
        """
        pose = self.at(stamp_s)
        if pose is None or not len(directions):
            return
        base = directions @ camera.optical_to_base.T
        level = np.abs(base[:, 2]) < 0.1
        off = -np.arctan2(base[level, 1], base[level, 0]) - pose.yaw
        off = np.mod(off + _QUARTER / 2, _QUARTER) - _QUARTER / 2
        variances = np.maximum(sigma[level], self.direction_floor) ** 2
        row = np.eye(6)[_YAW]
        told = 0.0
        for error, variance in zip(off, variances, strict=True):
            left = float(error) - told
            if left**2 > 16.0 * (whole(self._hypotheses).covariance[_YAW, _YAW] + variance):
                continue
            parts = [part.corrected(row, left, float(variance)) for part in self._hypotheses]
            told += self._believe(stamp_s, parts)[_YAW]

    def see_plan(self, stamp_s: float, plan: PlanView, eye: float, trust: float = 1.0) -> None:
        """Put the place right by the faces of walls in a plan of the floor.

        Args:
            stamp_s: of the picture, s.
            plan: in base_link.
            eye: of the camera ahead of base_link, m.
            trust: share of its usual weight.
        """
        pose = self.at(stamp_s)
        if pose is None:
            return
        found = faces(plan, pose, eye, self.reach or 2.0 * self.cell, self.cell, self.wall)
        told = np.zeros(2)
        for face in found:
            left = face.side * face.nearer - told[face.axis]
            variance = (self.face_sigma * self.cell) ** 2 / trust
            parts = [child for part in self._hypotheses for child in self._split(part, face, left, variance)]
            parts = reduced(parts, _MOST, _UNLIKELY, _ALIKE)
            told += self._believe(stamp_s, parts)[:2]

    def _split(self, part: Hypothesis, face: Face, error: float, variance: float) -> list[Hypothesis]:
        """What a hypothesis becomes where a face lies `error` (m) farther up its axis than believed."""
        spread = (_SPREAD * self.cell) ** 2
        number = _SHADOW + face.axis
        foot = np.eye(6)[face.axis]
        edge = foot - np.eye(6)[number]
        # of the lines of the grid that which is nearest to where the hypothesis has it
        own = error - part.off[face.axis]
        error -= self.cell * round(own / self.cell)
        own = error - part.off[face.axis]
        past_edge = error + float(self._shadow[face.axis])
        by_edge = part.corrected(edge, past_edge, variance)
        tip = float(self._shadow[face.axis] + by_edge.off[number])
        ahead = past_edge - float(edge @ part.off)
        likely = np.array(
            [
                _NEITHER / self.cell,
                _FOOT * _normal(own, part.covariance[face.axis, face.axis] + spread),
                # on the other side of walls there is no shadow to be seen
                _EDGE
                * _normal(ahead, float(edge @ part.covariance @ edge) + spread)
                * _below(face.side * tip, by_edge.covariance[number, number]),
            ]
        )
        if likely[2] < 0.5 * likely.sum():
            # what is likelier no edge must not teach where edges are: it would draw them to the feet of the walls
            by_edge = part.corrected(edge, past_edge, variance, learn=_PLACE)
        children = part, part.corrected(foot, error, variance), by_edge
        least = (_SHADOW_SPREAD * self.cell) ** 2
        split = []
        for child, weight in zip(children, likely.tolist(), strict=True):
            covariance = child.covariance.copy()
            for place in (_SHADOW, _SHADOW + 1):
                covariance[place, place] = max(covariance[place, place], least)
            split.append(Hypothesis(part.weight * weight, child.off, covariance))
        return split

    def _grow(self, step: Pose) -> None:
        """Grow the covariance by a step (m, in base_link) of odometry."""
        yaw = self._origin.yaw + self._rolled.yaw
        cos, sin = np.cos(yaw), np.sin(yaw)
        x, y = cos * step.x - sin * step.y, sin * step.x + cos * step.y
        forward = np.eye(6)
        forward[:2, _YAW], forward[:2, _WAY] = (-y, x), (x, y)
        # errors of a share add up while the robot goes on in one way: they grow with the way, not its root
        more = np.array([*[_SIDEWAYS * np.hypot(x, y)] * 2, self.turn_drift * abs(step.yaw)])
        most = np.array([_LOST * self.cell, _LOST * self.cell, _LOST])
        after = []
        for part in self._hypotheses:
            grown = forward @ part.covariance @ forward.T
            sigma = np.sqrt(np.diag(grown)[:3])
            grown[np.arange(3), np.arange(3)] = (sigma + more) ** 2
            less = np.ones(6)
            less[:3] = np.minimum(most / (sigma + more), 1.0)
            after.append(Hypothesis(part.weight, forward @ part.off, grown * np.outer(less, less)))
        self._hypotheses = after

    def _believe(self, stamp_s: float, parts: list[Hypothesis]) -> Array:
        """Believe the mean of what may be true; returns the change of the state (6,)."""
        mean = whole(parts).off
        self._hypotheses = [Hypothesis(part.weight, part.off - mean, part.covariance) for part in parts]
        self._shift(stamp_s, mean)
        return mean

    def _shift(self, stamp_s: float, shift: Array) -> None:
        """Change the state (6,); the pose is that of a time."""
        told = self._odometry.at(stamp_s)
        if told is None:
            return
        pose = Pose(*(np.array(self._origin.then(told[0])) + shift[:3]).tolist())
        self._origin = pose.then(told[0].inverse)
        self._way += float(shift[_WAY])
        self._shadow = self._shadow + shift[_SHADOW:]


def _normal(value: float, variance: float) -> float:
    """Density of a normal distribution about 0."""
    return math.exp(-0.5 * value**2 / variance) / math.sqrt(2.0 * math.pi * variance)


def _below(mean: float, variance: float) -> float:
    """Probability that something normally distributed is negative."""
    return 0.5 * (1.0 + math.erf(-mean / math.sqrt(2.0 * variance)))
