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
_KNOWN = 2.0
"""A stretch that was looked at for less says nothing: the lean of a single picture may be wrong by metres far ahead."""
ALONE = 8.0
"""Factor on what a picture can tell that has to speak for itself."""
_WEIGHTS = np.array([0.25, 0.5, 0.25])
_OPEN = 0.15
"""Share of the cover of rows before it that open ground has at most, all in all."""
_GOES_ON = 0.5
"""Share of the usual cover from which on rows go on, however little stands before: thin rows, a gap, dense ones."""
_TAIL = 3
"""So many stretches of open ground may still hold the last plants of rows."""
_NEARBY_M = 2.0
"""For the last plants a picture counts the less the farther off it shows them, from here on: few or small ones are
not all seen from afar."""
_LAST, _BEFORE = 4, 8
"""Stretches that make up the last metre of rows, and those before it that tell how densely it is sown."""
_GROWN = 0.2
"""Share of the usual cover from which on a stretch is grown over, be it by small plants."""
_LEAST_DENSE = 0.5
"""Rows are sown at least so densely, as a share of the usual cover."""
_NEAR_M, _ENOUGH = 3.0, 6
"""Ground before the robot, and stretches of it, that tell what is usual."""
_IN_ROWS = 0.35
"""Share of what grows that must stand in rows for these to be believed to lie aside: weeds lie somewhere, too."""
_SIGMAS = 3.0
"""Rows may lie so many standard deviations beside where they are known to."""
_ANYWHERE = np.diag([1e3, 0.0, 0.0])
"""Covariance of rows that may lie anywhere."""
_PARTED, _THIN = 6, 0.3
"""Stretches of open ground that part rows, and the share of the usual cover that open ground has at most."""
_ABOUT = 9
"""Stretches that tell together where rows lie: fewer, and weeds would be taken for rows."""


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
        self._sums = np.zeros((4, _CELLS))
        self._cover, self._seen, self._near_cover, self._near_seen = self._sums
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
            self._sums[:, : _CELLS - gone] = self._sums[:, gone:]
            self._sums[:, _CELLS - gone :] = 0.0
            self._origin += gone
        place = np.floor((way + ahead) / CELL_M).astype(np.int64) - self._origin
        good = (place >= 0) & (place < _CELLS)
        nearly = seen * _NEARBY_M / np.maximum(ahead, _NEARBY_M)
        for total, part in zip(self._sums, (seen * cover, seen, nearly * cover, nearly), strict=True):
            np.add.at(total, place[good], part[good])

    def is_open(self, way: float, ahead: Array) -> NDArray[np.bool_]:
        """Whether places so far ahead of the robot (N,), m, are known to be open ground: what grows there is weed."""
        known = self._seen > _KNOWN
        if not known.any():
            return np.zeros(len(ahead), np.bool_)
        cover = self._mean_cover(known)
        bare = known & (cover < self.sparse * self._usual(cover, known, way))
        place = np.floor((way + ahead) / CELL_M).astype(np.int64) - self._origin
        return np.asarray(bare[np.clip(place, 0, _CELLS - 1)])

    def end(self, way: float, reach: float = 0.0) -> float | None:
        """Metres from the robot to where the rows end, negative behind it; None: no end is known.

        It is before the first ground that was looked at all along, is as long as no gap may be, and on which next to
        nothing stands in rows. What grows behind that, such as the grass of a meadow, is of no account.

        Args:
            way: metres the robot has gone.
            reach: of leaves beyond the last stems, m, where the crop closes: from within, leaves upon leaves cover no
                more, so its end is not told by their amount.
        """
        known = self._seen > _KNOWN
        if not known.any():
            return None
        cover = self._mean_cover(known)
        usual = self._usual(cover, known, way)
        stands = np.flatnonzero(known & (cover > self.sparse * usual))
        length = int(np.ceil(self.gap / CELL_M))
        if not len(stands) or stands[0] + length + 1 >= _CELLS:
            return None
        begins = np.arange(stands[0] + 1, _CELLS - length)
        looked_at = np.concatenate([[0], np.cumsum(known)])
        covered = np.concatenate([[0.0], np.cumsum(cover)])
        is_open = looked_at[begins + length] - looked_at[begins] == length
        # Open is what grows far less than the rows before it: those behind a gap may be denser
        before = np.maximum(begins - _BEFORE, 0)
        dense = (covered[begins] - covered[before]) / np.maximum(looked_at[begins] - looked_at[before], 1)
        dense = np.clip(dense, self.sparse * usual, usual)
        is_open &= covered[begins + length] - covered[begins] < _OPEN * dense * length
        go_on = np.concatenate([[0], np.cumsum(cover > _GOES_ON * usual)])
        is_open &= go_on[begins + length] == go_on[begins + _TAIL]
        if not is_open.any():
            return None
        first = int(begins[is_open.argmax()])
        last = int(stands[stands < first + _TAIL].max())
        return float((self._origin + self._sown_until(last + 1, known, usual)) * CELL_M - reach - way)

    def _sown_until(self, leaves_until: int, known: NDArray[np.bool_], usual: float) -> float:
        """Where the stems end, in stretches, when the last leaves end before stretch `leaves_until`.

        The middle of two answers whose errors go opposite ways: the last metre of rows is as long as what grows there,
        were it to stand as densely as in the metres before, which is too short where the last plants are small; and
        rows end with the last stretch that is grown over at all, which is too long as leaves reach beyond the last
        stems and tall ones are seen farther off than they are.
        """
        cover = self._near_cover / np.maximum(self._near_seen, 1e-9)
        begin = max(leaves_until - _LAST, 0)
        before = slice(max(begin - _BEFORE, 0), begin)
        dense = usual
        if known[before].sum() >= _BEFORE // 2:
            dense = max(float(cover[before][known[before]].mean()), _LEAST_DENSE * usual)
        stretches = np.minimum(cover[begin : leaves_until + 1] / dense, 1.0)
        as_long = begin + float(np.clip(stretches.sum(), 0.0, leaves_until - begin))
        after = slice(leaves_until, leaves_until + _TAIL)
        grown = np.flatnonzero(known[after] & (cover[after] > _GROWN * usual))
        return 0.5 * (as_long + leaves_until + (int(grown[-1]) + 1 if len(grown) else 0))

    def _mean_cover(self, known: NDArray[np.bool_]) -> Array:
        """Cover of each stretch: neighbours together, as single plants are missing everywhere."""
        cover = np.where(known, self._cover / np.maximum(self._seen, 1e-9), 0.0)
        return np.asarray(np.convolve(cover, _WEIGHTS, "same"))

    def _usual(self, cover: Array, known: NDArray[np.bool_], way: float) -> float:
        """Cover of a stretch on which plants stand, by those near the robot where there are enough."""
        here = int(np.floor((way + _NEAR_M) / CELL_M)) - self._origin
        near = known & (np.arange(_CELLS) < here)
        told = cover[near if near.sum() > _ENOUGH else known]
        return max(float(np.quantile(told, 0.85)), 1e-3)


