# SPDX-License-Identifier: Apache-2.0
"""How much the lines speak for a vanishing point, and how much of that chance alone would have given."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_vision.perception.vanishing.bundle import Bundle

Array = NDArray[np.float64]

#: Residual at which a line stops supporting a vanishing point, in standard deviations.
TOLERANCE = 2.0
#: Lines that miss by more than the tolerance and less than this many times it tell how dense clutter is there.
_BESIDE = 3.0


def agreement(residuals: Array, tolerance: float = TOLERANCE) -> Array:
    """Support of lines with these residuals: 1 for perfect agreement, falling as a parabola to 0 at the tolerance."""
    return np.asarray(np.maximum(0.0, 1.0 - (residuals / tolerance) ** 2))


def assignment(residuals: Array, tolerance: float = TOLERANCE) -> tuple[NDArray[np.intp], Array]:
    """Give each line to the vanishing point it fits best: (K, N) -> index (N,), -1 for clutter, and support (N,)."""
    nearest = np.abs(residuals).argmin(axis=0)
    support = agreement(residuals[nearest, np.arange(residuals.shape[1])], tolerance)
    return np.where(support > 0.0, nearest, -1), support


def false_alarms(
    bundle: Bundle, residuals: Array, free: NDArray[np.bool_], spent: int, tests: float
) -> float:
    """How many directions with this many lines one expects in a picture of clutter alone.

    A line of random direction falls within the tolerance of a given direction with probability 2 T / pi, T =
    tolerance times sigma, so the number that do is binomial; the lines that fixed the direction agree anyway and do
    not count (Desolneux, Moisan and Morel 2000: a contrario detection). Clutter may prefer a direction, as blades of
    grass do: then as many lines miss the tolerance by a little as keep it, and chance is what they tell, if more.

    Args:
        bundle: the lines that could have agreed.
        residuals: (N,) of the lines to the direction.
        free: (N,) which of them lead to no other direction.
        spent: number of lines that fix the direction.
        tests: number of directions among which this one was chosen.
    """
    from scipy.special import betainc  # slow to import

    away = np.abs(residuals)
    agrees = free & (away < TOLERANCE)
    trials, agreeing = len(bundle) - spent, int(agrees.sum()) - spent
    if trials < 1 or agreeing < 1:
        return tests
    chance = float(np.mean(np.minimum(2.0 * TOLERANCE * bundle.sigma / np.pi, 1.0)))
    beside = int((free & ~agrees & (away < _BESIDE * TOLERANCE)).sum())
    # As many as were counted, and as many more as a count is uncertain by.
    chance = min(max(chance, (beside + np.sqrt(beside)) / (_BESIDE - 1.0) / trials), 1.0)
    # Probability of `agreeing` or more among `trials`.
    return tests * float(betainc(agreeing, trials - agreeing + 1, chance))
