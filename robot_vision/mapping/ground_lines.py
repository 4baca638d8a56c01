# SPDX-License-Identifier: Apache-2.0
"""Which of the lines towards the primary vanishing point lie on the floor, and at which of them the floor ends."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry.sphere import normalised
from robot_vision.mapping.boundary import Boundary
from robot_vision.mapping.ground_view import GroundView
from robot_vision.perception import LineSegments, Role, VanishingPoints

Array = NDArray[np.float64]
Scores = NDArray[np.float32]

_SAMPLES, _ACROSS = 24, 5
_RIM = (0.02, 0.07)
"""Strip beside a line that a shadow's edge has in shadow, m: a shadow need not be wider."""


class LineKind(IntEnum):
    """What a line of the picture is to the plan of the floor."""

    IRRELEVANT = 0
    GROUND = 1
    BORDER = 2


@dataclass(frozen=True)
class GroundLines:
    """Sorts the lines of a picture.

    Only the primary vanishing point counts. A line that leads there lies on the floor if it lies below the horizon
    and has floor on a side; where it has floor on one side and clearly less of it on the other, the
    floor ends at it. All others are irrelevant.

    Args:
        aside: greatest angle by which a line may miss the vanishing point, rad.
        strip: distance from a line of the strips of ground on its sides that are looked at, from and to, m.
        step: difference of the mean score of these strips that makes a line a border.
        doubtful: mean score of the worse one above which it is floor whatever the other one is.
        snap: distance over which the end of the floor is drawn to a border, working pixels.
        kerbs: whether floor may end at a border where nothing else tells so.
    """

    aside: float = float(np.deg2rad(1.0))
    strip: tuple[float, float] = (0.03, 0.16)
    step: float = 0.9
    doubtful: float = 1.8
    snap: float = 2.5
    kerbs: bool = True

    def sort(
        self,
        lines: LineSegments,
        points: VanishingPoints,
        score: Scores,
        dim: NDArray[np.bool_],
        view: GroundView,
    ) -> NDArray[np.intp]:
        """Give a `LineKind` for each line (N,).

        Args:
            lines: of the picture, rectified pixels.
            points: its vanishing points.
            score: (H - view.top, W) positive for floor, of the working picture.
            dim: (H - view.top, W) what has the colour of floor in shadow: a shadow's edge is no border.
            view: of the ground in the working picture.
        """
        kinds = np.zeros(len(lines), np.intp)
        primary = points.of(Role.PRIMARY)
        if primary is None or not len(lines):
            return kinds
        direction = points.directions[primary]
        camera = view.camera
        ends = [camera.rays(lines.endpoints[:, k : k + 2]) for k in (0, 2)]
        normal = normalised(np.cross(ends[0], ends[1]))
        leads = np.abs(normal @ direction) < np.sin(self.aside)
        up = camera.optical_to_base[2]
        below = np.maximum(ends[0] @ up, ends[1] @ up) < -0.02  # all of it: no line above can be floor
        chosen = np.flatnonzero(leads & below)
        if not len(chosen):
            return kinds
        ends_px = lines.endpoints[chosen] * view.scale + (view.scale - 1.0) / 2.0
        left, right = self._sides(ends_px, score, view, self.strip)
        floor = np.fmax(left, right) > 0.0
        step = np.abs(left - right) > self.step
        worse = np.fmin(left, right)
        dark = np.where(left < right, *self._sides(ends_px, dim.astype(np.float32), view, _RIM))
        rim = np.where(left < right, *self._sides(ends_px, score, view, _RIM))
        ends_here = (rim < -0.5) | ((worse < self.doubtful) & (dark < 0.4))
        kinds[chosen[floor]] = LineKind.GROUND
        kinds[chosen[floor & step & ends_here]] = LineKind.BORDER
        return kinds

    def straighten(self, boundary: Boundary, ends: Array, view: GroundView) -> Boundary:
        """Draw the end of the floor to the borders (N, 4), rectified pixels, that run close to it."""
        rows = boundary.rows.copy()
        columns = np.arange(len(rows))
        nearest = np.full(len(rows), self.snap)
        shift = (view.scale - 1.0) / 2.0
        for u1, v1, u2, v2 in ends * view.scale + shift:
            if abs(u2 - u1) < 2.0:
                continue
            over = (columns >= min(u1, u2)) & (columns <= max(u1, u2)) & boundary.ended
            line = v1 + (columns - u1) * (v2 - v1) / (u2 - u1)
            off = np.abs(line - boundary.rows)
            closer = over & (off < nearest)
            rows[closer] = line[closer]
            nearest[closer] = off[closer]
        return Boundary.at(rows, boundary.ended, view)

    def cut(
        self, lines: LineSegments, kinds: NDArray[np.intp], score: Scores, view: GroundView
    ) -> NDArray[np.bool_]:
        """Strips (H - view.top, W) along the borders on the side that is no floor.

        A low kerb of the floor's own colour is told by its whole length at once, where single pixels cannot tell.
        """
        strips = np.zeros(score.shape, np.uint8)
        chosen = np.flatnonzero(kinds == LineKind.BORDER)
        if not len(chosen) or not self.kerbs:
            return strips.astype(bool)
        ends = lines.endpoints[chosen] * view.scale + (view.scale - 1.0) / 2.0
        left, right = self._sides(ends, score, view, self.strip)
        away = np.where(left < right, -1.0, 1.0)
        for (u1, v1, u2, v2), side in zip(ends, away, strict=True):
            reach = [side * self.strip[1] * self._per_metre(u, v, view) for u, v in ((u1, v1), (u2, v2))]
            corners = [(u1, v1), (u2, v2), (u2 + reach[1], v2), (u1 + reach[0], v1)]
            outline = np.round(np.array(corners) - (0.0, view.top)).astype(np.int32)
            cv2.fillPoly(strips, [outline], 1)
        return strips.astype(bool)

    def _sides(
        self, ends: Array, score: Scores, view: GroundView, strip: tuple[float, float]
    ) -> tuple[Array, Array]:
        """Mean score (N,) of the strips of ground to the left and to the right of lines (N, 4), working pixels."""
        part = np.linspace(0.05, 0.95, _SAMPLES)[:, None]
        u = ends[:, 0] + part * (ends[:, 2] - ends[:, 0])
        v = ends[:, 1] + part * (ends[:, 3] - ends[:, 1])
        scale = self._per_metre(u, v, view)
        height, width = score.shape
        row = np.round(v - view.top).astype(int)
        means = []
        for side in (-1.0, 1.0):
            places = u + side * np.linspace(*strip, _ACROSS)[:, None, None] * scale
            column = np.round(places).astype(int)
            inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
            values = score[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
            count = inside.sum(axis=(0, 1))
            # Beside the picture nothing is known: such a side is like the other one.
            mean = np.where(inside, values, 0.0).sum(axis=(0, 1)) / np.maximum(count, 1)
            means.append(np.where(count >= _SAMPLES, mean, np.nan))
        left, right = means
        return np.where(np.isnan(left), right, left), np.where(np.isnan(right), left, right)

    @staticmethod
    def _per_metre(u: Any, v: Any, view: GroundView) -> Any:
        """Pixels that a metre across the way covers on the ground at pixels (u, v): y / H (20.3)."""
        slope = (view.horizon_rows[-1] - view.horizon_rows[0]) / (len(view.horizon_rows) - 1)
        below = v - (view.horizon_rows[0] + slope * u)
        return np.maximum(below, 0.0) / (view.camera.height_m or 1.0)


TALL_ONLY = GroundLines(kerbs=False)
"""Takes joints between slabs for no kerbs: for floors on which all that stands is tall."""
