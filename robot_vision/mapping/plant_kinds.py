# SPDX-License-Identifier: Apache-2.0
"""Crop or weed: by the distance to the row, the place in the planting grid along it, and the size.

Each cue says how much likelier a plant is where and as large as it is if it is a weed; together they are a naive
Bayes classifier. What crop and weeds are like in this field (how far from the row, how large, how many) is learned
from the plants on the way, by expectation and maximisation with a memory that fades.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from robot_vision.perception.crop_rows.ground_fit import lateral
from robot_vision.perception.crop_rows.plant_bodies import FOREIGN
from robot_vision.perception.lane import LaneHeading

Array = NDArray[np.float64]
Cue = Literal["row", "grid", "area", "colour"]
CUES: tuple[Cue, ...] = ("row", "grid", "area", "colour")

#: Distances between plants in a row that are tried: the least and the greatest, m, and their ratio.
_STEPS = np.geomspace(0.06, 0.9, 201)
#: Share of the greatest coherence that the step of the grid must have, and coherence below which there is no grid.
_AS_GOOD, _COHERENT = 0.8, 0.12
#: Share of what was learned that is kept from picture to picture.
_FADES = 0.95
#: Standard deviation of plants about their place in the grid, as a share of the step, and m.
_JITTER, _JITTER_M = 0.06, 0.012
#: Share of the crop that is much smaller than the rest, by how much (logarithm), and its scatter.
_STUNTED, _STUNTED_BY, _STUNTED_SIGMA = 0.12, 1.4, 0.7
#: Rounds in which rows are laid through their plants, distance from a row at which a plant loses its say (spacings),
#: and how much the line is known before: m, rad.
_LINE_ROUNDS, _LINE_SCATTER, _LINE_KNOWN = 3, 0.08, np.array([0.02, 0.01])
#: The step is sought in one of so many pictures, in so many rows to either side of the robot's own.
_SELDOM, _SIDE_ROWS = 4, 2
#: Least plants of a row that show its grid.
_FEWEST = 3.0
#: Row, grid and size say at most so much (logarithm of a ratio): a plant that was cut wrongly is out of every grid.
_MOST, _MOST_GRID, _MOST_AREA, _MOST_COLOUR = 6.0, 4.0, 4.0, 4.0
#: So many plants of each kind are taken to be foreign, and not to be, before any is seen.
_DOUBT = 0.5
#: Standard deviation of the logarithm of the area of a kind: least and most.
_ALIKE = 0.3, 0.8
_TAU = 2.0 * np.pi


@dataclass(frozen=True)
class InRow:
    """Plants as the rows see them.

    Attributes:
        row: (N,) number of the nearest row.
        aside: (N,) distance to the left of it, m.
        along: (N,) way along it, m, from any beginning.
        aside_variance: (N,) m^2.
        log_areas: (N,) of m^2.
        foreign: (N,) share of each that has another colour than the crop.
    """

    row: NDArray[np.intp]
    aside: Array
    along: Array
    aside_variance: Array
    log_areas: Array
    foreign: Array


@dataclass
class PlantJudge:
    """Tells crop from weeds, and learns both on the way.

    Args:
        step: between plants in a row, m; 0: it is found.
        cues: those that count.
        weeds: share of weeds among all plants, before anything is learned.

    Raises:
        ValueError: naming the setting that makes no sense.
    """

    step: float = 0.0
    cues: tuple[Cue, ...] = CUES
    weeds: float = 0.4
    scatter: float = field(default=0.022, init=False, repr=False, compare=False)
    found_step: float | None = field(default=None, init=False, repr=False, compare=False)
    _learned: Array = field(default_factory=lambda: np.zeros((2, 5)), init=False, repr=False, compare=False)
    _spectrum: Array = field(
        default_factory=lambda: np.zeros((2, len(_STEPS))), init=False, repr=False, compare=False
    )

    _pictures: int = field(default=0, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.step) and self.step >= 0.0):
            raise ValueError(f"step must not be negative, nor {self.step}")
        unknown = [cue for cue in self.cues if cue not in CUES]
        if unknown or not self.cues:
            raise ValueError(f"cues must be some of {', '.join(CUES)}, not {', '.join(self.cues) or 'none'}")
        if not 0.0 < self.weeds < 1.0:
            raise ValueError(f"weeds must lie in (0, 1), not {self.weeds}")

    def reset(self) -> None:
        """Forget what was learned."""
        self.scatter, self.found_step = 0.022, None
        self._learned[:] = 0.0
        self._spectrum[:] = 0.0
        self._pictures = 0

    def judge(self, plants: InRow, spacing: float) -> Array:
        """Probability (N,) that each plant is a weed.

        Args:
            plants: all that are known.
            spacing: between rows, m.
        """
        if not len(plants.row):
            return np.zeros(0)
        ratio = self._prior() + self._by_row(plants, spacing)
        crop = 1.0 / (1.0 + np.exp(ratio))
        if "grid" in self.cues:
            self._find_step(plants, crop)
            ratio = ratio + self._by_grid(plants, crop)
        self._learn(plants, ratio, spacing)
        if "area" in self.cues:
            ratio = ratio + self._by_area(plants.log_areas)
        if "colour" in self.cues:
            ratio = ratio + self._by_colour(plants.foreign)
        return np.asarray(1.0 / (1.0 + np.exp(-np.clip(ratio, -50.0, 50.0))))

    def _prior(self) -> float:
        amount = self._learned[:, 0]
        share = (amount[1] + 20.0 * self.weeds) / (amount.sum() + 20.0)
        return float(np.log(share / (1.0 - share)))

    def _by_row(self, plants: InRow, spacing: float) -> Array:
        """Crop scatters about its row, weeds stand anywhere."""
        if "row" not in self.cues:
            return np.zeros(len(plants.row))
        variance = self.scatter**2 + plants.aside_variance
        crop = np.exp(-0.5 * plants.aside**2 / variance) / np.sqrt(_TAU * variance)
        return _ratio(1.0 / spacing, crop)

    def _by_grid(self, plants: InRow, crop: Array) -> Array:
        """Crop stands a step apart in each row; where a row's grid lies is told by the other plants of the row."""
        step = self.step or self.found_step
        if not step:
            return np.zeros(len(plants.row))
        turn = np.exp(1j * _TAU * plants.along / step)
        _, row = np.unique(plants.row, return_inverse=True)
        others = np.bincount(row, crop)[row] - crop
        total = np.bincount(row, crop * turn.real) + 1j * np.bincount(row, crop * turn.imag)
        mean = total[row] - crop * turn
        away = np.angle(turn * np.conj(mean)) * step / _TAU
        jitter = np.hypot(_JITTER * step, _JITTER_M)
        variance = jitter**2 * (1.0 + 1.0 / np.maximum(others, 1.0))
        inside = np.exp(-0.5 * away**2 / variance) / np.sqrt(_TAU * variance)
        coherent = (others >= _FEWEST) & (np.abs(mean) > 0.5 * others)
        return np.where(coherent, _ratio(1.0 / step, inside, _MOST_GRID), 0.0)

    def _by_area(self, log_areas: Array) -> Array:
        crop, weed = self._learned
        if crop[0] < 5.0 or weed[0] < 5.0:
            return np.zeros(len(log_areas))
        (large, wide), (small, narrow) = (_bell_of(kind) for kind in (crop, weed))
        usual = _bell(log_areas, large, wide)
        stunted = _bell(log_areas, large - _STUNTED_BY, _STUNTED_SIGMA)
        crop_like = (1.0 - _STUNTED) * usual + _STUNTED * stunted
        return _ratio(_bell(log_areas, small, narrow), crop_like, _MOST_AREA)

    def _by_colour(self, foreign: Array) -> Array:
        """Weeds may have another colour than the crop, or the same."""
        if self._learned[:, 3].min() < 5.0 or self._learned[:, 4].max() < 1.0:
            return np.zeros(len(foreign))
        shares = (self._learned[:, 4] + _DOUBT) / (self._learned[:, 3] + 2.0 * _DOUBT)
        crop, weed = np.where(foreign[:, None] >= FOREIGN, shares, 1.0 - shares).T
        return _ratio(weed, crop, _MOST_COLOUR)

    def _learn(self, plants: InRow, ratio: Array, spacing: float) -> None:
        """Amount; of sure plants sums of the logarithms of areas and of their squares, number, and of foreign ones."""
        weed = 1.0 / (1.0 + np.exp(-np.clip(ratio, -50.0, 50.0)))
        for kind, share in enumerate((1.0 - weed, weed)):
            sure = np.where(share > 0.8, share, 0.0)
            own = np.array(
                [
                    share.sum(),
                    sure @ plants.log_areas,
                    sure @ plants.log_areas**2,
                    sure.sum(),
                    sure @ (plants.foreign >= FOREIGN),
                ]
            )
            self._learned[kind] = _FADES * self._learned[kind] + (1.0 - _FADES) * own
        near = (1.0 - weed) * (np.abs(plants.aside) < 0.2 * spacing)
        if near.sum() > 10.0:
            square = near @ np.maximum(plants.aside**2 - plants.aside_variance, 0.0) / near.sum()
            self.scatter += (1.0 - _FADES) * (float(np.clip(np.sqrt(square), 0.008, 0.06)) - self.scatter)

    def _find_step(self, plants: InRow, crop: Array) -> None:
        """The step at which the plants of each row are most in phase; of steps as good, the greatest.

        At a half or a third of the step they are in phase as well.
        """
        self._pictures += 1
        if self.step or self._pictures % _SELDOM != 1:
            return
        fresh = np.zeros((2, len(_STEPS)))
        for row in range(-_SIDE_ROWS, _SIDE_ROWS + 1):
            mine = (plants.row == row) & (crop > 0.5)
            if mine.sum() < _FEWEST + 1:
                continue
            total = crop[mine] @ np.exp(1j * _TAU * plants.along[mine, None] / _STEPS)
            alone = float((crop[mine] ** 2).sum())
            fresh[0] += np.abs(total) ** 2 - alone
            fresh[1] += float(crop[mine].sum()) ** 2 - alone
        self._spectrum = _FADES * self._spectrum + fresh
        if self._spectrum[1].max() <= 0.0:
            return
        score = self._spectrum[0] / np.maximum(self._spectrum[1], 1e-9)
        peaks = (score >= np.roll(score, 1)) & (score >= np.roll(score, -1))
        peaks[[0, -1]] = False
        good = np.flatnonzero(peaks & (score > max(_AS_GOOD * score[peaks].max(initial=0.0), _COHERENT)))
        self.found_step = float(_STEPS[good[-1]]) if len(good) else None


