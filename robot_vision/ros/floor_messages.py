# SPDX-License-Identifier: Apache-2.0
"""Plans of the floor, points on it and the free way ahead as messages, and poses from odometry."""

from __future__ import annotations

import array
import math

import numpy as np
from geometry_msgs.msg import Point, Pose
from nav_msgs.msg import MapMetaData, OccupancyGrid, Odometry
from sensor_msgs.msg import PointCloud2, Range
from std_msgs.msg import Header

from robot_vision.geometry.rotation import quaternion_to_rotation, rpy_from_rotation
from robot_vision.mapping import GroundPoints, PlanView
from robot_vision.mapping import Pose as PlanarPose
from robot_vision.ros.maps import floor_map_from_message
from robot_vision.ros.messages import MessageError, check_finite, cloud_from_points

GROUND_POINTS_LAYOUT = np.dtype(
    [(name, "<f4") for name in ("x", "y", "z", "sigma_x", "sigma_y")] + [("kind", "u1")]
)


def plan_to_message(header: Header, plan: PlanView, frame: str) -> OccupancyGrid:
    """Build `plan_view` or `map`, with the stamp of `header`."""
    rows, columns = plan.cells.shape
    x, y = plan.origin
    return OccupancyGrid(
        header=Header(stamp=header.stamp, frame_id=frame),
        info=MapMetaData(
            map_load_time=header.stamp,
            resolution=plan.resolution,
            width=columns,
            height=rows,
            origin=Pose(position=Point(x=x, y=y, z=0.0)),
        ),
        data=array.array("b", plan.cells.tobytes()),
    )


def plan_from_message(message: OccupancyGrid) -> PlanView:
    """Read `plan_view`.

    Raises:
        MessageError: it is not in base_link, is turned, holds another number of cells than it says, or no numbers.
    """
    if message.header.frame_id != "base_link":
        raise MessageError(f"the plan is in the frame {message.header.frame_id!r}; base_link is understood")
    floor = floor_map_from_message(message)
    x, y, yaw = floor.origin
    if yaw != 0.0:
        raise MessageError("the plan is turned against base_link")
    return PlanView(floor.cells, floor.resolution, (x, y))


def ground_points_to_message(header: Header, points: GroundPoints | None) -> PointCloud2:
    """Build `ground_points`, in base_link; None gives an empty cloud."""
    cloud = np.zeros(0 if points is None else len(points), GROUND_POINTS_LAYOUT)
    if points is not None:
        cloud["x"], cloud["y"], cloud["kind"] = points.x, points.y, points.kind
        cloud["sigma_x"], cloud["sigma_y"] = np.sqrt(np.diagonal(points.covariance, axis1=1, axis2=2)).T
    return cloud_from_points(Header(stamp=header.stamp, frame_id="base_link"), cloud)


def clearance_to_message(header: Header, clearance_m: float, width_m: float, reach_m: float) -> Range:
    """Build `clearance`: inf where nothing is in the way, -inf where it is nearer than can be seen (REP-117).

    Args:
        header: of the picture.
        clearance_m: from the robot's front, m.
        width_m: of the strip that was looked at, m.
        reach_m: greatest distance that can be told, m.
    """
    return Range(
        header=Header(stamp=header.stamp, frame_id="base_link"),
        radiation_type=Range.INFRARED,  # of the two that there are, the one that is light
        field_of_view=2.0 * math.atan2(width_m / 2.0, max(reach_m, width_m)),
        min_range=0.0,
        max_range=reach_m,
        range=clearance_m if clearance_m > 0.0 else -math.inf,
    )


def pose_from_odometry(message: Odometry) -> tuple[PlanarPose, float]:
    """Read x, y, yaw and the pitch (rad, nose down) of the body.

    Raises:
        MessageError: a number is not finite, or the orientation is none.
    """
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    check_finite({f"pose.position.{axis}": getattr(place, axis) for axis in "xy"})
    check_finite({f"pose.orientation.{axis}": getattr(turn, axis) for axis in "xyzw"})
    try:
        rotation = quaternion_to_rotation((turn.x, turn.y, turn.z, turn.w))
    except ValueError as error:
        raise MessageError(f"pose.orientation names no direction: {error}") from error
    _, pitch, yaw = rpy_from_rotation(rotation)
    return PlanarPose(float(place.x), float(place.y), yaw), pitch
