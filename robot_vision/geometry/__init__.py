# SPDX-License-Identifier: Apache-2.0
"""The geometry of one camera over a floor, in numpy alone, so that every other room can stand on it."""

from robot_vision.geometry.camera import Camera
from robot_vision.geometry.errors import CameraError, GroundPlaneError
from robot_vision.geometry.ground import GroundPlane
from robot_vision.geometry.rotation import (
    BODY_FROM_OPTICAL,
    attitude_from_up,
    quaternion_from_rotation,
    quaternion_to_rotation,
    rotation_from_rpy,
    rpy_from_rotation,
    up_from_attitude,
    wrap_angle,
)

__all__ = [
    "BODY_FROM_OPTICAL",
    "Camera",
    "CameraError",
    "GroundPlane",
    "GroundPlaneError",
    "attitude_from_up",
    "quaternion_from_rotation",
    "quaternion_to_rotation",
    "rotation_from_rpy",
    "rpy_from_rotation",
    "up_from_attitude",
    "wrap_angle",
]
