# SPDX-License-Identifier: Apache-2.0
"""An ellipse through edge points, to a small fraction of a pixel: first by algebra, then by distance.

The direct fit (Fitzgibbon, Pilu and Fisher 1999, in the stable form of Halir and Flusser 1998) always finds an
ellipse, but weighs points by their curvature. It begins a fit of least distance with Tukey's weights, which a few
points of other edges cannot pull away.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import ConicError, ImageEllipse

Array = NDArray[np.float64]

#: An ellipse has five numbers; fewer than twice as many points check nothing.
_LEAST = 10
_STEPS = 25
#: Tukey's constant: 95 % efficient on Gaussian errors.
_TUKEY = 4.685
#: px: edge points are not placed better than that, and weights must not collapse on fewer of them.
_FINEST = 0.02


@dataclass(frozen=True)
class FittedEllipse:
    """An ellipse and how well its edge points agree on it.

    Attributes:
        ellipse: px.
        distances: (N,) signed distances of the points from it, px, positive outside.
        weights: (N,) in [0, 1], 0 for points of something else.
        sigma: robust standard deviation of the points about it, px.
        covariance: (2, 2) of its centre (u, v), px².
    """

    ellipse: ImageEllipse
    distances: Array
    weights: Array
    sigma: float
    covariance: Array


def fit_ellipse(points: Array) -> FittedEllipse | None:
    """Fit an ellipse to points (N, 2), px; None when they are too few or lie on no ellipse."""
    if len(points) < _LEAST:
        return None
    centre = points.mean(axis=0)
    scale = float(np.abs(points - centre).max())
    if scale <= 0.0:
        return None
    begun = _direct((points - centre) / scale)
    if begun is None:
        return None
    place, shape = begun
    return _nearest(points, centre + scale * place, scale * shape)


def _direct(points: Array) -> tuple[Array, Array] | None:
    """Centre (2,) and shape (2, 2) of the ellipse of least algebraic distance with 4 a c - b² = 1."""
    x, y = points.T
    quadratic, linear = np.column_stack([x * x, x * y, y * y]), np.column_stack([x, y, np.ones(len(x))])
    s1, s2, s3 = quadratic.T @ quadratic, quadratic.T @ linear, linear.T @ linear
    try:
        to_linear = -np.linalg.solve(s3, s2.T)
        reduced = (s1 + s2 @ to_linear)[[2, 1, 0]] * np.array([[0.5], [-1.0], [0.5]])
        vectors = np.real(np.linalg.eig(reduced)[1])
    except np.linalg.LinAlgError:  # all on one line
        return None
    condition = 4.0 * vectors[0] * vectors[2] - vectors[1] ** 2
    if not (condition > 0.0).any():
        return None
    a, b, c = vectors[:, int(np.argmax(condition))]
    d, e, f = to_linear @ (a, b, c)
    try:
        found = ImageEllipse.from_conic([[a, b / 2, d / 2], [b / 2, c, e / 2], [d / 2, e / 2, f]])
    except ConicError:
        return None
    axes = found.frame[:2, :2]
    return found.centre, _root(axes @ axes.T)


def _root(squared: Array) -> Array:
    """The symmetric positive root of a symmetric positive matrix (2, 2)."""
    values, vectors = np.linalg.eigh(squared)
    return np.asarray((vectors * np.sqrt(values)) @ vectors.T)


def _nearest(points: Array, centre: Array, shape: Array) -> FittedEllipse | None:
    """Least weighted distances from q = centre + shape w, |w| = 1, where a circle is no special case.

    The shape is symmetric, so that it has three numbers and no angle, which a circle would leave open.
    """
    weights = np.ones(len(points))
    sigma, normal_matrix = math.inf, np.eye(5)
    for _ in range(_STEPS):
        distances, slopes = _distances(points, centre, shape)
        sigma = max(1.4826 * float(np.median(np.abs(distances))), _FINEST)
        weights = np.clip(1.0 - (distances / (_TUKEY * sigma)) ** 2, 0.0, None) ** 2
        weighted = slopes * weights[:, None]
        normal_matrix = np.asarray(weighted.T @ slopes)
        try:
            step = np.linalg.solve(normal_matrix, -weighted.T @ distances)
        except np.linalg.LinAlgError:
            return None
        centre = centre + step[:2]
        shape = shape + np.array([[step[2], step[3]], [step[3], step[4]]])
        if not np.isfinite(shape).all() or np.linalg.eigvalsh(shape)[0] <= 0.0:
            return None
        if float(np.abs(step).max()) < 1e-6:
            break
    distances, _ = _distances(points, centre, shape)
    covariance = np.linalg.inv(normal_matrix)[:2, :2] * sigma**2
    (minor, major), vectors = np.linalg.eigh(shape)
    angle = math.atan2(vectors[1, 1], vectors[0, 1])
    angle -= math.pi * math.ceil(angle / math.pi - 0.5)
    ellipse = ImageEllipse(float(centre[0]), float(centre[1]), float(major), float(minor), angle)
    return FittedEllipse(ellipse, distances, weights, sigma, np.asarray(covariance))


def _distances(points: Array, centre: Array, shape: Array) -> tuple[Array, Array]:
    """Distances (N,) of points from the ellipse, to first order, and their derivatives (N, 5)."""
    inverse = np.linalg.inv(shape)
    around = (points - centre) @ inverse
    around = around / np.maximum(np.linalg.norm(around, axis=1, keepdims=True), 1e-12)
    normal = around @ inverse
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    distances = np.einsum("ni,ni->n", normal, points - centre - around @ shape)
    cross = normal[:, 0] * around[:, 1] + normal[:, 1] * around[:, 0]
    by_shape = np.column_stack([normal[:, 0] * around[:, 0], cross, normal[:, 1] * around[:, 1]])
    return distances, -np.hstack([normal, by_shape])
