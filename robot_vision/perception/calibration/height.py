# SPDX-License-Identifier: Apache-2.0
"""The height of a camera from one length on the ground: every distance there is seen in heights (20.2), (20.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.perception.calibration.findings import Finding
from robot_vision.perception.calibration.robust import block_sigma, robust_mean
from robot_vision.perception.heading import HeadingEstimator
from robot_vision.perception.lane import LaneFilter
from robot_vision.perception.segments import LineSegments
from robot_vision.perception.vanishing import VanishingPointEstimator
from robot_vision.perception.vanishing.pavement import PavementSpacings

Array = NDArray[np.float64]

#: The foot of a wall is a skirting, whose face may be meant or the wall behind it: relative to the width.
_FOOT = 0.005
#: Heights between which a camera on a robot is looked for, relative to the width of its corridor.
_LOWEST, _TALLEST = 0.02, 2.0
_ENOUGH = 1e-4
_LEAST_SHARE = 0.1
#: How evenly stones are laid over a whole pavement: relative.
_STONE = 0.003
#: Heights that differ by less (relative) are the same, and how many, relative to the most, make one believed.
_SAME = 0.04
#: Standard deviation of the height that one picture tells by itself: relative.
_ONE_PICTURE = 0.03
_WITNESSES = 0.3


def height_from_corridor(
    pictures: Sequence[LineSegments], stamps_s: Sequence[float], camera: Camera, width: float
) -> Finding:
    """Find the height at which a corridor is as wide as it is known to be.

    Where walls meet the floor is told by what stands on it, and a skirting has a height in metres: so the search is
    repeated with the height found, until that stays.

    Args:
        pictures: lines of successive pictures.
        stamps_s: their times, s.
        camera: with focal length and mounting.
        width: between the feet of the walls, m.
    """
    height = 0.5 * width
    for _ in range(6):
        seen = _widths(pictures, stamps_s, replace(camera, height_m=height), width)
        told = np.isfinite(seen)
        if told.sum() < max(1.0, _LEAST_SHARE * len(pictures)):
            reason = f"the feet of both walls are seen in {int(told.sum())} of {len(pictures)} pictures only"
            return Finding.missing(reason, len(pictures))
        before = height
        height = float(
            np.clip(height * width / float(np.median(seen[told])), _LOWEST * width, _TALLEST * width)
        )
        if abs(height / before - 1.0) < _ENOUGH:
            break
    own = before * width / seen
    value, weights = robust_mean(own[told])
    sigma = float(np.hypot(block_sigma(own[told], weights, _ONE_PICTURE * value), _FOOT * value))
    return Finding(value, sigma, int(told.sum()), f"from the corridor's width of {width:g} m", own)


def height_from_stones(
    pictures: Sequence[LineSegments],
    camera: Camera,
    estimator: VanishingPointEstimator,
    width: float | None,
    length: float | None,
    focal_doubt: float = 0.0,
) -> list[Finding]:
    """Find the height from the spacings of a pavement, one finding for each of the two that is known.

    Args:
        pictures: lines of the pictures.
        camera: with focal length and mounting.
        estimator: of the vanishing points.
        width: of a stone with its joint, across the way, m.
        length: of a stone with its joint, along the way, m.
        focal_doubt: standard deviation of the focal length, relative: distances ahead are wrong by as much.
    """
    pavement = PavementSpacings()
    spacing = np.full((len(pictures), 2), np.nan)
    for k, lines in enumerate(pictures):
        points = pavement.fuse(estimator.estimate(lines, camera), lines)
        across, ahead = pavement.spacings(points, lines)
        spacing[k] = across or np.nan, ahead or np.nan
    found = []
    for axis, (name, size, doubt) in enumerate((("width", width, 0.0), ("length", length, focal_doubt))):
        if size is not None:
            own = size / spacing[:, axis]
            found.append(_height_from_spacing(own, f"stones' {name} of {size:g} m", doubt))
    return found


def _height_from_spacing(own: Array, what: str, doubt: float) -> Finding:
    told = np.isfinite(own)
    count = int(told.sum())
    if count < max(1.0, _LEAST_SHARE * len(own)):
        seen = f"regular joints to tell the {what} are seen in {count} of {len(own)} pictures only"
        return Finding.missing(seen, len(own))
    # Where something stands between the joints, stones seem half as long, and the camera twice as high.
    heights = np.sort(own[told])
    shares = np.mean(np.abs(heights / heights[:, None] - 1.0) < _SAME, axis=1)
    lowest = heights[int(np.argmax(shares > _WITNESSES * shares.max()))]
    mine = np.abs(own / lowest - 1.0) < 2.0 * _SAME
    value, weights = robust_mean(own[mine])
    sigma = float(
        np.hypot(block_sigma(own[mine], weights, _ONE_PICTURE * value), np.hypot(_STONE, doubt) * value)
    )
    return Finding(value, sigma, int(mine.sum()), f"from the {what}", np.where(mine, own, np.nan))


def _widths(
    pictures: Sequence[LineSegments], stamps_s: Sequence[float], camera: Camera, width: float
) -> Array:
    """Width of the lane in each picture, m, as a camera at this height would see it; nan where not known."""
    # The height may be off by a lot at first, and so may what the lane seems to be wide.
    lane = LaneFilter(narrowest=0.1 * width, widest=10.0 * width)
    estimator = HeadingEstimator(lane_filter=lane)
    seen = np.full(len(pictures), np.nan)
    for k, (lines, stamp) in enumerate(zip(pictures, stamps_s, strict=True)):
        found = estimator.update(lines, camera, stamp).lane
        if found is not None and found.offset_known and found.width > 0.0:
            seen[k] = found.width
    return seen
