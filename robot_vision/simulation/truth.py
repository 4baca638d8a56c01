# SPDX-License-Identifier: Apache-2.0
"""Says what is true in the messages that nodes use for what they believe, so that a scorer compares like with like.

Topics and types: `truth/heading`, `truth/odom`, `truth/attitude`, `truth/plants` a picture, and once, for
whoever comes later too, `truth/map` and `truth/shadows`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.geometry.rotation import attitude_from_up, quaternion_from_rotation, rotation_from_rpy
from robot_vision.simulation import floor_plan
from robot_vision.simulation.body import BodyState
from robot_vision.simulation.world import KINDS, World

BODY_FRAME, BASE_FRAME = "camera_link", "base_link"
PLANT_RANGE_M = 12.0
"""Plants farther off than this from the camera are no part of `truth/plants`."""
PLANT_FIELDS = np.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("area", "<f4"),
        ("id", "<u4"),
        ("kind", "u1"),
        ("row", "<i2"),
    ]
)
"""base_link, metres and square metres; kind 0 crop, 1 weed; row -1 for a weed between rows."""


class Said(NamedTuple):
    """A message on its way out: topic without a leading slash, type name, message of `bags.messages`."""

    topic: str
    type_name: str
    message: Any


class TruthTeller:
    """Tells the truth about one world.

    Args:
        world: where the robot drives.
        camera: on the robot.
    """

    def __init__(self, world: World, camera: Camera) -> None:
        self._world, self._camera = world, camera
        self._plants = _table(world)

    def lasting(self, stamp_ns: int) -> Iterator[Said]:
        """Plans of the floor, which hold for the whole drive."""
        from robot_vision.bags.clouds import occupancy_grid

        if not self._world.floor:
            return
        for topic, draw in (("truth/map", floor_plan.occupancy), ("truth/shadows", floor_plan.shadows)):
            plan = draw(self._world)
            grid = occupancy_grid(stamp_ns, self._world.frame, plan.cells, plan.resolution, plan.origin)
            yield Said(topic, "nav_msgs/msg/OccupancyGrid", grid)

    def at(self, stamp_ns: int, state: BodyState) -> Iterator[Said]:
        """What is true at the moment of a picture."""
        if self._world.lane is not None:
            yield self._heading(stamp_ns, state)
        yield self._odometry(stamp_ns, state)
        yield self._attitude(stamp_ns, state)
        if self._world.plants:
            yield self._seen_plants(stamp_ns, state)

    def _heading(self, stamp_ns: int, state: BodyState) -> Said:
        from robot_vision.bags import messages

        assert self._world.lane is not None
        pose = self._world.lane.locate(state.x, state.y, state.yaw)
        message = messages.lane_heading(stamp_ns, self._world.frame, pose.yaw, pose.offset)
        return Said("truth/heading", "geometry_msgs/msg/PoseWithCovarianceStamped", message)

    def _odometry(self, stamp_ns: int, state: BodyState) -> Said:
        from robot_vision.bags import messages

        message = messages.odometry(
            stamp_ns,
            (state.x, state.y, 0.0),
            messages.yaw_quaternion(state.yaw),
            (state.speed, 0.0, 0.0),
            (0.0, 0.0, state.turn_rate),
            frame_id=self._world.frame,
        )
        return Said("truth/odom", "nav_msgs/msg/Odometry", message)

    def _attitude(self, stamp_ns: int, state: BodyState) -> Said:
        """Of the camera's body: the lean of the robot with the mounting on top; yaw is no part of it."""
        from robot_vision.bags import messages

        leaning = rotation_from_rpy(state.roll, state.pitch, 0.0)
        roll, pitch = attitude_from_up((leaning @ self._camera.optical_to_base)[2])
        turn = [float(part) for part in quaternion_from_rotation(rotation_from_rpy(roll, pitch, 0.0))]
        covariance = np.diag([0.0, 0.0, messages.UNKNOWN_VARIANCE])
        return Said(
            "truth/attitude", "sensor_msgs/msg/Imu", messages.imu(stamp_ns, BODY_FRAME, turn, covariance)
        )

    def _seen_plants(self, stamp_ns: int, state: BodyState) -> Said:
        """Plants whose stem is in the picture."""
        from robot_vision.bags.clouds import point_cloud

        cos, sin = np.cos(state.yaw), np.sin(state.yaw)
        away = np.column_stack([self._plants["x"] - state.x, self._plants["y"] - state.y])
        near = np.hypot(away[:, 0], away[:, 1]) < PLANT_RANGE_M
        points, away = self._plants[near].copy(), away[near]
        places = np.column_stack([away + (state.x, state.y), np.zeros(len(away))])
        seen = self._in_picture(places, state)
        points["x"], points["y"] = cos * away[:, 0] + sin * away[:, 1], cos * away[:, 1] - sin * away[:, 0]
        cloud = np.zeros(int(seen.sum()), PLANT_FIELDS)
        for name in PLANT_FIELDS.names or ():
            cloud[name] = points[name][seen]
        return Said("truth/plants", "sensor_msgs/msg/PointCloud2", point_cloud(stamp_ns, BASE_FRAME, cloud))

    def _in_picture(self, places: NDArray[np.float64], state: BodyState) -> NDArray[np.bool_]:
        """Which points (N, 3) of the world the camera has in its picture."""
        pose = state.camera_pose(self._camera)
        u, v = self._camera.pixels((places - pose[:3, 3]) @ pose[:3, :3]).T  # NaN behind the camera
        inside = (u > -0.5) & (u < self._camera.width - 0.5) & (v > -0.5) & (v < self._camera.height - 0.5)
        return np.asarray(inside)


def _table(world: World) -> NDArray[np.void]:
    """All plants with their places in the world as float64: single precision is too coarse far away."""
    names = PLANT_FIELDS.names or ()
    table = np.zeros(len(world.plants), [(n, np.float64 if n in "xy" else PLANT_FIELDS[n]) for n in names])
    for number, plant in enumerate(world.plants):
        kind = KINDS.index(plant.kind)
        table[number] = (plant.x, plant.y, 0.0, plant.area, plant.id, kind, plant.row)
    return table
