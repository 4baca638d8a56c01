# SPDX-License-Identifier: Apache-2.0
"""Attitudes are said as matrix, angles, quaternion and up vector: here is the one place that translates them.

Angles are radians, right-handed, in the order of REP-103: R = Rz(yaw) Ry(pitch) Rx(roll). For a camera body
this means pitch > 0 looks down and roll > 0 lifts the left side.
"""

from __future__ import annotations

import math
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from robot_vision.geometry.arrays import FloatArray

BODY_FROM_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""(3, 3): optical frame (x right, y down, z forward) to camera body (x forward, y left, z up), REP-103."""
BODY_FROM_OPTICAL.setflags(write=False)


@overload
def wrap_angle(angle: float) -> float: ...


@overload
def wrap_angle(angle: FloatArray) -> FloatArray: ...


def wrap_angle(angle: float | FloatArray) -> float | FloatArray:
    """Give the same angle (rad) in (-π, π]; angles already there come back unchanged to the last bit."""
    wrapped = angle - 2.0 * np.pi * np.ceil((np.asarray(angle) - np.pi) / (2.0 * np.pi))
    return float(wrapped) if np.ndim(angle) == 0 else np.asarray(wrapped)


def rotation_from_rpy(roll: float, pitch: float, yaw: float) -> FloatArray:
    """Give R = Rz(yaw) Ry(pitch) Rx(roll), (3, 3): it takes a vector of the turned frame to the fixed one."""
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_from_rotation(rotation: ArrayLike) -> tuple[float, float, float]:
    """Give (roll, pitch, yaw) of a rotation (3, 3); pitch is in [-π/2, π/2], and at ±π/2 roll is zero."""
    r = np.asarray(rotation, dtype=np.float64)
    level = math.hypot(r[0, 0], r[1, 0])
    pitch = math.atan2(-r[2, 0], level)
    if level < 1e-12:  # straight up or down, roll and yaw turn about the same axis
        return 0.0, pitch, math.atan2(-r[0, 1], r[1, 1])
    return math.atan2(r[2, 1], r[2, 2]), pitch, math.atan2(r[1, 0], r[0, 0])


def quaternion_from_rotation(rotation: ArrayLike) -> FloatArray:
    """Give the unit quaternion (x, y, z, w), w >= 0, of a rotation (3, 3).

    The largest of the four components is found first and the others divided by it (Shepperd 1978), so that no
    half turn loses digits.
    """
    r = np.asarray(rotation, dtype=np.float64)
    trace = r[0, 0] + r[1, 1] + r[2, 2]
    squares = np.array([r[0, 0], r[1, 1], r[2, 2], trace])
    largest = int(np.argmax(squares))
    q = np.empty(4)
    if largest == 3:
        q[3] = 1.0 + trace
        q[:3] = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    else:
        i, j, k = largest, (largest + 1) % 3, (largest + 2) % 3
        q[i] = 1.0 + r[i, i] - r[j, j] - r[k, k]
        q[j] = r[j, i] + r[i, j]
        q[k] = r[k, i] + r[i, k]
        q[3] = r[k, j] - r[j, k]
    q /= math.copysign(float(np.linalg.norm(q)), q[3])
    return q


def quaternion_to_rotation(quaternion: ArrayLike) -> FloatArray:
    """Give the rotation (3, 3) of a quaternion (x, y, z, w), which need not be of unit length.

    Raises:
        ValueError: when it is zero or not finite and so names no rotation.
    """
    q = np.asarray(quaternion, dtype=np.float64)
    length = float(np.linalg.norm(q)) if q.shape == (4,) else math.nan
    if not (math.isfinite(length) and length > 1e-12):
        raise ValueError(f"quaternion (x, y, z, w) must be finite and not all zero, got {q.tolist()}")
    x, y, z, w = q / length
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def up_from_attitude(roll: float, pitch: float) -> FloatArray:
    """Give the vertical, a unit vector (3,) in the optical frame, of a body with this roll and pitch."""
    cp = math.cos(pitch)
    return np.array([-cp * math.sin(roll), -cp * math.cos(roll), -math.sin(pitch)])


def attitude_from_up(up: ArrayLike) -> tuple[float, float]:
    """Give (roll, pitch) of the camera body from the vertical in the optical frame (3,), of any length.

    Straight up or down, where roll has no meaning, it is zero.

    Raises:
        ValueError: when `up` is zero or not finite.
    """
    v = np.asarray(up, dtype=np.float64)
    length = float(np.linalg.norm(v)) if v.shape == (3,) else math.nan
    if not (math.isfinite(length) and length > 1e-12):
        raise ValueError(f"up must be three finite numbers, not all zero, got {v.tolist()}")
    x, y, z = v / length
    across = math.hypot(x, y)
    return (math.atan2(-x, -y) if across > 1e-12 else 0.0), math.atan2(-z, across)
