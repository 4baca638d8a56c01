# SPDX-License-Identifier: Apache-2.0
"""Tells from the edges in a picture how its grey levels stand to light."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import ImageEllipse

Array = NDArray[np.float64]

#: Exponents looked at: raw light has 1, cameras code it by 2.2 or a little more.
_EXPONENTS = np.linspace(1.0, 2.6, 9)
#: Light (9, 256) of each grey level by each of them.
_LIGHT = ((np.arange(256) / 255.0) ** _EXPONENTS[:, None]).astype(np.float32)
#: Points of a border at which it is crossed.
_POINTS = 72
#: px: how far a profile reaches to both sides of a border, the first that ends on even ground, and its step.
_REACHES, _STEP = (3.5, 5.0, 6.5), 0.25
#: A border is straight enough along a crossing that reaches less than that share of the shorter semi-axis.
_STRAIGHT = 0.5
#: px: how far the middle of a profile may lie from the border.
_ASIDE = 1.0
#: Samples at both ends, a pixel, over which a profile may rise or fall by that share of its contrast.
_END, _EVEN = 4, 0.006
#: Share of the crossings left out at either side at each distance: shadows, reflections and neighbours lie there.
_TRIMMED = 0.2
#: Distances from the middle at which the two sides are compared, as shares of the greatest; the last are the levels.
_TURNED, _LEVELS = np.linspace(0.1, 1.0, 10), 3
#: Rounds in which middle and levels settle.
_ROUNDS = 4
#: Share of the worst exponent's asymmetry, squared, that the best may have and still be told from the others.
_TELLING = 0.5


def light_exponent(gray: NDArray[np.uint8], ellipses: Iterable[ImageEllipse]) -> float | None:
    """The exponent that turns grey levels to light, as the borders of ellipses tell it.

    A lens blurs a step to a profile s that is symmetric in light, s(d) + s(-d) = 1 at distance d from where it is
    half way up; in what bends light it is not. What is left of that sum is averaged over the borders at each
    exponent, and the picture's exponent is where its square is least. Weights are as the inverse variance under
    picture noise: contrast² times size. (The skewness of the gradient alone would not do: it has one sign for a
    Gaussian blur, the other for pixels that only average, and none between.)

    Args:
        gray: (H, W) uint8.
        ellipses: in it, px; their borders may be some tenths of a pixel off.

    Returns:
        Between 1 and 2.6; None where no ellipse has even ground on both sides of its border, or where all exponents
        fit much alike.
    """
    left, weights = [], []
    for ellipse in ellipses:
        told = _asymmetries(gray, ellipse)
        if told is not None:
            left.append(told[0])
            weights.append(told[1] ** 2 * (ellipse.major + ellipse.minor))
    if not left:
        return None
    squares = np.square(np.average(left, axis=0, weights=weights)).sum(axis=1)
    best = int(squares.argmin())
    if squares[best] >= _TELLING * squares.max():
        return None
    if best in (0, len(squares) - 1):
        return float(_EXPONENTS[best])
    before, least, after = squares[best - 1 : best + 2]
    aside = (
        0.5 * (before - after) / (before - 2.0 * least + after)
    )  # vertex of the parabola through the three
    return float(_EXPONENTS[best] + aside * (_EXPONENTS[1] - _EXPONENTS[0]))


def _asymmetries(gray: NDArray[np.uint8], ellipse: ImageEllipse) -> tuple[Array, float] | None:
    """Asymmetry (9, 10) of the border of an ellipse at each exponent and its contrast, 0-1; None on uneven ground."""
    points = ellipse.points(_POINTS)
    inverse = np.linalg.inv(ellipse.frame[:2, :2])
    normals = (points - ellipse.centre) @ inverse.T @ inverse
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    margin = int(_REACHES[-1]) + 2
    left, top = np.maximum(np.floor(points.min(axis=0)).astype(int) - margin, 0)
    right, bottom = np.ceil(points.max(axis=0)).astype(int) + margin + 1
    window = gray[top:bottom, left:right]
    for reach in (each for each in _REACHES if each < _STRAIGHT * ellipse.minor):
        offsets = np.arange(-reach, reach + 0.5 * _STEP, _STEP)
        places = points[:, None] + offsets[:, None] * normals[:, None] - (left, top)
        plain = _profile(window, _LIGHT[0], places)
        contrast = float(abs(plain[-1] - plain[0]))
        uneven = max(abs(plain[_END] - plain[0]), abs(plain[-1] - plain[-1 - _END]))
        if uneven < _EVEN * contrast:
            profiles = (_profile(window, light, places) for light in _LIGHT)
            return np.array([_asymmetry(profile, offsets) for profile in profiles]), contrast
    return None


def _profile(window: NDArray[np.uint8], light: NDArray[np.float32], places: Array) -> Array:
    """Mean (M,) of light at places (N, M, 2) along crossings of a border, the outliers at each distance left out."""
    u, v = np.moveaxis(places.astype(np.float32), -1, 0)
    seen = cv2.remap(cv2.LUT(window, light), u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    cut = int(_TRIMMED * len(seen))
    return np.asarray(np.sort(seen, axis=0)[cut : len(seen) - cut].mean(axis=0), np.float64)


def _asymmetry(profile: Array, offsets: Array) -> Array:
    """What s(d) + s(-d) differs from 1 by (10,), from near the middle of a profile to its ends."""
    distances = _TURNED * (offsets[-1] - _ASIDE)
    middle = 0.0
    for _ in range(_ROUNDS):
        inner, outer = (np.interp(middle + d, offsets, profile) for d in (-distances, distances))
        low, high = inner[-_LEVELS:].mean(), outer[-_LEVELS:].mean()
        rise = np.maximum.accumulate((profile - low) / (high - low))
        middle = float(np.interp(0.5, rise, offsets))
    inner, outer = (np.interp(middle + d, offsets, profile) for d in (-distances, distances))
    return np.asarray((inner + outer - low - high) / abs(high - low))
