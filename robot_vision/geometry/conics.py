# SPDX-License-Identifier: Apache-2.0
"""Circles and ellipses appear as ellipses, but their centres do not appear at the centres of these.

The centre of a circle halves its diameters; perspective does not keep halves. Where it appears follows from the
vanishing line of its plane: (20.10) along one direction, the pole of that line in general. The same holds for
ellipses, whose centre is the pole of the line at infinity, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from robot_vision.geometry.arrays import FloatArray
from robot_vision.geometry.errors import ConicError

#: An ellipse thinner than this, semi-axis to semi-axis, is a line in double precision.
_THINNEST = 1e-5
#: Nearer than this share of its size, an ellipse touches the vanishing line.
_TOUCH = 1e-9


@dataclass(frozen=True)
class ImageEllipse:
    """An ellipse in a picture.

    Attributes:
        u: column of its centre, px.
        v: row of its centre, px.
        major: longer semi-axis, px.
        minor: shorter semi-axis, px.
        angle: of the longer axis, rad, from the column axis towards the row axis, in (-π/2, π/2].

    Raises:
        ConicError: semi-axes that are not positive and finite, or in the wrong order.
    """

    u: float
    v: float
    major: float
    minor: float
    angle: float = 0.0

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (self.u, self.v, self.major, self.angle))):
            raise ConicError("an ellipse needs finite centre, semi-axes and angle")
        if not 0.0 < self.minor <= self.major:
            raise ConicError(
                f"semi-axes must be positive and the longer one first, got {self.major} and {self.minor} px"
            )

    @classmethod
    def from_conic(cls, conic: ArrayLike) -> ImageEllipse:
        """Read a conic (3, 3) of any scale: the points p = (u, v, 1) with pᵀ C p = 0.

        Raises:
            ConicError: it is no ellipse, or one without points.
        """
        c = np.asarray(conic, dtype=np.float64)
        if c.shape != (3, 3) or not np.isfinite(c).all():
            raise ConicError(f"must be a finite (3, 3) matrix, got {c.tolist()}")
        c = 0.5 * (c + c.T)
        form = c[:2, :2]
        values, vectors = np.linalg.eigh(form * (-1.0 if np.trace(form) < 0.0 else 1.0))
        if values[0] <= _THINNEST**2 * values[1]:
            raise ConicError(
                "is no ellipse but a hyperbola, a parabola or a line: what it shows reaches into the plane of "
                "the camera's centre"
            )
        centre = -np.linalg.solve(form, c[:2, 2])
        level = float(-(c[2, 2] + c[2, :2] @ centre) * (-1.0 if np.trace(form) < 0.0 else 1.0))
        if level <= 0.0:
            raise ConicError("is an ellipse without real points")
        major, minor = np.sqrt(level / values)
        angle = math.atan2(vectors[1, 0], vectors[0, 0])
        angle -= math.pi * math.ceil(angle / math.pi - 0.5)
        return cls(float(centre[0]), float(centre[1]), float(major), float(minor), angle)

    @property
    def centre(self) -> FloatArray:
        """(2,) px: of the ellipse, not of what it shows."""
        return np.array([self.u, self.v])

    @property
    def frame(self) -> FloatArray:
        """(3, 3): from the unit circle, its first axis the longer one, to pixels."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        return np.array(
            [
                [c * self.major, -s * self.minor, self.u],
                [s * self.major, c * self.minor, self.v],
                [0.0, 0.0, 1.0],
            ]
        )

    @property
    def conic(self) -> FloatArray:
        """(3, 3) symmetric, positive outside: (u, v, 1) C (u, v, 1)ᵀ = 0 on the ellipse."""
        inverse = np.linalg.inv(self.frame)
        return np.asarray(inverse.T @ np.diag([1.0, 1.0, -1.0]) @ inverse)

    def points(self, count: int) -> FloatArray:
        """Points (count, 2) on the ellipse, px, at equal steps of the eccentric angle."""
        turn = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
        circle = np.column_stack([np.cos(turn), np.sin(turn), np.ones(count)])
        return np.asarray((circle @ self.frame.T)[:, :2])


@overload
def centre_shift(b: float, d: float) -> float: ...


@overload
def centre_shift(b: ArrayLike, d: ArrayLike) -> float | FloatArray: ...


def centre_shift(b: ArrayLike, d: ArrayLike) -> float | FloatArray:
    """Give ε = b² / d (20.10): how far the true centre lies from that of the ellipse, towards the vanishing line.

    It is (20.8) with y1 = b + ε, y2 = 2 b, y3 = b + d. Exact for an ellipse one axis of which meets the vanishing
    line at right angles, as that of a circle straight ahead does; of any other it is the part of the shift at
    right angles to the line, when b is half the ellipse's extent that way (see `projected_centre`).

    Args:
        b: semi-axis of the ellipse towards the vanishing line, px.
        d: distance of the ellipse's centre from the vanishing line, px.

    Raises:
        ConicError: b not positive, or d not greater than b: the ellipse touches or crosses the vanishing line.
    """
    extent, distance = np.broadcast_arrays(np.asarray(b, dtype=np.float64), np.asarray(d, dtype=np.float64))
    if not (np.isfinite(extent).all() and (extent > 0.0).all()):
        raise ConicError(f"the semi-axis b must be positive and finite, got {extent.min():g}")
    if not (distance > extent * (1.0 + _TOUCH)).all():
        raise ConicError(_touching(float(distance.min()), float(extent.max())))
    shift = extent**2 / distance
    return float(shift) if shift.ndim == 0 else np.asarray(shift)


