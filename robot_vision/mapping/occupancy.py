# SPDX-License-Identifier: Apache-2.0
"""The map of the floor in odom: log-odds of each cell over all pictures, with what was never seen unknown."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry.rotation import wrap_angle
from robot_vision.mapping.plan_view import DOUBTFUL, FREE, OCCUPIED, UNKNOWN, PlanView, Seen
from robot_vision.mapping.pose import Pose

LogOdds = NDArray[np.float32]


@dataclass
class OccupancyMap:
    """A window of the floor that goes with the robot (Moravec and Elfes 1985, in log-odds).

    What the robot leaves farther behind than half the window is forgotten, so that memory and the time a picture
    takes stay the same however far it drives.

    Args:
        size: side of the window, m.
        resolution: side of a cell, m.
        free, taken: log-odds that a picture adds at short distance.
        near: distance at which a picture counts half of that, m: farther off it sees worse.
        limit: greatest amount of the log-odds: what changes must be seen to change.
        known: log-odds below which a cell is unknown.
        moved: way (m) or turn (rad) after which a picture tells something new: the same view counts once.
        about: distance from the robot within which the floor begins that all free floor must hang together with, m.
    """

    size: float = 40.0
    resolution: float = 0.05
    free: float = 0.35
    taken: float = 0.6
    near: float = 3.0
    limit: float = 4.0
    known: float = 0.6
    moved: tuple[float, float] = (0.02, 0.02)
    about: float = 2.0
    _last: Pose | None = field(default=None, init=False, repr=False)
    _odds: LogOdds = field(init=False, repr=False)
    _corner: NDArray[np.int64] | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("size", "resolution", "free", "taken", "near", "limit", "known"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a positive number, not {value}")
        if self.size < 20 * self.resolution:
            raise ValueError(
                f"size must be 20 cells or more, not {self.size:g} m of {self.resolution:g} m cells"
            )
        self._side = round(self.size / self.resolution)
        self._odds = np.zeros((self._side, self._side), np.float32)

    def reset(self) -> None:
        """Forget everything."""
        self._odds[:] = 0.0
        self._corner = None
        self._last = None

    @property
    def nbytes(self) -> int:
        """Memory that the cells take, bytes."""
        return self._odds.nbytes

    @property
    def empty(self) -> bool:
        """Whether nothing has been seen yet."""
        return self._corner is None

    def update(self, seen: Seen, pose: Pose, trust: float = 1.0) -> None:
        """Take in one picture, unless the robot stands where the last one was taken.

        Args:
            seen: what it says, in base_link.
            pose: of base_link in odom.
            trust: share of its usual weight.
        """
        if self._last is not None:
            way = np.hypot(pose.x - self._last.x, pose.y - self._last.y)
            if way < self.moved[0] and abs(wrap_angle(pose.yaw - self._last.yaw)) < self.moved[1]:
                return
        self._last = pose
        corner = self._move(pose)
        rows, columns = self._rectangle(seen, pose, corner)
        y = ((np.arange(rows.start, rows.stop) + corner[1] + 0.5) * self.resolution - pose.y)[:, None]
        x = (np.arange(columns.start, columns.stop) + corner[0] + 0.5) * self.resolution - pose.x
        cos, sin = np.cos(pose.yaw), np.sin(pose.yaw)
        ahead, left = (cos * x + sin * y), (cos * y - sin * x)
        cells = seen.at(ahead, left)
        known = cells != UNKNOWN
        told = cells[known]
        weight = trust / (1.0 + (np.hypot(ahead[known], left[known]) / self.near) ** 2)
        old = self._odds[rows, columns][known]
        new = old + np.where(told == FREE, -self.free, self.taken) * weight
        # What ends somewhere about here speaks against free floor, but for nothing in its place.
        new = np.where(told == DOUBTFUL, np.minimum(new, np.maximum(old, 0.0)), new)
        self._odds[rows, columns][known] = np.clip(new, -self.limit, self.limit)

    def odds(self, x: NDArray[np.floating], y: NDArray[np.floating]) -> LogOdds:
        """Log-odds of being taken of points x, y (m) in odom, 0 for unknown ones, in their shape."""
        if self._corner is None:
            return np.zeros(np.shape(x), np.float32)
        column = np.floor(np.asarray(x) / self.resolution).astype(np.int64) - self._corner[0]
        row = np.floor(np.asarray(y) / self.resolution).astype(np.int64) - self._corner[1]
        inside = (column >= 0) & (column < self._side) & (row >= 0) & (row < self._side)
        values = self._odds[np.where(inside, row, 0), np.where(inside, column, 0)]
        return np.where(inside, values, np.float32(0.0))

    def grid(self) -> PlanView | None:
        """The map as cells 0, 100 and -1 with its origin in odom, cut to what has been seen; None before that."""
        if self._corner is None:
            return None
        cells = np.full(self._odds.shape, UNKNOWN, np.int8)
        cells[self._odds > self.known] = OCCUPIED
        cells[self._open_floor(self._odds < -self.known)] = FREE
        rows, columns = (np.flatnonzero((cells != UNKNOWN).any(axis=axis)) for axis in (1, 0))
        if not len(rows):
            return None
        cut = cells[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        low = (self._corner + (columns[0], rows[0])) * self.resolution
        return PlanView(np.ascontiguousarray(cut), self.resolution, (float(low[0]), float(low[1])))

    def _open_floor(self, free: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """What of the free cells hangs together with the floor about the robot, by more than two cells everywhere.

        What lies behind a kerb or a fence looks like floor, too, in pictures that do not show the fence well.
        """
        if self._last is None or self._corner is None:
            return free
        wide = cv2.morphologyEx(free.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
        count, found = cv2.connectedComponents(wide, connectivity=4)
        here = (
            np.floor(np.array([self._last.x, self._last.y]) / self.resolution).astype(np.int64) - self._corner
        )
        reach = round(self.about / self.resolution)
        low, high = np.maximum(here - reach, 0), here + reach + 1
        near = np.unique(found[low[1] : high[1], low[0] : high[0]])
        near = near[near > 0]
        if not len(near):
            return free
        mine = near[np.argmax(np.bincount(found.ravel(), minlength=count)[near])]
        return np.asarray(
            free & (cv2.dilate((found == mine).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0)
        )

    def _move(self, pose: Pose) -> NDArray[np.int64]:
        """Bring the window to the robot when it has come half way to its edge; returns the corner's cell."""
        here = np.floor(np.array([pose.x, pose.y]) / self.resolution).astype(np.int64)
        middle = here - self._side // 2
        if self._corner is None:
            self._corner = middle
            return self._corner
        shift = middle - self._corner
        if np.abs(shift).max() <= self._side // 4:
            return self._corner
        moved = np.zeros_like(self._odds)
        if np.abs(shift).max() < self._side:
            kept = [slice(max(s, 0), self._side + min(s, 0)) for s in shift]
            place = [slice(max(-s, 0), self._side + min(-s, 0)) for s in shift]
            moved[place[1], place[0]] = self._odds[kept[1], kept[0]]
        self._odds, self._corner = moved, middle
        return self._corner

    def _rectangle(self, seen: Seen, pose: Pose, corner: NDArray[np.int64]) -> tuple[slice, slice]:
        """Rows and columns of the cells that the picture can say something of."""
        view = seen.view
        columns = np.array([0.0, view.shape[1] - 1.0])
        x0, y0 = view.ground(columns, np.full(2, view.shape[0] - 1.0))
        toward = np.arctan2(y0, x0 - view.camera.x_m)
        reach = min(seen.reach, float(np.nanmax(seen.boundary.distance)) + seen.thickness)
        angles = np.linspace(toward.min(), toward.max(), 9)
        far = np.stack([view.camera.x_m + reach * np.cos(angles), reach * np.sin(angles), np.ones(9)])
        near = np.stack([x0, y0, np.ones(2)])
        places = pose.matrix @ np.concatenate([far, near], axis=1)
        low = np.floor(places[:2].min(axis=1) / self.resolution).astype(np.int64) - corner
        high = np.ceil(places[:2].max(axis=1) / self.resolution).astype(np.int64) - corner
        low, high = np.clip(low, 0, self._side), np.clip(high, 0, self._side)
        return slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0]))
