# SPDX-License-Identifier: Apache-2.0
"""Messages of the graph to and from the value types of the library; bytes go in and out without a loop."""

from __future__ import annotations

import array
import math
from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from geometry_msgs.msg import Pose, PoseStamped, PoseWithCovarianceStamped, Quaternion, TwistStamped
from nav_msgs.msg import Path
from numpy.typing import ArrayLike, NDArray
from sensor_msgs.msg import Imu, PointCloud2, PointField, Range
from std_msgs.msg import Header

from robot_vision.geometry import Camera
from robot_vision.geometry.rotation import (
    quaternion_from_rotation,
    quaternion_to_rotation,
    rotation_from_rpy,
    rpy_from_rotation,
)
from robot_vision.perception import LineSegments, VanishingPoints
from robot_vision.perception.attitude import Attitude
from robot_vision.perception.lane import LaneHeading
from robot_vision.perception.segments import USUAL_SIGMA

#: Variance of a part that is not known.
UNKNOWN = 1e6
LINES_LAYOUT = np.dtype([(name, "<f4") for name in ("x1", "y1", "x2", "y2", "strength")])
#: The body of the camera: x ahead along the lens, y left, z up (REP-103), unlike the optical frame of its pictures.
CAMERA_BODY = "camera_link"
VANISHING_POINTS_LAYOUT = np.dtype(
    [(name, "<f4") for name in ("x", "y", "z", "u", "v", "sigma", "weight")]
    + [("id", "<u4"), ("role", "<u4")]
)
_DATATYPES = {"|i1": 1, "|u1": 2, "<i2": 3, "<u2": 4, "<i4": 5, "<u4": 6, "<f4": 7, "<f8": 8}
_FORMATS = {number: kind for kind, number in _DATATYPES.items()}


class MessageError(ValueError):
    """A message does not hold what its topic promises; the text tells what and where."""


def cloud_from_points(header: Header, points: NDArray[np.void]) -> PointCloud2:
    """Build a PointCloud2 of one row from an (N,) structured array; its fields become the cloud's."""
    layout = points.dtype
    fields = [
        PointField(name=name, offset=int(offset), datatype=_DATATYPES[kind.str], count=1)
        for name, (kind, offset, *_) in (layout.fields or {}).items()
    ]
    return PointCloud2(
        header=header,
        height=1,
        width=len(points),
        fields=fields,
        is_bigendian=False,
        point_step=layout.itemsize,
        row_step=layout.itemsize * len(points),
        data=array.array("B", points.tobytes()),  # anything but an array or bytes costs tens of ms
        is_dense=bool(all(np.isfinite(points[name]).all() for name in layout.names or ())),
    )


def points_from_cloud(cloud: PointCloud2, needed: Sequence[str]) -> NDArray[np.void]:
    """Read a PointCloud2 as an (N,) structured array, by the names of its fields.

    Args:
        cloud: of any layout.
        needed: names of fields without which it is of no use.

    Raises:
        MessageError: a field is missing or of an unknown type, or the cloud contradicts itself.
    """
    present = [field.name for field in cloud.fields]
    missing = [name for name in needed if name not in present]
    if missing:
        has = ", ".join(present) or "none"
        raise MessageError(f"the cloud lacks the fields {', '.join(missing)}; it has {has}")
    order: Literal["big", "little"] = "big" if cloud.is_bigendian else "little"
    formats = []
    for field in cloud.fields:
        if field.datatype not in _FORMATS or field.count != 1:
            raise MessageError(
                f"field {field.name} has the type {field.datatype} and count {field.count}; "
                "one number of a type between 1 and 8 is understood"
            )
        formats.append(np.dtype(_FORMATS[field.datatype]).newbyteorder(order))
    try:
        layout = np.dtype(
            {
                "names": present,
                "formats": formats,
                "offsets": [field.offset for field in cloud.fields],
                "itemsize": cloud.point_step,
            }
        )
        return np.frombuffer(cloud.data, layout, cloud.width * cloud.height)
    except ValueError as error:
        raise MessageError(f"the cloud contradicts itself: {error}") from error


def lines_to_message(header: Header, lines: LineSegments) -> PointCloud2:
    """Build the `lines` message."""
    points = np.empty(len(lines), LINES_LAYOUT)
    for column, name in enumerate(("x1", "y1", "x2", "y2")):
        points[name] = lines.endpoints[:, column]
    points["strength"] = lines.strength
    return cloud_from_points(header, points)


