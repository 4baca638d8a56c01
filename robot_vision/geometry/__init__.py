# SPDX-License-Identifier: Apache-2.0
"""The geometry of one camera over a floor, in numpy alone, so that every other room can stand on it."""

from robot_vision.geometry.camera import Camera
from robot_vision.geometry.circle_plane import CirclePlane, circle_normals, plane_of_circles
from robot_vision.geometry.conics import (
    ImageEllipse,
    centre_by_tangents,
    centre_shift,
    contact_points,
    projected_centre,
)
from robot_vision.geometry.cross_ratio import length_ratio, vanishing_offset
from robot_vision.geometry.errors import (
    AboveHorizonError,
    CameraError,
    ConicError,
    CrossRatioError,
    GroundPlaneError,
)
from robot_vision.geometry.flagstones import OffsetFit, VanishingLineFit, fit_stones, fit_widths
from robot_vision.geometry.ground import GroundPlane, GroundPoints
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
from robot_vision.geometry.spacings import SpacingFit, fit_spacings
from robot_vision.geometry.vanishing_line import vanishing_line

__all__ = [
    "BODY_FROM_OPTICAL",
    "AboveHorizonError",
    "Camera",
    "CameraError",
    "CirclePlane",
    "ConicError",
    "CrossRatioError",
    "GroundPlane",
    "GroundPlaneError",
    "GroundPoints",
    "ImageEllipse",
    "OffsetFit",
    "SpacingFit",
    "VanishingLineFit",
    "attitude_from_up",
    "centre_by_tangents",
    "centre_shift",
    "circle_normals",
    "contact_points",
    "fit_spacings",
    "fit_stones",
    "fit_widths",
    "length_ratio",
    "plane_of_circles",
    "projected_centre",
    "quaternion_from_rotation",
    "quaternion_to_rotation",
    "rotation_from_rpy",
    "rpy_from_rotation",
    "up_from_attitude",
    "vanishing_line",
    "vanishing_offset",
    "wrap_angle",
]
