# SPDX-License-Identifier: Apache-2.0
"""A plan of the floor from one camera: what is free, what stands there, and what nobody has seen yet."""

from robot_vision.mapping.feature_points import GroundPoints, PointKind
from robot_vision.mapping.grid_pose import GridPose
from robot_vision.mapping.ground_lines import LineKind
from robot_vision.mapping.mapper import PlanViewEstimate, PlanViewMapper
from robot_vision.mapping.objects import GroundObject
from robot_vision.mapping.occupancy import OccupancyMap
from robot_vision.mapping.plan_view import PlanView
from robot_vision.mapping.pose import Pose, PoseHistory

__all__ = [
    "GridPose",
    "GroundObject",
    "GroundPoints",
    "LineKind",
    "OccupancyMap",
    "PlanView",
    "PlanViewEstimate",
    "PlanViewMapper",
    "PointKind",
    "Pose",
    "PoseHistory",
]
