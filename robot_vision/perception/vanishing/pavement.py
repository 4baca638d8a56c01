# SPDX-License-Identifier: Apache-2.0
"""Flagstones tell where the ground vanishes: not only where their joints lead to, but how their spacings shrink.

Stones are laid at regular spacings, so on any line across the joints the cross ratio (20.4) gives the point in
which that line vanishes, and with it a point of the horizon. Joints that lead ahead are crossed on a line towards
the vanishing point across; joints that lie across are crossed on a line towards the primary one. Either vanishing
point is then moved along that line, as far as the two covariances say.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import CrossRatioError, fit_spacings
from robot_vision.geometry.sphere import angle_between, normalised, retract, tangent_basis
from robot_vision.perception.segments import LineSegments
from robot_vision.perception.spacings import RegularMarks, find_regular
from robot_vision.perception.vanishing.points import Role, VanishingPoints

Array = NDArray[np.float64]

#: Standard deviation of a joint's edge across it, px: of one segment, and of all segments of one edge together.
_SEGMENT_SIGMA = 0.3
_EDGE_SIGMA = 0.1
#: And of the middle between the two edges of a joint, px.
_JOINT_SIGMA = 0.2
#: Joints are looked for no less than this below the horizon (sine of the angle).
_SHALLOWEST = 0.08
#: Segments of one edge lie as near to each other as this, px.
_ONE_EDGE = 1.5
#: The vanishing point across lies within this of square to the way.
_SQUARE = np.deg2rad(15.0)
#: Misfit a degree of freedom beyond which stones are not regular.
_MOST_MISFIT = 4.0
#: Squared distance (1 degree of freedom) beyond which spacings and lines contradict each other: 3 sigma.
_GATE = 9.0


@dataclass(frozen=True)
class PavementSpacings:
    """Takes the regular spacings of a pavement as a further source of its vanishing points.

    Args:
        least_joints: edges of joints of one kind that must follow each other regularly.
        shortest, longest: spacings looked for, in heights of the camera.
    """

    least_joints: int = 4
    shortest: float = 0.15
    longest: float = 2.0

    def fuse(self, points: VanishingPoints, lines: LineSegments) -> VanishingPoints:
        """The same vanishing points, the primary one and the one across drawn to where the spacings lead.

        Args:
            points: with a label for each line.
            lines: the segments they were found in.
        """
        primary = points.of(Role.PRIMARY)
        across = None if primary is None else _square_to(points, primary)
        if primary is None or across is None:
            return points
        up = normalised(np.cross(points.directions[primary], points.directions[across]))
        if float(up @ points.camera.optical_to_base[2]) < 0.0:
            up = -up
        fused = points
        for towards, along in ((across, primary), (primary, across)):
            fused = self._drawn(fused, points, lines, towards, along, up)
        return fused

    def joints(
        self, points: VanishingPoints, lines: LineSegments, towards: int, along: int, up: Array
    ) -> tuple[RegularMarks, Array, Array] | None:
        """The joints that lead to one vanishing point, numbered on a line towards another.

        Returns:
            the numbered marks, their places on the ground (heights) and in the picture (N, 2); None if none are
            regular.
        """
        marks = _marks(points, lines, towards, along, up)
        if marks is None:
            return None
        places, pixels, sigma, kinds = marks
        spread = float(np.ptp(places))
        regular = find_regular(places, sigma, kinds, self.shortest, min(self.longest, spread / 2.5))
        if regular is None:
            return None
        most = max(len(np.unique(regular.number[kinds[regular.chosen] == kind])) for kind in (0, 1))
        return (regular, places, pixels) if most >= self.least_joints else None

    def _drawn(
        self,
        fused: VanishingPoints,
        points: VanishingPoints,
        lines: LineSegments,
        towards: int,
        along: int,
        up: Array,
    ) -> VanishingPoints:
        """Move the vanishing point `towards` along the line on which the joints were crossed."""
        found = self.joints(points, lines, towards, along, up)
        if found is None:
            return fused
        regular, _, pixels = found
        distances, middles = _middles(regular, pixels)
        if len(distances) < self.least_joints:
            return fused
        try:
            fit = fit_spacings(middles, distances, _JOINT_SIGMA)
        except CrossRatioError:
            return fused
        # All marks lie on one line by construction: only along it they have room to misfit.
        freedom = max(len(distances) - 3, 1)
        misfit = fit.misfit / freedom
        if misfit > _MOST_MISFIT:
            return fused
        seen, covariance = fit.direction(points.camera)
        direction = points.directions[towards]
        seen = seen if float(seen @ direction) >= 0.0 else -seen
        line = normalised(np.cross(points.camera.rays(pixels[regular.chosen[:1]])[0], direction))
        ahead = np.cross(line, direction)
        innovation = float(np.arctan2(seen @ ahead, seen @ direction))
        own = tangent_basis(seen if seen[2] >= 0.0 else -seen) @ np.cross(line, seen)
        variance = float(own @ covariance @ own) * max(misfit, 1.0)
        slope = tangent_basis(direction) @ ahead
        before = points.covariance[towards]
        expected = float(slope @ before @ slope)
        if innovation**2 > _GATE * (expected + variance):
            return fused
        gain = before @ slope / (expected + variance)
        directions, covariances = fused.directions.copy(), fused.covariance.copy()
        moved = retract(direction, gain * innovation)
        directions[towards] = moved if moved[2] >= 0.0 else -moved
        covariances[towards] = before - np.outer(gain, slope @ before)
        return replace(fused, directions=directions, covariance=covariances)


def _middles(regular: RegularMarks, pixels: Array) -> tuple[Array, Array]:
    """Number (K,) and place in the picture (K, 2) of the joints of which both edges are seen.

    Blur drives the edges of a narrow joint apart, the more so the farther away, but leaves their middle in place.
    """
    place = pixels[regular.chosen]
    numbers, index, count = np.unique(regular.number, return_inverse=True, return_counts=True)
    middles = np.column_stack([np.bincount(index, place[:, axis]) / count for axis in (0, 1)])
    return numbers[count == 2].astype(np.float64), middles[count == 2]


def _square_to(points: VanishingPoints, primary: int) -> int | None:
    """The vanishing point that lies most squarely across the way; None when there is none."""
    level = np.flatnonzero(points.roles == Role.HORIZONTAL)
    if not len(level):
        return None
    off = np.pi / 2 - angle_between(points.directions[level], points.directions[primary])
    best = int(np.argmin(off))
    return int(level[best]) if off[best] < _SQUARE else None


def _marks(
    points: VanishingPoints, lines: LineSegments, towards: int, along: int, up: Array
) -> tuple[Array, Array, Array, NDArray[np.intp]] | None:
    """Edges of joints that lead to the vanishing point `along`, crossed on a line towards `towards`.

    Returns:
        their places on that line (heights of the camera), in the picture (N, 2), the standard deviation of the
        places, and on which side they are bright; None where there are too few.
    """
    camera = points.camera
    mine = np.flatnonzero(points.labels == along)
    rays = camera.rays(lines.midpoints[mine])
    deep = -(rays @ up)
    mine, rays, deep = mine[deep > _SHALLOWEST], rays[deep > _SHALLOWEST], deep[deep > _SHALLOWEST]
    if len(mine) < 4:
        return None
    far, ahead = points.directions[towards], points.directions[along]
    # The line on the ground starts below the middle of the joints and leads to the vanishing point.
    weight = lines.lengths[mine]
    base = ahead * float(weight @ ((rays @ ahead) / deep) / weight.sum()) - up
    planes = np.cross(rays, ahead)
    steep = planes @ far
    usable = np.abs(steep) > 1e-6
    places = -(planes[usable] @ base) / steep[usable]
    at = base + places[:, None] * far
    usable_at = at[:, 2] > 1e-3
    places, at, mine = places[usable_at], at[usable_at], mine[usable][usable_at]
    if len(mine) < 4:
        return None
    pixels = camera.pixels(at)
    rate = np.linalg.norm(camera.pixels(at + 1e-4 * far) - pixels, axis=1) / 1e-4
    tangent = lines.endpoints[mine, 2:] - lines.endpoints[mine, :2]
    vanishing = camera.matrix @ ahead
    away = vanishing[:2] - vanishing[2] * lines.midpoints[mine]
    kinds = (np.sum(tangent * away, axis=1) > 0.0).astype(np.intp)
    return _edges(places, pixels, rate, kinds, lines.lengths[mine])


def _edges(
    places: Array, pixels: Array, rate: Array, kinds: NDArray[np.intp], weight: Array
) -> tuple[Array, Array, Array, NDArray[np.intp]]:
    """Put the segments of one edge together: one mark an edge, at their weighted mean."""
    order = np.lexsort((places, kinds))
    places, pixels, rate, kinds, weight = (
        places[order],
        pixels[order],
        rate[order],
        kinds[order],
        weight[order],
    )
    apart = (np.diff(places) * rate[1:] > _ONE_EDGE) | (np.diff(kinds) != 0)
    edge = np.concatenate([[0], np.cumsum(apart)])
    total = np.bincount(edge, weight)
    mean = [np.bincount(edge, weight * values) / total for values in (places, pixels[:, 0], pixels[:, 1], rate)]
    pixel_sigma = np.hypot(_SEGMENT_SIGMA / np.sqrt(np.bincount(edge)), _EDGE_SIGMA)
    first = np.concatenate([[0], np.flatnonzero(apart) + 1])
    return mean[0], np.column_stack(mean[1:3]), pixel_sigma / mean[3], kinds[first]