def row_cover(
    x: Array,
    aside: Array,
    area: Array,
    spacing: float,
    half_width: float,
    within: tuple[float, float],
    covariance: Array,
) -> tuple[Array, Array, Array]:
    """Cover of the ground by rows, stretch by stretch ahead.

    Each bit votes as a wave of the rows' spacing has it (20.10's Hough transform, at the place where rows are known to
    be). How they go on far ahead is known less well than they are wide: there they may lie where they are seen to.

    Args:
        x: (N,) of bits of vegetation ahead of the robot, m.
        aside: (N,) of them to the left of the robot's row, m.
        area: (N,) of ground that each covers, m^2.
        spacing: between rows, m.
        half_width: ground to either side of the robot's row that counts, m.
        within: where the ground in view begins and ends ahead, m.
        covariance: (3, 3) of offset (m), yaw (rad) and curvature (1/m) of the rows.

    Returns:
        Distance ahead (m), cover (-1 to 1) and weight (0 to 1) of each stretch, (S,) each.
    """
    near, far = within
    edges = np.arange(np.ceil(near / CELL_M), np.floor(far / CELL_M) + 0.5) * CELL_M
    middles = 0.5 * (edges[:-1] + edges[1:])
    inside = np.abs(aside) < half_width
    place, phase = x[inside], 2.0 * np.pi * aside[inside] / spacing
    real, imaginary = (
        np.histogram(place, edges, weights=area[inside] * wave(phase))[0] for wave in (np.cos, np.sin)
    )
    most = np.minimum(2.0 * np.pi * _SIGMAS * sideways(middles, covariance) / spacing, np.pi)
    if len(middles):
        about = np.ones(min(_ABOUT, len(middles)))
        grown, _ = np.histogram(place, edges, weights=area[inside])
        across, along, total = (np.convolve(part, about, "same") for part in (imaginary, real, grown))
        in_rows = np.hypot(across, along) > _IN_ROWS * total
        lies = np.where(in_rows, np.clip(np.arctan2(across, along), -most, most), 0.0)
        real = real * np.cos(lies) + imaginary * np.sin(lies)
    weight = np.minimum(1.5 - middles / far, 1.0)  # a stretch seen from nearer counts for more
    return middles, real / (2.0 * half_width * CELL_M), weight


def sideways(ahead: Array, covariance: Array) -> Array:
    """Standard deviation (N,), m, of where rows lie so far ahead (N,), m, by the covariance of `row_cover`."""
    lateral = np.stack([np.ones(len(ahead)), ahead, -0.5 * ahead**2], axis=1)
    return np.asarray(np.sqrt(np.einsum("si,ij,sj->s", lateral, covariance, lateral)))


def go_on_until(
    x: Array, aside: Array, area: Array, spacing: float, half_width: float, within: tuple[float, float]
) -> float:
    """How far ahead rows go on without open ground between, m, wherever they lie; arguments as of `row_cover`."""
    ahead, cover, _ = row_cover(x, aside, area, spacing, half_width, within, _ANYWHERE)
    if not len(ahead):
        return within[1]
    cover = np.convolve(cover, _WEIGHTS, "same")
    stands = cover > _THIN * max(float(np.quantile(cover, 0.85)), 1e-3)
    if not stands.any():
        return within[1]
    since = np.arange(len(ahead)) - np.maximum.accumulate(np.where(stands, np.arange(len(ahead)), -1))
    since[: int(stands.argmax())] = 0
    parted = since >= _PARTED
    if not parted.any():
        return within[1]
    return float(ahead[int(parted.argmax()) - _PARTED] + 0.5 * CELL_M)
