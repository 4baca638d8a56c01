# SPDX-License-Identifier: Apache-2.0
"""How a camera is mounted, from the lean that many pictures show: the body leans, the mounting stays.

Each picture names the vertical by its vertical vanishing point and, by every level one, a great circle on which the
vertical lies. A body that leans does so to all sides: the mounting is the robust mean. A vanishing point that wanders
sideways while the robot turns draws the horizon, and so tells the roll that it cannot tell when standing still.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import attitude_from_up
from robot_vision.geometry.sphere import local_coordinates, retract, tangent_basis
from robot_vision.perception.attitude import tangent_of_attitude
from robot_vision.perception.calibration.robust import block_sigma, student_weights
from robot_vision.perception.vanishing import Role, VanishingPoints
from robot_vision.perception.vanishing.refit import SHARED_ERROR

Array = NDArray[np.float64]

#: Standard deviation with which a picture may know the lean itself, to be shown as one of its own.
_SHOWN = float(np.deg2rad(1.0))
#: Squared distance (2 degrees of freedom) beyond which a picture does not agree with the others: 3 sigma.
_GATE = 9.0
#: So little is known before (rad^-2) that what no picture tells stays where the guess was.
_LOOSE = 1e-3 * np.eye(2)
#: How members of a frame are held to it (`VanishingPointEstimator.orthogonality`), rad.
_SPRING = np.deg2rad(1.0)
_CONVERGED = 1e-8


@dataclass(frozen=True)
class Mounting:
    """Roll and pitch of a camera on the robot.

    Attributes:
        roll, pitch: of the camera with the body upright, rad.
        covariance: (2, 2) of (roll, pitch), rad^2; large for what the pictures do not tell.
        agreement: share of what the pictures know that agrees with it.
        telling: number of pictures that say something of roll, and of pitch.
        upright: number of pictures that show upright lines.
        own: (N, 2) roll and pitch of each picture by itself, rad; nan where it does not tell both.
    """

    roll: float
    pitch: float
    covariance: Array
    agreement: float
    telling: tuple[int, int]
    upright: int
    own: Array


@dataclass(frozen=True)
class _Evidence:
    """Normal equations of N pictures about one vertical.

    Attributes:
        information: (N, 2, 2) rad^-2.
        pull: (N, 2) rad^-1.
        upright: (N,) whether lines of its own tell where the vertical vanishing point is.
    """

    information: Array
    pull: Array
    upright: NDArray[np.bool_]


def find_mounting(pictures: Sequence[VanishingPoints], guess: Array, lean: float) -> Mounting:
    """Find roll and pitch of the mounting.

    Args:
        pictures: vanishing points with roles, all of one camera.
        guess: (3,) unit vertical in the optical frame from which the search starts.
        lean: standard deviation of the body's roll and pitch about the mounting, rad.
    """
    up = guess
    leaning = lean**2 * np.eye(2)
    for _ in range(20):
        evidence = _evidence(pictures, up)
        # What a picture knows of the mounting is what it knows of the lean, less the lean: (I^-1 + L)^-1, written
        # so that a picture may know one direction only.
        loosened = np.linalg.inv(np.eye(2) + evidence.information @ leaning)
        information = loosened @ evidence.information
        pull = np.einsum("nij,nj->ni", loosened, evidence.pull)
        squared = np.einsum("ni,nij,nj->n", pull, np.linalg.pinv(information, hermitian=True), pull)
        weights = student_weights(squared, 2)
        total = np.einsum("n,nij->ij", weights, information)
        step = np.linalg.solve(total + _LOOSE, weights @ pull)
        up = retract(up, step * min(1.0, 0.3 / max(float(np.linalg.norm(step)), 1e-12)))
        if float(np.linalg.norm(step)) < _CONVERGED:
            break
    roll, pitch = attitude_from_up(up)
    from_angles = tangent_of_attitude(up, roll, pitch)
    to_angles = np.linalg.inv(from_angles)
    formal = np.linalg.inv(total + _LOOSE)
    # What the mean owes to each picture, in order of time.
    influence = weights[:, None] * pull @ (to_angles @ formal).T
    spread = np.array([_total_sigma(influence[:, axis]) for axis in range(2)])
    covariance = to_angles @ formal @ to_angles.T
    covariance += np.diag(np.maximum(spread**2 - np.diag(covariance), 0.0))
    known = np.trace(information, axis1=1, axis2=2)
    agreement = float(known[squared < _GATE].sum() / max(float(known.sum()), 1e-12))
    by_angle = np.einsum("ia,nij,ja->na", from_angles, evidence.information, from_angles)
    telling = np.count_nonzero(by_angle > 1.0 / _SHOWN**2, axis=0)
    return Mounting(
        roll,
        pitch,
        covariance,
        agreement,
        (int(telling[0]), int(telling[1])),
        int(evidence.upright.sum()),
        _own(evidence, up),
    )


def _evidence(pictures: Sequence[VanishingPoints], up: Array) -> _Evidence:
    basis = tangent_basis(up)
    information, pull = np.zeros((len(pictures), 2, 2)), np.zeros((len(pictures), 2))
    upright = np.zeros(len(pictures), bool)
    for k, points in enumerate(pictures):
        level = np.isin(points.roles, [Role.PRIMARY, Role.HORIZONTAL])
        directions = points.directions[level]
        slopes = directions @ basis.T
        along = tangent_basis(directions) @ up
        told = _told_by_lines(points.covariance)
        # Where along the horizon it lies does not matter: what counts is how sure it is across.
        variance = np.einsum("mi,mij,mj->m", along, np.linalg.inv(told[level] + np.eye(2)), along)
        weighted = slopes / variance[:, None]
        information[k] = weighted.T @ slopes
        pull[k] = -weighted.T @ (directions @ up)
        vertical = points.of(Role.VERTICAL)
        if vertical is not None:
            carried = basis @ tangent_basis(points.directions[vertical]).T
            own = carried @ told[vertical] @ carried.T
            upright[k] = np.linalg.eigvalsh(own)[0] > 1.0 / _SHOWN**2
            information[k] += own
            pull[k] += own @ local_coordinates(up, points.directions[vertical])
    return _Evidence(information, pull, upright)


def _told_by_lines(covariance: Array) -> Array:
    """Information (M, 2, 2) that the lines alone give of directions with these covariances.

    A member of an orthogonal frame without lines of its own is held in its place by the two others: that is a guess
    of what is built there, and says nothing of the camera.
    """
    information = np.linalg.inv(covariance) - np.eye(2) / (SHARED_ERROR * _SPRING**2)
    values, vectors = np.linalg.eigh(information)
    return np.asarray(np.einsum("mij,mj,mkj->mik", vectors, np.maximum(values, 0.0), vectors))


def _total_sigma(influence: Array) -> float:
    """Standard deviation of a sum of (N,) influences whose neighbours are alike."""
    if len(influence) < 2:
        return 0.0  # what one picture knows of itself is all there is
    return block_sigma(influence * len(influence), np.ones(len(influence)))


def _own(evidence: _Evidence, up: Array) -> Array:
    own = np.full((len(evidence.pull), 2), np.nan)
    for k, (information, pull) in enumerate(zip(evidence.information, evidence.pull, strict=True)):
        if np.linalg.eigvalsh(information)[0] > 1.0 / _SHOWN**2:
            own[k] = attitude_from_up(retract(up, np.linalg.solve(information, pull)))
    return own
