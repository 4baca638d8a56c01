# SPDX-License-Identifier: Apache-2.0
"""Runs through known mazes: never slower than that over the fewest cells, and never through a wall."""

from __future__ import annotations

import numpy as np
import pytest

from robot_vision.planning import Maze, NoWayError, PlanningError, Racer, fastest_run, shortest_run
from robot_vision.simulation.maze import grown

SNAKE = """\
+---+---+---+
|         G |
+   +---+---+
|           |
+---+---+   +
| S         |
+---+---+---+
"""
STAIRS = """\
+---+---+---+---+
|           | G |
+   +---+---+   +
|   |   |       |
+   +---+   +---+
|   |       |   |
+   +   +---+   +
| S     |       |
+---+---+---+---+
"""


@pytest.mark.parametrize("seed", range(8))
def test_it_is_the_faster_one_and_its_time_is_that_of_its_pieces(seed: int) -> None:
    maze, racer = grown(12, 12, 0.3, seed), Racer()
    fastest, shortest = fastest_run(maze, racer), shortest_run(maze, racer)
    assert fastest.time_s <= shortest.time_s + 1e-9
    assert fastest.cells >= shortest.cells
    assert racer.time_of(fastest.points) == pytest.approx(fastest.time_s)
    assert racer.time_of(shortest.points) == pytest.approx(shortest.time_s)


@pytest.mark.parametrize("seed", range(8))
def test_every_piece_leads_through_openings(seed: int) -> None:
    maze = grown(9, 11, 0.3, 50 + seed)
    points = fastest_run(maze).points
    assert tuple(points[0]) == maze.start
    assert tuple(points[-1].astype(int)) in maze.goals
    for begin, end in zip(points, points[1:], strict=False):
        pieces = int(round(8 * np.abs(end - begin).max()))
        for place in begin + np.linspace(0, 1, pieces + 1)[:, None] * (end - begin):
            row, column = place + 0.5
            if column % 1 == 0 and row % 1 != 0:
                assert not maze.upright[int(row), int(column)]
            if row % 1 == 0 and column % 1 != 0:
                assert not maze.across[int(row), int(column)]
            assert row % 1 != 0 or column % 1 != 0  # a post


def test_a_staircase_is_one_straight_diagonal() -> None:
    points = fastest_run(Maze.parse(STAIRS)).points
    longest = np.hypot(*np.diff(points, axis=0).T).max()
    assert longest == pytest.approx(2.5 * np.sqrt(2.0))


def test_a_long_straight_takes_the_time_of_speeding_up_and_braking() -> None:
    racer = Racer(speed=2.0, acceleration=4.0, turn_speed=0.5, turn_rate=10.0, cell=0.2)
    east = np.zeros((1, 31), bool)
    east[0, -1] = True
    maze = Maze(east, np.ones((1, 31), bool), (0, 0), ((0, 30),))
    # 6 m: half a second and 0.5 m for each change, 5 m at full speed between
    assert fastest_run(maze, racer).time_s == pytest.approx(0.5 + 2.5 + 0.5)


def test_one_way_is_one_way() -> None:
    assert fastest_run(Maze.parse(SNAKE)).cells == shortest_run(Maze.parse(SNAKE)).cells == 8


def test_unknown_walls_are_not_run_through() -> None:
    maze = Maze.parse("+---+---+\n| S . G |\n+---+---+\n")
    for run in (fastest_run, shortest_run):
        with pytest.raises(NoWayError, match="no known way"):
            run(maze)


def test_a_racer_that_cannot_be_is_refused() -> None:
    with pytest.raises(PlanningError, match="acceleration must be a positive number, not 0"):
        Racer(acceleration=0.0)
