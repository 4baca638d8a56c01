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
from robot_vision.perception.joint_history import JointHistory
from robot_vision.ros.messages import MessageError, check_finite
from robot_vision.ros.node import stamp_ns

PAN, TILT = "camera_pan", "camera_tilt"
#: The joints of a head, and the greatest angle of each, rad.
_MOST = {PAN: math.pi, TILT: math.pi / 2}
BASE = "base_link"
#: A head that is turned by no more than this looks straight ahead, rad.
STRAIGHT = 0.01


class Head:
    """Knows where the camera looks; as long as nobody speaks of its joints it is fixed to the body."""

    def __init__(self) -> None:
        self._joints: dict[str, JointHistory] = {}

    def take(self, message: JointState) -> None:
        """Take in `joint_states`, of both joints or of one; those of wheels and arms tell nothing of the head.

        A joint that was never heard of stands at zero.

        Raises:
            MessageError: the angle of a joint of the head is missing, not finite or none a head can have.
        """
        names = list(message.name)
        told = [joint for joint in _MOST if joint in names]
        for joint in told:
            self._joints.setdefault(joint, JointHistory())
        angles = {}
        for joint in told:
            place = names.index(joint)
            if place >= len(message.position):
                raise MessageError(f"{joint} has no position")
            angles[joint] = float(message.position[place])
        check_finite(angles)
        for joint, angle in angles.items():
            if abs(angle) > _MOST[joint]:
                raise MessageError(f"{joint} is {angle:g} rad: angles are told in radians")
        for joint, angle in angles.items():
            self._joints[joint].add(1e-9 * stamp_ns(message.header.stamp), angle)

    def turned(self, camera: Camera, stamp_s: float) -> Camera:
        """The camera as the head held it at the time of a picture.

        Raises:
            MessageError: there is a head, and nobody says how it stood then.
        """
        if not self._joints:
            return camera
        angles = dict.fromkeys(_MOST, 0.0)
        for joint, history in self._joints.items():
            angle = history.at(stamp_s)
            if angle is None:
                newest = history.newest_s
                age = (
                    "nothing usable has come"
                    if newest is None
                    else f"the newest is {stamp_s - newest:.2f} s old"
                )
                raise MessageError(
                    f"where the camera looked is not known: of {joint} {age}; nothing is said of this picture"
                )
            angles[joint] = angle
        return replace(camera, pan=angles[PAN], tilt=angles[TILT])

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
        for history in self._joints.values():
            history.clear()


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
