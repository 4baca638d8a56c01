# SPDX-License-Identifier: Apache-2.0
"""Builds and reads ROS 2 messages from numpy and value types, without a ROS installation."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_vision.bags.errors import BagError
from robot_vision.bags.schema import message_class

UNKNOWN_VARIANCE = 1e6  # how a part that is not known stands in a covariance
_STAMP = {0: struct.Struct(">iI"), 1: struct.Struct("<iI")}  # by the second byte of the CDR encapsulation
_NS = 1_000_000_000
_ENCODINGS = {
    (1, "|u1"): "mono8",
    (1, "<u2"): "mono16",
    (1, "<f4"): "32FC1",
    (3, "|u1"): "bgr8",
    (4, "|u1"): "bgra8",
}


class CameraLike(Protocol):
    """What `camera_info` asks of a camera: `robot_vision.geometry.Camera` has it."""

    def camera_info(self) -> dict[str, Any]:
        """Return width, height, distortion_model, d, k, r, p as sensor_msgs/CameraInfo has them."""
        ...


def header_stamp_ns(cdr: bytes) -> int:
    """Return the header stamp of any message that begins with a std_msgs/Header, from its CDR bytes.

    Raises:
        BagError: the bytes are too short or no plain CDR.
    """
    sec, nanosec = _stamp_layout(cdr).unpack_from(cdr, 4)
    return int(sec) * _NS + int(nanosec)


def with_header_stamp(cdr: bytes, stamp_ns: int) -> bytes:
    """Return a copy of a message that begins with a std_msgs/Header, with another stamp.

    Raises:
        BagError: the bytes are too short or no plain CDR.
    """
    changed = bytearray(cdr)
    _stamp_layout(cdr).pack_into(changed, 4, *divmod(stamp_ns, _NS))
    return bytes(changed)


def _stamp_layout(cdr: bytes) -> struct.Struct:
    if len(cdr) < 12:
        raise BagError(f"a message of {len(cdr)} bytes is too short to begin with a header")
    if cdr[0] != 0 or cdr[1] not in _STAMP:
        raise BagError(f"a message that begins with bytes {cdr[:2].hex()} is no plain CDR")
    return _STAMP[cdr[1]]


def stamp_ns(message: Any) -> int:
    """Return the header stamp of a decoded message in nanoseconds."""
    return int(message.header.stamp.sec) * _NS + int(message.header.stamp.nanosec)


def time(stamp_ns: int) -> Any:
    """Build a builtin_interfaces/Time."""
    sec, nanosec = divmod(int(stamp_ns), _NS)
    return message_class("builtin_interfaces/msg/Time")(sec=sec, nanosec=nanosec)


def clock(stamp_ns: int) -> Any:
    """Build a rosgraph_msgs/Clock."""
    return message_class("rosgraph_msgs/msg/Clock")(clock=time(stamp_ns))


def header(stamp_ns: int, frame_id: str) -> Any:
    """Build a std_msgs/Header."""
    return message_class("std_msgs/msg/Header")(stamp=time(stamp_ns), frame_id=frame_id)


def image(stamp_ns: int, frame_id: str, picture: NDArray[Any], encoding: str | None = None) -> Any:
    """Build a sensor_msgs/Image.

    Args:
        stamp_ns: when the picture was taken.
        frame_id: the optical frame.
        picture: (H, W) or (H, W, channels), uint8, uint16 or float32.
        encoding: None chooses mono8, mono16, 32FC1, bgr8 or bgra8 by shape and type.

    Raises:
        BagError: a shape or type that no encoding fits.
    """
    pixels = np.ascontiguousarray(picture)
    channels = 1 if pixels.ndim == 2 else pixels.shape[-1]
    if encoding is None:
        encoding = _ENCODINGS.get((channels, pixels.dtype.str)) if pixels.ndim in (2, 3) else None
        if encoding is None:
            raise BagError(f"no image encoding fits an array of shape {pixels.shape} and type {pixels.dtype}")
    return message_class("sensor_msgs/msg/Image")(
        header=header(stamp_ns, frame_id),
        height=pixels.shape[0],
        width=pixels.shape[1],
        encoding=encoding,
        is_bigendian=0,
        step=pixels.shape[1] * channels * pixels.itemsize,
        data=pixels.reshape(-1).view(np.uint8),
    )


def compressed_image(
    stamp_ns: int, frame_id: str, picture: NDArray[Any], kind: str = "jpeg", quality: int = 90
) -> Any:
    """Build a sensor_msgs/CompressedImage.

    Args:
        stamp_ns: when the picture was taken.
        frame_id: the optical frame.
        picture: (H, W) or (H, W, 3) BGR, uint8 (png: uint16 as well).
        kind: "jpeg" or "png".
        quality: of the JPEG, 1 to 100.

    Raises:
        BagError: the picture cannot be encoded.
    """
    import cv2

    if kind not in ("jpeg", "png"):
        raise BagError(f"pictures are compressed as jpeg or png, not as {kind!r}")
    if not 1 <= quality <= 100:
        raise BagError(f"the JPEG quality goes from 1 to 100, not {quality}")
    settings = [cv2.IMWRITE_JPEG_QUALITY, quality] if kind == "jpeg" else [cv2.IMWRITE_PNG_COMPRESSION, 3]
    try:
        done, data = cv2.imencode(".jpg" if kind == "jpeg" else ".png", picture, settings)
    except cv2.error as error:
        raise BagError(f"an array of shape {picture.shape} cannot become a {kind}: {error.err}") from error
    if not done:
        raise BagError(f"an array of shape {picture.shape} cannot become a {kind} picture")
    raw = "mono8" if picture.ndim == 2 else "bgr8"
    return compressed_bytes(stamp_ns, frame_id, data.tobytes(), f"{raw}; {kind} compressed {raw}")


def compressed_bytes(stamp_ns: int, frame_id: str, data: bytes, kind: str) -> Any:
    """Build a sensor_msgs/CompressedImage around a picture file as it is; `kind` such as "jpeg"."""
    return message_class("sensor_msgs/msg/CompressedImage")(
        header=header(stamp_ns, frame_id), format=kind, data=np.frombuffer(data, np.uint8)
    )


def picture(message: Any) -> NDArray[Any]:
    """Decode an Image or CompressedImage message (of rosbags or of rclpy) to an array.

    Returns:
        (H, W) uint8 or uint16 grey, or (H, W, 3) uint8 BGR.

    Raises:
        PictureError: it cannot be decoded; the text tells why.
    """
    from robot_vision.perception.picture import picture_from_buffer, picture_from_compressed

    if hasattr(message, "format"):
        return picture_from_compressed(message.data)
    width, height, is_bigendian = message.width, message.height, bool(message.is_bigendian)
    return picture_from_buffer(message.encoding, width, height, message.step, message.data, is_bigendian)


def camera_info(stamp_ns: int, frame_id: str, camera: CameraLike) -> Any:
    """Build a sensor_msgs/CameraInfo of a camera."""
    info = camera.camera_info()
    roi = message_class("sensor_msgs/msg/RegionOfInterest")(
        x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
    )
    return message_class("sensor_msgs/msg/CameraInfo")(
        header=header(stamp_ns, frame_id),
        height=int(info["height"]),
        width=int(info["width"]),
        distortion_model=str(info["distortion_model"]),
        d=_floats(info["d"]),
        k=_floats(info["k"], 9),
        r=_floats(info["r"], 9),
        p=_floats(info["p"], 12),
        binning_x=0,
        binning_y=0,
        roi=roi,
    )


def vector3(xyz: Sequence[float]) -> Any:
    """Build a geometry_msgs/Vector3."""
    return message_class("geometry_msgs/msg/Vector3")(x=float(xyz[0]), y=float(xyz[1]), z=float(xyz[2]))


def pose(position: Sequence[float], quaternion: Sequence[float]) -> Any:
    """Build a geometry_msgs/Pose from a position (m) and a unit quaternion (x, y, z, w)."""
    x, y, z, w = (float(part) for part in quaternion)
    return message_class("geometry_msgs/msg/Pose")(
        position=message_class("geometry_msgs/msg/Point")(
            x=float(position[0]), y=float(position[1]), z=float(position[2])
        ),
        orientation=message_class("geometry_msgs/msg/Quaternion")(x=x, y=y, z=z, w=w),
    )


def yaw_quaternion(yaw: float) -> tuple[float, float, float, float]:
    """Return the quaternion (x, y, z, w) of a turn by `yaw` (rad, counter-clockwise) about z."""
    return 0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2))


def yaw_of(quaternion: Any) -> float:
    """Return the yaw (rad) of a geometry_msgs/Quaternion."""
    x, y, z, w = quaternion.x, quaternion.y, quaternion.z, quaternion.w
    return float(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))


def pose_with_covariance_stamped(
    stamp_ns: int,
    frame_id: str,
    position: Sequence[float],
    quaternion: Sequence[float],
    covariance: ArrayLike | None = None,
) -> Any:
    """Build a geometry_msgs/PoseWithCovarianceStamped; covariance (6, 6) of x y z roll pitch yaw."""
    return message_class("geometry_msgs/msg/PoseWithCovarianceStamped")(
        header=header(stamp_ns, frame_id), pose=_pose_with_covariance(position, quaternion, covariance)
    )


def lane_heading(
    stamp_ns: int,
    frame_id: str,
    yaw: float,
    offset: float | None,
    yaw_variance: float = 0.0,
    offset_variance: float = 0.0,
) -> Any:
    """Build the `heading` message: place and direction of the robot in its lane.

    Args:
        stamp_ns: of the picture.
        frame_id: `corridor`, `road` or `row`.
        yaw: of the robot relative to the lane, rad, counter-clockwise positive.
        offset: of the robot to the LEFT of the centre line, m; None if unknown.
        yaw_variance: rad².
        offset_variance: m².
    """
    covariance = np.diag([UNKNOWN_VARIANCE, offset_variance, *[UNKNOWN_VARIANCE] * 3, yaw_variance])
    if offset is None:
        covariance[1, 1] = UNKNOWN_VARIANCE
    position = (0.0, 0.0 if offset is None else offset, 0.0)
    return pose_with_covariance_stamped(stamp_ns, frame_id, position, yaw_quaternion(yaw), covariance)


def odometry(
    stamp_ns: int,
    position: Sequence[float],
    quaternion: Sequence[float],
    linear: Sequence[float] = (0.0, 0.0, 0.0),
    angular: Sequence[float] = (0.0, 0.0, 0.0),
    frame_id: str = "odom",
    child_frame_id: str = "base_link",
) -> Any:
    """Build a nav_msgs/Odometry: pose of the child in the frame (m), twist in the child (m/s, rad/s)."""
    twist = message_class("geometry_msgs/msg/TwistWithCovariance")(
        twist=message_class("geometry_msgs/msg/Twist")(linear=vector3(linear), angular=vector3(angular)),
        covariance=np.zeros(36),
    )
    return message_class("nav_msgs/msg/Odometry")(
        header=header(stamp_ns, frame_id),
        child_frame_id=child_frame_id,
        pose=_pose_with_covariance(position, quaternion, None),
        twist=twist,
    )


def twist_stamped(stamp_ns: int, frame_id: str, speed: float, turn_rate: float) -> Any:
    """Build a geometry_msgs/TwistStamped: m/s ahead, rad/s counter-clockwise."""
    return message_class("geometry_msgs/msg/TwistStamped")(
        header=header(stamp_ns, frame_id),
        twist=message_class("geometry_msgs/msg/Twist")(
            linear=vector3((speed, 0.0, 0.0)), angular=vector3((0.0, 0.0, turn_rate))
        ),
    )


def imu(
    stamp_ns: int, frame_id: str, quaternion: Sequence[float], covariance: ArrayLike | None = None
) -> Any:
    """Build a sensor_msgs/Imu with an orientation only, covariance (3, 3) rad²; the rest is marked absent."""
    absent = np.zeros(9)
    absent[0] = -1.0
    x, y, z, w = (float(part) for part in quaternion)
    return message_class("sensor_msgs/msg/Imu")(
        header=header(stamp_ns, frame_id),
        orientation=message_class("geometry_msgs/msg/Quaternion")(x=x, y=y, z=z, w=w),
        orientation_covariance=np.zeros(9) if covariance is None else _floats(covariance, 9),
        angular_velocity=vector3((0.0, 0.0, 0.0)),
        angular_velocity_covariance=absent,
        linear_acceleration=vector3((0.0, 0.0, 0.0)),
        linear_acceleration_covariance=absent.copy(),
    )


def joint_state(stamp_ns: int, positions: Mapping[str, float]) -> Any:
    """Build a sensor_msgs/JointState of joints by name, rad; velocities and efforts are not told."""
    return message_class("sensor_msgs/msg/JointState")(
        header=header(stamp_ns, ""),
        name=list(positions),
        position=_floats(list(positions.values())),
        velocity=np.zeros(0),
        effort=np.zeros(0),
    )


def _pose_with_covariance(
    position: Sequence[float], quaternion: Sequence[float], covariance: ArrayLike | None
) -> Any:
    return message_class("geometry_msgs/msg/PoseWithCovariance")(
        pose=pose(position, quaternion),
        covariance=np.zeros(36) if covariance is None else _floats(covariance, 36),
    )


def _floats(values: ArrayLike, count: int | None = None) -> NDArray[np.float64]:
    flat = np.ascontiguousarray(values, np.float64).reshape(-1)
    if count is not None and flat.size != count:
        raise BagError(f"{flat.size} numbers where a message wants {count}")
    return flat
