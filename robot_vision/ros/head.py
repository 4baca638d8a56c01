# SPDX-License-Identifier: Apache-2.0
"""The head that carries the camera, as `joint_states` tells of it, and the point it is asked to look at."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from geometry_msgs.msg import Point, PointStamped
from numpy.typing import NDArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from robot_vision.geometry import Camera
from robot_vision.perception.head_angles import HeadAngles, HeadHistory
from robot_vision.ros.messages import MessageError, check_finite
from robot_vision.ros.node import stamp_ns

PAN, TILT = "camera_pan", "camera_tilt"
BASE = "base_link"
#: A head that is turned by no more than this looks straight ahead, rad.
STRAIGHT = 0.01


class Head:
    """Knows where the camera looks; as long as nobody speaks of its joints it is fixed to the body."""

    def __init__(self) -> None:
        self._history = HeadHistory()
        self._there = False

    def take(self, message: JointState) -> None:
        """Take in `joint_states`; those of wheels and arms tell nothing of the head.

        Raises:
            MessageError: the angle of a joint of the head is missing, not finite or none a head can have.
        """
        if PAN not in message.name and TILT not in message.name:
            return
        self._there = True
        angles = {}
        for joint in (PAN, TILT):
            place = list(message.name).index(joint) if joint in message.name else None
            if place is not None and place >= len(message.position):
                raise MessageError(f"{joint} has no position")
            angles[joint] = 0.0 if place is None else float(message.position[place])
        check_finite(angles)
        for joint, most in ((PAN, math.pi), (TILT, math.pi / 2)):
            if abs(angles[joint]) > most:
                raise MessageError(f"{joint} is {angles[joint]:g} rad: angles are told in radians")
        self._history.add(HeadAngles(1e-9 * stamp_ns(message.header.stamp), angles[PAN], angles[TILT]))

    def turned(self, camera: Camera, stamp_s: float) -> Camera:
        """The camera as the head held it at the time of a picture.

        Raises:
            MessageError: there is a head, and nobody says how it stood then.
        """
        if not self._there:
            return camera
        angles = self._history.at(stamp_s)
        if angles is None:
            newest = self._history.newest_s
            age = (
                "nothing usable has come" if newest is None else f"the newest is {stamp_s - newest:.2f} s old"
            )
            raise MessageError(
                f"where the camera looked is not known: {age}; nothing is said of this picture"
            )
        return replace(camera, pan=angles.pan, tilt=angles.tilt)

    def check_straight(self, camera: Camera, stamp_s: float) -> None:
        """Look whether the head looked straight ahead at the time of a picture.

        Raises:
            MessageError: it did not, or nobody says so: the picture is not that of a fixed camera.
        """
        turned = self.turned(camera, stamp_s)
        if max(abs(turned.pan), abs(turned.tilt)) > STRAIGHT:
            aside = f"pan {turned.pan:.2f} rad, tilt {turned.tilt:.2f} rad"
            raise MessageError(f"the camera looks aside ({aside}); only pictures straight ahead are used")

    def clear(self) -> None:
        """Forget what was said before a clock jumped; that there is a head stays known."""
        self._history.clear()


def point_to_message(header: Header, point: NDArray[Any]) -> PointStamped:
    """Build the `look_at` message: a point (3,) of base_link, m, with the stamp of a picture."""
    x, y, z = (float(part) for part in point)
    return PointStamped(header=Header(stamp=header.stamp, frame_id=BASE), point=Point(x=x, y=y, z=z))


def point_from_message(message: PointStamped) -> tuple[float, float, float]:
    """Read `look_at`, (x, y, z) m in base_link.

    Raises:
        MessageError: it is told in another frame.
    """
    frame = message.header.frame_id.lstrip("/")
    if frame != BASE:
        raise MessageError(f"the point is told in the frame {frame!r}; {BASE} is understood")
    return message.point.x, message.point.y, message.point.z
