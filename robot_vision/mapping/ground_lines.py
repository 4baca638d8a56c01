# SPDX-License-Identifier: Apache-2.0
"""Which of the lines towards the primary vanishing point lie on the floor, and at which of them the floor ends."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry.sphere import normalised
from robot_vision.mapping.boundary import Boundary
from robot_vision.mapping.ground_view import GroundView
from robot_vision.perception import LineSegments, Role, VanishingPoints

Array = NDArray[np.float64]
Scores = NDArray[np.float32]

_SAMPLES = 12


class LineKind(IntEnum):
    """What a line of the picture is to the plan of the floor."""

    IRRELEVANT = 0
    GROUND = 1
    BORDER = 2


@dataclass(frozen=True)
class GroundLines:
    """Sorts the lines of a picture.

    Only the primary vanishing point counts. A line that leads there lies on the floor if it lies below the horizon
    and has floor on a side; where it has floor on one side only, the floor ends at it. All others are irrelevant.

    Args:
        aside: greatest angle by which a line may miss the vanishing point, rad.
        beside: distance from a line at which its sides are looked at, working pixels.
        share: part of its length along which a side must be floor, or must not be.
        snap: distance over which the end of the floor is drawn to a border, working pixels.
    """

    aside: float = float(np.deg2rad(1.0))
    beside: float = 3.0
    share: float = 0.7
    snap: float = 2.5

    def sort(
        self, lines: LineSegments, points: VanishingPoints, score: Scores, view: GroundView
    ) -> NDArray[np.intp]:
        """Give a `LineKind` for each line (N,).

        Args:
            lines: of the picture, rectified pixels.
            points: its vanishing points.
            score: (H - view.top, W) positive for floor, of the working picture.
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
        left, right = self._sides(lines.endpoints[chosen] * view.scale, score, view.top)
        floor, none = self.share, 1.0 - self.share
        kinds[chosen[(left > floor) | (right > floor)]] = LineKind.GROUND
        kinds[chosen[((left > floor) & (right < none)) | ((right > floor) & (left < none))]] = LineKind.BORDER
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

    def _sides(self, ends: Array, score: Scores, top: int) -> tuple[Array, Array]:
        """Shares (N,) of the length of lines (N, 4) beside which floor lies, on either side."""
        part = np.linspace(0.1, 0.9, _SAMPLES)[:, None]
        u = ends[:, 0] + part * (ends[:, 2] - ends[:, 0])
        v = ends[:, 1] + part * (ends[:, 3] - ends[:, 1])
        along = np.hypot(ends[:, 2] - ends[:, 0], ends[:, 3] - ends[:, 1])
        across = np.stack([ends[:, 1] - ends[:, 3], ends[:, 2] - ends[:, 0]]) / np.maximum(along, 1e-6)
        height, width = score.shape
        shares = []
        for side in (-self.beside, self.beside):
            column = np.clip(np.round(u + side * across[0]), 0, width - 1).astype(int)
            row = np.clip(np.round(v + side * across[1]) - top, 0, height - 1).astype(int)
            shares.append(np.asarray((score[row, column] > 0.0).mean(axis=0)))
        return shares[0], shares[1]
