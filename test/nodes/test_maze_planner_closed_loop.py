# SPDX-License-Identifier: Apache-2.0
"""The planner drives through mazes in the simulator by the true map: one through the real nodes, more without DDS."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from robot_vision.planning import Maze
from robot_vision.simulation.maze import grown

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from bench import maze_nodes  # noqa: E402  (not installed)
from bench.maze_drives import CELL_M, contest_maze, drive  # noqa: E402  (not installed)
from bench.sources import MissingSetError  # noqa: E402  (not installed)


def test_the_nodes_drive_through_a_maze_without_touching_a_wall() -> None:
    driven = maze_nodes.drive(grown(3, 3, 0.0, 0), cell=1.0, rate=10)
    assert driven.arrived
    assert driven.contacts == 0
    assert driven.closest_m > 0.05
    assert driven.way_m > 3.0
    assert driven.unanswered <= 1


@pytest.mark.parametrize("seed", range(3))
def test_grown_mazes_are_driven_without_touching_a_wall(seed: int) -> None:
    driven = drive(grown(6, 6, 0.1, 20 + seed), CELL_M, seed=seed)
    assert driven.arrived
    assert driven.contacts == 0


def test_a_contest_maze_is_driven_without_touching_a_wall() -> None:
    try:
        maze: Maze = contest_maze("16MM2016H_Kansai")
    except MissingSetError as missing:
        pytest.skip(str(missing))
    driven = drive(maze)
    assert driven.arrived
    assert driven.contacts == 0
    assert driven.closest_m > 0.01
