# SPDX-License-Identifier: Apache-2.0
"""Small plants that grow into each other: neither a usual size nor a colour tells them apart, but a waist does."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

#: Two plants side by side are so many times as long as wide (standard deviations), and of their cells at most this
#: share lies about the middle, up to so many standard deviations to either side: of an ellipse it is 0.31.
_LONG, _WAIST, _MIDDLE = 1.5, 0.25, 0.5


def twins(row: Rows, column: Rows, label: Rows, count: int, least: float, most: float) -> tuple[Rows, Array]:
    """Blobs that are two plants side by side.

    Args:
        row: (N,) of the cells in which something grows.
        column: (N,) of them.
        label: (N,) blob of each.
        count: of labels.
        least: cells of the smallest plant.
        most: cells of the largest blob that may be two.

    Returns:
        Their labels (M,), and the middles (M, 2, 2) of both plants of each: row and column.
    """
    size = np.bincount(label, minlength=count)
    asked = (size >= 2.0 * least) & (size <= most)
    which = np.flatnonzero(asked)
    if not len(which):
        return which, np.zeros((0, 2, 2))
    number = np.cumsum(asked) - 1
    mine = asked[label]
    of, places = number[label[mine]], np.column_stack([row[mine], column[mine]]).astype(np.float64)
    amount = size[which].astype(np.float64)
    middle = _sums(of, places, len(which)) / amount[:, None]
    away = places - middle[of]
    products = np.column_stack([away[:, 0] ** 2, away[:, 0] * away[:, 1], away[:, 1] ** 2])
    spread = _sums(of, products, len(which)) / amount[:, None]
    variance, axes = np.linalg.eigh(spread[:, [[0, 1], [1, 2]]])
    sigma = np.sqrt(np.maximum(variance, 1.0 / 12.0))
    along = np.einsum("ni,ni->n", away, axes[of, :, 1])
    waist = np.bincount(of, np.abs(along) < _MIDDLE * sigma[of, 1], len(which)) / amount
    ahead = np.bincount(of, along > 0.0, len(which))
    halves = np.stack([amount - ahead, ahead], axis=1)
    two = (sigma[:, 1] > _LONG * sigma[:, 0]) & (waist < _WAIST) & (halves.min(axis=1) >= least)
    sides = [_sums(of, places * side[:, None], len(which)) for side in (along <= 0.0, along > 0.0)]
    middles = np.stack(sides, axis=1) / np.maximum(halves, 1.0)[:, :, None]
    return which[two], middles[two]


def _sums(of: Rows, values: Array, count: int) -> Array:
    """Sums (count, K) of values (N, K) by their numbers (N,)."""
    return np.stack([np.bincount(of, part, count) for part in values.T], axis=1)
