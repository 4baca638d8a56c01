# SPDX-License-Identifier: Apache-2.0
"""Known lengths along a line tell where it vanishes, and a known vanishing point tells lengths (20.4)-(20.9).

O, H1 and H2 lie on a line in space, H1 at the length a from O and H2 at a + b; y1, y2 and y3 are where H1, H2
and the vanishing point of the line appear, measured in the picture from the image of O along the image of the
line. The cross ratio of four points on a line survives every projection, so nothing is assumed of camera or
line: neither need be level, and only the ratio of a to b counts. All arguments may be arrays that broadcast.
"""

from __future__ import annotations

from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from robot_vision.geometry.arrays import FloatArray
from robot_vision.geometry.errors import CrossRatioError

#: What is smaller than this share of its own summands is their rounding.
_ROUNDING = 8.0 * float(np.finfo(np.float64).eps)
#: The same for places that came through a projection: a vanishing point 1e12 lengths away is at infinity.
_PARALLEL = 1e-12


@overload
def vanishing_offset(y1: float, y2: float, a: float = 1.0, b: float = 1.0) -> float: ...


@overload
def vanishing_offset(
    y1: ArrayLike, y2: ArrayLike, a: ArrayLike = 1.0, b: ArrayLike = 1.0
) -> float | FloatArray: ...


def vanishing_offset(
    y1: ArrayLike, y2: ArrayLike, a: ArrayLike = 1.0, b: ArrayLike = 1.0
) -> float | FloatArray:
    """Give y3, the distance of the vanishing point from O (20.7): y3 = b y1 y2 / [(a + b) y1 - a y2].

    With a = b this is (20.8), y3 = y1 y2 / (2 y1 - y2). A negative y3 lies on the other side of O: the line
    comes towards the camera.

    Args:
        y1: distance of the image of H1 from that of O, any unit.
        y2: of that of H2, the same unit.
        a: length O H1 on the ground, any unit.
        b: length H1 H2, the same unit.

    Raises:
        CrossRatioError: a length that is not positive, points that coincide, or a picture that keeps the
            ratio of the lengths, so that the line is parallel to it and vanishes at infinity.
    """
    near, far, first, second = _checked(("y1", y1), ("y2", y2), ("a", a), ("b", b))
    for name, length in (("a", first), ("b", second)):
        if (length <= 0.0).any():
            raise CrossRatioError(
                f"the length {name} must be positive, got {length.min():g}: a ratio of spacings that is zero "
                "puts two of the points in one place"
            )
    _check_distinct(("O", 0.0 * near), ("y1", near), ("y2", far))
    whole, part = (first + second) * near, first * far
    slant = whole - part
    if (np.abs(slant) <= _PARALLEL * (np.abs(whole) + np.abs(part))).any():
        raise CrossRatioError(
            "the picture shows the lengths in their true ratio, so the line is parallel to the picture and "
            "its vanishing point at infinity"
        )
    return _plain(second * near * far / slant)


@overload
def length_ratio(y1: float, y2: float, y3: float) -> float: ...


@overload
def length_ratio(y1: ArrayLike, y2: ArrayLike, y3: ArrayLike) -> float | FloatArray: ...


def length_ratio(y1: ArrayLike, y2: ArrayLike, y3: ArrayLike) -> float | FloatArray:
    """Give (a + b) / a, the lengths O H2 to O H1 on the ground (20.4): y2 (y3 - y1) / [y1 (y3 - y2)].

    Args:
        y1: distance of the image of H1 from that of O, any unit.
        y2: of that of H2, the same unit.
        y3: distance of the vanishing point from the image of O, the same unit.

    Raises:
        CrossRatioError: H1 appears at O, or a point appears at the vanishing point, infinitely far away.
    """
    near, far, vanishing = _checked(("y1", y1), ("y2", y2), ("y3", y3))
    _check_distinct(("O", 0.0 * near), ("y1", near), ("y3", vanishing))
    _check_distinct(("y2", far), ("y3", vanishing))
    return _plain(far * (vanishing - near) / (near * (vanishing - far)))


def _checked(*named: tuple[str, ArrayLike]) -> list[FloatArray]:
    """The arguments as float64 arrays of one shape."""
    values = [np.asarray(value, dtype=np.float64) for _, value in named]
    for (name, _), value in zip(named, values, strict=True):
        if not np.isfinite(value).all():
            raise CrossRatioError(f"{name} must be finite, got {value[~np.isfinite(value)].flat[0]:g}")
    return [np.asarray(value) for value in np.broadcast_arrays(*values)]


def _check_distinct(*named: tuple[str, FloatArray]) -> None:
    for number, (name, place) in enumerate(named):
        for other, taken in named[:number]:
            if (np.abs(place - taken) <= _ROUNDING * np.maximum(np.abs(place), np.abs(taken))).any():
                raise CrossRatioError(f"{other} and {name} are one point of the picture; they must differ")


def _plain(values: FloatArray) -> float | FloatArray:
    return float(values) if np.ndim(values) == 0 else np.asarray(values)
