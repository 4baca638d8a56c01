# SPDX-License-Identifier: Apache-2.0
"""The centre line of a road that bends: a curvature that changes evenly between knots ahead, and nothing else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

#: Distance of the places along the curve at which it is integrated, m.
_STEP = 0.5
#: Newton steps for the foot of a point on the curve: two leave less than a millimetre on any road.
_FOOT_STEPS = 3
#: A place beside a bend is never taken to lie beyond this share of the way to the bend's middle.
_TO_THE_MIDDLE = 0.7


class Alignment:
    """The knots of a curve: all that does not depend on how it bends, worked out once.

    Args:
        spacing: of the knots, m.
        count: of knots; the first lies beside the robot.
        behind: how far the curve reaches behind the robot, m.

    Attributes:
        knots: (K,) along the curve, m.
        along: (S,) places at which it is integrated, m.
        hats: (S, K) share of each knot in the curvature at each place.
        ramps: (S, K) their integrals from the robot on, m: how a knot's curvature turns the curve there.
    """

    def __init__(self, spacing: float = 4.0, count: int = 10, behind: float = 6.0) -> None:
        self.spacing = spacing
        self.knots = spacing * np.arange(count)
        self.along = np.arange(-behind, self.knots[-1] + spacing + 0.5 * _STEP, _STEP)
        self.origin = int(np.argmin(np.abs(self.along)))
        self.hats = self.at(self.along)
        self.ramps = self.integrated(self.hats)

    def at(self, along: ArrayLike) -> Array:
        """Share of each knot in the curvature at places along the curve, (N,) m: (N, K)."""
        place = np.clip(np.asarray(along, np.float64) / self.spacing, 0.0, len(self.knots) - 1.0)
        return np.asarray(np.maximum(0.0, 1.0 - np.abs(place[:, None] - np.arange(len(self.knots)))))

    def integrated(self, values: Array) -> Array:
        """Integral of values (S, …) at `along` from the robot to each place, by trapezia."""
        steps = 0.5 * _STEP * (values[1:] + values[:-1])
        whole = np.concatenate([np.zeros_like(steps[:1]), np.cumsum(steps, axis=0)])
        return np.asarray(whole - whole[self.origin])


@dataclass(frozen=True)
class Feet:
    """Where points lie beside a curve, N of them.

    Attributes:
        along: (N,) of the nearest point of the curve, m.
        left: (N,) distance to the left of it, m.
        heading: (N,) of the curve there, rad.
        normal: (N, 2) to the left of the curve there.
        bending: (N, K) how `left` changes with the curvature at each knot, m^2.
    """

    along: Array
    left: Array
    heading: Array
    normal: Array
    bending: Array


class RoadCurve:
    """A centre line in its own frame: it begins beside the robot at the origin and leads along x there.

    Args:
        alignment: its knots.
        curvature: (K,) at the knots, 1/m, positive to the left.
    """

    def __init__(self, alignment: Alignment, curvature: Array) -> None:
        self._alignment = alignment
        self.curvature = curvature
        self._heading = alignment.ramps @ curvature
        self._tangent = np.stack([np.cos(self._heading), np.sin(self._heading)], axis=1)
        self._points = alignment.integrated(self._tangent)

    def heading(self, along: ArrayLike) -> Array:
        """Direction (N,) in rad at places (N,) in m."""
        return np.interp(np.asarray(along, np.float64), self._alignment.along, self._heading)

    def points(self, along: ArrayLike) -> Array:
        """Points (N, 2), m."""
        ways = np.asarray(along, np.float64)
        return np.stack([np.interp(ways, self._alignment.along, axis) for axis in self._points.T], axis=1)

    def turning(self, along: ArrayLike) -> Array:
        """How the direction at places (N,) changes with the curvature at each knot, (N, K) m."""
        ways = np.asarray(along, np.float64)
        ramps = self._alignment.ramps
        return np.stack([np.interp(ways, self._alignment.along, ramp) for ramp in ramps.T], axis=1)

    def feet(self, points: Array) -> Feet:
        """The place beside the curve of each point (N, 2), m."""
        ways = self._alignment.along
        along = np.clip(points[:, 0], ways[0], ways[-1])
        sharpest = float(np.abs(self.curvature).max())
        for _ in range(_FOOT_STEPS):
            heading = self.heading(along)
            cos, sin = np.cos(heading), np.sin(heading)
            away = points - self.points(along)
            ahead, left = cos * away[:, 0] + sin * away[:, 1], cos * away[:, 1] - sin * away[:, 0]
            bend = np.clip(sharpest * np.abs(left), 0.0, _TO_THE_MIDDLE)
            along = np.clip(along + ahead / (1.0 + bend), ways[0], ways[-1])
        heading = self.heading(along)
        normal = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
        left = np.einsum("ni,ni->n", normal, points - self.points(along))
        return Feet(along, left, heading, normal, self._bending(along, normal))

    def _bending(self, along: Array, normal: Array) -> Array:
        """A knot that bends more turns all that comes after it, and so shifts the curve beside a point."""
        alignment = self._alignment
        shifts = alignment.integrated(
            np.stack(
                [-self._tangent[:, 1:] * alignment.ramps, self._tangent[:, :1] * alignment.ramps], axis=1
            )
        )
        low = np.clip((along - alignment.along[0]) / _STEP, 0.0, len(alignment.along) - 1.001)
        index = low.astype(np.intp)
        part = (low - index)[:, None, None]
        shift = (1.0 - part) * shifts[index] + part * shifts[index + 1]
        return np.asarray(-np.einsum("ni,nik->nk", normal, shift))
