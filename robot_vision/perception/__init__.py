# SPDX-License-Identifier: Apache-2.0
"""What a picture shows: straight lines, the vanishing points they lead to, and the lane between two of them."""

from robot_vision.perception.attitude import Attitude
from robot_vision.perception.centres import CentreError, CentreFinder, Centres, TrueCentre
from robot_vision.perception.crop_rows import CropRowDetector, RowPattern
from robot_vision.perception.ellipse_detector import EllipseDetector, SeenEllipse
from robot_vision.perception.heading import HeadingEstimate, HeadingEstimator
from robot_vision.perception.lane import LaneHeading
from robot_vision.perception.line_detector import LineDetector
from robot_vision.perception.segments import LineSegments
from robot_vision.perception.vanishing import (
    Role,
    VanishingPointEstimator,
    VanishingPoints,
    VanishingPointTracker,
)

__all__ = [
    "Attitude",
    "CentreError",
    "CentreFinder",
    "Centres",
    "CropRowDetector",
    "EllipseDetector",
    "HeadingEstimate",
    "HeadingEstimator",
    "LaneHeading",
    "LineDetector",
    "LineSegments",
    "Role",
    "RowPattern",
    "SeenEllipse",
    "TrueCentre",
    "VanishingPointEstimator",
    "VanishingPointTracker",
    "VanishingPoints",
]
