# SPDX-License-Identifier: Apache-2.0
"""Mice in mazes they have never seen: the way they prove is the shortest, and they need fewer steps than others."""

from __future__ import annotations

import os
import sys
from collections import deque
from pathlib import Path

import numpy as np
import pytest

from robot_vision.planning import Maze, MazeExplorer, NoWayError
from robot_vision.simulation.maze import grown

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from bench.flood_fill import flood_fill  # noqa: E402  (the benchmarks are not installed)

DATA = Path(os.environ.get("ROBOT_VISION_DATA", Path(__file__).resolve().parents[3] / "shared" / "data"))


def shortest(maze: Maze) -> int | None:
    """Steps of the shortest way, by breadth-first search over the walls themselves; None if there is none."""
    steps = {maze.start: 0}
    queue = deque([maze.start])
    while queue:
        row, column = cell = queue.popleft()
        if cell in maze.goals:
            return steps[cell]
        for there, wall in (
            ((row + 1, column), maze.across[row + 1, column]),
            ((row - 1, column), maze.across[row, column]),
            ((row, column + 1), maze.upright[row, column + 1]),
            ((row, column - 1), maze.upright[row, column]),
        ):
            if not wall and there not in steps:
                steps[there] = steps[cell] + 1
                queue.append(there)
    return None


def contest_mazes() -> list[Path]:
    return sorted((DATA / "mazes").glob("*.maze"))


def check(maze: Maze) -> int:
    """Explore, and hold what is told to what is so; returns the steps to proof."""
    run = MazeExplorer(maze).explore()
    assert len(run.shortest_path) - 1 == shortest(maze)
    assert run.shortest_path[0] == maze.start
    assert run.shortest_path[-1] in maze.goals
    for track in (run.track, run.shortest_path):
        for (row, column), (r, c) in zip(track, track[1:], strict=False):
            assert abs(row - r) + abs(column - c) == 1
            low = min((row, column), (r, c))
            assert not (maze.walls_north if column == c else maze.walls_east)[low]
    assert run.track[run.steps_to_goal] in maze.goals
    assert not set(run.track[: run.steps_to_goal]) & set(maze.goals)
    assert run.steps_to_goal <= run.steps_to_proof <= run.steps_home == len(run.track) - 1
    assert run.track[-1] == maze.start
    seen = run.seen
    assert not (seen.walls_east & ~maze.walls_east).any()
    assert not (seen.walls_north & ~maze.walls_north).any()
    assert shortest(Maze(seen.walls_east, seen.walls_north, seen.start, seen.goals)) == shortest(maze)
    return run.steps_to_proof


@pytest.mark.parametrize("seed", range(20))
def test_grown_mazes_are_explored_to_proof(seed: int) -> None:
    rows, columns = np.random.default_rng(seed).integers(2, 20, 2)
    check(grown(int(rows), int(columns), loops=(seed % 5) / 10, seed=seed))


def test_it_needs_fewer_steps_than_flood_fill_over_grown_mazes() -> None:
    mazes = [grown(16, 16, 0.15, 100 + seed) for seed in range(30)]
    ratios = [check(maze) / flood_fill(maze)[1] for maze in mazes]
    assert np.exp(np.mean(np.log(ratios))) <= 0.95


def test_contest_mazes_are_explored_to_proof_in_fewer_steps_than_by_flood_fill() -> None:
    files = contest_mazes()
    if not files:
        pytest.skip(f"contest mazes are not there: {DATA / 'mazes'} (set ROBOT_VISION_DATA)")
    mazes = [maze for maze in map(Maze.read, files) if shortest(maze) is not None]
    assert len(mazes) >= 79
    steps = [check(maze) for maze in mazes]
    # the larger ones are compared by the benchmark `mazes`
    small = [(count, maze) for count, maze in zip(steps, mazes, strict=True) if maze.size[0] <= 16]
    ratios = [count / flood_fill(maze)[1] for count, maze in small]
    assert np.exp(np.mean(np.log(ratios))) <= 0.95


def test_a_goal_that_cannot_be_reached_is_said() -> None:
    maze = Maze.parse("+---+---+\n| S | G |\n+---+---+\n")
    with pytest.raises(NoWayError, match=r"no way leads from the start \(0, 0\)"):
        MazeExplorer(maze).explore()


def test_a_mouse_that_starts_at_the_goal_is_done() -> None:
    maze = Maze(np.ones((1, 1), bool), np.ones((1, 1), bool), (0, 0), ((0, 0),))
    run = MazeExplorer(maze).explore()
    assert (run.steps_to_goal, run.steps_to_proof, run.shortest_path) == (0, 0, [(0, 0)])
