# SPDX-License-Identifier: Apache-2.0
"""Whether the camera stands upright: the vertical direction from everything in the picture that tells of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera, attitude_from_up, up_from_attitude
from robot_vision.geometry.sphere import local_coordinates, retract, tangent_basis
from robot_vision.perception.vanishing import Role, VanishingPoints

Array = NDArray[np.float64]


#: Support of a vertical vanishing point that is believed though no track of it is.
_CLEAR = 15.0


@dataclass(frozen=True)
class Attitude:
    """Lean of the camera body, as it is while a head that carries it looks straight ahead.

    Attributes:
        roll: left side up positive, rad.
        pitch: nose down positive, rad.
        covariance: (2, 2) of (roll, pitch), rad^2.
        up: (3,) unit, the vertical in the optical frame.
        up_covariance: (2, 2) rad^2 in the tangent plane of `up`.
        seen: whether the picture told anything of it, or only the mounting.
    """

    roll: float
    pitch: float
    covariance: Array
    up: Array
    up_covariance: Array
    seen: bool

    @classmethod
    def from_angles(
        cls, roll: float, pitch: float, covariance: Array, camera: Camera | None = None
    ) -> Attitude:
        """One told as roll and pitch (rad) with their covariance (2, 2) by a picture of `camera`, wherever it looks."""
        turn = np.eye(3) if camera is None else camera.head_turn
        up = turn.T @ up_from_attitude(roll, pitch)
        jacobian = tangent_basis(up) @ turn.T @ _swings_of_up(roll, pitch)
        return cls(roll, pitch, covariance, up, jacobian @ covariance @ jacobian.T, True)


@dataclass(frozen=True)
class Lean:
    """How far a body leans from how it stands upright.

    Attributes:
        angle: rad.
        towards: the side it leans to most: left, right, forward or back.
    """

    angle: float
    towards: str


def lean_from(roll: float, pitch: float, mounted_roll: float, mounted_pitch: float) -> Lean:
    """Lean of a body whose camera has this roll and pitch, and the mounted ones when the body is upright, rad."""
    cosine = float(up_from_attitude(roll, pitch) @ up_from_attitude(mounted_roll, mounted_pitch))
    angle = float(np.arccos(np.clip(cosine, -1.0, 1.0)))
    sideways, forwards = roll - mounted_roll, pitch - mounted_pitch
    if abs(sideways) >= abs(forwards):
        return Lean(angle, "right" if sideways > 0.0 else "left")
    return Lean(angle, "forward" if forwards > 0.0 else "back")


def estimate_attitude(
    points: VanishingPoints, lean: float, picture: VanishingPoints | None = None
) -> Attitude:
    """The vertical that agrees best with the vertical vanishing point, the horizontal ones and the mounting.

    A vertical vanishing point names the vertical itself; each horizontal one says that the vertical lies at right
    angles to it. One linear least-squares step in the tangent plane, repeated once.

    Args:
        points: with roles; `points.camera` tells how the camera is mounted.
        lean: standard deviation of the body's lean about the mounting, rad.
        picture: those of this picture alone. A body may roll faster than a track of the vertical follows; then the
            vertical of the picture itself tells, if it has much support.
    """
    mounted = points.camera.optical_to_base[2]
    vertical = _vertical(points, picture)
    level = np.isin(points.roles, [Role.PRIMARY, Role.HORIZONTAL])
    directions, covariance = points.directions[level], points.covariance[level]
    tangents = tangent_basis(directions)
    prior = np.eye(2) / lean**2
    up, information = mounted, prior
    for _ in range(2):
        basis = tangent_basis(up)
        slopes = directions @ basis.T
        along = tangents @ up
        variance = np.einsum("mi,mij,mj->m", along, covariance, along)
        weighted = slopes / np.maximum(variance, 1e-12)[:, None]
        information = prior + weighted.T @ slopes
        pull = prior @ local_coordinates(up, mounted) - weighted.T @ (directions @ up)
        if vertical is not None:
            # The covariance holds in the tangent plane of the point; carry it over to that of `up`.
            direction, doubt = vertical
            carried = basis @ tangent_basis(direction).T
            own = np.linalg.inv(carried @ doubt @ carried.T)
            information = information + own
            pull = pull + own @ local_coordinates(up, direction)
        up = retract(up, np.asarray(np.linalg.solve(information, pull), dtype=np.float64))
    up_covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    turn = points.camera.head_turn
    roll, pitch = attitude_from_up(turn @ up)
    inverse = np.linalg.inv(tangent_basis(up) @ turn.T @ _swings_of_up(roll, pitch))
    telling = np.isin(points.roles, [Role.PRIMARY, Role.VERTICAL, Role.HORIZONTAL])
    seen = bool(np.any(telling & (points.weight > 0.0)))
    covariance = np.asarray(inverse @ up_covariance @ inverse.T, dtype=np.float64)
    return Attitude(roll, pitch, covariance, up, up_covariance, seen)


def _vertical(points: VanishingPoints, picture: VanishingPoints | None) -> tuple[Array, Array] | None:
    """The vertical direction and its covariance: after a jolt an unseen track may live on beside what is seen."""
    for told, least in ((points, 0.0), (picture, _CLEAR), (points, -1.0)):
        if told is None:
            continue
        upright = np.flatnonzero((told.roles == Role.VERTICAL) & (told.weight > least))
        if len(upright):
            best = int(upright[np.argmax(told.weight[upright])])
            return told.directions[best], told.covariance[best]
    return None


def tangent_of_attitude(up: Array, roll: float, pitch: float) -> Array:
    """How `up` moves in its tangent plane with roll and pitch of a camera without a head: (2, 2)."""
    return np.asarray(tangent_basis(up) @ _swings_of_up(roll, pitch))


def _swings_of_up(roll: float, pitch: float) -> Array:
    """How the vertical moves in the optical frame with roll and pitch: (3, 2), by central differences."""
    step = 1e-6
    columns = [
        (up_from_attitude(roll + step, pitch) - up_from_attitude(roll - step, pitch)) / (2.0 * step),
        (up_from_attitude(roll, pitch + step) - up_from_attitude(roll, pitch - step)) / (2.0 * step),
    ]
    return np.stack(columns, axis=1)
