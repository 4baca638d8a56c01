# SPDX-License-Identifier: Apache-2.0
"""A state of which several things may be true: weighted normal distributions that are corrected, split and merged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Hypothesis:
    """One of the things that may be true.

    Attributes:
        weight: probability.
        off: (N,) mean of the state, from the state that is believed.
        covariance: (N, N) of the state.
    """

    weight: float
    off: Array
    covariance: Array

    def corrected(self, row: Array, error: float, variance: float, learn: slice = slice(None)) -> Hypothesis:
        """After `row` @ state was measured `error` from where it is believed; only a part of the state may learn."""
        ahead = self.covariance @ row
        gain = np.zeros_like(self.off)
        gain[learn] = ahead[learn] / (float(row @ ahead) + variance)
        left = np.eye(len(gain)) - np.outer(gain, row)  # Joseph's form holds for any gain
        covariance = left @ self.covariance @ left.T + variance * np.outer(gain, gain)
        return Hypothesis(self.weight, self.off + gain * (error - float(row @ self.off)), covariance)


def whole(parts: list[Hypothesis]) -> Hypothesis:
    """The normal distribution with the mean and the covariance of all (parts not empty)."""
    weights = np.array([part.weight for part in parts])
    shares = weights / weights.sum()
    offs = np.array([part.off for part in parts])
    mean = np.asarray(shares @ offs)
    apart = offs - mean
    covariances = np.array([part.covariance for part in parts]) + apart[:, :, None] * apart[:, None, :]
    return Hypothesis(float(weights.sum()), mean, np.einsum("n,nij->ij", shares, covariances))


def reduced(parts: list[Hypothesis], most: int, least: float, near: float) -> list[Hypothesis]:
    """Fewer hypotheses that say about the same; their weights sum to one.

    What says the same as a likelier one is merged with it, the least likely are dropped (Salmond 1990, "Mixture
    reduction algorithms for target tracking in clutter").

    Args:
        parts: not empty.
        most: that are left.
        least: weight, share of all, of those that are left.
        near: Mahalanobis distance, squared, within which two say the same.
    """
    left = sorted(parts, key=lambda part: -part.weight)
    total = sum(part.weight for part in left)
    left = [part for part in left if part.weight >= least * total]
    kept = []
    while left:
        first = left[0]
        offs = np.array([part.off for part in left]) - first.off
        same = np.einsum("ni,ni->n", offs, np.linalg.solve(first.covariance, offs.T).T) < near
        kept.append(whole([part for part, with_first in zip(left, same, strict=True) if with_first]))
        left = [part for part, with_first in zip(left, same, strict=True) if not with_first]
    kept = sorted(kept, key=lambda part: -part.weight)[:most]
    total = sum(part.weight for part in kept)
    return [Hypothesis(part.weight / total, part.off, part.covariance) for part in kept]
