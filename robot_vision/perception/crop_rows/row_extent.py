# SPDX-License-Identifier: Apache-2.0
"""Where rows begin, have gaps and end: what stands along the way, gathered over all pictures that showed it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CELL_M = 0.25
"""Length of a stretch of way, m."""
_CELLS, _BEHIND = 200, 60
"""Stretches remembered, and how many of them behind the robot."""
_KNOWN = 0.25
"""A stretch that was looked at for less says nothing."""
_FARTHEST = 0.15
"""A stretch seen from nearer counts for more; the farthest ones for this much."""


@dataclass
class RowExtent:
    """Keeps how much of each stretch of the way is covered by rows, in the robot's own metres of way.

    What grows in rows counts for its row and against it between rows, so weeds and grass cancel and are no row.

    Args:
        gap: longest piece of the field without plants, m: rows that do not go on behind so much open ground
            have ended.
        sparse: share of the usual cover below which a stretch is open.

    Raises:
        ValueError: naming the setting that makes no sense.
    """

    gap: float = 4.0
    sparse: float = 0.3

    def __post_init__(self) -> None:
        if not (np.isfinite(self.gap) and self.gap >= 2 * CELL_M):
            raise ValueError(f"gap must be at least {2 * CELL_M:g} m, not {self.gap}")
        if not 0.0 < self.sparse < 1.0:
            raise ValueError(f"sparse must lie in (0, 1), not {self.sparse}")
        self.reset()

    def reset(self) -> None:
        """Forget the way so far."""
        self._cover = np.zeros(_CELLS)
        self._seen = np.zeros(_CELLS)
        self._origin = -_BEHIND

    def see(self, way: float, ahead: Array, cover: Array, seen: Array) -> None:
        """Take in a picture.

        Args:
            way: metres the robot has gone.
            ahead: (N,) distance of stretches ahead of the robot, m.
            cover: (N,) share of their ground that rows cover, from -1 to 1.
            seen: (N,) how much this picture can tell of each, 0 to 1.
        """
        gone = min(int(np.floor(way / CELL_M)) - _BEHIND - self._origin, _CELLS)
        if gone > 0:
            for kept in (self._cover, self._seen):
                kept[: _CELLS - gone] = kept[gone:]
                kept[_CELLS - gone :] = 0.0
            self._origin += gone
        place = np.floor((way + ahead) / CELL_M).astype(np.int64) - self._origin
        good = (place >= 0) & (place < _CELLS)
        np.add.at(self._cover, place[good], seen[good] * cover[good])
        np.add.at(self._seen, place[good], seen[good])

    def end(self, way: float) -> float | None:
        """Metres from the robot to where the rows end, negative behind it; None: no end is known.

        Stretches must have been looked at well, and so many of them be open that it is no gap.
        """
        known = self._seen > _KNOWN
        if not known.any():
            return None
        cover = self._cover / np.maximum(self._seen, 1e-9)
        # Single plants are missing everywhere: two stretches together are looked at
        cover = np.convolve(cover, [0.25, 0.5, 0.25], "same")
        stands = np.flatnonzero(known & (cover > self.sparse * self._usual(cover[known])))
        if not len(stands):
            return None
        behind = known[stands[-1] + 1 :]
        open_ground = int(np.argmin(behind)) if not behind.all() else len(behind)
        if open_ground * CELL_M < self.gap:
            return None
        return float((self._origin + stands[-1] + 1) * CELL_M - way)

    @staticmethod
    def _usual(cover: Array) -> float:
        """Cover of a stretch on which plants stand."""
        return max(float(np.quantile(cover, 0.85)), 1e-3)


def row_cover(
    x: Array, aside: Array, area: Array, spacing: float, half_width: float, near: float, far: float
) -> tuple[Array, Array, Array]:
    """Cover of the ground by rows, stretch by stretch ahead.

    Args:
        x: (N,) of bits of vegetation ahead of the robot, m.
        aside: (N,) of them to the left of the robot's row, m.
        area: (N,) of ground that each covers, m^2.
        spacing: between rows, m.
        half_width: ground to either side of the robot's row that counts, m.
        near: where the ground in view begins, m.
        far: where it ends, m.

    Returns:
        Distance ahead (m), cover (-1 to 1) and weight (0 to 1) of each stretch, (S,) each.
    """
    edges = np.arange(np.ceil(near / CELL_M), np.floor(far / CELL_M) + 0.5) * CELL_M
    middles = 0.5 * (edges[:-1] + edges[1:])
    inside = np.abs(aside) < half_width
    votes = area[inside] * np.cos(2.0 * np.pi * aside[inside] / spacing)
    summed, _ = np.histogram(x[inside], edges, weights=votes)
    weight = np.clip(1.5 - middles / far, _FARTHEST, 1.0)
    return middles, summed / (2.0 * half_width * CELL_M), weight
