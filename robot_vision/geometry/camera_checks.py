# SPDX-License-Identifier: Apache-2.0
"""No camera is built from nonsense: each field is checked here, and refused with its reason."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from robot_vision.geometry.arrays import FloatArray
from robot_vision.geometry.errors import CameraError

_FARTHEST_PRINCIPAL_POINT = 2.0  # focal lengths outside the picture: crops of a 126° camera still pass
_LARGEST_SIZE = 1_000_000  # px: far beyond any sensor
_SHORTEST_FOCAL_LENGTH = 1e-3  # px: below it a picture would be all horizon
_ORTHONORMAL_WITHIN = 1e-3  # of a unit entry: calibration files carry as few as four digits


def checked_number(name: str, value: Any) -> float:
    """Give a finite float, or refuse naming the field."""
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise CameraError(name, f"must be a number, got {value!r}") from None
    except OverflowError:
        raise CameraError(name, "is greater than any number of a picture") from None
    if not math.isfinite(number):
        raise CameraError(name, f"must be a finite number, got {number}")
    return number


def checked_size(name: str, value: Any) -> int:
    """Give a whole number of pixels above zero, or refuse naming the field."""
    number = checked_number(name, value)
    if number <= 0 or number != int(number):
        raise CameraError(name, f"must be a whole number of pixels above zero, got {value}")
    if number > _LARGEST_SIZE:
        raise CameraError(name, f"must be at most {_LARGEST_SIZE} px, got {value}")
    return int(number)


def checked_focal_length(name: str, value: Any) -> float:
    """Give a focal length in px, or refuse naming the field."""
    number = checked_number(name, value)
    if number <= 0.0:
        raise CameraError(name, f"focal length must be positive, got {number:g} px")
    if number < _SHORTEST_FOCAL_LENGTH:
        raise CameraError(name, f"must be at least {_SHORTEST_FOCAL_LENGTH:g} px, got {number:g} px")
    return number


def checked_angle(name: str, value: Any) -> float:
    """Give an angle of at most a whole turn, rad, or refuse naming the field."""
    number = checked_number(name, value)
    if abs(number) > 2.0 * math.pi:
        raise CameraError(name, f"must be an angle in rad, within a turn, got {number:g}; is it in degrees?")
    return number


def check_principal_point(name: str, place: float, focal: float, size_name: str, size: int) -> None:
    """Refuse a principal point so far outside that the calibration must be of another picture."""
    outside = max(-0.5 - place, place - (size - 0.5), 0.0)
    if outside > size and outside > _FARTHEST_PRINCIPAL_POINT * focal:
        raise CameraError(
            name,
            f"principal point {place:g} lies {outside:g} px outside the picture ({size_name} {size}); "
            "check that the calibration belongs to this picture size",
        )


def checked_rotation(value: Any) -> tuple[tuple[float, ...], ...] | None:
    """Give a rotation (3, 3) as tuples, None for none or the identity, or refuse it."""
    if value is None:
        return None
    rotation = _array("rectification", "3x3", value)
    if rotation.shape != (3, 3) or not np.isfinite(rotation).all():
        raise CameraError("rectification", "must be 3x3 finite numbers")
    error = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    if error > _ORTHONORMAL_WITHIN or np.linalg.det(rotation) < 0.0:
        determinant = float(np.linalg.det(rotation))
        raise CameraError(
            "rectification",
            f"must be a rotation: R Rᵀ is off by {error:.3g}, determinant {determinant:.3g} (CameraInfo r)",
        )
    if np.array_equal(rotation, np.eye(3)):
        return None
    return tuple(tuple(row) for row in rotation.tolist())


def checked_projection(value: Any, matrix: FloatArray) -> tuple[tuple[float, ...], ...] | None:
    """Give CameraInfo `p` (3, 4) as tuples, None when it only repeats `matrix`, or refuse it."""
    if value is None:
        return None
    projection = _array("projection", "3x4", value)
    if projection.shape != (3, 4) or not np.isfinite(projection).all():
        raise CameraError("projection", "must be 3x4 finite numbers")
    if projection[0, 0] <= 0.0 or projection[1, 1] <= 0.0:
        focals = f"{projection[0, 0]:g} and {projection[1, 1]:g} px"
        raise CameraError("projection", f"focal lengths must be positive, got {focals} (CameraInfo p)")
    check_no_skew("projection", projection)
    if np.array_equal(projection, np.column_stack([matrix, np.zeros(3)])):
        return None
    return tuple(tuple(row) for row in projection.tolist())


def _array(field: str, form: str, value: Any) -> FloatArray:
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise CameraError(field, f"must be {form} finite numbers, got {value!r}") from None


def check_no_skew(field: str, matrix: FloatArray) -> None:
    """Refuse a camera matrix (3, 3) or (3, 4) that is not [[fx, 0, cx], [0, fy, cy], [0, 0, 1]].

    Raises:
        CameraError: naming `field`.
    """
    form = matrix[:, :3].copy()
    form[[0, 1, 0, 1], [0, 1, 2, 2]] = 0.0
    if not np.array_equal(form, np.diag([0.0, 0.0, 1.0])):
        given = matrix[:, :3].tolist()
        raise CameraError(field, f"must be [fx 0 cx; 0 fy cy; 0 0 1], without skew, got {given}")
