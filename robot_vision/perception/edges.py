# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs, allow-untyped-calls
"""Edge points placed to a fraction of a pixel: the crests of the gradient, found once and shared by every tracer.

Kernels here are compiled by numba, which infers their types; import this module only where edges are about to be found.
"""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

#: A 3x3 Sobel kernel answers 8 to a slope of one grey level a pixel.
SOBEL_GAIN = 8.0

#: Columns of an edge point: place (u, v), unit gradient (towards the brighter side), gradient in grey levels a pixel.
U, V, NORMAL_U, NORMAL_V, CONTRAST = range(5)

_MARGIN = 2


class EdgeFinder:
    """Finds sub-pixel edge points in pictures of one size, in buffers that are allocated once.

    Args:
        height, width: size of the pictures, px.
        blur: standard deviation of the Gaussian before the gradient, px.
    """

    def __init__(self, height: int, width: int, blur: float) -> None:
        self.shape = (height, width)
        self._blur = blur
        self._smooth = np.empty((height, width), np.uint8)
        self._gu = np.empty((height, width), np.int16)
        self._gv = np.empty((height, width), np.int16)
        self._index = np.empty((height, width), np.int32)
        self._points = np.empty((height * width // 2 + 1, 5), np.float32)

    def look(self, gray: NDArray[np.uint8]) -> None:
        """Take the gradient of a picture; `find` then tells its edge points."""
        smooth = gray
        if self._blur > 0.0:
            cv2.GaussianBlur(gray, (0, 0), self._blur, dst=self._smooth)
            smooth = self._smooth
        cv2.Sobel(smooth, cv2.CV_16S, 1, 0, dst=self._gu)
        cv2.Sobel(smooth, cv2.CV_16S, 0, 1, dst=self._gv)

    def find(self, contrast: float) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Edge points of the picture last looked at.

        Args:
            contrast: least gradient of an edge point, grey levels a pixel.

        Returns:
            index: (H, W) int32, number of the edge point in each pixel, -1 where there is none.
            points: (N, 5) float32, columns `U, V, NORMAL_U, NORMAL_V, CONTRAST`, in reading order.
            Both are views of buffers that the next call overwrites.
        """
        floor = (contrast * SOBEL_GAIN) ** 2
        count = _crests(self._gu, self._gv, floor, self._index, self._points)
        return self._index, self._points[:count]


@njit(cache=True, fastmath=True)
def _squared(gu, gv, row, column):
    a = np.int32(gu[row, column])
    b = np.int32(gv[row, column])
    return a * a + b * b


@njit(cache=True, fastmath=True)
def _crests(gu, gv, floor, index, points):
    """Non-maximum suppression along the steeper axis, with the crest of the parabola through three magnitudes."""
    height, width = gu.shape
    index[:] = -1
    count = 0
    limit = len(points)
    for row in range(_MARGIN, height - _MARGIN):
        for column in range(_MARGIN, width - _MARGIN):
            here = _squared(gu, gv, row, column)
            if here < floor:
                continue
            a = np.float32(gu[row, column])
            b = np.float32(gv[row, column])
            along_row = abs(a) >= abs(b)
            if along_row:
                before = _squared(gu, gv, row, column - 1)
                after = _squared(gu, gv, row, column + 1)
            else:
                before = _squared(gu, gv, row - 1, column)
                after = _squared(gu, gv, row + 1, column)
            if here <= before or here < after or count == limit:
                continue
            peak = np.sqrt(np.float32(here))
            low = np.sqrt(np.float32(before))
            high = np.sqrt(np.float32(after))
            shift = np.float32(0.5) * (low - high) / (low + high - 2 * peak)
            points[count, U] = column + shift if along_row else column
            points[count, V] = row if along_row else row + shift
            points[count, NORMAL_U] = a / peak
            points[count, NORMAL_V] = b / peak
            points[count, CONTRAST] = peak / np.float32(SOBEL_GAIN)
            index[row, column] = count
            count += 1
    return count
