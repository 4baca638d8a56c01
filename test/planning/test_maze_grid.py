# SPDX-License-Identifier: Apache-2.0
"""Mazes become occupancy grids, letters and pictures, and come back from grids as they were."""

from __future__ import annotations

import numpy as np
import pytest

from robot_vision.planning import Maze, MazeError, MazeExplorer, maze_from_grid, maze_to_grid
from robot_vision.planning.pictures import draw_field, draw_maze, letters, steps_to_goal
from robot_vision.simulation.maze import grown

SMALL = """\
+---+---+
| S   G |
+   +---+
|       |
+---+---+
"""


@pytest.mark.parametrize(("pitch", "wall"), [(8, 1), (12, 3), (2, 1)])
@pytest.mark.parametrize("seed", range(3))
def test_a_maze_comes_back_from_its_grid_unseen_walls_included(pitch: int, wall: int, seed: int) -> None:
    maze = MazeExplorer(grown(7, 9, 0.1, seed)).explore().seen
    grid = maze_to_grid(maze, pitch, wall)
    assert grid.shape == (7 * pitch + wall, 9 * pitch + wall)
    assert maze_from_grid(grid, pitch, wall, maze.start, maze.goals) == maze


def test_walls_with_holes_are_what_most_of_them_is() -> None:
    maze = Maze.parse(SMALL)
    grid = maze_to_grid(maze, 10, 1)
    walls = np.argwhere(grid == 100)
    holes = np.random.default_rng(0).random(len(walls)) < 0.2
    grid[tuple(walls[holes].T)] = 0
    assert maze_from_grid(grid, 10, 1, maze.start, maze.goals) == maze


def test_grids_that_are_no_mazes_are_refused() -> None:
    maze = Maze.parse(SMALL)
    grid = maze_to_grid(maze, 8, 1)
    with pytest.raises(MazeError, match=r"shape \(16, 17\) is no whole number of cells"):
        maze_from_grid(grid[1:], 8, 1, maze.start, maze.goals)
    with pytest.raises(MazeError, match="leave no room"):
        maze_to_grid(maze, 2, 2)
    open_grid = grid.copy()
    open_grid[9:16, -1] = 0
    with pytest.raises(MazeError, match="outer wall in the east has a gap at cell 1"):
        maze_from_grid(open_grid, 8, 1, maze.start, maze.goals)


def test_the_distance_function_in_letters() -> None:
    maze = Maze.parse(SMALL)
    assert steps_to_goal(maze).tolist() == [[2, 3], [1, 0]]
    assert letters(maze) == "+---+---+\n| a   X |\n+   +---+\n| b   c |\n+---+---+\n"
    path = MazeExplorer(maze).explore().shortest_path
    assert letters(maze, path) == "+---+---+\n| a   X |\n+   +---+\n|       |\n+---+---+\n"


def test_pictures_show_walls_field_and_way() -> None:
    maze = Maze.parse(SMALL)
    plain, with_way = draw_maze(maze, scale=20), draw_maze(maze, [(1, 0), (1, 1)], scale=20)
    assert plain.shape == with_way.shape == (44, 44, 3)
    red = (with_way == (30, 30, 220)).all(axis=2) & ~(plain == (30, 30, 220)).all(axis=2)
    rows, columns = np.nonzero(red)
    assert abs(rows.mean() - 12) < 3  # the upper row of cells
    assert columns.min() < 20 < columns.max()
    free = np.ones((10, 12), bool)
    free[4] = False
    field = np.where(free, np.arange(12.0), np.inf)
    picture = draw_field(free, field, [(0, 0), (0, 11)], scale=3)
    assert picture.shape == (30, 36, 3)
    assert (picture[12:15] == 40).all()
