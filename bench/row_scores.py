# SPDX-License-Identifier: Apache-2.0
"""Crop row detection accuracy (CRDA) after Vidović, Cupec and Hocenski (2016)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MIDDLE_ROWS = np.array([-1.0, 0.0, 1.0])


def crda(table: Array, truth: Array, middle: float, sigma: float) -> float:
    """Mean over image rows and the three central crop rows of max(0, 1 - ((u* - u) / (sigma d))^2).

    The found rows are shifted by that whole number of rows which fits best.

    Args:
        table: (H, K) columns of the rows found at each image row, left to right, px.
        truth: (N, 2) as in `CropPicture.rows`.
        middle: column from which the truth counts, px.
        sigma: of the spacing d that is an error too many.
    """
    found = table[len(table) - len(truth) :]
    spacing = truth[:, 1:]
    true = middle + truth[:, :1] + MIDDLE_ROWS * spacing
    return max(
        float(np.maximum(0.0, 1.0 - ((found[:, k : k + 3] - true) / (sigma * spacing)) ** 2).mean())
        for k in range(found.shape[1] - 2)
    )


def horizon_and_spacing(truth: Array, height: int) -> tuple[float, float]:
    """Image row of the vanishing line and distance of the rows at the last image row, px, of a truth (N, 2)."""
    slope, start = np.polyfit(np.arange(height - len(truth), height), truth[:, 1], 1)
    return -start / slope, slope * (height - 1.0) + start
