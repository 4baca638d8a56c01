# SPDX-License-Identifier: Apache-2.0
"""The joints of a pavement in one picture: which segments lie on them, which joint follows which, and where."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.geometry.sphere import cross, normalised
from robot_vision.perception.regular_marks import RegularMarks, find_regular
from robot_vision.perception.segments import LineSegments
from robot_vision.perception.vanishing.points import VanishingPoints

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
#: A row of marks is looked for that is so many periods long.
_PERIODS = 2.5


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


def regular_joints(
    points: VanishingPoints,
    lines: LineSegments,
    towards: int,
    along: int,
    up: Array,
    shortest: float,
    longest: float,
) -> Joints | None:
    """The joints that lead to the vanishing point `along`, on a line towards the one `towards`.

    Args:
        points: with a label for each line.
        lines: the segments they were found in.
        towards: index of the vanishing point of the line on which the joints are counted.
        along: index of the vanishing point to which the joints lead.
        up: (3,) unit vertical in the optical frame.
        shortest: spacing looked for, heights of the camera.
        longest: spacing looked for, heights of the camera.

    Returns:
        None where no joints follow each other regularly.
    """
    edges = _edges_on_the_ground(points, lines, towards, along, up)
    if edges is None:
        return None
    place, sigma, kind = _marks(edges)
    regular = find_regular(place, sigma, kind, shortest, min(longest, float(np.ptp(place)) / _PERIODS))
    return None if regular is None else _middles(edges, regular, points.camera)


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
