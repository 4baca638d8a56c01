# SPDX-License-Identifier: Apache-2.0
"""Vanishing points refitted to the lines that lead to them, as one orthogonal frame or each by itself.

Gauss-Newton on the sphere with support falling to zero at the tolerance, so that clutter has no pull.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_vision.perception.vanishing.bundle import Bundle
from robot_vision.perception.vanishing.support import TOLERANCE

Array = NDArray[np.float64]

#: Lines of one wall share errors of paint, lens and picture, so many lines tell less than as many independent ones:
#: factor on the covariance, so that squared errors over it are 1 in the mean against simulated truth.
SHARED_ERROR = 1.2
#: Mean squared residual of lines that err as they are taken to, as `agreement` weighs it with `TOLERANCE` 2.
_USUAL_SQUARE = 0.52
#: So many lines that err as they are taken to are believed in before any is seen.
_LINES_BELIEVED = 3.0


def refit_frame(bundle: Bundle, frame: Array, rounds: int = 8) -> tuple[Array, float]:
    """Turn an orthogonal frame (3, 3), directions in rows, to where its lines lead; with their support for it."""
    from robot_vision.perception.vanishing import kernels

    turned = np.array(frame, dtype=np.float64)
    support = kernels.turn_frame(*bundle.arrays, turned, TOLERANCE, rounds)
    return turned, float(support)


def refit_each(bundle: Bundle, directions: Array, prior_sigma: float, rounds: int = 6) -> tuple[Array, Array]:
    """Let each direction follow its own lines, held to where it started by a spring.

    Lines that agree better than their sigma tells are believed to be better: the covariance follows what they show.

    Args:
        bundle: N lines; each pulls at the one direction it fits best.
        directions: (K, 3) unit directions to start from.
        prior_sigma: standard deviation of the true direction about the start, rad: how far vanishing points of a
            built scene stray from orthogonality.
        rounds: most steps of the iteration.

    Returns:
        directions: (K, 3) unit.
        covariance: (K, 2, 2) rad^2, in the tangent plane of each.
    """
    from robot_vision.perception.vanishing import kernels

    moved = np.array(directions, dtype=np.float64)
    information, spread = np.zeros((len(moved), 2, 2)), np.zeros((len(moved), 2))
    stiffness = 1.0 / prior_sigma**2
    kernels.move_each(*bundle.arrays, moved, directions, stiffness, TOLERANCE, rounds, information, spread)
    shown = (spread[:, 1] / _USUAL_SQUARE + _LINES_BELIEVED) / (spread[:, 0] + _LINES_BELIEVED)
    held = np.linalg.inv(information / shown[:, None, None] + stiffness * np.eye(2))
    return moved, np.asarray(SHARED_ERROR * held)


def rotation_about(vector: Array) -> Array:
    """Rotation matrix (3, 3) by the angle |vector| in radians about the axis along it (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle < 1e-15:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)
