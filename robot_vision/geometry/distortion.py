# SPDX-License-Identifier: Apache-2.0
"""Lenses bend rays: the distortion models of CameraInfo, forward in closed form, back by Newton iteration.

Points are normalised, (x, y) = (X/Z, Y/Z) of the ray on the way in, and the place in the picture before the
matrix K is applied on the way out. A lens polynomial is only true as far as it grows with the angle; further
out it folds back over the picture and would give one pixel two rays. Each model therefore knows the radius of
its field, and whatever lies outside is NaN in both directions.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TypeAlias

import numpy as np

from robot_vision.geometry.arrays import FloatArray
from robot_vision.geometry.errors import CameraError

COEFFICIENT_COUNTS = {
    "plumb_bob": (4, 5),
    "rational_polynomial": (8, 12, 14),
    "equidistant": (4,),
    "fisheye": (4,),
}
_WIDEST_ANGLE = math.radians(89.9)  # beyond it a normalised point runs off to infinity
_SAMPLES = 4096  # of the angle, for the field and for starting values: the starts are then good to about 1e-6
_MOST_STEPS = 60  # Newton needs 3 to 6; the rest is for points just inside the edge of the field
_LEAST_DENOMINATOR = 1e-2  # of the rational model: nearer to its pole no lens stretches rays so far
_START_WITHIN = 0.97  # of the field: at its very edge the Jacobian is singular
_LONGEST_STEP = 0.2  # of the field: near its edge a Newton step would leap across it
_RADIUS_ROUNDING = 1e-9  # of the field: a point of its edge may come back this much outside
_LEAST_STRIDE = 1e-6  # of a Newton step: where this little does not help, nothing in the field does
_RESIDUAL = 1e-13  # of a normalised point: 1e-10 px at a focal length of 1000 px


@dataclass(frozen=True)
class RadialTangential:
    """plumb_bob and rational_polynomial (Brown 1971; OpenCV, camera calibration and 3D reconstruction).

    bent = x (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶) + 2 (p·x) x + r² p, p = (p2, p1)

    Attributes:
        numerator: k1, k2, k3.
        denominator: k4, k5, k6.
        tangential: p1, p2.
    """

    numerator: tuple[float, float, float]
    denominator: tuple[float, float, float]
    tangential: tuple[float, float]

    def distort(self, points: FloatArray) -> FloatArray:
        """Bend normalised points (N, 2); NaN outside the field."""
        with np.errstate(invalid="ignore"):
            inside = np.hypot(points[:, 0], points[:, 1]) <= self.field_radius
        bent = np.full(points.shape, np.nan)
        bent[inside] = self._bend(points[inside])
        return bent

    def undistort(self, points: FloatArray) -> FloatArray:
        """Straighten bent normalised points (N, 2); NaN where no point of the field is bent to there.

        Both parts of the model are gradients, so the Jacobian is symmetric, and inside the field it is
        positive definite: there is one answer at most, and Newton's iteration with step halving finds it.
        """
        straight = np.full(points.shape, np.nan)
        length = np.hypot(points[:, 0], points[:, 1])
        radii, bent_radii = self._radial_table
        reach = bent_radii[-1] + 3.0 * radii[-1] ** 2 * math.hypot(*self.tangential)
        with np.errstate(invalid="ignore"):
            active = np.flatnonzero(length <= reach)
        if not active.size:
            return straight
        target = points[active]
        near = np.minimum(np.interp(length[active], bent_radii, radii), _START_WITHIN * self.field_radius)
        x = target * (near / np.maximum(length[active], np.finfo(float).tiny))[:, None]
        error = self._bend(x) - target
        stride = np.ones(len(active))
        tolerance = _RESIDUAL * (1.0 + _norm(target))
        going = np.arange(len(active))
        for _ in range(_MOST_STEPS):
            step = self._newton_step(x[going], error[going])
            trial = x[going] - stride[going, None] * step
            trial_error = self._bend(trial) - target[going]
            better = _norm(trial_error) < _norm(error[going])
            x[going[better]], error[going[better]] = trial[better], trial_error[better]
            stride[going] *= np.where(better, 1.0, 0.5)
            # A point is done when rounding stops its progress, and lost when not even a tiny step helps it.
            done = ~better & (_norm(error[going]) <= tolerance[going])
            going = going[~done & (stride[going] > _LEAST_STRIDE)]
            if not going.size:
                break
        settled = (_norm(error) <= tolerance) & (_norm(x) <= self.field_radius * (1.0 + _RADIUS_ROUNDING))
        straight[active[settled]] = x[settled]
        return straight

    @cached_property
    def field_radius(self) -> float:
        """Radius of the disc of normalised points on which the model is one-to-one.

        A map whose symmetric Jacobian is positive definite on a convex set is one-to-one there; without
        tangential terms this disc ends exactly where the bent radius stops growing.
        """
        return _first_failure(self._is_one_to_one_at)

    @cached_property
    def _radial_table(self) -> tuple[FloatArray, FloatArray]:
        radii = np.tan(np.linspace(0.0, math.atan(self.field_radius), _SAMPLES))
        radii[-1] = self.field_radius
        return radii, radii * self._gain(radii * radii)[0]

    def _gain(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Radial gain g and dg/ds at the squared radius s."""
        k1, k2, k3 = self.numerator
        k4, k5, k6 = self.denominator
        above = 1.0 + s * (k1 + s * (k2 + s * k3))
        below = 1.0 + s * (k4 + s * (k5 + s * k6))
        slope_above = k1 + s * (2.0 * k2 + s * 3.0 * k3)
        slope_below = k4 + s * (2.0 * k5 + s * 3.0 * k6)
        return above / below, (slope_above - above / below * slope_below) / below

    def _bend(self, x: FloatArray) -> FloatArray:
        p = np.array([self.tangential[1], self.tangential[0]])
        s = np.einsum("ij,ij->i", x, x)
        gain, _ = self._gain(s)
        bent: FloatArray = x * (gain + 2.0 * (x @ p))[:, None] + s[:, None] * p
        return bent

    def _newton_step(self, x: FloatArray, error: FloatArray) -> FloatArray:
        p1, p2 = self.tangential
        u, v = x[:, 0], x[:, 1]
        gain, slope = self._gain(u * u + v * v)
        shared = gain + 2.0 * (p2 * u + p1 * v)
        uu = shared + 2.0 * slope * u * u + 4.0 * p2 * u
        vv = shared + 2.0 * slope * v * v + 4.0 * p1 * v
        uv = 2.0 * slope * u * v + 2.0 * (p1 * u + p2 * v)
        determinant = uu * vv - uv * uv
        determinant = np.where(np.abs(determinant) > np.finfo(float).eps, determinant, np.finfo(float).eps)
        step = np.stack([vv * error[:, 0] - uv * error[:, 1], uu * error[:, 1] - uv * error[:, 0]], axis=1)
        step /= determinant[:, None]
        # Never longer than a fifth of the way to the edge of the field or of the point's own radius.
        longest = _LONGEST_STEP * np.minimum(self.field_radius, 1.0 + _norm(x))
        bounded: FloatArray = step * (longest / np.maximum(_norm(step), longest))[:, None]
        return bounded

    def _is_one_to_one_at(self, radius: FloatArray) -> np.ndarray:
        """Whether the Jacobian is positive definite all around the circle of this radius.

        Along direction e it is [[h' + 6 r p·e, 2 r p·t], [2 r p·t, g + 2 r p·e]] in the basis (e, t); with c
        the cosine between p and e its determinant is a parabola in c, least at `worst`.
        """
        k4, k5, k6 = self.denominator
        s = radius * radius
        below = 1.0 + s * (k4 + s * (k5 + s * k6))
        gain, slope = self._gain(s)
        growth = gain + 2.0 * s * slope
        shift = radius * math.hypot(*self.tangential)
        linear = (2.0 * growth + 6.0 * gain) * shift
        worst = np.clip(-linear / np.maximum(32.0 * shift * shift, np.finfo(float).tiny), -1.0, 1.0)
        determinant = growth * gain - 4.0 * shift**2 + linear * worst + 16.0 * shift**2 * worst**2
        holds: np.ndarray = (
            (below > _LEAST_DENOMINATOR) & (determinant > 0.0) & (growth + gain - 8.0 * shift > 0.0)
        )
        return holds


