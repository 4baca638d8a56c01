# SPDX-License-Identifier: Apache-2.0
"""Mazes as occupancy grids, and occupancy grids of mazes read back: 0 free, 100 wall, -1 not known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_vision.planning.grid import Cell
from robot_vision.planning.maze import Maze, MazeError

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
OCCUPIED_FROM = 50
"""A grid cell counts as a wall from this probability on, percent."""


def maze_to_grid(maze: Maze, pitch: int = 8, wall: int = 1) -> NDArray[np.int8]:
    """A maze as an occupancy grid, int8 (R * pitch + wall, C * pitch + wall); row 0 in the south, as in ROS.

    Args:
        maze: any.
        pitch: grid cells from one wall to the next, wall included.
        wall: grid cells of a wall's thickness.

    Raises:
        MazeError: the walls leave no room between them.
    """
    _check(pitch, wall)
    rows, columns = maze.size
    grid = np.zeros((rows * pitch + wall, columns * pitch + wall), np.int8)
    upright_unknown = np.pad(maze.unknown_east, ((0, 0), (1, 0)))
    across_unknown = np.pad(maze.unknown_north, ((1, 0), (0, 0)))
    for walls, unknown, transposed in (
        (maze.upright, upright_unknown, False),
        (maze.across.T, across_unknown.T, True),
    ):
        view = grid.T if transposed else grid
        for value, there in ((UNKNOWN, unknown), (OCCUPIED, walls)):
            for row, column in np.argwhere(there):
                strip = slice(row * pitch, (row + 1) * pitch + wall)
                if value == UNKNOWN:
                    strip = slice(row * pitch + wall, (row + 1) * pitch)
                view[strip, column * pitch : column * pitch + wall] = value
    for row in range(rows + 1):  # posts stand where walls may meet
        for column in range(columns + 1):
            grid[row * pitch : row * pitch + wall, column * pitch : column * pitch + wall] = OCCUPIED
    return grid


def maze_from_grid(grid: ArrayLike, pitch: int, wall: int, start: Cell, goals: Sequence[Cell]) -> Maze:
    """A maze from an occupancy grid as `maze_to_grid` makes it; each wall is what most of its strip is.

    Args:
        grid: int (R * pitch + wall, C * pitch + wall): 0 to 100, or -1 where not known.
        pitch: grid cells from one wall to the next.
        wall: grid cells of a wall's thickness.
        start: cell of the maze where a run begins.
        goals: cells that end it.

    Raises:
        MazeError: the grid holds no whole number of cells, the outer wall has a gap, start or goals lie outside.
    """
    _check(pitch, wall)
    values = np.asarray(grid)
    if values.ndim != 2 or any(size < pitch + wall or (size - wall) % pitch for size in values.shape):
        raise MazeError(
            f"maze: a grid of shape {values.shape} is no whole number of cells, {pitch} each and {wall} more"
        )
    upright = _strips(values, pitch, wall)
    across = _strips(values.T, pitch, wall).T
    outer = (upright[:, 0], upright[:, -1], across[0], across[-1])
    for side, walls in zip(("west", "east", "south", "north"), outer, strict=True):
        if not (walls == OCCUPIED).all():
            place = int(np.argmax(walls != OCCUPIED))
            raise MazeError(f"maze: the outer wall in the {side} has a gap at cell {place}")
    return Maze(
        upright[:, 1:] == OCCUPIED,
        across[1:] == OCCUPIED,
        start,
        tuple(goals),
        upright[:, 1:] == UNKNOWN,
        across[1:] == UNKNOWN,
    )


def _strips(values: NDArray[np.integer[Any]], pitch: int, wall: int) -> NDArray[np.int8]:
    """What most of each upright strip between two posts is, (R, C + 1)."""
    rows, columns = ((size - wall) // pitch for size in values.shape)
    found = np.zeros((rows, columns + 1), np.int8)
    for row in range(rows):
        for column in range(columns + 1):
            strip = values[row * pitch + wall : (row + 1) * pitch, column * pitch : column * pitch + wall]
            shares = np.mean(strip >= OCCUPIED_FROM), np.mean(strip < 0)
            found[row, column] = OCCUPIED if shares[0] >= 0.5 else UNKNOWN if shares[1] >= 0.5 else FREE
    return found


def _check(pitch: int, wall: int) -> None:
    if not 1 <= wall < pitch:
        raise MazeError(f"maze: walls of {wall} grid cells every {pitch} leave no room between them")
