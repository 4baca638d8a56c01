# SPDX-License-Identifier: Apache-2.0
"""Things that stand on the floor: stretches of its end that belong to no line towards the vanishing point."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping.boundary import Boundary
from robot_vision.mapping.ground_view import GroundView


@dataclass(frozen=True)
class GroundObject:
    """A thing on the floor as one picture shows it.

    Attributes:
        left, right: first and last column of the working picture.
        x, y: middle of its foot, m in base_link.
        width: of its foot as seen from the camera, m.
        distance: of its foot from the camera, over the floor, m.
    """

    left: int
    right: int
    x: float
    y: float
    width: float
    distance: float


@dataclass(frozen=True)
class ObjectFinder:
    """Cuts the end of the floor where it jumps, and keeps the pieces that no border of the floor explains.

    Args:
        jump: change of distance from column to column at which another thing begins, as share of the distance.
        narrowest: fewest columns of a thing.
        widest: greatest width of a thing, m; what is wider bounds the floor.
        bordered: share of a piece along which a border runs that makes it part of that border.
    """

    jump: float = 0.06
    narrowest: int = 4
    widest: float = 1.5
    bordered: float = 0.6

    def find(self, boundary: Boundary, on_border: NDArray[np.bool_], view: GroundView) -> list[GroundObject]:
        """Find the things.

        Args:
            boundary: of the floor.
            on_border: (W,) columns in which a line towards the vanishing point is the end of the floor.
            view: of the ground in the working picture.
        """
        distance = boundary.distance
        cut = np.abs(np.diff(distance)) > self.jump * np.minimum(distance[1:], distance[:-1])
        cut |= boundary.ended[1:] != boundary.ended[:-1]
        edges = np.concatenate([[0], np.flatnonzero(cut) + 1, [len(distance)]])
        found = []
        for left, after in zip(edges[:-1], edges[1:], strict=True):
            right = int(after) - 1
            if after - left < self.narrowest or not boundary.ended[left]:
                continue
            x, y = boundary.x[left:after], boundary.y[left:after]
            width = math.hypot(x[-1] - x[0], y[-1] - y[0])
            if width > self.widest or on_border[left:after].mean() > self.bordered:
                continue
            found.append(
                GroundObject(int(left), right, _median(x), _median(y), width, _median(distance[left:after]))
            )
        return found


def _median(values: NDArray[np.float64]) -> float:
    """Median of a few numbers (N,); that of numpy looks for nan first, which takes longer than all else."""
    ordered = np.sort(values)
    return float(0.5 * (ordered[(len(values) - 1) // 2] + ordered[len(values) // 2]))