@dataclass(frozen=True)
class Equidistant:
    """equidistant, also called fisheye (Kannala and Brandt 2006): θd = θ (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸).

    Rays at more than 89.9° from the axis have no normalised point and are outside the field.
    """

    coefficients: tuple[float, float, float, float]

    def distort(self, points: FloatArray) -> FloatArray:
        """Bend normalised points (N, 2); NaN outside the field."""
        radius = np.hypot(points[:, 0], points[:, 1])
        with np.errstate(invalid="ignore"):
            angle = np.where(radius <= self.field_radius, np.arctan(radius), np.nan)
        ratio = np.where(radius == 0.0, 1.0, self._bend(angle) / np.where(radius == 0.0, 1.0, radius))
        bent: FloatArray = points * ratio[:, None]
        return bent

    def undistort(self, points: FloatArray) -> FloatArray:
        """Straighten bent normalised points (N, 2); NaN where no ray of the field is bent to there."""
        bent_angle = np.hypot(points[:, 0], points[:, 1])
        angles, bent_angles = self._angle_table
        with np.errstate(invalid="ignore"):
            bent_angle_inside = np.where(bent_angle <= bent_angles[-1], bent_angle, np.nan)
        angle = np.interp(bent_angle_inside, bent_angles, angles)
        error = self._bend(angle) - bent_angle_inside
        stride = np.ones_like(angle)
        for _ in range(_MOST_STEPS):
            slope = np.maximum(self._slope(angle), np.finfo(float).eps)
            trial = np.clip(angle - stride * error / slope, 0.0, angles[-1])
            trial_error = self._bend(trial) - bent_angle_inside
            better = np.abs(trial_error) < np.abs(error)
            angle, error = np.where(better, trial, angle), np.where(better, trial_error, error)
            stride = np.where(better, stride, 0.5 * stride)
            if not np.any((better | (np.abs(error) > _RESIDUAL)) & (stride > _LEAST_STRIDE)):
                break
        angle = np.where(np.abs(error) <= _RESIDUAL, angle, np.nan)
        ratio = np.where(bent_angle == 0.0, 1.0, np.tan(angle) / np.where(bent_angle == 0.0, 1.0, bent_angle))
        straight: FloatArray = points * ratio[:, None]
        return straight

    @cached_property
    def field_radius(self) -> float:
        """Radius of the disc of normalised points on which the bent angle grows with the angle."""
        return _first_failure(lambda radius: self._slope(np.arctan(radius)) > 0.0)

    @cached_property
    def _angle_table(self) -> tuple[FloatArray, FloatArray]:
        angles = np.linspace(0.0, math.atan(self.field_radius), _SAMPLES)
        return angles, self._bend(angles)

    def _bend(self, angle: FloatArray) -> FloatArray:
        k1, k2, k3, k4 = self.coefficients
        s = angle * angle
        bent: FloatArray = angle * (1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4))))
        return bent

    def _slope(self, angle: FloatArray) -> FloatArray:
        k1, k2, k3, k4 = self.coefficients
        s = angle * angle
        slope: FloatArray = 1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * (7.0 * k3 + s * 9.0 * k4)))
        return slope


