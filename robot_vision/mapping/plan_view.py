# SPDX-License-Identifier: Apache-2.0
"""The plan of the floor that one picture gives: (X, Z) of all that is seen, and nothing of what is not (20.2, 20.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping.boundary import Boundary
from robot_vision.mapping.ground_view import GroundView

Array = NDArray[np.float64]
Cells = NDArray[np.int8]

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
DOUBTFUL = 50
"""The floor ends about there, but at which of these cells the ray is too flat to tell: only a map can."""
_FLATTEST = 0.01
"""Least sine of the angle between ray and end of the floor that is reckoned with."""


@dataclass(frozen=True)
class PlanView:
    """Cells of the floor before the robot.

    Attributes:
        cells: (rows, columns) int8, 0 free, 100 occupied, -1 unknown, as nav_msgs/OccupancyGrid has them: row 0 at
            the smallest y, column 0 at the smallest x.
        resolution: side of a cell, m.
        origin: (x, y) of the corner of cell (0, 0), m in base_link.
    """

    cells: Cells
    resolution: float
    origin: tuple[float, float]


@dataclass(frozen=True)
class Seen:
    """What one picture says of points of the floor.

    Args:
        boundary: of the floor.
        view: of the ground in the working picture.
        reach: beyond which nothing is said, m from the camera.
        thickness: of the part behind the end of the floor that is taken for the thing that stands there, m.
        margin: before the end of the floor within which nothing is said, m: an edge is seen to about as much.
        inside: behind the end of the floor up to which nothing is taken, m across it: half a cell, all of which must
            lie behind it.
    """

    boundary: Boundary
    view: GroundView
    reach: float
    thickness: float = 0.15
    margin: float = 0.01
    inside: float = 0.025

    def at(self, x: NDArray[np.floating], y: NDArray[np.floating]) -> Cells:
        """FREE, OCCUPIED, DOUBTFUL or UNKNOWN for points x, y (m) in base_link, in the shape they make together."""
        u, v = self.view.pixels(x, y)
        rows, columns = self.view.shape
        inside = (u > -0.5) & (u < columns - 0.5) & (v < rows - 0.5)
        x, y = np.broadcast_arrays(x, y)
        column = np.round(u[inside]).astype(np.intp)
        away = np.hypot(x[inside] - self.view.camera.x_m, y[inside])
        # At the end of the floor distances grow too fast with the row for a whole one to do.
        behind = away - self.boundary.distance[column]
        ended = self.boundary.ended[column]
        # `inside` is measured across the end; along the ray, which meets it at an angle, it is longer.
        slant = 1.0 / np.maximum(self.boundary.facing, _FLATTEST)[column]
        within = away < self.reach
        free = within & (behind < np.where(ended, -self.margin, 0.0))
        there = within & ended & (behind >= self.inside) & (behind < self.thickness)
        told = np.full(len(column), UNKNOWN, np.int8)
        told[free] = FREE
        told[there] = np.where(behind >= self.inside * slant, OCCUPIED, DOUBTFUL)[there]
        cells = np.full(inside.shape, UNKNOWN, np.int8)
        cells[inside] = told
        return cells


@dataclass(frozen=True)
class PlanViewMaker:
    """Draws the plan of one picture.

    Args:
        resolution: side of a cell, m.
        length: of the plan ahead of base_link, m.
        half_width: to either side, m.
    """

    resolution: float = 0.05
    length: float = 8.0
    half_width: float = 4.0

    def __post_init__(self) -> None:
        """Lay out the cells once.

        Raises:
            ValueError: naming the setting that is not a positive number.
        """
        for name in ("resolution", "length", "half_width"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a positive number, not {value}")
        middles = (np.arange(round(self.length / self.resolution)) + 0.5) * self.resolution
        sides = (np.arange(round(2 * self.half_width / self.resolution)) + 0.5) * self.resolution
        object.__setattr__(self, "_x", middles)
        object.__setattr__(self, "_y", (sides - self.half_width)[:, None])

    def draw(self, seen: Seen | None) -> PlanView:
        """The plan of what was seen; all unknown when nothing was."""
        x, y = self.__dict__["_x"], self.__dict__["_y"]
        shape = len(y), len(x)
        cells = np.full(shape, UNKNOWN, np.int8) if seen is None else seen.at(x, y)
        cells[cells == DOUBTFUL] = OCCUPIED
        return PlanView(cells, self.resolution, (0.0, -self.half_width))
