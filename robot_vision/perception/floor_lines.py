# SPDX-License-Identifier: Apache-2.0
"""What the lines of one picture say about the floor: how far to the side those that lead ahead run on it, by (20.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.geometry.sphere import normalised, tangent_basis
from robot_vision.perception.attitude import Attitude
from robot_vision.perception.segments import LineSegments
from robot_vision.perception.vanishing import Role, VanishingPoints

Array = NDArray[np.float64]

#: Lines less far below the horizon than this (sine of the angle) say little of the floor near the robot.
_SHALLOWEST = 0.05
#: How well a line is placed in the picture across its direction, px.
_LINE_SIGMA = 0.3
#: Shortest foot worth the name, as share of the height of the picture.
_LEAST_FOOT = 0.12
#: Points along a line on the floor at which it is looked whether the picture shows it.
_STATIONS = 40


@dataclass(frozen=True)
class FloorEvidence:
    """What the lines of a picture say about the floor, read as lateral distances on it.

    Attributes:
        lateral, sigma, weight: (N,) place (m), standard deviation (m) and length (px) of the lines towards the
            primary vanishing point, below the horizon.
        shown: (N,) length that a foot at that place shows in the picture from end to end, px.
        least: shortest foot worth the name, px.
        height: of the camera above the floor, m.
        bottoms, bottom_weight: (K,) place (m) of the lower ends of upright lines, and their lengths (px).
    """

    lateral: Array
    sigma: Array
    weight: Array
    shown: Array
    least: float
    height: float
    bottoms: Array
    bottom_weight: Array


def floor_evidence(
    lines: LineSegments, points: VanishingPoints, attitude: Attitude, primary: int
) -> FloorEvidence:
    """Read the lines of a picture on the floor.

    Args:
        lines: of the picture, with `points.labels` for each.
        points: vanishing points; `points.camera.height_m` must be known.
        attitude: of the camera.
        primary: index of the primary vanishing point.
    """
    camera = points.camera
    assert camera.height_m is not None
    direction = points.directions[primary]
    # Measured from the vanishing point itself: where the lean was judged with a doubtful focal length, the horizon
    # still passes through it.
    up = normalised(attitude.up - float(attitude.up @ direction) * direction)
    left = np.cross(up, direction)
    mine = points.labels == primary
    side, depth, seen = _lateral_and_depth(camera.rays(lines.midpoints[mine]), left, up)
    # A line misplaced across its direction by an angle e moves by e H (side^2 + depth^2)^(1/2) / depth^2 on the floor,
    # and a lean of the camera about the way ahead turns the whole floor under the line.
    placed = _LINE_SIGMA / camera.fx * camera.height_m * np.hypot(side, depth) / depth**2
    lean_axis = tangent_basis(up) @ left
    lean = float(np.sqrt(lean_axis @ attitude.up_covariance @ lean_axis))
    leaning = lean * camera.height_m * (1.0 + (side / depth) ** 2)
    lateral = camera.height_m * side / depth
    vertical = points.of(Role.VERTICAL)
    upright = points.labels == vertical if vertical is not None else np.zeros(len(lines), bool)
    ends = lines.endpoints[upright]
    lower = np.where((ends[:, 1] > ends[:, 3])[:, None], ends[:, :2], ends[:, 2:])
    bottom_side, bottom_depth, ending = _lateral_and_depth(camera.rays(lower), left, up)
    return FloorEvidence(
        lateral=lateral,
        sigma=np.hypot(placed, leaning),
        weight=lines.lengths[mine][seen],
        shown=_shown(camera, direction, left, up, lateral),
        least=_LEAST_FOOT * camera.height,
        height=camera.height_m,
        bottoms=camera.height_m * bottom_side / bottom_depth,
        bottom_weight=lines.lengths[upright][ending],
    )


def _shown(camera: Camera, direction: Array, left: Array, up: Array, lateral: Array) -> Array:
    """Length in the picture of lines on the floor towards `direction`, (N,) px, as far away as lines are used."""
    assert camera.height_m is not None
    ahead = direction if direction[2] >= 0.0 else -direction
    along = camera.height_m * np.geomspace(0.2, 1.0 / _SHALLOWEST, _STATIONS)
    points = lateral[:, None, None] * left - camera.height_m * up + along[:, None] * ahead
    depth = np.maximum(points[..., 2], 1e-6)
    u = camera.cx + camera.fx * points[..., 0] / depth
    v = camera.cy + camera.fy * points[..., 1] / depth
    inside = (points[..., 2] > 1e-6) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    steps = np.hypot(np.diff(u), np.diff(v))
    return np.asarray(np.where(inside[:, 1:] & inside[:, :-1], steps, 0.0).sum(axis=1))


def _lateral_and_depth(rays: Array, left: Array, up: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Components of rays to the left and down, of those that point clearly below the horizon, and which those are."""
    depth = -(rays @ up)
    below = depth > _SHALLOWEST
    return (rays @ left)[below], depth[below], below
