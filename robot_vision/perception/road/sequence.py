# SPDX-License-Identifier: Apache-2.0
"""The sequence of vanishing points of a road that bends (20.7): near, middle, far, along the vanishing line."""

from __future__ import annotations

import numpy as np

from robot_vision.geometry import Camera, rotation_from_rpy
from robot_vision.geometry.rotation import BODY_FROM_OPTICAL
from robot_vision.geometry.sphere import tangent_basis
from robot_vision.perception.attitude import Attitude
from robot_vision.perception.road.estimate import PITCH, ROLL, RoadEstimate
from robot_vision.perception.vanishing import Role, VanishingPoints

#: Distances ahead at which the direction of the road is told, m.
SEQUENCE_M = (5.0, 15.0, 30.0)
#: Their numbers: far from those that a tracker counts up from 1.
SEQUENCE_IDS = (0xFFFFFFF1, 0xFFFFFFF2, 0xFFFFFFF3)


def vanishing_sequence(road: RoadEstimate, camera: Camera, lines: int) -> VanishingPoints:
    """Where lines along the road nearby, in the middle and far ahead would meet: all on the vanishing line.

    The one nearby is the primary one. Those farther off than the road was seen are left out.

    Args:
        road: with the attitude of the camera.
        camera: rectified.
        lines: number of lines of the picture; labels of those on the road tell the nearest of the sequence.
    """
    ways = np.array([way for way in SEQUENCE_M if way <= max(road.reach, SEQUENCE_M[0])])
    bearing, variance = road.bearings(ways)
    level = np.stack([np.cos(bearing), np.sin(bearing), np.zeros(len(ways))], axis=1)
    sideways = np.stack([-np.sin(bearing), np.cos(bearing), np.zeros(len(ways))], axis=1)
    roll, pitch = float(road.state[ROLL]), float(road.state[PITCH])
    to_optical = (rotation_from_rpy(roll, pitch, 0.0) @ BODY_FROM_OPTICAL @ camera.head_turn).T
    directions = level @ to_optical.T
    basis = tangent_basis(directions)
    # A lean moves a direction by its cross product with the axis of the lean: roll about x, pitch about y.
    axes = np.eye(3)[:2]
    swings = np.cross(axes[None], level[:, None]) @ to_optical.T
    across = np.einsum("mij,mj->mi", basis, sideways @ to_optical.T)
    leaning = np.einsum("mij,mkj->mik", basis, swings)
    lean = road.covariance[ROLL : PITCH + 1, ROLL : PITCH + 1]
    covariance = variance[:, None, None] * across[:, :, None] * across[:, None, :]
    covariance = covariance + leaning @ lean @ leaning.transpose(0, 2, 1)
    nearest = np.argmin(np.abs(road.members_along[:, None] - ways), axis=1)
    labels = np.full(lines, -1, np.intp)
    labels[road.members] = nearest
    return VanishingPoints(
        directions=directions,
        covariance=covariance,
        weight=np.bincount(nearest, minlength=len(ways)).astype(np.float64),
        roles=np.array([Role.PRIMARY] + [Role.OTHER] * (len(ways) - 1), np.uint32),
        ids=np.array(SEQUENCE_IDS[: len(ways)], np.uint32),
        labels=labels,
        camera=camera,
    )


def attitude_on(road: RoadEstimate, camera: Camera) -> Attitude:
    """Lean of the camera's body as the road's borders tell it, which run side by side on the ground."""
    lean = road.covariance[ROLL : PITCH + 1, ROLL : PITCH + 1]
    return Attitude.from_angles(float(road.state[ROLL]), float(road.state[PITCH]), lean, camera)
