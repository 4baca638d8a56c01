# SPDX-License-Identifier: Apache-2.0
"""Finds a road nobody knows yet: every chord votes for where it would lie beside the robot, bend by bend.

On the right bend all that runs along the road (edges, paint, verges, kerbs) falls on few lateral places, on a wrong one
it spreads. And a road is the same on both sides: its middle is where what lies to the left mirrors what lies to
the right, brighter sides included.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.perception.road.chords import Chords

Array = NDArray[np.float64]

#: Directions of the robot on the road that are tried, rad, and curvatures, 1/m.
_YAWS = np.radians(np.arange(-24.0, 24.1, 1.5))
_CURVATURES = np.linspace(-0.03, 0.03, 13)
#: Width of a lateral place, m.
_BIN = 0.1
#: A chord on a road is as parallel to it as this, rad.
_PARALLEL = 0.03
#: Yaw and curvature that are usual, rad and 1/m: of places as good, the usual one.
_USUAL_YAW, _USUAL_CURVATURE = 0.25, 0.03
#: Support of a border, relative to the best one.
_STRONG = 0.4
#: What stands at a border mirrors within this many places.
_SMEAR = np.array([0.5, 1.0, 0.5])


@dataclass(frozen=True)
class FoundRoad:
    """A road seen in one picture.

    Attributes:
        offset: of the robot to the left of its middle, m.
        yaw: of the robot relative to it, rad.
        curvature: of its middle, 1/m.
        width: between its borders, m.
        support: length of the chords at both borders, px; of the worse one.
    """

    offset: float
    yaw: float
    curvature: float
    width: float
    support: float


def find_road(chords: Chords, narrowest: float, widest: float, reach: float) -> FoundRoad | None:
    """The road that most chords run along, None where no two borders mirror each other.

    Args:
        chords: of one picture.
        narrowest: distance that its borders have at least, m.
        widest: and at most, m.
        reach: chords that begin farther ahead than this do not vote, m.
    """
    near = np.min(chords.points[..., 0], axis=1) < reach
    if near.sum() < 2:
        return None
    points, placed = chords.points[near], chords.placed[near]
    left = _places(points)
    way = np.linalg.norm(points[:, 1] - points[:, 0], axis=1)
    tolerance = np.sum(placed**2, axis=(1, 2)) + (_PARALLEL * way) ** 2
    weight = chords.lengths[near] * np.exp(-0.5 * (left[..., 1] - left[..., 0]) ** 2 / tolerance)
    shares = _histograms(left.mean(axis=-1), weight, chords.bright_left[near], widest)
    usual = np.exp(-0.5 * ((_YAWS[:, None] / _USUAL_YAW) ** 2 + (_CURVATURES / _USUAL_CURVATURE) ** 2))
    score = usual * np.sum(shares**2, axis=(2, 3))
    yaw, bend = np.unravel_index(int(np.argmax(score)), score.shape)
    borders = _borders(shares[yaw, bend], narrowest, widest)
    if borders is None:
        return None
    right, left_side, support = borders
    middle = 0.5 * (left_side + right)
    # The curvature voted for is that of the line through the robot; the road's middle lies `middle` to its left.
    curvature = float(_CURVATURES[bend]) / (1.0 - float(_CURVATURES[bend]) * middle)
    return FoundRoad(-middle, float(_YAWS[yaw]), curvature, left_side - right, support)


def _places(points: Array) -> Array:
    """Distance (Y, C, N, 2) of each end from the circle through the robot, for each yaw and curvature."""
    cos, sin = np.cos(_YAWS)[:, None, None], np.sin(_YAWS)[:, None, None]
    x = (cos * points[..., 0] - sin * points[..., 1])[:, None]
    y = (sin * points[..., 0] + cos * points[..., 1])[:, None]
    curvature = _CURVATURES[:, None, None]
    bulge = curvature * (x * x + y * y) - 2.0 * y
    return np.asarray(-bulge / (1.0 + np.sqrt(np.maximum(1.0 + curvature * bulge, 0.05))))


def _histograms(left: Array, weight: Array, bright_left: NDArray[np.bool_], widest: float) -> Array:
    """Lengths by place (Y, C, 2, B) of chords (Y, C, N) whose brighter side is the right (0) or the left (1)."""
    half = int(np.ceil(widest / _BIN))
    bins = 2 * half + 1
    place = np.rint(left / _BIN).astype(np.intp) + half
    inside = (place >= 0) & (place < bins)
    row = np.arange(left.shape[0] * left.shape[1]).reshape(*left.shape[:2], 1)
    cell = (2 * row + bright_left) * bins + place
    counted = np.bincount(cell[inside], weight[inside], minlength=2 * row.size * bins)
    shares = counted.reshape(*left.shape[:2], 2, bins)
    spread = _SMEAR[1] * shares
    spread[..., 1:] += _SMEAR[0] * shares[..., :-1]
    spread[..., :-1] += _SMEAR[2] * shares[..., 1:]
    return np.asarray(spread)


def _borders(shares: Array, narrowest: float, widest: float) -> tuple[float, float, float] | None:
    """Right and left border (m) and the support of the weaker one, from lengths by brighter side and place (2, B)."""
    bins = shares.shape[1]
    half = bins // 2
    right, left = np.triu_indices(bins, 1)
    mirrored = np.minimum(shares[0][right], shares[1][left]) + np.minimum(shares[1][right], shares[0][left])
    # All pairs of places with one middle speak for that middle, the two edges of a line along it included.
    middles = np.bincount(left + right, mirrored)
    width = (left - right) * _BIN
    fits = (width >= narrowest) & (width <= widest) & (right < half) & (left >= half)
    paired = np.bincount(left + right, np.where(fits, mirrored, 0.0))
    if paired.max() <= 0.0:
        return None
    same = fits & (left + right == int(np.argmax(np.where(paired > 0.0, middles, 0.0))))
    strong = same & (mirrored >= _STRONG * mirrored[same].max())
    inner = int(np.argmin(np.where(strong, width, np.inf)))
    return (
        float((right[inner] - half) * _BIN),
        float((left[inner] - half) * _BIN),
        float(mirrored[inner]),
    )
