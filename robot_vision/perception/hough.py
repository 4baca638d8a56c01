# SPDX-License-Identifier: Apache-2.0
"""Straight lines by Hough transform, each then refitted to the gradient that supports it.

The probabilistic Hough transform (Matas et al. 2000) places a line to about a pixel and a degree, because its cells
are that large. The refit measures, at many places along a line, where across it the gradient has its crest, and fits
a line through those crests: three times as many vanishing points come out within a degree.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.perception.segments import LineSegments

Array = NDArray[np.float64]

_SOBEL_GAIN = 8.0
_SAMPLES = 24
_REACH = 2
_CAUCHY_SCALE = 0.3


class HoughFinder:
    """Canny edges, probabilistic Hough transform, sub-pixel refit.

    Args:
        blur: standard deviation of the Gaussian before the gradient, px.
        levels: contrast at which an edge may begin and at which it may be followed, grey levels a pixel, for the first
            look and for each further one.
        enough: number of lines after which no further look is taken.
        min_length: shortest line, px.
        max_gap: longest gap bridged, px.
        votes: edge pixels that a line must collect.
    """

    def __init__(
        self,
        blur: float,
        levels: list[tuple[float, float]],
        enough: int,
        min_length: float,
        max_gap: int,
        votes: int = 30,
    ) -> None:
        self._blur = blur
        self._levels = levels
        self._enough = enough
        self._min_length = min_length
        self._max_gap = max_gap
        self._votes = votes

    def find(self, gray: NDArray[np.uint8], look: int | None = None) -> tuple[LineSegments, int]:
        """Segments of one picture, and the look that showed them; the same picture gives the same segments.

        Args:
            gray: picture, or a part of one.
            look: the one to take; None: the first, and fainter ones while there are too few lines.
        """
        smooth = cv2.GaussianBlur(gray, (0, 0), self._blur) if self._blur > 0.0 else gray
        gu = cv2.Sobel(smooth, cv2.CV_16S, 1, 0)
        gv = cv2.Sobel(smooth, cv2.CV_16S, 0, 1)
        lines = LineSegments.empty()
        for taken_look in range(len(self._levels)) if look is None else (look,):
            seed, edge = self._levels[taken_look]
            edges = cv2.Canny(gu, gv, edge * _SOBEL_GAIN, seed * _SOBEL_GAIN, L2gradient=True)
            cv2.setRNGSeed(0)
            found = cv2.HoughLinesP(
                edges, 1, np.pi / 180, self._votes, minLineLength=self._min_length, maxLineGap=self._max_gap
            )
            if found is not None:
                gradient = np.stack([gu, gv], axis=-1).astype(np.float32)
                lines = self._refitted(found.reshape(-1, 4).astype(np.float64), gradient, edge * _SOBEL_GAIN)
            if len(lines) >= self._enough:
                break
        return lines, taken_look

    def _refitted(self, lines: Array, gradient: NDArray[np.float32], least: float) -> LineSegments:
        magnitude = np.hypot(gradient[..., 0], gradient[..., 1])
        for _ in range(2):
            tangent, normal = _axes(lines)
            crest, support = _crests(lines, normal, magnitude, least)
            along = np.broadcast_to(np.linspace(-0.48, 0.48, _SAMPLES), crest.shape)
            shift, slope, spread = _robust_fit(along, crest, support)
            moved = np.concatenate(
                [(shift - 0.5 * slope)[:, None] * normal, (shift + 0.5 * slope)[:, None] * normal], axis=1
            )
            lines = lines + moved
        strength = np.sqrt(support).mean(axis=1) / _SOBEL_GAIN
        # Two lines of the transform can settle on one edge; a line without gradient along it is none.
        kept = (strength > 0.1) & np.isfinite(lines).all(axis=1)
        lines = _brighter_side_left(lines[kept], gradient)
        return LineSegments(lines, strength[kept], np.maximum(spread[kept], 0.1))


def _crests(lines: Array, normal: Array, magnitude: NDArray[np.float32], least: float) -> tuple[Array, Array]:
    """Offset of the gradient's crest across each line at many places along it, and its weight: both (N, S)."""
    share = np.linspace(0.02, 0.98, _SAMPLES)[None, :, None]
    centres = lines[:, None, :2] + share * (lines[:, None, 2:] - lines[:, None, :2])
    across = np.arange(-_REACH, _REACH + 1.0)
    places = centres[:, :, None, :] + across[None, None, :, None] * normal[:, None, None, :]
    flat = places.reshape(len(lines) * _SAMPLES, len(across), 2).astype(np.float32)
    sampled = _sample(magnitude, flat).reshape(len(lines), _SAMPLES, len(across)).astype(np.float64)
    weight = np.maximum(sampled - least, 0.0) ** 2
    total = weight.sum(axis=2)
    crest = (weight * across).sum(axis=2) / np.maximum(total, 1e-9)
    return crest, total


