# SPDX-License-Identifier: Apache-2.0
"""Rows as they really run: from the straight ones of the votes to a column for every image row, however they wind."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.perception.crop_rows.votes import StraightRows

Array = NDArray[np.float64]

USUAL_HEIGHT = 240.0
_PHASES = 64
#: Phases to either side of the best path that are averaged.
_NEAR_PHASES = 20
#: Share of the picture's width as spacing up to which a step sideways is cheaper the fewer pixels it is.
_WIDE = 0.35


@dataclass(frozen=True)
class TracedRows:
    """Where the rows stand in each image row.

    Attributes:
        centre: (H,) column of one row near the middle, the same one all the way, px.
        spacing: (H,) between rows, px, positive.
        score: mean over image rows of how well rows fit; about 0 on noise.
    """

    centre: Array
    spacing: Array
    score: float


@dataclass
class RowTracer:
    """Follows phase and spacing from band to band of image rows by dynamic programming.

    The central rows count most: they are what a robot drives by, and fields are not evenly sown to their ends. A path
    may change how fast its phase drifts, and its spacing, from band to band at a price; the cheapest of all is found.

    Args:
        band: image rows a band, of a picture 240 high.
        reach: rows to either side of the middle that count, the less the farther: (1 - (x / reach)^2)^2.
        usual: weight of the mean of all phases beside what a phase shows, in rows fully in view.
        power: of the standard deviation by which a band is divided.
        blur: standard deviation of the fit of a row, in spacings.
        stretch: most the spacing may differ from that of the straight rows, as a share.
        stretches: steps of the spacing.
        drift: most phase steps (1/64 spacing) a band.
        turn_cost: of a change of the drift by a step a band, where rows are wide.
        ease: the turn costs less where rows are narrow, by this power of their spacing in the picture.
        stretch_cost: of a change of the spacing by a step.
        stretched_cost: of a spacing that differs by its own size, an image row of a picture 240 high.
        known_cost: the same where spacing and horizon are known and not estimated.
        smooth: standard deviation of the smoothing along the path, bands.
        doubt: by how much less a path may score whose say on the phase is still a third of the best one's.
        stretch_doubt: likewise on the spacing.
    """

    band: float = 3.0
    reach: float = 3.5
    usual: float = 0.2
    power: float = 0.2
    blur: float = 0.06
    stretch: float = 0.21
    stretches: int = 9
    drift: int = 6
    turn_cost: float = 4.5
    ease: float = 1.5
    stretch_cost: float = 0.9
    stretched_cost: float = 0.4
    known_cost: float = 1.8
    smooth: float = 2.2
    doubt: float = 2.5
    stretch_doubt: float = 1.5

    def __post_init__(self) -> None:
        self._totals = self._back = np.empty((0, 0, 0, 0), np.float32)

    def trace(
        self, weight: NDArray[np.float32], rows: StraightRows, least: float, known: bool = False
    ) -> TracedRows:
        """Follow rows through a weight picture (H, W).

        Args:
            weight: of vegetation.
            rows: from which it begins.
            least: spacing below which an image row says nothing, px.
            known: spacing and horizon of the rows are known, not estimated from the picture.
        """
        height, width = weight.shape
        spacing, phase, first = expected(rows, height, least)
        # One and the same row all the way, on average the one nearest the middle: changing the row midway would
        # change what a stretched spacing means
        number = np.round(phase[first:].mean())
        centre = 0.5 * width + (phase - number) * spacing
        tall = USUAL_HEIGHT / height
        band = max(1, round(self.band / tall))
        most = self.stretch if self.stretches > 1 else 0.0
        stretches = np.linspace(-most, most, self.stretches)
        scores = self._scores(weight, spacing, centre, first, band, stretches)
        scores *= np.float32(tall)
        cost = self.known_cost if known else self.stretched_cost
        scores -= (cost * band * tall * np.abs(stretches))[:, None].astype(np.float32)
        bands = len(scores)
        middles = np.minimum(band * np.arange(bands) + 0.5 * (band - 1), height - 1.0)
        lines = np.arange(height)
        wide = np.interp(middles, lines, spacing) / (_WIDE * width)
        turn = (self.turn_cost * np.minimum(wide, 1.0) ** self.ease).astype(np.float32)
        shape = (bands, self.stretches, 2 * self.drift + 1, _PHASES)
        if self._totals.shape != shape:
            self._totals, self._back = np.empty(shape, np.float32), np.empty(shape, np.float32)
        lag, stretch = self._path(scores, turn, stretches)
        moved = np.interp(lines, middles, _smoothed(lag, self.smooth))
        stretched = spacing * (1.0 + np.interp(lines, middles, _smoothed(stretch, self.smooth)))
        total = float(self._totals[-1].max()) / USUAL_HEIGHT
        return TracedRows(centre + (moved + number) * stretched, stretched, total)

    def _scores(
        self,
        weight: NDArray[np.float32],
        spacing: Array,
        centre: Array,
        first: int,
        band: int,
        stretches: Array,
    ) -> NDArray[np.float32]:
        """How well rows fit each band of image rows at each stretch and phase, float32 (B, E, P)."""
        from robot_vision.perception.crop_rows.band_kernels import fold, lay_out

        height, width = weight.shape
        bands = -(-height // band)
        half = int(self.reach * _PHASES)
        window = (1.0 - np.linspace(-1.0, 1.0, 2 * half + 3)[1:-1] ** 2) ** 2
        window *= _PHASES / window.sum()
        laid = np.empty((len(window), bands), np.float32)
        lay_out(weight, spacing, centre, first, band, _PHASES, laid)
        tops = band * np.arange(bands)
        middle = np.minimum(tops + band // 2, height - 1)
        borders = (np.array([[0.0], [width - 1.0]]) - centre[middle]) / spacing[middle]
        rows = np.minimum(tops + band, height) - np.maximum(tops, first)
        scores = np.empty((bands, len(stretches), _PHASES), np.float32)
        fold(
            laid,
            window.astype(np.float32),
            half + _PHASES * borders.T,
            np.maximum(rows, 0),
            np.float32(self.usual),
            self.power,
            stretches,
            self._kernel(),
            scores,
        )
        return scores

    def _path(
        self, scores: NDArray[np.float32], turn: NDArray[np.float32], stretches: Array
    ) -> tuple[Array, Array]:
        """Phase about the one expected, in spacings, and stretch of each band, (B,) each.

        The best path tells which way; about it, every state is weighed by the best path that leads through it, so
        that where several fit about as well their mean is taken.
        """
        from robot_vision.perception.crop_rows.tracing_kernels import accumulate, best_through, recall

        cost = np.float32(self.stretch_cost)
        accumulate(scores, turn, cost, self._totals)
        path = np.empty((len(scores), 2), np.int64)
        recall(self._totals, turn, cost, path)
        # Upwards a path drifts the other way
        backwards = np.ascontiguousarray(turn[::-1])
        upwards = np.ascontiguousarray(scores[::-1])
        accumulate(upwards, backwards, cost, self._back)
        by_phase, by_stretch = (
            np.empty((len(scores), _PHASES), np.float32),
            np.empty(scores.shape[:2], np.float32),
        )
        best_through(self._totals, self._back, scores, by_phase, by_stretch)
        best = path[:, 1:]
        aside = (np.arange(_PHASES) - best + _PHASES // 2) % _PHASES - _PHASES // 2
        phases = _weights(by_phase, self.doubt) * (np.abs(aside) <= _NEAR_PHASES)
        lag = best[:, 0] - _PHASES // 2
        lag = lag - _PHASES * np.round(lag[-1] / _PHASES) + (phases * aside).sum(axis=1) / phases.sum(axis=1)
        weights = _weights(by_stretch, self.stretch_doubt)
        return lag / _PHASES, np.asarray(weights @ stretches / weights.sum(axis=1))

    def _kernel(self) -> NDArray[np.float32]:
        reach = int(3.0 * self.blur * _PHASES + 1.0)
        kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (self.blur * _PHASES)) ** 2)
        return np.asarray(kernel / kernel.sum(), np.float32)


def straight(rows: StraightRows, height: int, width: int, least: float) -> TracedRows:
    """Rows as the votes have them, without following them; see `expected`."""
    spacing, phase, _ = expected(rows, height, least)
    return TracedRows(0.5 * width + phase * spacing, spacing, rows.votes)


def expected(rows: StraightRows, height: int, least: float) -> tuple[Array, Array, int]:
    """Spacing (H,) px and phase (H,) of the rows, and the first image row in which they are not too narrow.

    Args:
        rows: straight or bent.
        height: of the picture, px.
        least: narrowest spacing of use, px; narrower ones become it.
    """
    lines = np.arange(height)
    spacing = rows.spacing * (1.0 - (1.0 - rows.ratio) * (height - 1 - lines) / (height - 1.0))
    first = int(np.argmax(spacing >= least))
    spacing = np.maximum(spacing, least)
    density = 1.0 / spacing - 1.0 / spacing[-1]
    x = density / (density[first] + 1e-9)
    return spacing, rows.offset + rows.column * density + rows.bend * (x * x - x), first


def _weights(scores: NDArray[np.float32], doubt: float) -> Array:
    """Say (B, N) of each state beside the best one of its band."""
    return np.asarray(np.exp((scores - scores.max(axis=1, keepdims=True)) / doubt), np.float64)


def _smoothed(values: Array, sigma: float) -> Array:
    reach = int(3.0 * sigma + 0.5)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / max(sigma, 1e-6)) ** 2)
    return np.asarray(np.convolve(np.pad(values, reach, mode="edge"), kernel / kernel.sum(), "valid"))
