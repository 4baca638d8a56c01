# SPDX-License-Identifier: Apache-2.0
"""Where a robot is among walls that stand on a square grid: odometry, put right by vanishing points and by walls."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.geometry.rotation import wrap_angle
from robot_vision.mapping.plan_view import FREE, OCCUPIED, PlanView
from robot_vision.mapping.pose import Pose, PoseHistory

Array = NDArray[np.float64]

_QUARTER = np.pi / 2
_NEARER, _FARTHER, _RAMP = 0.04, 0.08, 0.03
"""Cells by which a face may lie nearer or farther than believed and count in full, and over which it loses that: floor
may seem to end at the wall's shadow, and where it goes on past the end of a wall another one's face may be taken for
the same."""
_DOUBTED = 4.0
"""Factor on the deviation of faces beyond that."""


@dataclass
class GridPose:
    """Follows a robot through a maze of square cells (three Kalman filters: x, y and yaw).

    Vanishing points of the walls tell the yaw up to quarter turns. Where a plan of the floor shows faces of walls,
    these lie half a wall's thickness beside a line of the grid, which tells the place across them up to whole cells.
    Odometry, which drifts, tells which quarter and which cell.

    Args:
        start: where the robot is at its first odometry: x to the east, y to the north, m; yaw from east, rad.
        cell: side of a cell, m.
        wall: thickness of the walls, m.
        reach: how far walls are used, m; None: two cells.
        way_drift: standard deviation of odometry's way, share of it.
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
    way_drift: float = 0.03
    turn_drift: float = 0.03
    direction_floor: float = 0.006
    face_sigma: float = 0.08
    _odometry: PoseHistory = field(default_factory=PoseHistory, init=False, repr=False)
    _last: Pose | None = field(default=None, init=False, repr=False)
    _origin: Pose = field(init=False, repr=False)
    _variance: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("cell", "wall", "way_drift", "turn_drift", "direction_floor", "face_sigma"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a positive number, not {value}")
        self._variance = np.array([(0.02 * self.cell) ** 2, (0.02 * self.cell) ** 2, 0.05**2])

    @property
    def sigma(self) -> Array:
        """Standard deviations (3,) of x and y (m) and yaw (rad)."""
        return np.sqrt(self._variance)

    @property
    def pose(self) -> Pose | None:
        """Where the robot is by its latest odometry, in the maze; None before there is any."""
        return None if self._last is None else _composed(self._origin, self._last)

    def move(self, stamp_s: float, odometry: Pose) -> None:
        """Take in a pose that odometry tells."""
        if self._last is None:
            self._origin = _composed(self.start, _inverted(odometry))
        else:
            way = float(np.hypot(odometry.x - self._last.x, odometry.y - self._last.y))
            turn = abs(wrap_angle(odometry.yaw - self._last.yaw))
            # errors of a share add up while the robot goes on in one way: they grow with the way, not its root
            grown = self.sigma + np.array([self.way_drift * way] * 2 + [self.turn_drift * turn])
            self._variance = np.minimum(grown**2, [(0.3 * self.cell) ** 2] * 2 + [0.3**2])
        self._last = odometry
        self._odometry.add(stamp_s, odometry)

    def at(self, stamp_s: float) -> Pose | None:
        """Where the robot was at a time; None where odometry is missing."""
        told = self._odometry.at(stamp_s)
        return None if told is None else _composed(self._origin, told[0])

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
        for error, variance in zip(off, variances, strict=True):
            self._correct(stamp_s, 2, float(error), float(variance))

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
        ends = floor_ends(plan, eye, self.reach or 2.0 * self.cell)
        cos, sin = np.cos(pose.yaw), np.sin(pose.yaw)
        turned = ends @ np.array([[cos, sin], [-sin, cos]])
        for axis in (0, 1):
            for side in (-1.0, 1.0):
                short = self._face_error(turned, axis, side, pose)
                if short is not None:
                    sigma = self.face_sigma * self.cell * _doubt(short / self.cell)
                    self._correct(stamp_s, axis, side * short, sigma**2 / trust)

    def _face_error(self, ends: Array, axis: int, side: float, pose: Pose) -> float | None:
        """By how much the faces of walls across an axis lie nearer than the grid's lines; None without any.

        Args:
            ends: (K, 2) of the floor relative to the robot, turned into the maze, in the order of their bearing;
                nan where it does not end.
            axis: 0 or 1.
            side: of the robot where the faces are: 1 up the axis, -1 down it.
            pose: believed, of the robot.
        """
        step = np.full_like(ends, np.nan)
        step[2:-2] = ends[4:] - ends[:-4]
        with np.errstate(invalid="ignore"):
            across = (np.abs(step[:, axis]) < 0.25 * np.abs(step[:, 1 - axis])) & (
                np.abs(step[:, 1 - axis]) < 0.6 * self.cell
            )
            across &= ends[:, axis] * side > 0.0
        faces = ends[across, axis]
        if len(faces) < 5:
            return None
        lines = (faces + side * self.wall / 2 + (pose.x, pose.y)[axis]) / self.cell
        short = side * (np.round(lines) - lines) * self.cell
        middle = float(np.median(short))
        near = np.abs(short - middle) < 0.08 * self.cell
        if near.sum() < 5 or near.mean() < 0.5 or abs(middle) > 0.3 * self.cell:
            return None
        return float(short[near].mean())

    def _correct(self, stamp_s: float, axis: int, error: float, variance: float) -> None:
        """Take in a measurement of x (0), y (1) or yaw (2) that differs from what is believed by `error`."""
        told = self._odometry.at(stamp_s)
        believed = self._variance[axis]
        if told is None or error**2 > 16.0 * (believed + variance):
            return
        gain = believed / (believed + variance)
        self._variance[axis] = (1.0 - gain) * believed
        pose = _composed(self._origin, told[0])
        moved = np.array(pose)
        moved[axis] += gain * error
        self._origin = _composed(Pose(*moved.tolist()), _inverted(told[0]))


def _doubt(short: float) -> float:
    """Factor on the deviation of a face that lies `short` cells nearer than believed."""
    beyond = abs(short) - (_NEARER if short > 0.0 else _FARTHER)
    return 1.0 + (_DOUBTED - 1.0) * min(max(beyond / _RAMP, 0.0), 1.0)


def floor_ends(plan: PlanView, eye: float, reach: float, rays: int = 91) -> Array:
    """Where the floor ends in a plan, bearing by bearing from right to left; (rays, 2) m in base_link, nan where not.

    Args:
        plan: in base_link.
        eye: of the camera ahead of base_link, m.
        reach: farthest end looked for, m.
        rays: bearings from -45 to 45 degrees.
    """
    bearings = np.linspace(-np.pi / 4, np.pi / 4, rays)[:, None]
    ranges = np.arange(0.0, reach, plan.resolution / 4)
    x, y = eye + ranges * np.cos(bearings), ranges * np.sin(bearings)
    column = np.floor((x - plan.origin[0]) / plan.resolution).astype(np.int64)
    row = np.floor((y - plan.origin[1]) / plan.resolution).astype(np.int64)
    rows, columns = plan.cells.shape
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    cells = np.where(inside, plan.cells[np.where(inside, row, 0), np.where(inside, column, 0)], -1)
    taken, free = cells >= OCCUPIED, cells == FREE
    first = np.argmax(taken, axis=1)
    numbers = np.arange(len(ranges))
    last = np.max(np.where(free & (numbers < first[:, None]), numbers, -1), axis=1)
    # floor that was seen up to what ends it: else the end may be nearer than the picture's lower edge
    good = taken.any(axis=1) & (last >= 0) & (ranges[first] - ranges[last] < 2.5 * plan.resolution)
    end = np.where(good, (ranges[first] + ranges[last]) / 2, np.nan)[:, None]
    return np.concatenate([eye + end * np.cos(bearings), end * np.sin(bearings)], axis=1)


def _composed(first: Pose, then: Pose) -> Pose:
    """A pose told in the frame of another one, in the frame of that one."""
    cos, sin = np.cos(first.yaw), np.sin(first.yaw)
    return Pose(
        float(first.x + cos * then.x - sin * then.y),
        float(first.y + sin * then.x + cos * then.y),
        float(wrap_angle(first.yaw + then.yaw)),
    )


def _inverted(pose: Pose) -> Pose:
    cos, sin = np.cos(pose.yaw), np.sin(pose.yaw)
    return Pose(float(-cos * pose.x - sin * pose.y), float(sin * pose.x - cos * pose.y), float(-pose.yaw))
