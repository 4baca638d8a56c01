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

#: How kernels of this package over pixels and edge points are compiled: division by zero gives inf, as in numpy.
FAST = {"cache": True, "fastmath": True, "error_model": "numpy"}

_MARGIN = 2
_ROWS_KEPT = 3
_WORD = 8


class EdgeFinder:
    """Finds sub-pixel edge points in pictures of one size and in parts of them, in buffers that are allocated once.

    Args:
        height, width: size of the largest pictures, px.
        blur: standard deviation of the Gaussian before the gradient, px.
    """

    def __init__(self, height: int, width: int, blur: float) -> None:
        self.shape = (height, width)
        self._blur = blur
        self._bytes = np.empty(height * width, np.uint8)
        self._gradients = np.empty((2, height * width), np.int16)
        self._numbers = np.empty(height * width, np.int32)
        self._points = np.empty((height * width, 5), np.float32)
        self._lay_out(height, width)

    def _lay_out(self, height: int, width: int) -> None:
        """Use the beginning of each buffer for pictures of this size."""
        size = height * width
        self._smooth = self._bytes[:size].reshape(height, width)
        self._gu, self._gv = (part[:size].reshape(height, width) for part in self._gradients)
        self._index = self._numbers[:size].reshape(height, width)
        self._squares = np.empty((_ROWS_KEPT, width), np.int32)
        self._marks = np.zeros(-(-width // _WORD) * _WORD, np.uint8)

    def look(self, gray: NDArray[np.uint8]) -> None:
        """Take the gradient of a picture, or of a part of one, no larger; `find` then tells its edge points."""
        if gray.shape != self._smooth.shape:
            self._lay_out(*gray.shape)
        smooth = gray
        if self._blur > 0.0:
            cv2.GaussianBlur(gray, (0, 0), self._blur, dst=self._smooth)
            smooth = self._smooth
        cv2.spatialGradient(smooth, self._gu, self._gv)

    def find(self, contrast: float) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Edge points of the picture last looked at.

        Args:
            contrast: least gradient of an edge point, grey levels a pixel.

        Returns:
            index: (H, W) int32, number of the edge point in each pixel, -1 where there is none.
            points: (N, 5) float32, columns `U, V, NORMAL_U, NORMAL_V, CONTRAST`, in reading order.
            Both are views of buffers that the next call overwrites.
        """
        least = np.int32(np.ceil((contrast * SOBEL_GAIN) ** 2))
        marks, words = self._marks, self._marks.view(np.uint64)
        count = _crests(self._gu, self._gv, least, self._squares, marks, words, self._index, self._points)
        return self._index, self._points[:count]


@njit(**FAST)
def _crests(gu, gv, least, squares, marks, words, index, points):
    """Edge points in reading order, row by row: squared gradient, crests marked, marked pixels placed.

    The first two steps are loops without branches, which the compiler turns into vector instructions; few pixels
    are left for the third. `squares` holds the rows above, here and below in turn.
    """
    height, width = gu.shape
    index[:_MARGIN] = -1
    index[height - _MARGIN :] = -1
    count = 0
    for row in range(_MARGIN - 1, _MARGIN + 1):
        _square(gu[row], gv[row], squares[row % _ROWS_KEPT])
    for row in range(_MARGIN, height - _MARGIN):
        u_row, v_row, numbers = gu[row], gv[row], index[row]
        up, here = squares[(row - 1) % _ROWS_KEPT], squares[row % _ROWS_KEPT]
        down = squares[(row + 1) % _ROWS_KEPT]
        _square(gu[row + 1], gv[row + 1], down)
        _mark(u_row, v_row, up, here, down, least, marks)
        numbers[:] = -1
        for word in range(len(words)):
            if words[word] == 0:
                continue
            for column in range(_WORD * word, _WORD * word + _WORD):
                if marks[column]:
                    shift_u, shift_v, nu, nv, contrast = _crest(u_row, v_row, up, here, down, column)
                    points[count, U] = column + shift_u
                    points[count, V] = row + shift_v
                    points[count, NORMAL_U] = nu
                    points[count, NORMAL_V] = nv
                    points[count, CONTRAST] = contrast
                    numbers[column] = count
                    count += 1
    return count


@njit(**FAST)
def _square(gu, gv, square):
    for k in range(len(square)):
        a, b = np.int32(gu[k]), np.int32(gv[k])
        square[k] = a * a + b * b


@njit(**FAST)
def _mark(gu, gv, up, here, down, least, marks):
    """Non-maximum suppression along the steeper axis; slices, so that no index could run below zero."""
    end = len(here) - _MARGIN
    left, right = here[_MARGIN - 1 : end - 1], here[_MARGIN + 1 : end + 1]
    gu, gv, marks = gu[_MARGIN:end], gv[_MARGIN:end], marks[_MARGIN:end]
    up, here, down = up[_MARGIN:end], here[_MARGIN:end], down[_MARGIN:end]
    for k in range(len(here)):
        a, b, m = np.int32(gu[k]), np.int32(gv[k]), here[k]
        steeper_along_row = a * a >= b * b
        along_row = (m > left[k]) & (m >= right[k])
        along_column = (m > up[k]) & (m >= down[k])
        marks[k] = (m >= least) & ((steeper_along_row & along_row) | (~steeper_along_row & along_column))


@njit(**FAST)
def _crest(gu, gv, up, here, down, column):
    """Where the parabola through three magnitudes has its crest (shift along u, along v), unit gradient, contrast."""
    a, b = np.float32(gu[column]), np.float32(gv[column])
    along_row = abs(a) >= abs(b)
    before = here[column - 1] if along_row else up[column]
    after = here[column + 1] if along_row else down[column]
    peak = np.sqrt(np.float32(here[column]))
    low, high = np.sqrt(np.float32(before)), np.sqrt(np.float32(after))
    shift, none = np.float32(0.5) * (low - high) / (low + high - peak - peak), np.float32(0.0)
    contrast = peak / np.float32(SOBEL_GAIN)
    return shift if along_row else none, none if along_row else shift, a / peak, b / peak, contrast
