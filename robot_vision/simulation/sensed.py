# SPDX-License-Identifier: Apache-2.0
"""Says what the robot's sensors sense, in the messages of real drivers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.simulation.head import JOINTS
from robot_vision.simulation.odometry import Reading
from robot_vision.simulation.truth import Said

OPTICAL_FRAME = "camera_optical_frame"


class PictureFormat(NamedTuple):
    """How pictures are sent: as they are, or as JPEG of a quality of 1 to 100."""

    compressed: bool
    quality: int = 90

    @property
    def topic(self) -> str:
        """Where they are sent to."""
        return "image/compressed" if self.compressed else "image"

    @property
    def type_name(self) -> str:
        """Of the messages."""
        return "sensor_msgs/msg/CompressedImage" if self.compressed else "sensor_msgs/msg/Image"

    def say(self, stamp_ns: int, picture: NDArray[np.uint8]) -> Said:
        """A picture, uint8 (H, W, 3) BGR."""
        from robot_vision.bags import messages

        if self.compressed:
            message = messages.compressed_image(stamp_ns, OPTICAL_FRAME, picture, quality=self.quality)
        else:
            message = messages.image(stamp_ns, OPTICAL_FRAME, picture)
        return Said(self.topic, self.type_name, message)


def camera_info(stamp_ns: int, camera: Camera) -> Said:
    """The calibration of the camera."""
    from robot_vision.bags import messages

    message = messages.camera_info(stamp_ns, OPTICAL_FRAME, camera)
    return Said("camera_info", "sensor_msgs/msg/CameraInfo", message)


def head_joints(stamp_ns: int, camera: Camera) -> Said:
    """How the head that carries the camera stands."""
    from robot_vision.bags import messages

    message = messages.joint_state(stamp_ns, dict(zip(JOINTS, (camera.pan, camera.tilt), strict=True)))
    return Said("joint_states", "sensor_msgs/msg/JointState", message)


def odometry(stamp_ns: int, reading: Reading) -> Said:
    """What the wheels say."""
    from robot_vision.bags import messages

    message = messages.odometry(
        stamp_ns,
        (reading.x, reading.y, 0.0),
        messages.yaw_quaternion(reading.yaw),
        (reading.speed, 0.0, 0.0),
        (0.0, 0.0, reading.turn_rate),
    )
    return Said("odom", "nav_msgs/msg/Odometry", message)
