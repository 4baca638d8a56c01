# SPDX-License-Identifier: Apache-2.0
"""What moves all plants of a picture at once: the lean and bounce of the body, and what odometry missed.

Roll and pitch by a degree move a plant 2 m ahead by several times its own size, but all plants together, each as
its place commands (20.11)-(20.13). So they are found from all matched plants at once and taken out, before any
plant is corrected.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FORWARD, LEFT, TURN, ROLL, PITCH, BOUNCE = range(6)
_ROUNDS = 4
#: Residual, in standard deviations, from which on a plant loses its say.
_ROBUST = 2.5


@dataclass(frozen=True)
class Shift:
    """The common shift of a picture.

    Attributes:
        values: (6,) forward and left (m), turn, roll, pitch (rad), logarithm of the height over what was taken.
        covariance: (6, 6).
    """

    values: Array
    covariance: Array

    def straightened(self, slopes: Array) -> Array:
        """Slopes (N, 2) of sights, had the body leaned as it did."""
        moved = slopes + np.einsum("nij,j->ni", by_lean(slopes), self.values[ROLL : PITCH + 1])
        return np.asarray(np.exp(self.values[BOUNCE]) * moved)


def common_shift(
    slopes: Array, expected: Array, covariance: Array, height: float, camera_x: float, sigmas: Array
) -> Shift:
    """Find the shift on which all plants agree.

    Args:
        slopes: (N, 2) of the sights to plants, as `Blobs.slopes`.
        expected: (N, 2) where the same plants should appear on the ground, ahead and left of the camera, m.
        covariance: (N, 2, 2) of what is seen less what is expected, m^2.
        height: of the camera, m.
        camera_x: of the camera ahead of base_link, m.
        sigmas: (6,) of what is known of the shift before; 0 is there none.
    """
    known = np.maximum(sigmas, 1e-9) ** -2.0
    values = np.zeros(6)
    whitener = np.linalg.cholesky(np.linalg.inv(covariance)).transpose(0, 2, 1)
    jacobian = np.empty((len(slopes), 2, 6))
    jacobian[:, :, FORWARD : LEFT + 1] = np.eye(2)
    jacobian[:, 0, TURN] = -expected[:, 1]
    jacobian[:, 1, TURN] = expected[:, 0] + camera_x
    jacobian[:, :, ROLL : PITCH + 1] = height * by_lean(slopes)
    jacobian[:, :, BOUNCE] = height * slopes
    jacobian = whitener @ jacobian
    surprise = (whitener @ (height * slopes - expected)[:, :, None])[:, :, 0]
    information = np.diag(known)
    for _ in range(_ROUNDS):
        left = surprise + jacobian @ values
        say = 1.0 / (1.0 + (left**2).sum(axis=1) / (2.0 * _ROBUST**2)) ** 2
        weighted = jacobian * say[:, None, None]
        information = np.einsum("nij,nik->jk", weighted, jacobian) + np.diag(known)
        values = -np.linalg.solve(information, np.einsum("nij,ni->j", weighted, surprise))
    return Shift(values, np.asarray(np.linalg.inv(information)))


def by_lean(slopes: Array) -> Array:
    """Derivatives (N, 2, 2) of slopes by roll and pitch of the body, rad.

    A sight (a, b, -1) turned by a small roll r and pitch p is (a - p, b + r, -1 + r b - p a).
    """
    a, b = slopes[:, 0], slopes[:, 1]
    return np.stack(
        [np.column_stack([a * b, -(1.0 + a * a)]), np.column_stack([1.0 + b * b, -a * b])], axis=1
    )
