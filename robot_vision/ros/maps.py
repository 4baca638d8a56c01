# SPDX-License-Identifier: Apache-2.0
"""Maps, goals and distance fields of the graph to and from the value types of planning."""

from __future__ import annotations

import array
import math

import numpy as np
from geometry_msgs.msg import Pose, PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import MapMetaData, OccupancyGrid, Odometry
from numpy.typing import NDArray
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from robot_vision.geometry.rotation import quaternion_to_rotation
from robot_vision.planning.floor_map import FloorMap
from robot_vision.planning.grid import PlanningError
from robot_vision.planning.maze import Maze
from robot_vision.planning.maze_grid import maze_to_grid
from robot_vision.ros.messages import MessageError, check_finite

_CELLS = 8
"""Cells of a map from one wall of a maze to the next."""


def floor_map_from_message(message: OccupancyGrid) -> FloorMap:
    """Read a map.

    Raises:
        MessageError: it has no cells, another number of them than it says, values that are neither -1 nor 0 to 100, or
            numbers that make no sense.
    """
    info = message.info
    rows, columns = int(info.height), int(info.width)
    if len(message.data) != rows * columns:
        raise MessageError(f"it holds {len(message.data)} cells, not {columns} x {rows} as its info says")
    cells = np.frombuffer(message.data, np.int8).reshape(rows, columns)
    x, y, yaw = _planar(info.origin, "info.origin")
    try:
        return FloorMap(cells, float(info.resolution), (x, y, yaw))
    except PlanningError as why:
        raise MessageError(str(why).removeprefix("map: ")) from why


def place_from_odometry(message: Odometry) -> tuple[float, float, float]:
    """Read where the robot is: x, y (m) and yaw (rad) in the frame of the header.

    Raises:
        MessageError: a number is none, or there is no orientation.
    """
    return _planar(message.pose.pose, "pose.pose")


def goal_from_message(message: PoseStamped) -> tuple[float, float]:
    """Read a goal: x, y (m) in the frame of the header.

    Raises:
        MessageError: a number is none.
    """
    position = message.pose.position
    check_finite({"pose.position.x": position.x, "pose.position.y": position.y})
    return float(position.x), float(position.y)


def field_to_message(header: Header, field: NDArray[np.float64]) -> Image:
    """Build the picture of a distance function (R, C): 32FC1, metres, inf where there is no way; row 0 first."""
    rows, columns = field.shape
    return Image(
        header=header,
        height=rows,
        width=columns,
        encoding="32FC1",
        is_bigendian=0,
        step=4 * columns,
        data=array.array("B", field.astype("<f4").tobytes()),
    )


def maze_to_message(header: Header, maze: Maze, cell: float, frame: str) -> OccupancyGrid:
    """Build the map of a maze of cells of `cell` metres; its frame has its origin in the south-western corner."""
    cells = maze_to_grid(maze, _CELLS, 1)
    resolution = cell / _CELLS
    origin = Pose()
    origin.position.x = origin.position.y = -resolution / 2
    info = MapMetaData(
        map_load_time=header.stamp,
        resolution=resolution,
        width=cells.shape[1],
        height=cells.shape[0],
        origin=origin,
    )
    own = Header(stamp=header.stamp, frame_id=frame)
    return OccupancyGrid(header=own, info=info, data=array.array("b", cells.tobytes()))


def place_to_message(
    header: Header, place: tuple[float, float, float], sigma: NDArray[np.float64], frame: str
) -> PoseWithCovarianceStamped:
    """Build the message of a place x, y (m) and yaw (rad) with their standard deviations (3,)."""
    message = PoseWithCovarianceStamped(header=Header(stamp=header.stamp, frame_id=frame))
    pose = message.pose.pose
    pose.position.x, pose.position.y = place[0], place[1]
    pose.orientation.z, pose.orientation.w = math.sin(place[2] / 2), math.cos(place[2] / 2)
    covariance = np.zeros(36)
    covariance[[0, 7, 35]] = sigma**2
    message.pose.covariance = covariance
    return message


def _planar(pose: Pose, name: str) -> tuple[float, float, float]:
    position, turn = pose.position, pose.orientation
    check_finite(
        {
            f"{name}.position.x": position.x,
            f"{name}.position.y": position.y,
            **{f"{name}.orientation.{axis}": getattr(turn, axis) for axis in "xyzw"},
        }
    )
    quaternion = np.array([turn.x, turn.y, turn.z, turn.w])
    length = float(np.linalg.norm(quaternion))
    if length == 0.0:
        raise MessageError(f"{name}.orientation is missing")
    rotation = quaternion_to_rotation(quaternion / length)
    return float(position.x), float(position.y), math.atan2(rotation[1, 0], rotation[0, 0])