def lines_from_message(cloud: PointCloud2) -> LineSegments:
    """Read the `lines` message; how well each line is placed is not in it, so all are taken to be alike.

    Raises:
        MessageError: fields are missing, or a number is not finite.
    """
    points = points_from_cloud(cloud, ("x1", "y1", "x2", "y2", "strength"))
    columns = {name: points[name].astype(np.float64) for name in LINES_LAYOUT.names or ()}
    for name, values in columns.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise MessageError(f"{name} of line {bad[0]} is {values[bad[0]]} ({len(bad)} lines are so)")
    ends = np.column_stack([columns[name] for name in ("x1", "y1", "x2", "y2")])
    return LineSegments(ends, columns["strength"], np.full(len(points), USUAL_SIGMA))


def vanishing_points_to_message(header: Header, found: VanishingPoints | None) -> PointCloud2:
    """Build the `vanishing_points` message; None gives an empty one."""
    points = np.empty(0 if found is None else len(found), VANISHING_POINTS_LAYOUT)
    if found is not None and len(found):
        for column, name in enumerate(("x", "y", "z")):
            points[name] = found.directions[:, column]
        with np.errstate(over="ignore"):  # beyond float32 a pixel is at infinity
            points["u"], points["v"] = found.pixels.T
        points["sigma"] = found.sigma
        points["weight"] = found.weight
        points["id"] = found.ids
        points["role"] = found.roles
    return cloud_from_points(header, points)


def vanishing_points_from_message(cloud: PointCloud2, camera: Camera) -> VanishingPoints:
    """Read the `vanishing_points` message; which line belongs to which point is not in it.

    Args:
        cloud: the message.
        camera: of the picture.

    Raises:
        MessageError: fields are missing, or a number is not finite.
    """
    points = points_from_cloud(cloud, ("x", "y", "z", "sigma", "weight", "id", "role"))
    for name in ("x", "y", "z", "sigma", "weight"):
        bad = np.flatnonzero(~np.isfinite(points[name]))
        if len(bad):
            raise MessageError(f"{name} of vanishing point {bad[0]} is {points[name][bad[0]]}")
    directions = np.column_stack([points[name].astype(np.float64) for name in "xyz"])
    length = np.linalg.norm(directions, axis=1)
    if (length < 1e-6).any():
        raise MessageError(f"vanishing point {int(np.argmin(length))} has no direction")
    sigma = np.maximum(points["sigma"].astype(np.float64), 1e-6)
    return VanishingPoints(
        directions=directions / length[:, None],
        covariance=sigma[:, None, None] ** 2 * np.eye(2),
        weight=points["weight"].astype(np.float64),
        roles=points["role"].astype(np.uint32),
        ids=points["id"].astype(np.uint32),
        labels=np.zeros(0, np.intp),
        camera=camera,
    )


def heading_to_message(
    header: Header, lane: LaneHeading, frame: str = "corridor"
) -> PoseWithCovarianceStamped:
    """Build the `heading` message, with the stamp of `header` in the frame of the lane."""
    message = PoseWithCovarianceStamped(header=Header(stamp=header.stamp, frame_id=frame))
    known = lane.offset_known
    message.pose.pose.position.y = float(lane.offset) if known else 0.0
    message.pose.pose.orientation = _quaternion(0.0, 0.0, lane.yaw)
    covariance = np.zeros(36)
    covariance[::7] = UNKNOWN
    covariance[7] = min(lane.offset_variance, UNKNOWN)
    covariance[35] = min(lane.yaw_variance, UNKNOWN)
    message.pose.covariance = covariance
    return message


def heading_from_message(message: PoseWithCovarianceStamped) -> LaneHeading:
    """Read the `heading` message; the width of the lane is not in it.

    Raises:
        MessageError: a number is not finite, the orientation is none, or a variance is negative. A variance
            without end is one: it says that nothing is known.
    """
    pose, covariance = message.pose.pose, message.pose.covariance
    q = pose.orientation
    numbers = {
        "position.y": pose.position.y,
        **{f"orientation.{axis}": getattr(q, axis) for axis in "xyzw"},
        "the variance of y": min(covariance[7], UNKNOWN),
        "the variance of yaw": min(covariance[35], UNKNOWN),
    }
    check_finite(numbers)
    for name in ("the variance of y", "the variance of yaw"):
        if numbers[name] < 0.0:
            raise MessageError(f"{name} is negative ({numbers[name]:g})")
    try:
        rotation = quaternion_to_rotation((q.x, q.y, q.z, q.w))
    except ValueError as error:
        raise MessageError(f"orientation names no direction: {error}") from error
    yaw = rpy_from_rotation(rotation)[2]
    if covariance[35] >= UNKNOWN:
        raise MessageError("yaw is marked as unknown (variance 1e6), so there is nothing to steer by")
    known = covariance[7] < UNKNOWN
    return LaneHeading(
        yaw,
        float(covariance[35]),
        float(pose.position.y) if known else 0.0,
        float(covariance[7]) if known else math.inf,
    )