Distortion: TypeAlias = RadialTangential | Equidistant


def checked_coefficients(model: str, coefficients: Sequence[float]) -> tuple[float, ...]:
    """Give the coefficients in the shortest form that means the same: () when nothing is bent.

    Raises:
        CameraError: naming `distortion_model` when unknown, `distortion` when number or values are wrong.
    """
    if model not in COEFFICIENT_COUNTS:
        known = ", ".join(COEFFICIENT_COUNTS)
        raise CameraError("distortion_model", f"{model!r} is not known; known are {known}")
    try:
        values = tuple(float(value) for value in coefficients)
    except (TypeError, ValueError, OverflowError):
        raise CameraError("distortion", f"must be a sequence of numbers, got {coefficients!r}") from None
    if not all(math.isfinite(value) for value in values):
        raise CameraError("distortion", f"coefficients must be finite numbers, got {values}")
    counts = COEFFICIENT_COUNTS[model]
    bends_by_nature = model in ("equidistant", "fisheye")
    if len(values) not in counts and (values or bends_by_nature):
        wanted = " or ".join(str(count) for count in counts)
        hint = "; 8 belong to rational_polynomial" if model == "plumb_bob" and len(values) == 8 else ""
        raise CameraError("distortion", f"{model} takes {wanted} coefficients, got {len(values)}{hint}")
    if any(values[8:12]):
        raise CameraError("distortion", f"thin prism terms s1..s4 must be zero, got {values[8:12]}")
    if any(values[12:14]):
        raise CameraError("distortion", f"sensor tilt terms τx, τy must be zero, got {values[12:14]}")
    if not any(values) and not bends_by_nature:
        return ()
    return values[:8]


@lru_cache(maxsize=64)
def distortion_of(model: str, coefficients: tuple[float, ...]) -> Distortion | None:
    """Give the model for coefficients that `checked_coefficients` passed; None when nothing is bent."""
    if not coefficients:
        return None
    if model in ("equidistant", "fisheye"):
        e1, e2, e3, e4 = coefficients
        return Equidistant((e1, e2, e3, e4))
    k1, k2, p1, p2, k3, k4, k5, k6 = (*coefficients, *([0.0] * (8 - len(coefficients))))
    return RadialTangential((k1, k2, k3), (k4, k5, k6), (p1, p2))


def _norm(points: FloatArray) -> FloatArray:
    return np.hypot(points[:, 0], points[:, 1])


def _first_failure(holds: Callable[[FloatArray], np.ndarray]) -> float:
    """Give the radius up to which `holds` is true without a break: by samples, then bisection."""
    radii = np.tan(np.linspace(0.0, _WIDEST_ANGLE, _SAMPLES))
    with np.errstate(all="ignore"):
        failed = np.flatnonzero(~holds(radii))
        if not failed.size:
            return float(radii[-1])
        good, bad = float(radii[max(failed[0] - 1, 0)]), float(radii[failed[0]])
        while bad - good > 1e-15 * bad:
            middle = 0.5 * (good + bad)
            if middle in (good, bad):
                break
            if holds(np.array([middle]))[0]:
                good = middle
            else:
                bad = middle
    return good
