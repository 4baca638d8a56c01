# SPDX-License-Identifier: Apache-2.0
"""Circles tell how the plane lies that they are on: a camera that knows its focal length sees it in their shape.

An ellipse in the picture and the camera's centre make a cone. Two planes cut that cone in circles, and one of them
is the circle's own (Chen and others 2004). Which one, several circles on one plane agree on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry.arrays import FloatArray
from robot_vision.geometry.camera import Camera
from robot_vision.geometry.conics import ImageEllipse
from robot_vision.geometry.errors import ConicError
from robot_vision.geometry.sphere import cross, normalised, retract, tangent_basis

_STEPS = 10
#: rad: step of the derivative of a circle's shape to the plane's normal.
_NUDGE = 1e-6
#: rad: longest step of the search for the normal.
_STRIDE = 0.1
#: rad between two normals that are one.
_SAME = 0.02
#: A plane is the right one when the other fits so many times worse.
_CLEARLY = 3.0
#: A share of the longer semi-axis by which a circle's picture, moved to the plane, may miss a circle.
ROUND = 0.02


@dataclass(frozen=True)
class CirclePlane:
    """The plane that circles lie on.

    Attributes:
        normal: (3,) unit, optical frame, towards the camera.
        covariance: (2, 2) rad² in the tangent plane of `normal`, from how well the circles agree.
        circles: (N,) bool, which of the ellipses are circles on that plane.
    """

    normal: FloatArray
    covariance: FloatArray
    circles: NDArray[np.bool_]


def circle_normals(ellipse: ImageEllipse, camera: Camera) -> FloatArray:
    """Give the unit normals (2, 3), optical frame, towards the camera, of the planes on which it is a circle.

    Args:
        ellipse: in the rectified picture of `camera`.
        camera: which knows its focal length.
    """
    matrix = camera.rectified().matrix
    cone = matrix.T @ ellipse.conic @ matrix
    values, axes = np.linalg.eigh(cone)
    # Signs of an elliptic cone: one eigenvalue below zero, two above; ascending, so the axis comes first.
    low, middle, high = values
    along = np.sqrt(max((middle - low) / (high - low), 0.0))
    across = np.sqrt(max((high - middle) / (high - low), 0.0))
    normals = np.array([along * axes[:, 0] + across * axes[:, 2], along * axes[:, 0] - across * axes[:, 2]])
    ray = np.linalg.solve(matrix, [ellipse.u, ellipse.v, 1.0])
    return np.asarray(normals * -np.sign(normals @ ray)[:, None])


def plane_of_circles(
    ellipses: Sequence[ImageEllipse], camera: Camera, tolerance: float = ROUND
) -> CirclePlane:
    """Find the plane on which most of the ellipses are circles, and fit its normal to these.

    Args:
        ellipses: in the rectified picture of `camera`; some may show ellipses, or lie elsewhere.
        camera: which knows its focal length.
        tolerance: greatest difference of the semi-axes of a circle on the plane, as a share of them.

    Raises:
        ConicError: a focal length that is only a guess, or fewer than two circles that agree on a plane: one
            circle alone fits two planes, as many do from afar.
    """
    if not camera.focal_known:
        raise ConicError("the focal length of the camera is only a guess, so the plane cannot be told")
    cones = _cones(ellipses, camera)
    pairs = np.array([circle_normals(each, camera) for each in ellipses]).reshape(-1, 2, 3)
    best, agreeing = np.zeros(3), np.zeros(len(ellipses), dtype=bool)
    missed = np.inf
    for normal in pairs.reshape(-1, 3):
        apart = np.hypot(*_out_of_round(cones, tangent_basis(normal)).T)
        near = apart < tolerance
        # Most circles win; among as many, the roundest.
        if near.any() and (near.sum(), -apart[near].sum()) > (agreeing.sum(), -missed):
            best, agreeing, missed = normal, near, float(apart[near].sum())
    if agreeing.sum() < 2:
        raise ConicError(
            f"{len(ellipses)} ellipses show no two circles on one plane, and one alone fits two planes: give "
            "the plane's normal or its vanishing line"
        )
    normal, spread, misfit = _fitted(cones[agreeing], best)
    # The other plane of each circle: from afar, where perspective is weak, these agree among themselves, too.
    pairs = pairs[agreeing]
    others = np.where((pairs[:, :1] @ normal < pairs[:, 1:] @ normal)[..., None], pairs[:, :1], pairs[:, 1:])
    mirrored, _, rival = _fitted(cones[agreeing], normalised(others[:, 0].sum(axis=0)))
    if float(np.linalg.norm(mirrored - normal)) > _SAME and rival < _CLEARLY**2 * misfit:
        raise ConicError(
            f"the {agreeing.sum()} circles fit two planes about as well, because perspective is too weak to tell "
            "which end is farther: give the plane's normal or its vanishing line"
        )
    freedom = 2 * int(agreeing.sum()) - 2
    return CirclePlane(normal, spread * misfit / freedom, agreeing)


def _fitted(cones: FloatArray, normal: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """The normal (3,) nearest by on which the cones are roundest, its spread (2, 2), and the misfit left."""
    spread = np.eye(2)
    for _ in range(_STEPS):
        residual = _out_of_round(cones, tangent_basis(normal)).ravel()
        slope = _slopes(cones, normal)
        spread = np.asarray(np.linalg.pinv(slope.T @ slope), dtype=np.float64)
        step = np.asarray(-spread @ (slope.T @ residual), dtype=np.float64)
        step = step * min(1.0, _STRIDE / max(float(np.hypot(step[0], step[1])), 1e-300))
        normal = retract(normal, step)
        if float(np.abs(step).max()) < 1e-13:
            break
    residual = _out_of_round(cones, tangent_basis(normal)).ravel()
    return normal, spread, float(residual @ residual)


def _cones(ellipses: Sequence[ImageEllipse], camera: Camera) -> FloatArray:
    """(N, 3, 3) conics in units of the focal length, each turned so that its centre lies ahead."""
    matrix = camera.rectified().matrix
    return np.array([matrix.T @ each.conic @ matrix for each in ellipses]).reshape(-1, 3, 3)


def _out_of_round(cones: FloatArray, basis: FloatArray) -> FloatArray:
    """How far each cone's cut with a plane is from a circle (N, 2): in the difference of its sides, and aslant.

    With e1, e2 (2, 3) along the plane and n across it, the cut with n . X = 1 has the quadratic part eᵢᵀ Q eⱼ,
    which for a circle is a multiple of the identity. For a nearly round one the length of the answer is the
    relative difference of its semi-axes; a hyperbola's is greater than one.
    """
    form = basis @ cones @ basis.T
    trace = np.abs(form[:, 0, 0] + form[:, 1, 1])
    parts = np.stack([form[:, 0, 0] - form[:, 1, 1], 2.0 * form[:, 0, 1]], axis=1)
    return np.asarray(parts / np.maximum(trace, 1e-12 * np.abs(form).max(axis=(1, 2)))[:, None])


def _slopes(cones: FloatArray, normal: FloatArray) -> FloatArray:
    """Derivative (2 N, 2) of the out-of-roundness to the normal, whose basis is carried along, not chosen anew."""
    basis = tangent_basis(normal)
    here = _out_of_round(cones, basis)
    columns = []
    for axis in range(2):
        moved = normalised(normal + _NUDGE * basis[axis])
        first = normalised(basis[0] - (basis[0] @ moved) * moved)
        there = _out_of_round(cones, np.stack([first, cross(moved, first)]))
        columns.append((there - here).ravel() / _NUDGE)
    return np.column_stack(columns)
