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

from robot_vision.geometry import Camera, CrossRatioError, fit_spacings
from robot_vision.geometry.sphere import angle_between, cross, normalised, retract, tangent_basis
from robot_vision.perception.segments import LineSegments
from robot_vision.perception.spacings import RegularMarks, find_regular
from robot_vision.perception.vanishing.points import Role, VanishingPoints

Array = NDArray[np.float64]

#: Standard deviation of a joint's edge across it, px: of one segment, and of all segments of one edge together.
_SEGMENT_SIGMA = 0.3
_EDGE_SIGMA = 0.1
#: Joints are looked for no less than this below the horizon (sine of the angle).
_SHALLOWEST = 0.08
#: Segments of one edge lie as near to each other as this, px.
_ONE_EDGE = 1.5
#: Farther off an edge than this share of the spacing, a segment is not of it.
_OFF = 0.06
_FEWEST = 4
#: The vanishing point across lies within this of square to the way.
_SQUARE = np.deg2rad(15.0)
#: Misfit a degree of freedom beyond which stones are not regular.
_MOST_MISFIT = 2.0
#: Joints share errors of light and lens: factor on the variance, from simulated paths.
_SHARED_ERROR = 1.7
#: Squared distance (1 degree of freedom) beyond which spacings and lines contradict each other: 3 sigma.
_GATE = 9.0


@dataclass(frozen=True)
class _Edges:
    """Segments (N) on edges of joints, as they cross a line on the ground towards a vanishing point.

    Attributes:
        base, far: (3,) the line in the optical frame, in heights of the camera: base + place far.
        place: (N,) where the edges cross it, heights.
        scale: (N,) how far a segment moves across itself in the picture when its joint moves along the line,
            px a height.
        kind: (N,) 0 or 1, on which side it is bright.
        length: (N,) px.
    """

    base: Array
    far: Array
    place: Array
    scale: Array
    kind: NDArray[np.intp]
    length: Array


@dataclass(frozen=True)
class Joints:
    """Joints of a pavement that follow each other regularly along a line on the ground.

    Attributes:
        number: (K,) of each along the line, from 0.
        place: (K,) of their middles along the line, heights of the camera.
        sigma: (K,) standard deviations of the places.
        pixels: (K, 2) where they cross the line in the picture.
        pixel_sigma: (K,) standard deviations along the line there, px.
        normal: (3,) unit normal of the plane through the camera in which the line lies.
    """

    number: NDArray[np.intp]
    place: Array
    sigma: Array
    pixels: Array
    pixel_sigma: Array
    normal: Array

    @property
    def spacing(self) -> float:
        """From one joint to the next, heights of the camera, by weighted least squares."""
        weight = 1.0 / self.sigma**2
        number = self.number - weight @ self.number / weight.sum()
        return float((weight * number) @ self.place / ((weight * number) @ number))


