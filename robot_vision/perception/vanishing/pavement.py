# SPDX-License-Identifier: Apache-2.0
"""Flagstones tell where the ground vanishes: not only where their joints lead to, but how their spacings shrink.

Stones are laid at regular spacings, so on any line across the joints the cross ratio (20.4) gives the point in
which that line vanishes, and with it a point of the horizon. Joints that lead ahead are crossed on a line towards
the vanishing point across; joints that lie across are crossed on a line towards the primary one. Either vanishing
point is then raised or lowered to that horizon, as far as the two covariances say.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import CrossRatioError, fit_spacings
from robot_vision.geometry.sphere import angle_between, cross, normalised, retract, tangent_basis
from robot_vision.perception.segments import LineSegments
from robot_vision.perception.vanishing.joints import Joints, regular_joints
from robot_vision.perception.vanishing.points import Role, VanishingPoints

Array = NDArray[np.float64]

#: The vanishing point across lies within this of square to the way.
_SQUARE = np.deg2rad(15.0)
#: Misfit a degree of freedom beyond which stones are not regular.
_MOST_MISFIT = 2.0
#: Joints share errors of light and lens: factor on the variance, from simulated paths.
_SHARED_ERROR = 1.7
#: Squared distance (1 degree of freedom) beyond which spacings and lines contradict each other: 3 sigma.
_GATE = 9.0


@dataclass(frozen=True)
class PavementSpacings:
    """Takes the regular spacings of a pavement as a further source of its vanishing points.

    Args:
        least_joints: joints that must follow each other regularly.
        shortest, longest: spacings looked for, in heights of the camera.
        sure: standard deviation across the horizon below which a vanishing point needs no spacings, rad.
    """

    least_joints: int = 5
    shortest: float = 0.15
    longest: float = 2.0
    sure: float = float(np.deg2rad(0.08))

    def fuse(self, points: VanishingPoints, lines: LineSegments) -> VanishingPoints:
        """The same vanishing points, the primary one and the one across drawn to where the spacings lead.

        Args:
            points: with a label for each line.
            lines: the segments they were found in.
        """
        ground = _ground(points)
        if ground is None:
            return points
        primary, across, up = ground
        fused = points
        for towards, along in ((across, primary), (primary, across)):
            fused = self._levelled(fused, points, lines, towards, along, up)
        return fused

    def spacings(self, points: VanishingPoints, lines: LineSegments) -> tuple[float | None, float | None]:
        """Spacing of the joints across the way and along it, heights of the camera; None where none are regular.

        Args:
            points: with a label for each line.
            lines: the segments they were found in.
        """
        ground = _ground(points)
        if ground is None:
            return None, None
        primary, across, up = ground
        found = (self.joints(points, lines, *order, up) for order in ((across, primary), (primary, across)))
        spacing_across, spacing_along = (None if joints is None else joints.spacing for joints in found)
        return spacing_across, spacing_along

    def joints(
        self, points: VanishingPoints, lines: LineSegments, towards: int, along: int, up: Array
    ) -> Joints | None:
        """The joints that lead to the vanishing point `along`, on a line towards the one `towards`.

        Args:
            points: with a label for each line.
            lines: the segments they were found in.
            towards: index of the vanishing point of the line on which the joints are counted.
            along: index of the vanishing point to which the joints lead.
            up: (3,) unit vertical in the optical frame.

        Returns:
            None where no joints follow each other regularly.
        """
        joints = regular_joints(points, lines, towards, along, up, self.shortest, self.longest)
        return joints if joints is not None and len(joints.number) >= self.least_joints else None

    def _levelled(
        self,
        fused: VanishingPoints,
        points: VanishingPoints,
        lines: LineSegments,
        towards: int,
        along: int,
        up: Array,
    ) -> VanishingPoints:
        """Raise or lower the vanishing point `towards` to the horizon that the spacings tell."""
        direction, before = points.directions[towards], points.covariance[towards]
        upward = normalised(up - float(up @ direction) * direction)
        slope = tangent_basis(direction) @ upward
        expected = float(slope @ before @ slope)
        if expected < self.sure**2:
            return fused
        joints = self.joints(points, lines, towards, along, up)
        if joints is None:
            return fused
        try:
            fit = fit_spacings(joints.pixels, joints.number, joints.pixel_sigma)
        except CrossRatioError:
            return fused
        # All marks lie on one line by construction: only along it have they room to misfit.
        misfit = fit.misfit / (len(joints.number) - 3)
        if misfit > _MOST_MISFIT:
            return fused
        seen, covariance = fit.direction(points.camera)
        ahead = cross(joints.normal, direction)
        side = 1.0 if float(seen @ direction) >= 0.0 else -1.0
        innovation = float(np.arctan2(side * seen @ ahead, side * seen @ direction))
        own = tangent_basis(seen) @ cross(joints.normal, seen)
        variance = float(own @ covariance @ own) * _SHARED_ERROR * max(misfit, 1.0)
        # The line vanishes where it meets the horizon: how far along it that is says how high above or below the
        # horizon it was aimed, and nothing else.
        lift = float(ahead @ upward)
        innovation, variance = lift * innovation, lift**2 * variance
        # Errors of spacings stay the same from picture to picture: what tells less than the lines would not average
        # out, so it is left out, as is what contradicts them.
        if variance > expected or innovation**2 > _GATE * (expected + variance):
            return fused
        gain = before @ slope / (expected + variance)
        directions, covariances = fused.directions.copy(), fused.covariance.copy()
        directions[towards] = retract(direction, gain * innovation)
        covariances[towards] = before - np.outer(gain, slope @ before)
        if directions[towards, 2] < 0.0:
            # Of the tangents at the other end of the line of sight the first points the other way.
            directions[towards] *= -1.0
            covariances[towards] *= [[1.0, -1.0], [-1.0, 1.0]]
        return replace(fused, directions=directions, covariance=covariances)


def _ground(points: VanishingPoints) -> tuple[int, int, Array] | None:
    """The primary vanishing point, the one across, and the vertical (3,) of the ground that both span."""
    primary = points.of(Role.PRIMARY)
    across = None if primary is None else _square_to(points, primary)
    if primary is None or across is None:
        return None
    up = normalised(cross(points.directions[primary], points.directions[across]))
    return primary, across, up if float(up @ points.camera.optical_to_base[2]) > 0.0 else -up


def _square_to(points: VanishingPoints, primary: int) -> int | None:
    """The vanishing point that lies most squarely across the way; None when there is none."""
    level = np.flatnonzero(points.roles == Role.HORIZONTAL)
    if not len(level):
        return None
    off = np.pi / 2 - angle_between(points.directions[level], points.directions[primary])
    best = int(np.argmin(off))
    return int(level[best]) if off[best] < _SQUARE else None
