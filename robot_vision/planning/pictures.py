# SPDX-License-Identifier: Apache-2.0
"""Mazes, distance functions and ways to look at: in letters as on paper, and in colours."""

from __future__ import annotations

from collections.abc import Sequence
from string import ascii_letters

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_vision.planning.grid import Cell, checked_grid
from robot_vision.planning.known_maze import KnownMaze
from robot_vision.planning.maze import Maze

Picture = NDArray[np.uint8]
GOAL_MARK, FAR_MARK = "X", "*"
_WALL, _PAPER, _NOWHERE = (40, 40, 40), (255, 255, 255), (225, 225, 225)
_WAY, _START, _GOAL = (30, 30, 220), (40, 140, 30), (30, 30, 220)
_BANDS = 24
"""Lines of equal distance in a picture."""


def steps_to_goal(maze: Maze) -> NDArray[np.int32]:
    """The distance function of a maze from cell to cell, int32 (R, C) steps to the nearest goal; -1 where no way leads.

    Walls that are unknown count as walls.
    """
    return KnownMaze.all_of(maze).steps_from(maze.goals)


def letters(maze: Maze, path: Sequence[Cell] = ()) -> str:
    """The maze as text with its distance function in letters: a is 1, z 26, A 27, Z 52, * more, X the goal.

    Args:
        maze: any.
        path: cells of a way; given, only they get a letter.
    """
    steps = steps_to_goal(maze)
    lines = maze.text().splitlines()
    rows, columns = maze.size
    for row in range(rows):
        line = list(lines[2 * (rows - row) - 1])
        for column in range(columns):
            if path and (row, column) not in path:
                continue
            line[4 * column + 2] = _letter(int(steps[row, column]))
        lines[2 * (rows - row) - 1] = "".join(line)
    return "\n".join(lines) + "\n"


def _letter(steps: int) -> str:
    if steps <= 0:
        return GOAL_MARK if steps == 0 else " "
    return ascii_letters[steps - 1] if steps <= len(ascii_letters) else FAR_MARK


def draw_maze(maze: Maze, path: ArrayLike = (), scale: int = 24, coloured: bool = True) -> Picture:
    """A picture of a maze with its distance function, uint8 (H, W, 3) BGR, north up.

    Args:
        maze: any; unknown walls are drawn thin.
        path: (M, 2) row, column of points on a way, cell middles at whole numbers; empty: none.
        scale: pixels of a cell.
        coloured: whether cells show their distance.
    """
    rows, columns = maze.size
    margin = max(2, scale // 8)
    steps = steps_to_goal(maze).astype(np.float64)
    field = np.where(steps < 0, np.inf, steps)
    shown = _colours(field) if coloured else np.full((rows, columns, 3), _PAPER, np.uint8)
    picture = _enlarged(shown[::-1], scale)
    framed = cv2.copyMakeBorder(picture, *(margin,) * 4, cv2.BORDER_CONSTANT, value=_PAPER)
    picture = np.asarray(framed, np.uint8)

    def at(row: float, column: float) -> tuple[int, int]:
        return round(margin + column * scale), round(margin + (rows - row) * scale)

    thick = max(2, scale // 10)
    for walls, unknown, down, right in (
        (maze.upright, np.pad(maze.unknown_east, ((0, 0), (1, 0))), 1, 0),
        (maze.across, np.pad(maze.unknown_north, ((1, 0), (0, 0))), 0, 1),
    ):
        for there, width in ((unknown, 1), (walls, thick)):
            for row, column in np.argwhere(there):
                cv2.line(picture, at(row, column), at(row + down, column + right), _WALL, width)
    _mark(picture, at(maze.start[0] + 0.5, maze.start[1] + 0.5), _START, scale // 5)
    for goal in maze.goals:
        _mark(picture, at(goal[0] + 0.5, goal[1] + 0.5), _GOAL, scale // 5)
    points = np.asarray(path, np.float64).reshape(-1, 2)
    _line(picture, [at(row + 0.5, column + 0.5) for row, column in points], thick)
    return picture


def draw_field(free: ArrayLike, field: ArrayLike, path: ArrayLike = (), scale: int = 4) -> Picture:
    """A picture of a distance function over a grid, uint8 (H, W, 3) BGR, row 0 at the top.

    Args:
        free: bool (R, C).
        field: float (R, C), inf where no way leads.
        path: (M, 2) row, column of a way; empty: none.
        scale: pixels of a cell.
    """
    grid = checked_grid(free)
    distances = np.asarray(field, np.float64)
    shown = _colours(distances)
    shown[~grid] = _WALL
    picture = _enlarged(shown, scale)
    points = np.asarray(path, np.float64).reshape(-1, 2)
    places = [(round((column + 0.5) * scale), round((row + 0.5) * scale)) for row, column in points]
    _line(picture, places, max(1, scale // 2))
    if places:
        _mark(picture, places[0], _START, scale + 2)
        _mark(picture, places[-1], _GOAL, scale + 2)
    return picture


def _colours(field: NDArray[np.float64]) -> Picture:
    """Near is light, far is dark, with lines of equal distance; nowhere is grey."""
    there = np.isfinite(field)
    most = float(field[there].max(initial=0.0)) or 1.0
    share = np.where(there, field, 0.0) / most
    level = np.asarray(255 * (1.0 - 0.85 * np.floor(share * _BANDS) / _BANDS), np.uint8)
    shown = np.asarray(cv2.applyColorMap(level, cv2.COLORMAP_VIRIDIS), np.uint8)
    shown[~there] = _NOWHERE
    return shown


def _enlarged(shown: Picture, scale: int) -> Picture:
    return np.repeat(np.repeat(shown, scale, axis=0), scale, axis=1)


def _line(picture: Picture, places: Sequence[tuple[int, int]], width: int) -> None:
    for begin, end in zip(places, places[1:], strict=False):
        cv2.line(picture, begin, end, _WAY, width, cv2.LINE_AA)


def _mark(picture: Picture, place: tuple[int, int], colour: tuple[int, int, int], radius: int) -> None:
    cv2.circle(picture, place, max(2, radius), colour, -1, cv2.LINE_AA)
