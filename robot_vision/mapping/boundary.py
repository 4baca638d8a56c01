# SPDX-License-Identifier: Apache-2.0
"""Where the floor before the robot ends, column by column: its continuity, examined in the picture itself."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping.ground_view import GroundView

Array = NDArray[np.float64]
Scores = NDArray[np.float32]
Mask = NDArray[np.bool_]


_SIDE = 2
"""Columns to either side over which the direction of the end of the floor is read."""


@dataclass(frozen=True)
class Boundary:
    """The end of the floor in each column of the working picture.

    Attributes:
        rows: (W,) row at which floor ends: what lies below is floor without a gap.
        ended: (W,) whether something stands there; else the floor goes on as far as can be told.
        distance: (W,) of the end, m from the camera over the floor.
        x, y: (W,) of the end, m in base_link.
        facing: (W,) sine of the angle under which the camera looks at the end of the floor: 1 for what faces it, near
            0 for what recedes along the ray, as the rim of a thing before what lies behind it does.
    """

    rows: Array
    ended: NDArray[np.bool_]
    distance: Array
    x: Array
    y: Array
    facing: Array

    @classmethod
    def at(cls, rows: Array, ended: NDArray[np.bool_], view: GroundView) -> Boundary:
        """The boundary at given rows (W,)."""
        x, y = view.ground(np.arange(len(rows), dtype=np.float64), rows)
        ahead = x - view.camera.x_m
        distance = np.hypot(ahead, y)
        return cls(rows, ended, distance, x, y, _facing(ahead, y, distance))


@dataclass(frozen=True)
class BoundaryFinder:
    """Goes up each column from the bottom until what it meets is no floor over the height of a least object.

    Args:
        least_height: of a thing worth the name, m; by (20.1) it covers y h / H rows at y rows below the horizon.
        least_width: of a thing worth the name, m: what is narrower is a joint of the floor.
        least_rows: fewer rows than this are noise wherever they lie, px.
        covered: share of the ground's rows which, without floor from the bottom of the picture on, need no edge.
        doubt: mean score below which those rows are no floor.
        median: columns over which a single one is outvoted; insignificant inconsistencies are 3 to 5 px.
        snake: rows by which the boundary may move to the edge it belongs to, px of the working picture.
        stiffness: cost of a bend of the boundary, as share of the strongest edge a row.
    """

    least_height: float = 0.07
    least_width: float = 0.035
    least_rows: int = 3
    covered: float = 0.25
    doubt: float = 0.2
    median: int = 5
    snake: int = 3
    stiffness: float = 0.12

    def find(
        self, score: Scores, hard: Mask, gray: NDArray[np.uint8], view: GroundView, reach: float
    ) -> Boundary:
        """Find the boundary.

        Args:
            score: (H - view.top, W) positive for floor.
            hard: (H - view.top, W) where an edge is near that a thing on the floor would have.
            gray: (H, W) the working picture, for the edge at the end of the floor.
            view: of the ground in it.
            reach: how far it is looked, m.
        """
        rows, columns = view.shape
        top = view.top
        last = self._last_rows(view, reach)
        first = self._first_gap(self._without_joints(score, view), hard, view)
        ended = first >= last
        place = np.where(ended, first, last).astype(np.float64)
        place = _median(place, self.median)
        ended = place >= last + 0.5
        moved = self._snap(place, gray, top)
        place = np.where(ended, np.maximum(moved, last), place)
        return Boundary.at(np.clip(place, top, rows - 1.0), ended, view)

    def _last_rows(self, view: GroundView, reach: float) -> Array:
        """Row (W,) of the floor at `reach` straight away from the camera in each column."""
        # Planes at one distance ahead are close enough to circles here; the plan measures exactly.
        columns = np.arange(view.shape[1], dtype=np.float64)
        rows = np.full(view.shape[1], float(view.shape[0] - 1))
        x0, y0 = view.ground(columns, rows)
        toward = np.arctan2(y0, x0 - view.camera.x_m)
        _, v = view.pixels(view.camera.x_m + reach * np.cos(toward), reach * np.sin(toward))
        return np.asarray(np.clip(v, view.top, view.shape[0] - 1))

    def _first_gap(self, score: Scores, hard: Mask, view: GroundView) -> NDArray[np.int64]:
        """Lowest row (W,) from which on upwards no floor is seen; the row above the part when there is none."""
        height, top = len(score), view.top
        below = np.arange(top, top + height) - float(view.horizon_rows.mean())
        tall = self.least_height / (view.camera.height_m or 1.0)
        need = np.clip(np.round(below * tall), self.least_rows, 12).astype(int)
        need = np.minimum(need, np.arange(1, height + 1))
        total = np.zeros((height + 1, score.shape[1]), np.float32)
        np.cumsum(score, axis=0, out=total[1:])
        index = np.arange(height)
        window = (total[index + 1] - total[index + 1 - need]) / need[:, None]
        gap = (window < self.doubt) & (score < self.doubt) & (hard | self._from_below(score))
        gap[: self.least_rows] = False
        lowest = height - 1 - np.argmax(gap[::-1], axis=0)
        return np.where(gap.any(axis=0), top + lowest, top - 1)

    def _without_joints(self, score: Scores, view: GroundView) -> Scores:
        """The score with what is narrower than a thing closed: joints between stones run up the picture for long."""
        closed = score.copy()
        below = np.arange(view.top, view.top + len(score)) - float(view.horizon_rows.mean())
        widths = np.round(below * self.least_width / (view.camera.height_m or 1.0)).astype(int)
        for width in range(2, int(widths.max()) + 1, 2):
            band = np.flatnonzero((widths == width) | (widths == width + 1))
            if len(band):
                part = slice(int(band[0]), int(band[-1]) + 1)
                closed[part] = cv2.morphologyEx(
                    score[part], cv2.MORPH_CLOSE, np.ones((1, width + 1), np.uint8)
                )
        return closed

    def _from_below(self, score: Scores) -> Mask:
        """The lowest rows (H, W) of columns that begin without floor: the foot of what stands there is below them.

        What is shorter than that is the glare of a lamp.
        """
        height = len(score)
        part = max(round(self.covered * height), 1)
        bare = (score[height - part :] < self.doubt).all(axis=0)
        rows = np.zeros(score.shape, bool)
        rows[height - part :, bare] = True
        return rows

    def _snap(self, place: Array, gray: NDArray[np.uint8], top: int) -> Array:
        """Move the boundary to the edge near it as one line: strong edge and few bends, weighed against each other."""
        from robot_vision.mapping.contour import contour  # numba: slow to import

        reach = self.snake
        edge = np.abs(cv2.Scharr(gray, cv2.CV_16S, 0, 1))
        offsets = np.arange(-reach, reach + 1)
        base = np.round(place).astype(int)
        rows = np.clip(base[:, None] + offsets, top + 1, gray.shape[0] - 2)
        columns = np.arange(len(place))[:, None]
        strength = edge[rows, columns].astype(np.float32) / np.float32(32.0)
        cost = -np.minimum(strength, 12.0) / 12.0 + 0.03 * np.abs(offsets)
        bend = self.stiffness * np.abs(offsets[:, None] - offsets[None, :]).astype(np.float32)
        # Where another thing begins nothing holds the two ends together.
        broken = np.abs(np.diff(base)) > 2 * reach
        chosen = contour(cost, bend, broken)
        moved = rows[np.arange(len(place)), chosen]
        return self._subpixel(edge, moved)

    @staticmethod
    def _subpixel(edge: NDArray[np.int16], rows: NDArray[np.int64]) -> Array:
        """Vertex of the parabola through the edge strengths about each row."""
        columns = np.arange(len(rows))
        low, mid, high = (edge[rows + d, columns] / 32.0 for d in (-1, 0, 1))
        curve = low - 2.0 * mid + high
        shift = np.where(curve < -1e-3, 0.5 * (low - high) / np.minimum(curve, -1e-3), 0.0)
        return np.asarray(rows + np.clip(shift, -0.5, 0.5))


def _facing(ahead: Array, left: Array, distance: Array) -> Array:
    """Sine of the angle between ray and end of the floor (W,), over two columns to either side."""
    before, after = (_neighbours(len(ahead), side) for side in (-_SIDE, _SIDE))
    along_x, along_y = (part[after] - part[before] for part in (ahead, left))
    across = np.abs(ahead * along_y - left * along_x)
    return np.asarray(across / np.maximum(distance * np.hypot(along_x, along_y), 1e-9))


def _median(values: Array, width: int) -> Array:
    """Running median of an odd width."""
    if width < 3:
        return values
    half = width // 2
    windows = np.stack([values[_neighbours(len(values), side)] for side in range(-half, half + 1)])
    return np.asarray(np.sort(windows, axis=0)[half])


def _neighbours(count: int, side: int) -> NDArray[np.intp]:
    """Numbers (N,) of the columns so many to the right of each; the outermost one where there is none."""
    return np.clip(np.arange(side, count + side), 0, count - 1)
