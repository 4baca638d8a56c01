# SPDX-License-Identifier: Apache-2.0
"""All plants vote for all rows at once: a Hough transform whose votes are summed row spectra.

At image row v parallel rows on level ground stand d(v) = a (v - horizon) apart and their phase, counted in rows, is
linear in 1 / d. So one Fourier coefficient an image row, at the frequency 1 / d(v), holds what all pixels of that
image row have to say, whichever crop row they belong to; turned by the phase of a hypothesis and summed, the
coefficients are its votes. Their sum is a complex number: its angle is the offset, which need not be searched.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Weights = NDArray[np.float32]

#: Pixels of a picture for which the settings are given; others are scaled.
USUAL_WIDTH = 320.0
_POOLED = 24
#: Peaks of the coarse search that are looked at again.
_PEAKS = 6
_WIDER, _NEARER = np.array([(i, j) for i in (-1.0, 0.0, 1.0) for j in (-1.0, 0.0, 1.0)]).T


@dataclass(frozen=True)
class StraightRows:
    """Parallel rows on level ground as a picture shows them, bent by at most a little.

    Attributes:
        spacing: of the rows at the last image row, px.
        ratio: spacing at the first image row / at the last one; below 0 where the horizon is in the picture.
        column: vanishing point, px right of the middle of the picture.
        bend: how far curved rows sway to the side half-way up, in quarter rows.
        offset: place of a row at the last image row, rows right of the middle of the picture, in [0, 1).
        votes: mean over image rows, less what leaning and bending cost; 0 on noise.
    """

    spacing: float
    ratio: float
    column: float
    bend: float
    offset: float
    votes: float

    def horizon(self, height: int) -> float:
        """Image row at which the spacing is zero, px."""
        return -(height - 1) * self.ratio / (1.0 - self.ratio) if self.ratio != 1.0 else -np.inf


@dataclass(frozen=True)
class RowVotes:
    """Searches spacing, horizon, vanishing column, bend and offset of the rows.

    Args:
        narrowest, widest: spacing at the last image row, in picture widths.
        nearest, farthest: ratio of the spacings at first and last image row.
        least: spacing below which an image row says nothing, px of a picture 320 wide.
        power: of the standard deviation by which an image row is divided.
        fading: how much less than in the middle a pixel at the left or right border counts.
        columns: farthest vanishing point to either side, px of a picture 320 wide.
        lean_cost: votes that 100 px of vanishing column cost.
        bend_cost: votes that a bend of 1 costs.
        second: weight of the second harmonic when the offset is settled.
    """

    narrowest: float = 0.05
    widest: float = 0.7
    nearest: float = -0.25
    farthest: float = 0.42
    least: float = 8.0
    power: float = 0.884
    fading: float = 0.9
    columns: float = 60.0
    lean_cost: float = 0.05
    bend_cost: float = 0.0018
    second: float = 0.45

    def spectrum(self, weight: Weights) -> Weights:
        """Fourier transform of each image row, packed as cv2.dft does, of a weight picture (H, W)."""
        from robot_vision.perception.crop_rows.kernels import standardise_rows

        height, width = weight.shape
        centred = np.zeros((height, cv2.getOptimalDFTSize(int(3.2 * width))), np.float32)
        side = np.linspace(-1.0, 1.0, width)
        standardise_rows(weight, (1.0 - self.fading * side**2).astype(np.float32), centred, self.power)
        return np.asarray(cv2.dft(centred, flags=cv2.DFT_ROWS), np.float32)

    def search(
        self, spectrum: Weights, width: int, spacing: float | None = None, ratio: float | None = None
    ) -> StraightRows:
        """The rows with the most votes.

        Args:
            spectrum: of `spectrum`.
            width: of the picture, px.
            spacing: at the last image row, px, if it is known.
            ratio: spacing at the first image row / at the last one, if it is known.
        """
        if spacing is not None and ratio is not None:
            return self.settle(spectrum, width, spacing, ratio)
        spacings = np.geomspace(self.narrowest, self.widest, 24) * width
        ratios = np.arange(self.nearest, self.farthest + 1e-9, 0.025)
        step = np.array([np.log(spacings[1] / spacings[0]), 0.025])
        if spacing is not None:
            spacings, step = np.array([spacing]), step * [0.0, 1.0]
        if ratio is not None:
            ratios, step = np.array([ratio]), step * [1.0, 0.0]
        grid = np.stack(np.meshgrid(spacings, ratios, indexing="ij"), -1).reshape(-1, 2)
        votes = self._search(spectrum, width, grid, 11, _bends(3, 1.0), 0.01)
        votes = votes.reshape(len(spacings), len(ratios)).astype(np.float32)
        peaks = np.argwhere(votes >= cv2.dilate(votes, np.ones((3, 3), np.uint8)))
        order = np.argsort(-votes[peaks[:, 0], peaks[:, 1]], kind="stable")[:_PEAKS]
        found = [np.array([spacings[i], ratios[j]]) for i, j in peaks[order]]
        better = self._search(spectrum, width, np.array(found), 31, _bends(11, 4.5), 0.003)
        best, place = -np.inf, found[0]
        for start in np.argsort(-better, kind="stable")[:2]:
            refined, value = self._refined(spectrum, width, found[start], step)
            if value > best:
                best, place = value, refined
        return self.settle(spectrum, width, float(place[0]), float(place[1]))

    def settle(self, spectrum: Weights, width: int, spacing: float, ratio: float) -> StraightRows:
        """The rows with the most votes of a spacing at the last image row (px) and a ratio that are known."""
        from robot_vision.perception.crop_rows.kernels import settle

        z = width / USUAL_WIDTH
        bends = _bends(21, 6.0)
        gains = np.array([0.81, 0.43])
        costs = 0.035 / 100.0 / z, 0.003
        fixed = spectrum, spacing, ratio, self.least * z, 0.003 / z, _POOLED, gains
        reach = 2.0 * self.columns * z
        step = reach / 30.0
        _, column, bend, _ = settle(*fixed, 0.0, step, 61, 0.0, bends, *costs)
        fine = max(0.1, 0.5 * float(np.min(np.abs(bends - bend)[np.abs(bends - bend) > 1e-9])))
        near = fine * np.linspace(-1.0, 1.0, 5)
        votes, column, bend, offset = settle(*fixed, column, 0.5 * step, 7, bend, near, *costs)
        return StraightRows(spacing, ratio, float(column), float(bend), float(offset), float(votes))

    def _refined(self, spectrum: Weights, width: int, place: Array, step: Array) -> tuple[Array, float]:
        """Halve the grid about a place three times; returns the best place and its votes."""
        best = -np.inf
        for _ in range(3):
            step = 0.5 * step
            around = np.column_stack([place[0] * np.exp(step[0] * _WIDER), place[1] + step[1] * _NEARER])
            votes = self._search(spectrum, width, around, 31, _bends(11, 4.5), 0.003)
            place, best = around[votes.argmax()], float(votes.max())
        return place, best

    def _search(
        self, spectrum: Weights, width: int, grid: Array, columns: int, bends: Array, pooling: float
    ) -> Array:
        from robot_vision.perception.crop_rows.kernels import search

        z = width / USUAL_WIDTH
        step = 2.0 * self.columns * z / (columns - 1)
        costs = self.lean_cost / 100.0 / z, self.bend_cost
        return np.asarray(
            search(spectrum, grid, self.least * z, pooling / z, _POOLED, step, columns, bends, *costs)
        )


@cache
def _bends(count: int, most: float) -> Array:
    """Bends to try, denser about none."""
    even = np.linspace(-1.0, 1.0, count)
    return np.asarray(most * np.sign(even) * np.abs(even) ** 1.5)
