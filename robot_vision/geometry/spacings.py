# SPDX-License-Identifier: Apache-2.0
"""Marks at known distances along a line, such as the joints of a pavement, tell where that line vanishes.

The cross ratio (20.4) for any number of marks, any distances and any camera: a point at the distance s along a
line in space appears at p(s) = (A + s B) / (1 + s c), which for s to infinity is the vanishing point B / c.
The five numbers A, B, c are fitted to all marks at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from robot_vision.geometry.arrays import FloatArray, as_rows
from robot_vision.geometry.camera import Camera
from robot_vision.geometry.errors import CrossRatioError
from robot_vision.geometry.sphere import tangent_basis

#: Fewer marks leave the vanishing point open.
_LEAST = 3
#: Of the numbers A, B, c.
_UNKNOWNS = 5
_STEPS = 20
#: Marks nearer to each other than this share of their spread are one mark.
_COINCIDENT = 1e-9
#: A vanishing point farther away than this many spreads of the marks cannot be told from one at infinity.
_INFINITY = 1e12


@dataclass(frozen=True)
class SpacingFit:
    """The vanishing point that spacings along a line lead to.

    Attributes:
        homogeneous: (3,) of unit length, rectified pixels: (u, v) = (h0, h1) / h2; h2 = 0 at infinity.
        covariance: (3, 3) of `homogeneous`, from the standard deviation of the marks.
        misfit: weighted sum of squared residuals; `freedom` on average when the marks are as good as was said.
        freedom: degrees of freedom of `misfit`, 2 N - 5.
    """

    homogeneous: FloatArray
    covariance: FloatArray
    misfit: float
    freedom: int

    @property
    def pixel(self) -> FloatArray:
        """The vanishing point (2,), rectified px.

        Raises:
            CrossRatioError: the line is parallel to the picture: it vanishes at infinity.
        """
        depth = float(self.homogeneous[2])
        if abs(depth) * _INFINITY <= float(np.hypot(self.homogeneous[0], self.homogeneous[1])):
            raise CrossRatioError(
                "the picture shows the lengths in their true ratio, so the line is parallel to the picture "
                "and its vanishing point at infinity"
            )
        return np.asarray(self.homogeneous[:2] / depth)

    @property
    def pixel_covariance(self) -> FloatArray:
        """Covariance (2, 2) of `pixel`, px².

        Raises:
            CrossRatioError: as `pixel`.
        """
        depth = float(self.homogeneous[2])
        slope = np.column_stack([np.eye(2), -self.pixel]) / depth
        return np.asarray(slope @ self.covariance @ slope.T)

    def direction(self, camera: Camera) -> tuple[FloatArray, FloatArray]:
        """Give the direction (3,) of the line, unit, optical frame, z >= 0, and its covariance (2, 2), rad².

        A point at infinity is a direction like any other. The covariance holds in the tangent plane
        (`sphere.tangent_basis`), as that of vanishing points found from lines.
        """
        inverse = np.linalg.inv(camera.rectified().matrix)
        ray = inverse @ self.homogeneous
        length = float(np.linalg.norm(ray)) * (-1.0 if ray[2] < 0.0 else 1.0)
        direction = np.asarray(ray / length)
        slope = tangent_basis(direction) @ inverse / length
        return direction, np.asarray(slope @ self.covariance @ slope.T)


def fit_spacings(pixels: ArrayLike, distances: ArrayLike, sigma: ArrayLike = 0.5) -> SpacingFit:
    """Fit the vanishing point of a line in space to marks on it at known distances, by least squares.

    Three marks suffice, O, H1 and H2 at 0, a and a + b (20.7); more make it surer. Neither the ground nor the
    camera's axis need be level, and the line may run obliquely over the stones.

    Args:
        pixels: (N, 2) marks in the rectified picture, px.
        distances: (N,) along the line from any origin, in any unit, growing or falling in any order.
        sigma: standard deviation of a mark in each direction, px; one for all or (N,).

    Raises:
        CrossRatioError: fewer than three marks, two of them in one place, spacings of zero, or an order
            along the line in which no camera sees them.
    """
    marks, along, spread = _checked(pixels, distances, sigma)
    centre, scale = marks.mean(axis=0), float(np.sqrt(np.mean((marks - marks.mean(axis=0)) ** 2)))
    m = (marks - centre) / scale
    t = (along - along.mean()) / float(np.abs(along - along.mean()).max())
    weight = np.repeat(scale / spread, 2)
    unknowns = _linear(m, t)
    for _ in range(_STEPS):
        residual, slope = _residuals(unknowns, m, t)
        step = np.linalg.lstsq(slope * weight[:, None], -residual * weight, rcond=None)[0]
        unknowns = unknowns + step
        _check_order(unknowns, t)
        if float(np.abs(step).max()) < 1e-14 * (1.0 + float(np.abs(unknowns).max())):
            break
    residual, slope = _residuals(unknowns, m, t)
    weighted = slope * weight[:, None]
    try:
        covariance = np.linalg.inv(weighted.T @ weighted)[2:, 2:]
    except np.linalg.LinAlgError as error:
        raise CrossRatioError("the marks lie so that they leave the vanishing point open") from error
    to_pixels = np.array([[scale, 0.0, centre[0]], [0.0, scale, centre[1]], [0.0, 0.0, 1.0]])
    point = to_pixels @ unknowns[2:]
    length = float(np.linalg.norm(point))
    unit = point / length
    onto = (np.eye(3) - np.outer(unit, unit)) @ to_pixels / length
    misfit = float(np.sum((residual * weight) ** 2))
    return SpacingFit(unit, np.asarray(onto @ covariance @ onto.T), misfit, 2 * len(m) - _UNKNOWNS)


def _checked(
    pixels: ArrayLike, distances: ArrayLike, sigma: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    marks = as_rows(pixels, 2, "pixels")
    along = np.asarray(distances, dtype=np.float64)
    if along.shape != (len(marks),):
        raise ValueError(f"distances must have shape ({len(marks)},), one for each pixel, got {along.shape}")
    spread = np.broadcast_to(np.asarray(sigma, dtype=np.float64), along.shape)
    if len(marks) < _LEAST:
        raise CrossRatioError(f"a vanishing point needs three marks or more, not {len(marks)}")
    if not (np.isfinite(marks).all() and np.isfinite(along).all()):
        raise CrossRatioError("pixels and distances must be finite")
    if not (spread > 0.0).all():
        raise CrossRatioError(f"sigma must be positive, got {spread.min():g} px")
    order = np.argsort(along)
    gaps = np.diff(along[order])
    if gaps.min() <= _COINCIDENT * (along[order[-1]] - along[order[0]]):
        raise CrossRatioError("two marks have the same distance: a spacing, and so their ratio, is zero")
    steps = np.linalg.norm(np.diff(marks[order], axis=0), axis=1)
    if steps.min() <= _COINCIDENT * max(float(np.ptp(marks, axis=0).max()), 1e-9):
        raise CrossRatioError("two marks at different distances are one point of the picture")
    return marks, along, spread


def _linear(m: FloatArray, t: FloatArray) -> FloatArray:
    """First guess of A, B, c from m (1 + t c) = A + t B, which is linear in them."""
    rows = np.zeros((len(m), 2, _UNKNOWNS))
    rows[:, 0, 0] = rows[:, 1, 1] = 1.0
    rows[:, 0, 2] = rows[:, 1, 3] = t
    rows[:, :, 4] = -t[:, None] * m
    solved = np.linalg.lstsq(rows.reshape(-1, _UNKNOWNS), m.ravel(), rcond=None)[0]
    guess = np.asarray(solved, dtype=np.float64)
    _check_order(guess, t)
    return guess


def _residuals(unknowns: FloatArray, m: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Residuals (2 N,) of the marks and their derivatives (2 N, 5) to A, B, c."""
    depth = 1.0 + t * unknowns[4]
    seen = (unknowns[:2] + t[:, None] * unknowns[2:4]) / depth[:, None]
    slope = np.zeros((len(m), 2, _UNKNOWNS))
    slope[:, 0, 0] = slope[:, 1, 1] = 1.0 / depth
    slope[:, 0, 2] = slope[:, 1, 3] = t / depth
    slope[:, :, 4] = -seen * (t / depth)[:, None]
    return (seen - m).ravel(), slope.reshape(-1, _UNKNOWNS)


def _check_order(unknowns: FloatArray, t: FloatArray) -> None:
    """All marks lie before the camera, so none of them may lie beyond the vanishing point."""
    if (1.0 + t * unknowns[4] <= 0.0).any():
        raise CrossRatioError(
            "the marks do not follow each other in the picture as their distances do: the vanishing point "
            "would lie among them"
        )
