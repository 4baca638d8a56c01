# SPDX-License-Identifier: Apache-2.0
"""Pictures with edges whose place is known to a hundredth of a pixel, for the tests of this room."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

Gray = NDArray[np.uint8]
Array = NDArray[np.float64]

#: Each pixel is the mean of this many by this many samples, as a sensor's pixel is of its light.
FINE = 8


def polygon(corners: Array, shape: tuple[int, int], dark: int = 60, bright: int = 180) -> Gray:
    """A bright convex polygon on a dark ground, pixel centres at integers.

    Args:
        corners: (K, 2) px, clockwise as seen in the picture.
        shape: (height, width) px.
        dark, bright: grey levels.
    """
    height, width = shape
    # The corner of the picture lies at -0.5; samples lie in the middles of their parts of a pixel.
    v = ((np.arange(height * FINE, dtype=np.float32) + 0.5) / FINE - 0.5)[:, None]
    u = (np.arange(width * FINE, dtype=np.float32) + 0.5) / FINE - 0.5
    inside = np.ones((height * FINE, width * FINE), bool)
    for (u0, v0), (u1, v1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        inside &= np.float32(u1 - u0) * (v - np.float32(v0)) > np.float32(v1 - v0) * (u - np.float32(u0))
    share = cv2.resize(inside.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
    return np.rint(dark + (bright - dark) * share).astype(np.uint8)


def half_plane(
    point: tuple[float, float], angle: float, shape: tuple[int, int], dark: int = 60, bright: int = 180
) -> Gray:
    """Bright to the left (in the picture) of the line through a point (px) in direction `angle` (rad)."""
    along = np.array([math.cos(angle), math.sin(angle)])
    # In the picture v points down: to the left of a walker along (1, 0) lies (0, -1).
    left = np.array([along[1], -along[0]])
    far, here = 4.0 * sum(shape), np.array(point)
    corners = [
        here + far * along,
        here - far * along,
        here + far * (left - along),
        here + far * (along + left),
    ]
    return polygon(np.array(corners), shape, dark, bright)


def distances(points: Array, ends: Array) -> Array:
    """Distance (px) of points (N, 2) from the endless line through `ends` (4,)."""
    along = ends[2:] - ends[:2]
    normal = np.array([-along[1], along[0]]) / np.hypot(*along)
    return np.asarray(np.abs((points - ends[:2]) @ normal))


def angle_to(line: Array, angle: float) -> float:
    """Angle (rad) in [0, pi/2] between a segment (4,) and a direction."""
    along = line[2:] - line[:2]
    return abs(math.remainder(math.atan2(along[1], along[0]) - angle, math.pi))
