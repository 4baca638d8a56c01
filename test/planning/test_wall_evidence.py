# SPDX-License-Identifier: Apache-2.0
"""Walls of mazes told from plans of the floor: none is told wrongly, and those near the robot are told."""

from __future__ import annotations

import numpy as np
import pytest
from seen_mazes import plan_from

from robot_vision.mapping import Pose
from robot_vision.planning import Maze, WallEvidence
from robot_vision.planning.grid import PlanningError
from robot_vision.planning.known_maze import KnownMaze
from robot_vision.simulation.maze import grown


def wrong_and_seen(maze: Maze, known: KnownMaze) -> tuple[int, int]:
    """Walls within the maze that are told wrongly, and that are told at all."""
    seen = known.as_maze()
    wrong = ((seen.walls_east != maze.walls_east) & ~seen.unknown_east).sum()
    wrong += ((seen.walls_north != maze.walls_north) & ~seen.unknown_north).sum()
    told = (~seen.unknown_east)[:, :-1].sum() + (~seen.unknown_north)[:-1].sum()
    return int(wrong), int(told)


@pytest.mark.parametrize("seed", range(4))
def test_a_look_around_tells_the_walls_of_the_cell_and_none_wrongly(seed: int) -> None:
    random = np.random.default_rng(seed)
    maze = grown(6, 6, 0.2, seed)
    evidence = WallEvidence(maze.size, 1.0)
    known = KnownMaze(maze.size, maze.start, maze.goals)
    row, column = (int(part) for part in random.integers(0, 6, 2))
    for turn in np.linspace(0, 2 * np.pi, 24, endpoint=False):
        true = Pose(column + 0.5, row + 0.5, float(turn))
        believed = Pose(*(np.array(true) + random.normal(0.0, (0.02, 0.02, 0.005))).tolist())
        evidence.see(plan_from(maze, true, 0.02, random), believed)
    assert evidence.tell(known)
    assert not evidence.tell(known)
    wrong, told = wrong_and_seen(maze, known)
    assert wrong == 0
    assert told >= 3
    assert all(known.is_seen((row, column), direction) for direction in range(4))


def test_one_look_is_not_enough_and_walls_can_be_taken_back() -> None:
    maze = Maze.parse("+---+---+\n| S | G |\n+---+---+\n")
    evidence = WallEvidence(maze.size, 1.0)
    known = KnownMaze(maze.size, maze.start, maze.goals)
    pose = Pose(0.5, 0.5, 0.0)
    for count in range(4):
        evidence.see(plan_from(maze, pose), pose)
        if count == 0:
            assert not evidence.tell(known)
    assert evidence.tell(known)
    assert not known.is_open((0, 0), 1)
    assert evidence.forget_weakest(known)
    assert not evidence.forget_weakest(known)
    assert known.is_open((0, 0), 1)
    assert not known.is_seen((0, 0), 1)


@pytest.mark.parametrize("name", ["cell", "reach", "near", "sure", "open", "limit"])
def test_settings_that_make_no_sense_are_refused(name: str) -> None:
    with pytest.raises(PlanningError, match=name):
        WallEvidence((2, 2), **{"cell": 1.0, name: -1.0})
