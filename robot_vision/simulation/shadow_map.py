# SPDX-License-Identifier: Apache-2.0
"""Shadows on the ground from their outlines, so that what is drawn and what is told as true are the same."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray


class ShadowMap:
    """How much of the light is taken from each place of the ground.

    Args:
        outlines: (K, 2) outlines of shadows, metres.
        low: smallest x, y that is asked for, metres.
        high: largest x, y.
        cell: side of a cell of the map, metres.
        softness: standard deviation by which the borders are smeared, metres.
    """

    def __init__(
        self,
        outlines: Sequence[NDArray[np.float64]],
        low: NDArray[np.float64],
        high: NDArray[np.float64],
        cell: float,
        softness: float,
    ) -> None:
        self._low, self._cell = np.asarray(low, np.float64), cell
        columns, rows = (int(np.ceil(side / cell)) + 1 for side in np.subtract(high, low))
        mask = np.zeros((rows, columns), np.uint8)
        for outline in outlines:
            corners = np.round(256 * (outline - self._low) / cell).astype(np.int32)
            cv2.fillPoly(mask, [corners], 255, cv2.LINE_AA, 8)
        share = mask.astype(np.float32) / 255
        self._share = cv2.GaussianBlur(share, (0, 0), softness / cell)

    def share(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Share of the light (N,), 0 to 1, that is taken from points (N, 2 or 3)."""
        from scipy.ndimage import map_coordinates  # slow to import

        places = (points[:, 1::-1] - self._low[::-1]) / self._cell
        taken = map_coordinates(self._share, places.T, np.float64, order=1, mode="nearest")
        return np.asarray(taken, np.float64)
