# SPDX-License-Identifier: Apache-2.0
"""Which of the lines towards the primary vanishing point lie on the floor, and at which of them the floor ends."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry.sphere import normalised
from robot_vision.mapping.beside_lines import RIM, Beside
from robot_vision.mapping.boundary import Boundary
from robot_vision.mapping.ground_view import GroundView
from robot_vision.perception import LineSegments, Role, VanishingPoints

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Scores = NDArray[np.float32]


class LineKind(IntEnum):
    """What a line of the picture is to the plan of the floor."""

    IRRELEVANT = 0
    GROUND = 1
    BORDER = 2


@dataclass(frozen=True)
class Borders:
    """Pieces of lines at which the floor ends.

    Attributes:
        ends: (M, 4) u1, v1, u2, v2, working pixels.
        away: (M,) side that is no floor: -1 left, +1 right.
    """

    ends: Array
    away: Array

    @classmethod
    def none(cls) -> Borders:
        """No piece."""
        return cls(np.zeros((0, 4)), np.zeros(0))

    @classmethod
    def along(cls, ends: Array, stops: Mask) -> Borders:
        """The runs of marked sections (2, N, sections), of the left and right sides of lines (N, 4)."""
        sections = stops.shape[2]
        outside = np.int8(0)
        change = np.diff(stops.astype(np.int8), axis=2, prepend=outside, append=outside)
        side, line, first = np.nonzero(change == 1)
        last = np.nonzero(change == -1)[2]
        if not len(line):
            return cls.none()
        a, b = ends[line, :2], ends[line, 2:]
        pieces = [a + (part / sections)[:, None] * (b - a) for part in (first, last)]
        return cls(np.concatenate(pieces, axis=1), np.where(side == 0, -1.0, 1.0))

    def joined(self, other: Borders) -> Borders:
        """These and those of another."""
        return Borders(np.concatenate([self.ends, other.ends]), np.concatenate([self.away, other.away]))


@dataclass(frozen=True)
class GroundLines:
    """Sorts the lines of a picture.

    Only the primary vanishing point counts. A line that leads there lies on the floor if it lies below the horizon
    and has floor on a side. Where it has floor on one side and, along most of it, clearly less of it on the other, the
    floor ends at it. All other lines are irrelevant.

    Args:
        aside: greatest angle by which a line may miss the vanishing point, rad.
        strip: distance from a line of the strips of ground on its sides that are looked at, from and to, m.
        step: difference of the mean score of these strips that makes a line a border.
        doubtful: mean score of the worse one above which it is floor whatever the other one is.
        along: share of its sections in which a border must be one.
        shortest: length of a line that can be a border, working pixels: a thing beside a joint blurs what lies about it
            over some ten of them.
        snap: distance over which the end of the floor is drawn to a border, working pixels.
    """

    aside: float = float(np.deg2rad(1.0))
    strip: tuple[float, float] = (0.03, 0.16)
    step: float = 0.9
    doubtful: float = 1.8
    along: float = 0.7
    shortest: float = 20.0
    snap: float = 2.5

    def sort(
        self,
        lines: LineSegments,
        points: VanishingPoints,
        score: Scores,
        dim: Mask,
        view: GroundView,
    ) -> tuple[NDArray[np.intp], Borders]:
        """Give a `LineKind` for each line (N,), and the pieces at which the floor ends.

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
            return kinds, Borders.none()
        direction = points.directions[primary]
        chosen = self._leading(lines, direction, view)
        if not len(chosen):
            return kinds, Borders.none()
        shift = (view.scale - 1.0) / 2.0
        ends = lines.endpoints[chosen] * view.scale + shift
        vanishing = view.camera.pixels(direction[None])[0] * view.scale + shift
        near = Beside(ends, view, vanishing, self.strip).means(score)
        floor = np.nanmax(near, axis=(0, 2), initial=-np.inf) > 0.0
        kinds[chosen[floor]] = LineKind.GROUND
        ends, near = ends[floor], near[:, floor]
        rim = Beside(ends, view, vanishing, RIM)
        stops = self._stops(near, rim.means(score), rim.means(dim.astype(np.float32)) < 0.4)
        stops &= (np.hypot(*(ends[:, 2:] - ends[:, :2]).T) >= self.shortest)[:, None]
        kinds[chosen[floor][stops.any(axis=(0, 2))]] = LineKind.BORDER
        return kinds, Borders.along(ends, stops)

    def _leading(self, lines: LineSegments, direction: Array, view: GroundView) -> NDArray[np.intp]:
        """Numbers of the lines that lead to the vanishing point and lie below the horizon from end to end."""
        camera = view.camera
        ends = [camera.rays(lines.endpoints[:, k : k + 2]) for k in (0, 2)]
        normal = normalised(np.cross(ends[0], ends[1]))
        leads = np.abs(normal @ direction) < np.sin(self.aside)
        up = camera.optical_to_base[2]
        return np.flatnonzero(leads & (np.maximum(ends[0] @ up, ends[1] @ up) < -0.02))

    def _stops(self, near: Array, rim: Array, lit: Mask) -> Mask:
        """Sections (2, N, sections) to whose left or right there is clearly less floor."""
        less = near[::-1] - near
        known = np.isfinite(less)
        here = known & (near[::-1] > 0.0) & (less > self.step)
        here &= (rim < -0.5) | ((near < self.doubtful) & lit)
        # A thing that stands on a joint of the floor hides a part of it; where the floor ends it does along all of it.
        share = here.sum(axis=2) / np.maximum(known.sum(axis=2), 1)
        return np.asarray(known & (share > self.along)[..., None])

    def straighten(self, boundary: Boundary, borders: Borders, view: GroundView) -> Boundary:
        """Draw the end of the floor to the borders that run close to it."""
        if not len(borders.ends):
            return boundary
        rows = boundary.rows.copy()
        columns = np.arange(len(rows))
        nearest = np.full(len(rows), self.snap)
        for u1, v1, u2, v2 in borders.ends:
            if abs(u2 - u1) < 2.0:
                continue
            over = (columns >= min(u1, u2)) & (columns <= max(u1, u2)) & boundary.ended
            line = v1 + (columns - u1) * (v2 - v1) / (u2 - u1)
            off = np.abs(line - boundary.rows)
            closer = over & (off < nearest)
            rows[closer] = line[closer]
            nearest[closer] = off[closer]
        return Boundary.at(rows, boundary.ended, view)

    def cut(self, borders: Borders, shape: tuple[int, ...], view: GroundView) -> Mask:
        """Strips (H - view.top, W) along the borders on the side that is no floor.

        A low kerb of the floor's own colour is told by its whole length at once, where single pixels cannot tell.
        """
        strips = np.zeros(shape, np.uint8)
        for (u1, v1, u2, v2), side in zip(borders.ends, borders.away, strict=True):
            reach = side * self.strip[1] * _per_metre(np.array([u1, u2]), np.array([v1, v2]), view)
            corners = [(u1, v1), (u2, v2), (u2 + reach[1], v2), (u1 + reach[0], v1)]
            outline = np.round(np.array(corners) - (0.0, view.top)).astype(np.int32)
            cv2.fillPoly(strips, [outline], 1)
        return strips.astype(bool)


def _per_metre(u: Array, v: Array, view: GroundView) -> Array:
    """Pixels that a metre across the way covers on the ground at pixels (u, v): y / H (20.3)."""
    slope = (view.horizon_rows[-1] - view.horizon_rows[0]) / (len(view.horizon_rows) - 1)
    below = v - (view.horizon_rows[0] + slope * u)
    return np.asarray(np.maximum(below, 0.0) / (view.camera.height_m or 1.0))
