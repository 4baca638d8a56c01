# SPDX-License-Identifier: Apache-2.0
"""How far the floor goes on without a gap along the way ahead, read in one picture: no map and no odometry needed.

What has left the picture, because the robot has come too near, is remembered where there is a map.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robot_vision.mapping.boundary import Boundary
from robot_vision.mapping.ground_view import GroundView
from robot_vision.mapping.occupancy import OccupancyMap
from robot_vision.mapping.pose import Pose
from robot_vision.perception import Role, VanishingPoints

_HIDDEN_M = 3.0
"""How far ahead of the front the map is asked."""


@dataclass(frozen=True)
class Clearance:
    """Measures the strip of floor that the robot is about to cover.

    Args:
        width: of the strip, m: the robot's and some more.
        front: how far the robot's front lies ahead of base_link, m; the clearance begins there.
        fewest: columns of the picture that must have something in the way: fewer are noise.
        fewest_cells: of the map, in place of columns.
    """

    width: float = 0.6
    front: float = 0.3
    fewest: int = 3
    fewest_cells: int = 2

    def __post_init__(self) -> None:
        if not (np.isfinite(self.width) and self.width > 0.0):
            raise ValueError(f"width must be a positive number of metres, not {self.width}")
        if not np.isfinite(self.front):
            raise ValueError(f"front must be a number of metres, not {self.front}")

    def measure(
        self, boundary: Boundary, points: VanishingPoints | None, view: GroundView, reach: float
    ) -> float:
        """Free floor ahead of the robot's front along the primary direction, m.

        Args:
            boundary: of the floor.
            points: vanishing points; without a primary one the way ahead is the robot's own.
            view: of the ground in the working picture.
            reach: how far the picture can be trusted, m from the camera.

        Returns:
            0 when the floor begins nowhere in the strip, inf when nothing is in the way as far as `reach`.
        """
        toward = self._azimuth(points, view)
        along = np.cos(toward) * boundary.x + np.sin(toward) * boundary.y
        across = np.cos(toward) * boundary.y - np.sin(toward) * boundary.x
        inside = (np.abs(across) < self.width / 2) & (along > 0.0) & np.isfinite(along)
        if inside.sum() < self.fewest:
            # A thing so near that the strip leaves the picture beside it.
            return 0.0
        blocked = inside & boundary.ended & (boundary.distance < reach)
        if blocked.sum() < self.fewest:
            return float("inf")
        nearest = float(np.sort(along[blocked])[self.fewest - 1])
        bottom = float(view.ground(np.array([view.shape[1] / 2.0]), np.array([view.shape[0] - 4.0]))[0][0])
        if nearest <= bottom:
            # The picture begins with it: what is nearer than the picture shows is not known to be free.
            return 0.0
        return max(nearest - self.front, 0.0)

    def remembered(
        self, known: OccupancyMap, pose: Pose, points: VanishingPoints | None, view: GroundView
    ) -> float:
        """Way to what the map has in the strip and this picture does not show, m from the robot's front.

        A thing at the rim of the strip leaves the picture before the robot has passed it.

        Args:
            known: the map.
            pose: of base_link in it.
            points: vanishing points; without a primary one the way ahead is the robot's own.
            view: of the ground in the working picture.

        Returns:
            inf when nothing is there.
        """
        toward = self._azimuth(points, view)
        half, step = self.width / 2, known.resolution / 2
        along, across = np.meshgrid(
            np.arange(self.front, self.front + _HIDDEN_M, step),
            np.linspace(-half, half, math.ceil(self.width / step) + 1),
        )
        x = np.cos(toward) * along - np.sin(toward) * across
        y = np.sin(toward) * along + np.cos(toward) * across
        rows, columns = view.shape
        with np.errstate(invalid="ignore"):
            u, v = view.pixels(x, y)
            shown = (u > -0.5) & (u < columns - 0.5) & (v < rows - 0.5)
        here = pose.matrix @ np.stack([x[~shown], y[~shown], np.ones(int((~shown).sum()))])
        taken = known.odds(here[0], here[1]) > known.known
        cells = np.floor(here[:2, taken] / known.resolution)
        if len(np.unique(cells, axis=1).T) < self.fewest_cells:
            return float("inf")
        return max(float(along[~shown][taken].min()) - self.front, 0.0)

    @staticmethod
    def _azimuth(points: VanishingPoints | None, view: GroundView) -> float:
        """Direction of the way ahead in base_link, rad, counter-clockwise."""
        primary = None if points is None else points.of(Role.PRIMARY)
        if points is None or primary is None:
            return 0.0
        ahead = view.camera.optical_to_base @ points.directions[primary]
        return float(np.arctan2(ahead[1], ahead[0]))