def projected_centre(conic: ArrayLike, vanishing_line: ArrayLike) -> FloatArray:
    """Give where (2,) (u, v) the centre of a circle or ellipse appears: the pole C⁻¹ l of its plane's vanishing line.

    Args:
        conic: (3, 3) image of the circle or ellipse, any scale.
        vanishing_line: (3,) of its plane, any scale; (0, 0, 1), at infinity, for a plane parallel to the picture.

    Raises:
        ConicError: no ellipse, no line, or an ellipse that touches or crosses the vanishing line.
    """
    ellipse = ImageEllipse.from_conic(conic)
    slope, height = _line_from(ellipse, vanishing_line)
    return np.asarray((ellipse.frame @ np.append(-slope / height, 1.0))[:2])


def contact_points(conic: ArrayLike, point: ArrayLike) -> FloatArray:
    """Give the points (2, 2), px, at which the two tangents from a point touch an ellipse.

    Args:
        conic: (3, 3), any scale.
        point: (2,) px, or (3,) homogeneous, (x, y, 0) for the point at infinity in the direction (x, y).

    Raises:
        ConicError: no ellipse, or the point does not lie outside it.
    """
    ellipse = ImageEllipse.from_conic(conic)
    p = np.asarray(point, dtype=np.float64)
    x, y, w = np.linalg.solve(ellipse.frame, p if p.shape == (3,) else np.append(p, 1.0))
    away = math.hypot(x, y)
    if not away > abs(w) * (1.0 + _TOUCH):
        raise ConicError("no tangent leads from a point on or in an ellipse to it")
    # From the unit circle's centre a point at the distance r sees its contact points at arccos(1 / r) aside.
    aside = math.acos(w / away)
    turns = math.atan2(y, x) + np.array([aside, -aside])
    circle = np.column_stack([np.cos(turns), np.sin(turns), np.ones(2)])
    return np.asarray((circle @ ellipse.frame.T)[:, :2])


def centre_by_tangents(conic: ArrayLike, vanishing_line: ArrayLike) -> FloatArray:
    """Give where (2,) (u, v) the centre appears, by the construction of Fig. 20.9.

    Tangents from a point on the vanishing line are parallel on the plane, so the chord that joins their contact
    points passes through the centre; two chords cross there. `projected_centre` says the same by algebra.

    Args:
        conic: (3, 3) image of the circle or ellipse, any scale.
        vanishing_line: (3,) of its plane, any scale.

    Raises:
        ConicError: as `projected_centre`.
    """
    ellipse = ImageEllipse.from_conic(conic)
    _line_from(ellipse, vanishing_line)
    a, b, c = np.asarray(vanishing_line, dtype=np.float64)
    along = np.array([-b, a, 0.0])
    nearest = np.array([-a, -b, 0.0]) * (a * ellipse.u + b * ellipse.v + c)
    nearest += (a * a + b * b) * np.array([ellipse.u, ellipse.v, 1.0])
    points = [along, nearest] if math.hypot(a, b) > 0.0 else [np.array([1.0, 0, 0]), np.array([0, 1.0, 0])]
    (first, second), (third, fourth) = (contact_points(conic, point) for point in points)
    sides = np.column_stack([second - first, third - fourth])
    share = np.linalg.solve(sides, third - first)[0]
    return np.asarray(first + share * (second - first))


def _line_from(ellipse: ImageEllipse, vanishing_line: ArrayLike) -> tuple[FloatArray, float]:
    """The line as slope (2,) and height, slope . x + height = 0, where the ellipse is the unit circle."""
    line = np.asarray(vanishing_line, dtype=np.float64)
    if line.shape != (3,) or not np.isfinite(line).all() or not line.any():
        raise ConicError(
            f"its vanishing line must be three finite numbers, not all zero, got {line.tolist()}"
        )
    moved = ellipse.frame.T @ line
    slope, height = moved[:2], float(moved[2])
    if abs(height) <= float(np.hypot(slope[0], slope[1])) * (1.0 + _TOUCH):
        scale = float(np.hypot(line[0], line[1]))
        raise ConicError(_touching(abs(height) / scale, float(np.hypot(slope[0], slope[1])) / scale))
    return slope, height


def _touching(distance: float, extent: float) -> str:
    return (
        f"it touches or crosses the vanishing line of its plane ({distance:.1f} px away, {extent:.1f} px of extent): "
        "then it has no centre before the camera, so ellipse or line is wrong"
    )