#: cv2.remap counts the rows of a map and the pixels of a picture in 16 bits.
_REMAP_ROWS = 32000


def _sample(picture: NDArray[np.float32], places: NDArray[np.float32]) -> NDArray[np.float32]:
    """Bilinear samples of a picture at (R, K, 2) places, 0 outside."""
    if max(picture.shape) > _REMAP_ROWS:
        from scipy.ndimage import map_coordinates  # slow to import

        rows_and_columns = np.moveaxis(places[..., ::-1], 2, 0)
        return np.asarray(map_coordinates(picture, rows_and_columns, order=1, mode="grid-constant"))
    parts = [
        cv2.remap(picture, part[..., 0], part[..., 1], cv2.INTER_LINEAR)
        for part in np.split(places, range(_REMAP_ROWS, len(places), _REMAP_ROWS))
    ]
    return np.asarray(np.concatenate(parts), dtype=np.float32)


def _axes(lines: Array) -> tuple[Array, Array]:
    """Unit tangent and normal of each line, (N, 2) each."""
    tangent = lines[:, 2:] - lines[:, :2]
    tangent = tangent / np.maximum(np.hypot(tangent[:, 0], tangent[:, 1]), 1e-9)[:, None]
    return tangent, np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)


def _robust_fit(x: Array, y: Array, support: Array) -> tuple[Array, Array, Array]:
    """Straight fits y = shift + slope x along the last axis with Cauchy weights; shift, slope, spread: (N,) each."""
    base = np.sqrt(support)
    weight = base
    for _ in range(3):
        w0, w1, w2 = weight.sum(-1), (weight * x).sum(-1), (weight * x * x).sum(-1)
        d0, d1 = (weight * y).sum(-1), (weight * x * y).sum(-1)
        determinant = w0 * w2 - w1 * w1 + 1e-9
        shift, slope = (w2 * d0 - w1 * d1) / determinant, (w0 * d1 - w1 * d0) / determinant
        residual = y - shift[:, None] - slope[:, None] * x
        weight = base / (1.0 + (residual / _CAUCHY_SCALE) ** 2)
    spread = np.sqrt((weight * residual**2).sum(-1) / np.maximum(weight.sum(-1), 1e-9))
    return shift, slope, spread


def _brighter_side_left(lines: Array, gradient: NDArray[np.float32]) -> Array:
    """Turn each line so that its brighter side lies on the left in the picture."""
    if not len(lines):
        return lines
    middle = 0.5 * (lines[:, :2] + lines[:, 2:])
    rows = np.clip(np.rint(middle[:, 1]).astype(int), 0, gradient.shape[0] - 1)
    columns = np.clip(np.rint(middle[:, 0]).astype(int), 0, gradient.shape[1] - 1)
    slope = gradient[rows, columns]
    tangent, _ = _axes(lines)
    turned = slope[:, 0] * tangent[:, 1] - slope[:, 1] * tangent[:, 0] < 0.0
    return np.where(turned[:, None], lines[:, [2, 3, 0, 1]], lines)