def attitude_to_message(header: Header, attitude: Attitude) -> Imu:
    """Build the `attitude` message: roll and pitch of the camera's body; yaw is not known."""
    own = Header(stamp=header.stamp, frame_id=CAMERA_BODY)
    message = Imu(header=own, orientation=_quaternion(attitude.roll, attitude.pitch, 0.0))
    covariance = np.zeros((3, 3))
    covariance[:2, :2] = attitude.covariance
    covariance[2, 2] = UNKNOWN
    message.orientation_covariance = covariance.ravel()
    message.angular_velocity_covariance[0] = -1.0
    message.linear_acceleration_covariance[0] = -1.0
    return message


def attitude_from_message(message: Imu) -> tuple[float, float]:
    """Read roll and pitch (rad) of the `attitude` message.

    Raises:
        MessageError: its orientation is marked absent, is not finite, or names none.
    """
    q = message.orientation
    check_finite({f"orientation.{axis}": getattr(q, axis) for axis in "xyzw"})
    if message.orientation_covariance[0] < 0.0:
        raise MessageError("its orientation is marked as absent (covariance -1)")
    try:
        rotation = quaternion_to_rotation((q.x, q.y, q.z, q.w))
    except ValueError as error:
        raise MessageError(f"orientation names no direction: {error}") from error
    roll, pitch, _ = rpy_from_rotation(rotation)
    return roll, pitch


def path_to_message(header: Header, points: ArrayLike, frame: str = "base_link") -> Path:
    """Build a Path in a frame through (N, 2) points (m), each turned towards the next."""
    xy = np.asarray(points, np.float64).reshape(-1, 2)
    own = Header(stamp=header.stamp, frame_id=frame)
    along = np.diff(xy, axis=0, append=xy[-1:] + (xy[-1:] - xy[-2:-1]))
    message = Path(header=own)
    for (x, y), (dx, dy) in zip(xy.tolist(), along.tolist(), strict=True):
        pose = Pose(orientation=_quaternion(0.0, 0.0, math.atan2(dy, dx)))
        pose.position.x, pose.position.y = x, y
        message.poses.append(PoseStamped(header=own, pose=pose))
    return message


def path_from_message(message: Path) -> NDArray[np.float64]:
    """Read the points (N, 2) of a Path in base_link, m.

    Raises:
        MessageError: it is in another frame, or a number is not finite.
    """
    if message.header.frame_id != "base_link":
        raise MessageError(f"the path is in the frame {message.header.frame_id!r}; base_link is understood")
    places = [pose.pose.position for pose in message.poses]
    points = np.array([(place.x, place.y) for place in places], np.float64).reshape(-1, 2)
    bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(bad):
        raise MessageError(f"point {bad[0]} of the path is {points[bad[0]].tolist()}")
    return points


def steering_to_message(header: Header, speed: float, turn_rate: float) -> TwistStamped:
    """Build the `steering` message: m/s ahead and rad/s counter-clockwise, in base_link."""
    message = TwistStamped(header=Header(stamp=header.stamp, frame_id="base_link"))
    message.twist.linear.x = float(speed)
    message.twist.angular.z = float(turn_rate)
    return message


def clearance_from_message(message: Range) -> float:
    """Read the free way ahead in m; inf when there is nothing within the range of the sensor.

    Raises:
        MessageError: the range is no number or negative (-inf is nearer than can be measured: 0 m).
    """
    if message.range == -math.inf:
        return 0.0
    if math.isnan(message.range) or message.range < 0.0:
        raise MessageError(f"range is {message.range}")
    return float(message.range)


def check_finite(numbers: Mapping[str, float]) -> None:
    """Refuse numbers that are NaN or infinite, naming the first of them.

    Raises:
        MessageError: one is so.
    """
    for name, value in numbers.items():
        if not math.isfinite(value):
            raise MessageError(f"{name} is {value}")


def _quaternion(roll: float, pitch: float, yaw: float) -> Quaternion:
    x, y, z, w = quaternion_from_rotation(rotation_from_rpy(roll, pitch, yaw)).tolist()
    return Quaternion(x=x, y=y, z=z, w=w)
