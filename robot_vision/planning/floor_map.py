# SPDX-License-Identifier: Apache-2.0
"""A plan of the floor as it is known: free, occupied or not seen yet, and where in the world its cells lie."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_vision.planning.grid import Cell, PlanningError, checked_positive
from robot_vision.planning.maze_grid import OCCUPIED_FROM


@dataclass(frozen=True, eq=False)
class FloorMap:
    """An occupancy grid.

    Attributes:
        cells: int8 (R, C): 0 free to 100 occupied, -1 not known; row 0 lies at the origin.
        resolution: side of a cell, metres.
        origin: x, y (m) and yaw (rad) of the outer corner of cell (0, 0) in the frame of the map; columns run along
            the turned x axis, rows along the turned y axis.

    Raises:
        PlanningError: no cells, a value that is neither -1 nor 0 to 100, or numbers that make no sense; says where.
    """

    cells: NDArray[np.int8]
    resolution: float
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        cells = np.asarray(self.cells)
        if cells.ndim != 2 or 0 in cells.shape:
            raise PlanningError(f"map: it has no cells (its shape is {cells.shape})")
        checked_positive(self.resolution, "map: resolution")
        if not np.isfinite(self.origin).all():
            raise PlanningError(f"map: its origin {self.origin} is no place")
        if cells.min() < -1 or cells.max() > 100:
            row, column = (int(part) for part in np.argwhere((cells < -1) | (cells > 100))[0])
            raise PlanningError(
                f"map: cell ({row}, {column}) is {cells[row, column]}, neither -1 nor 0 to 100"
            )
        object.__setattr__(self, "cells", np.asarray(cells, np.int8))

    @property
    def unknown(self) -> NDArray[np.bool_]:
        """Cells nobody has seen, bool (R, C)."""
        return np.asarray(self.cells < 0)

    @property
    def occupied(self) -> NDArray[np.bool_]:
        """Cells that are probably occupied, bool (R, C)."""
        return np.asarray(self.cells >= OCCUPIED_FROM)

    def cell_at(self, x: float, y: float, what: str = "place") -> Cell:
        """The cell of a place in the world (m); `what` is what errors call it.

        Raises:
            PlanningError: it lies outside.
        """
        row, column = (int(part) for part in np.floor(self.to_cells([[x, y]])[0] + 0.5))
        if not (0 <= row < self.cells.shape[0] and 0 <= column < self.cells.shape[1]):
            raise PlanningError(f"{what} ({x:.2f}, {y:.2f}) m lies outside the map")
        return row, column

    def to_cells(self, places: ArrayLike) -> NDArray[np.float64]:
        """Places in the world (M, 2) x, y in metres as (M, 2) row, column; cell centres at whole numbers."""
        away = np.asarray(places, np.float64).reshape(-1, 2) - self.origin[:2]
        cos, sin = np.cos(self.origin[2]), np.sin(self.origin[2])
        along = np.column_stack([cos * away[:, 1] - sin * away[:, 0], cos * away[:, 0] + sin * away[:, 1]])
        return np.asarray(along / self.resolution - 0.5)

    def to_world(self, points: ArrayLike) -> NDArray[np.float64]:
        """The reverse of `to_cells`."""
        rows, columns = (self.resolution * (np.asarray(points, np.float64).reshape(-1, 2) + 0.5)).T
        cos, sin = np.cos(self.origin[2]), np.sin(self.origin[2])
        turned = np.column_stack([cos * columns - sin * rows, sin * columns + cos * rows])
        return np.asarray(turned + self.origin[:2])

    def is_laid_out_as(self, other: FloorMap) -> bool:
        """Whether the cells of both are the same places."""
        same = self.cells.shape == other.cells.shape and self.resolution == other.resolution
        return same and self.origin == other.origin
