# SPDX-License-Identifier: Apache-2.0
"""What each kind of message looks like in the viewer."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from robot_vision.bags.clouds import points
from robot_vision.bags.messages import picture, yaw_of
from robot_vision.geometry.rotation import quaternion_to_rotation, rpy_from_rotation

Shown = Iterator[tuple[str, Any]]

_NOT_KNOWN = 1e5
"""Variance from which on a number means nothing."""
_ROLES = np.array([(160, 160, 160), (255, 60, 60), (60, 220, 60), (60, 140, 255)], np.uint8)
_KINDS = np.array([(90, 200, 90), (230, 70, 70), (110, 110, 160)], np.uint8)


def shown(topic: str, type_name: str, message: Any) -> Shown:
    """Yield entity paths and archetypes of a message; nothing for what means nothing, such as an empty cloud.

    Args:
        topic: without a leading slash.
        type_name: one of `KNOWN`.
        message: decoded.
    """
    return KNOWN[type_name](topic, message)


def _image(topic: str, message: Any) -> Shown:
    if message.encoding == "32FC1":
        order = ">f4" if message.is_bigendian else "<f4"
        metres = np.frombuffer(bytes(message.data), order).reshape(message.height, message.step // 4)
        metres = metres[:, : message.width].astype(np.float32)
        # Of a distance function the first row lies below, as that of the map.
        plan = topic.split("/")[-1] == "distance_field"
        yield f"{'plan' if plan else 'camera'}/{topic}", rr.DepthImage(metres[::-1] if plan else metres)
        return
    pixels = picture(message)
    model = "L" if pixels.ndim == 2 else "BGR"
    yield f"{_screen(topic)}/{topic}", rr.Image(pixels, color_model=model, draw_order=-1.0)


def _compressed_image(topic: str, message: Any) -> Shown:
    data = bytes(message.data)
    kind = "image/png" if data[:4] == b"\x89PNG" else "image/jpeg"
    yield (
        f"{_screen(topic)}/{topic}",
        rr.EncodedImage(contents=data, media_type=kind, draw_order=-1.0),
    )


def _screen(topic: str) -> str:
    return "overlay" if "overlay" in topic else "camera"


def _cloud(topic: str, message: Any) -> Shown:
    cloud = points(message)
    names = cloud.dtype.names or ()
    if "x1" in names:
        ends = np.stack([cloud[name] for name in ("x1", "y1", "x2", "y2")], axis=-1).reshape(-1, 2, 2)
        yield f"camera/{topic}", rr.LineStrips2D(ends, colors=[(255, 200, 0)], radii=-1.0)
    elif "u" in names and "role" in names:
        near = np.isfinite(cloud["u"]) & np.isfinite(cloud["v"])
        pixels = np.stack([cloud["u"], cloud["v"]], axis=-1)[near]
        colours = _ROLES[np.minimum(cloud["role"][near], len(_ROLES) - 1)]
        labels = [str(number) for number in cloud["id"][near]]
        yield f"camera/{topic}", rr.Points2D(pixels, colors=colours, labels=labels, radii=-5.0)
    elif {"x", "y", "z"} <= set(names):
        places = np.stack([cloud[name] for name in ("x", "y", "z")], axis=-1)
        kinds = cloud["kind"] if "kind" in names else np.zeros(len(cloud), np.uint8)
        yield (
            f"{message.header.frame_id}/{topic}",
            rr.Points3D(places, colors=_KINDS[np.minimum(kinds, len(_KINDS) - 1)], radii=-3.0),
        )


def _heading(topic: str, message: Any) -> Shown:
    spread = np.asarray(message.pose.covariance).reshape(6, 6)
    if spread[1, 1] < _NOT_KNOWN:
        yield f"curves/offset/{topic}", rr.Scalars(message.pose.pose.position.y)
    if spread[5, 5] < _NOT_KNOWN:
        yield f"curves/angle/{topic}/yaw", rr.Scalars(math.degrees(yaw_of(message.pose.pose.orientation)))


def _steering(topic: str, message: Any) -> Shown:
    yield f"curves/speed/{topic}", rr.Scalars(message.twist.linear.x)
    yield f"curves/angle/{topic}/turn_rate", rr.Scalars(math.degrees(message.twist.angular.z))


def _attitude(topic: str, message: Any) -> Shown:
    q = message.orientation
    roll, pitch, _ = rpy_from_rotation(quaternion_to_rotation((q.x, q.y, q.z, q.w)))
    yield f"curves/angle/{topic}/roll", rr.Scalars(math.degrees(roll))
    yield f"curves/angle/{topic}/pitch", rr.Scalars(math.degrees(pitch))


def _range(topic: str, message: Any) -> Shown:
    if math.isfinite(message.range):
        yield f"curves/clearance/{topic}", rr.Scalars(message.range)


def _path(topic: str, message: Any) -> Shown:
    way = [(p.pose.position.x, p.pose.position.y, p.pose.position.z) for p in message.poses]
    yield f"{message.header.frame_id}/{topic}", rr.LineStrips3D([way] if way else [], colors=[(80, 180, 255)])


def _odometry(topic: str, message: Any) -> Shown:
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    rotation = quaternion_to_rotation((turn.x, turn.y, turn.z, turn.w))
    yield (
        f"odom/{topic}",
        rr.Arrows3D(origins=[(place.x, place.y, place.z)], vectors=[0.5 * rotation[:, 0]]),
    )
    yield f"curves/speed/{topic}", rr.Scalars(message.twist.twist.linear.x)


def _grid(topic: str, message: Any) -> Shown:
    cells: NDArray[np.int8] = np.asarray(message.data, np.int8).reshape(
        message.info.height, message.info.width
    )
    if not cells.size:
        return
    grey = np.where(cells < 0, 128, 255 - (np.clip(cells, 0, 100).astype(np.int16) * 255) // 100)
    # The first row of a grid lies at its smallest y, which in a plan is below.
    yield f"plan/{topic}", rr.Image(grey[::-1].astype(np.uint8), color_model="L")


KNOWN: dict[str, Callable[[str, Any], Shown]] = {
    "sensor_msgs/msg/Image": _image,
    "sensor_msgs/msg/CompressedImage": _compressed_image,
    "sensor_msgs/msg/PointCloud2": _cloud,
    "geometry_msgs/msg/PoseWithCovarianceStamped": _heading,
    "geometry_msgs/msg/TwistStamped": _steering,
    "sensor_msgs/msg/Imu": _attitude,
    "sensor_msgs/msg/Range": _range,
    "nav_msgs/msg/Path": _path,
    "nav_msgs/msg/Odometry": _odometry,
    "nav_msgs/msg/OccupancyGrid": _grid,
}
