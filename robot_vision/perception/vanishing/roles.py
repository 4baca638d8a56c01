# SPDX-License-Identifier: Apache-2.0
"""Which vanishing point is the way ahead, which one is up: the part each plays for a robot on a floor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.geometry.sphere import angle_between
from robot_vision.perception.vanishing.points import Role

Array = NDArray[np.float64]

#: A camera leans by no more than this from how it was mounted, or, where that is not known, from upright.
_LEAN = np.deg2rad(40.0)
#: A horizontal direction lies this close to perpendicular to the vertical one.
_LEVEL = np.deg2rad(6.0)
#: With no vertical vanishing point, horizontal means level within this with the camera as mounted.
_LEVEL_AS_MOUNTED = np.deg2rad(15.0)
#: The way ahead lies within this of where the robot looks; in a right-angled scene one direction always does.
_AHEAD = np.deg2rad(55.0)
_CLEARLY_MORE = 1.5


def roles(
    directions: Array, weight: Array, camera: Camera, members: int, ahead: Array | None = None
) -> NDArray[np.uint32]:
    """A `Role` for each direction.

    Args:
        directions: (M, 3) unit directions, optical frame.
        weight: (M,) support of each.
        members: number of directions, from the first, that all lines found together; the others were found among
            what they left over and lead the way only with clearly more support.
        camera: tells by its mounting where up and forward are.
        ahead: (3,) direction known to be the way ahead (from earlier pictures), else the robot's own x axis.
    """
    found = np.full(len(directions), Role.OTHER, np.uint32)
    if not len(directions):
        return found
    base_from_optical = camera.optical_to_base
    up, forward = base_from_optical[2], base_from_optical[0]
    from_up = angle_between(directions, up)
    upright = from_up < _LEAN
    level = np.abs(np.pi / 2 - from_up) < _LEVEL_AS_MOUNTED
    if upright.any():
        vertical = int(np.argmax(np.where(upright, weight * np.cos(from_up), -1.0)))
        found[vertical] = Role.VERTICAL
        level = np.abs(np.pi / 2 - angle_between(directions, directions[vertical])) < _LEVEL
        level[vertical] = False
    found[level] = Role.HORIZONTAL
    off_course = angle_between(directions, forward if ahead is None else ahead)
    eligible = level & (off_course < _AHEAD)
    if eligible[:members].any():
        first = int(np.argmin(np.where(eligible, off_course, np.inf)[:members]))
        eligible[members:] &= weight[members:] > _CLEARLY_MORE * weight[first]
    if eligible.any():
        found[int(np.argmin(np.where(eligible, off_course, np.inf)))] = Role.PRIMARY
    return found


def primary_first(found: NDArray[np.uint32], weight: Array) -> NDArray[np.intp]:
    """Order (M,) with the primary first, then the vertical, then by falling weight."""
    rank = np.select([found == Role.PRIMARY, found == Role.VERTICAL], [0, 1], 2)
    return np.lexsort((-weight, rank))