def in_rows(
    places: Array,
    covariance: Array,
    log_areas: Array,
    foreign: Array,
    lane: LaneHeading,
    spacing: float,
    scatter: float,
) -> InRow:
    """Where plants stand in the rows, whose lines the plants near them shift a little.

    Args:
        places: (N, 2) in base_link, m.
        covariance: (N, 2, 2) of them.
        log_areas: (N,) of m^2.
        foreign: (N,) share of each that has another colour than the crop.
        lane: the robot in its row.
        spacing: between rows, m.
        scatter: of the crop about its row, m.
    """
    values = np.array([lane.offset, lane.yaw, lane.curvature, 0.0, 0.0, 0.0])
    aside, along = lateral(places[:, 0], places[:, 1], values)
    row = np.rint(aside / spacing).astype(np.intp)
    aside = aside - spacing * row
    design = np.column_stack([np.ones(len(along)), along])
    line: Array = np.zeros(2)
    for _ in range(_LINE_ROUNDS):
        left = aside - design @ line
        say = np.exp(-0.5 * (left / (_LINE_SCATTER * spacing)) ** 2) / (scatter**2 + covariance[:, 1, 1])
        weighted = design * say[:, None]
        known = weighted.T @ design + np.diag(_LINE_KNOWN**-2.0)
        line = np.asarray(np.linalg.solve(known, weighted.T @ aside), np.float64)
    off = aside - design @ line
    return InRow(row, off, along, covariance[:, 1, 1], log_areas, foreign)


def _ratio(weed: Array | float, crop: Array, most: float = _MOST) -> Array:
    return np.asarray(np.clip(np.log(np.maximum(weed, 1e-12) / np.maximum(crop, 1e-12)), -most, most))


def _bell(value: Array, mean: float, sigma: float) -> Array:
    return np.asarray(np.exp(-0.5 * ((value - mean) / sigma) ** 2) / (np.sqrt(_TAU) * sigma))


def _bell_of(kind: Array) -> tuple[float, float]:
    """Mean and standard deviation of the logarithm of the area of a kind."""
    amount = max(float(kind[3]), 1e-6)
    mean = float(kind[1]) / amount
    return mean, float(np.clip(np.sqrt(max(float(kind[2]) / amount - mean**2, 0.0)), *_ALIKE))
