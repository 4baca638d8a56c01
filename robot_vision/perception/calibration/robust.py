# SPDX-License-Identifier: Apache-2.0
"""Means over the pictures of a drive that outliers do not bend, and how sure they are though neighbours are alike."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Degrees of freedom of the Student distribution that errors of single pictures are taken to have.
_FREEDOM = 4.0
_BLOCKS = 10


def student_weights(squared: Array, dimensions: int) -> Array:
    """Weights (N,) of observations with these squared Mahalanobis distances under heavy tails."""
    return np.asarray((_FREEDOM + dimensions) / (_FREEDOM + squared))


def block_sigma(values: Array, weights: Array, single: float | None = None) -> float:
    """Standard deviation of the weighted mean of (N,) values in order of time.

    Successive pictures see the same walls, so they err alike. The drive is cut into blocks and each left out in
    turn (jackknife); what independent pictures would give is the least it can be.

    Args:
        values: (N,).
        weights: (N,), inverse variances unless `single` is given.
        single: standard deviation of one value by itself, for when there is only one.
    """
    mean = float(weights @ values / weights.sum())
    alone = float(np.sqrt(np.sum((weights * (values - mean)) ** 2)) / weights.sum())
    blocks = min(_BLOCKS, len(values))
    if blocks < 2:
        return float(1.0 / np.sqrt(weights.sum())) if single is None else single
    edges = np.linspace(0, len(values), blocks + 1).astype(int)
    left_out = np.ones(blocks)
    for k in range(blocks):
        kept = np.ones(len(values), bool)
        kept[edges[k] : edges[k + 1]] = False
        left_out[k] = weights[kept] @ values[kept] / weights[kept].sum()
    jackknife = float(np.sqrt((blocks - 1) / blocks * np.sum((left_out - left_out.mean()) ** 2)))
    return max(alone, jackknife)


def robust_mean(values: Array) -> tuple[float, Array]:
    """Mean of (N,) values under heavy tails, and the weight of each."""
    mean = float(np.median(values))
    weights = np.ones(len(values))
    for _ in range(10):
        spread = max(1.4826 * float(np.median(np.abs(values - mean))), 1e-9 * abs(mean) + 1e-12)
        weights = student_weights(((values - mean) / spread) ** 2, 1)
        mean = float(weights @ values / weights.sum())
    return mean, weights