@dataclass(frozen=True)
class PavementSpacings:
    """Takes the regular spacings of a pavement as a further source of its vanishing points.

    Args:
        least_joints: edges of joints of one kind that must follow each other regularly.
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
        edges = _edges_on_the_ground(points, lines, towards, along, up)
        if edges is None:
            return None
        place, sigma, kind = _marks(edges)
        regular = find_regular(
            place, sigma, kind, self.shortest, min(self.longest, float(np.ptp(place)) / 2.5)
        )
        if regular is None:
            return None
        joints = _middles(edges, regular, points.camera)
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


def _edges_on_the_ground(
    points: VanishingPoints, lines: LineSegments, towards: int, along: int, up: Array
) -> _Edges | None:
    """Segments on the ground that lead to `along`, crossed on a line towards `towards`; None when too few."""
    camera = points.camera
    mine = np.flatnonzero(points.labels == along)
    rays = camera.rays(lines.midpoints[mine])
    deep = -(rays @ up)
    far, ahead = points.directions[towards], points.directions[along]
    planes = cross(rays, ahead)
    steep = planes @ far
    usable = (deep > _SHALLOWEST) & (np.abs(steep) > 1e-6)
    mine, rays, deep, planes, steep = mine[usable], rays[usable], deep[usable], planes[usable], steep[usable]
    if len(mine) < _FEWEST:
        return None
    length = lines.lengths[mine]
    # The line on the ground starts below the middle of the joints and leads to the vanishing point.
    base = ahead * float(length @ ((rays @ ahead) / deep) / length.sum()) - up
    place = -(planes @ base) / steep
    tangent = (lines.endpoints[mine, 2:] - lines.endpoints[mine, :2]) / length[:, None]
    foot = rays / deep[:, None]
    # Seen from the midpoint of a segment the picture of the ground moves by this, px a height along the line.
    by_place = (far[:2] - foot[:, :2] / foot[:, 2:] * far[2]) / foot[:, 2:] * (camera.fx, camera.fy)
    scale = np.abs(by_place[:, 0] * tangent[:, 1] - by_place[:, 1] * tangent[:, 0])
    vanishing = camera.matrix @ ahead
    away = vanishing[:2] - vanishing[2] * lines.midpoints[mine]
    kind = (np.sum(tangent * away, axis=1) > 0.0).astype(np.intp)
    return _Edges(base, far, place, np.maximum(scale, 1e-6), kind, length)


def _marks(edges: _Edges) -> tuple[Array, Array, NDArray[np.intp]]:
    """Put the segments of one edge together: place, standard deviation and kind, one an edge."""
    order = np.lexsort((edges.place, edges.kind))
    place, scale, kind, length = (
        edges.place[order],
        edges.scale[order],
        edges.kind[order],
        edges.length[order],
    )
    apart = (np.diff(place) * np.maximum(scale[1:], scale[:-1]) > _ONE_EDGE) | (np.diff(kind) != 0)
    edge = np.concatenate([[0], np.cumsum(apart)])
    weight = length * scale**2
    total = np.bincount(edge, weight)
    nearest = np.sqrt(total / np.bincount(edge, length))
    sigma = np.hypot(_SEGMENT_SIGMA / np.sqrt(np.bincount(edge)), _EDGE_SIGMA) / nearest
    first = np.concatenate([[0], np.flatnonzero(apart) + 1])
    return np.bincount(edge, weight * place) / total, sigma, kind[first]


def _middles(edges: _Edges, regular: RegularMarks, camera: Camera) -> Joints | None:
    """The middles of numbered joints, from all segments on either of their edges.

    Blur drives the edges of a narrow joint apart by as much in the picture wherever it is seen: its middle, the width
    of all joints and that push are found together, place = middle +- (width / 2 + push / scale).
    """
    number = np.rint((edges.place - regular.start[edges.kind]) / regular.period).astype(np.intp)
    off = edges.place - regular.start[edges.kind] - number * regular.period
    row = (np.abs(off) < _OFF * regular.period) & np.isin(number, regular.number)
    place, scale, number = edges.place[row], edges.scale[row], number[row]
    side = np.where(edges.kind[row] == 0, -1.0, 1.0)
    numbers, index = np.unique(number, return_inverse=True)
    if len(numbers) < 3 or len(np.unique(side)) < 2:
        return None
    design = np.zeros((len(place), len(numbers) + 2))
    design[np.arange(len(place)), index] = 1.0
    design[:, -2], design[:, -1] = side, side / scale
    sigma = np.hypot(_SEGMENT_SIGMA, _EDGE_SIGMA) / scale
    prior = np.diag([*np.zeros(len(numbers)), 1.0 / regular.period**2, 1.0])
    weight = 1.0 / sigma**2
    for _ in range(4):
        weighted = design * weight[:, None]
        covariance = np.linalg.inv(weighted.T @ design + prior)
        solved = covariance @ (weighted.T @ place)
        away = np.abs(place - design @ solved) / sigma
        weight = 1.0 / sigma**2 / (1.0 + (away / 2.0) ** 2)
    middle = solved[: len(numbers)]
    spread = np.sqrt(np.diag(covariance)[: len(numbers)])
    at = edges.base + middle[:, None] * edges.far
    pixels = camera.pixels(at)
    rate = np.linalg.norm(camera.pixels(at + 1e-4 * edges.far) - pixels, axis=1) / 1e-4
    return Joints(
        numbers - numbers.min(),
        middle,
        spread,
        pixels,
        spread * rate,
        normalised(cross(edges.base, edges.far)),
    )
