# SPDX-License-Identifier: Apache-2.0
"""Regular spacings: marks along a line, such as the joints of a pavement, numbered by their common period."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Periods tried in a doubling: neighbours differ by less than a fifth of a turn over the marks of one period.
_STEPS_A_DOUBLING = 40
#: A mark takes part in the search for periods of at least so many of its standard deviations.
_SHARPNESS = 8.0
#: Farther off its place than this share of a period, a mark is not one of the row: before and after the fit.
_FAR_OFF, _OFF = 0.2, 0.02
_ROUNDS = 8
#: Rows one accepts among marks that lie at random, in the mean.
_CERTAINTY = 0.03
#: Of periods about as good the longest is meant: a row of period s is also one of s / 2.
_ABOUT = 0.8


@dataclass(frozen=True)
class RegularMarks:
    """Marks of a regular row.

    Attributes:
        period: distance from one mark to the next, in the unit of the places.
        sigma: standard deviation of the period.
        chosen: (K,) indices of the marks that belong to the row.
        number: (K,) number of each in the row, from 0; two kinds may have one number.
        start: (2,) place of number 0 for each kind of mark.
    """

    period: float
    sigma: float
    chosen: NDArray[np.intp]
    number: NDArray[np.intp]
    start: Array


def find_regular(
    places: Array, sigma: Array, kinds: NDArray[np.intp], shortest: float, longest: float
) -> RegularMarks | None:
    """Find the period of marks along a line and number them.

    A period s turns the places into angles 2 pi p / s; marks of a row all point the same way. Marks of different
    kinds (the two edges of a joint) have the same period but each its own place in it.

    Args:
        places: (N,) of the marks.
        sigma: (N,) standard deviations of the places.
        kinds: (N,) 0 or 1.
        shortest: period looked for.
        longest: period looked for.

    Returns:
        None where no period stands out from chance.
    """
    if len(places) < 4 or not longest > shortest > 0.0:
        return None
    doublings = float(np.log2(longest / shortest))
    steps = int(np.ceil(_STEPS_A_DOUBLING * doublings)) + 1
    periods = shortest * np.exp2(np.linspace(0.0, doublings, steps))
    sharp = sigma < periods[:, None] / _SHARPNESS
    turned = np.exp(2j * np.pi * places / periods[:, None]) * sharp
    aligned = sum(np.abs(turned[:, kinds == kind].sum(axis=1)) for kind in (0, 1))
    used = sharp.sum(axis=1)
    coherence = np.where(used > 3, aligned / np.maximum(used, 1), 0.0)
    # Rayleigh: random directions agree by R or more with probability exp(-n R^2).
    chance = steps * np.exp(-used * coherence**2)
    likely = np.flatnonzero((chance < _CERTAINTY) & (coherence >= _ABOUT * coherence.max()))
    if not len(likely):
        return None
    best = likely[-1]
    best = likely[int(np.argmax(np.where(periods[likely] > 0.9 * periods[best], coherence[likely], 0.0)))]
    return _number(places, kinds, float(periods[best]), sharp[best])


def _number(
    places: Array, kinds: NDArray[np.intp], period: float, sharp: NDArray[np.bool_]
) -> RegularMarks | None:
    """Number the marks near the places of a period, and improve the period with those that follow it well."""
    offset = np.zeros(2)
    for kind in (0, 1):
        turned = np.exp(2j * np.pi * places[sharp & (kinds == kind)] / period)
        offset[kind] = np.angle(turned.sum()) / (2 * np.pi) * period
    # The two edges of one joint have one number: those that lie nearer together than half a period.
    offset[1] += np.rint((offset[0] - offset[1]) / period) * period
    number = np.rint((places - offset[kinds]) / period)
    row = np.flatnonzero(sharp & (np.abs(places - offset[kinds] - number * period) < _FAR_OFF * period))
    present = [kind for kind in (0, 1) if (kinds[row] == kind).any()]
    if len(row) < 4 + len(present):
        return None
    # A period, a place for each kind, and the bend that a misjudged horizon gives a row (1 + place^2).
    design = np.column_stack(
        [number[row], number[row] ** 2, *[(kinds[row] == kind).astype(float) for kind in present]]
    )
    weight = np.ones(len(row))
    tiny = 1e-9 * np.eye(design.shape[1])  # two numbers alone leave the bend open
    for _ in range(_ROUNDS):
        # Least absolute deviations: marks of other things pull no harder the farther off they are.
        weighted = design.T * weight
        solved = np.linalg.solve(weighted @ design + tiny, weighted @ places[row])
        away = np.abs(places[row] - design @ solved)
        weight = 1.0 / np.maximum(away, _OFF / 4.0 * period)
    near = away < _OFF * period
    chosen = row[near]
    counted = number[chosen].astype(np.intp)
    chosen, away, counted = _one_each(chosen, away[near], counted, kinds[chosen])
    run = _longest_run(counted)
    chosen, counted = chosen[run], counted[run]
    if len(np.unique(counted)) < 3:
        return None
    middle = 0.5 * float(counted.min() + counted.max())
    period = float(solved[0] + 2.0 * solved[1] * middle)
    start = np.zeros(2)
    # The tangent to the bent row in its middle, so that all of it lies near.
    start[present] = solved[2:] + (solved[0] - period) * middle + solved[1] * middle**2
    start += counted.min() * period
    scatter = float(np.sqrt(np.mean(away[run] ** 2)))
    sigma = scatter / float(np.sqrt(np.sum((counted - counted.mean()) ** 2)))
    return RegularMarks(period, sigma, chosen, counted - counted.min(), start)


def _one_each(
    marks: NDArray[np.intp], away: Array, number: NDArray[np.intp], kinds: NDArray[np.intp]
) -> tuple[NDArray[np.intp], Array, NDArray[np.intp]]:
    """Of several marks for one place of the row the one that lies best."""
    order = np.argsort(away, kind="stable")
    best = order[np.unique(2 * number[order] + kinds[order], return_index=True)[1]]
    return marks[best], away[best], number[best]


def _longest_run(number: NDArray[np.intp]) -> NDArray[np.bool_]:
    """The marks (K,) of the longest stretch of the row in which no two successive ones are missing."""
    steps = np.unique(number)
    stretch = np.concatenate([[0], np.cumsum(np.diff(steps) > 2)])
    longest = int(np.argmax(np.bincount(stretch)))
    return np.isin(number, steps[stretch == longest])
