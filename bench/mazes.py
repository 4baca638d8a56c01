# SPDX-License-Identifier: Apache-2.0
"""Contest mazes explored by a mouse that has never seen them, beside the rule of most mice; and the runs after that."""

from __future__ import annotations

import numpy as np

from bench.flood_fill import flood_fill
from bench.report import Cell, Row, Table, at_least, at_most
from bench.sources import data_set
from robot_vision.planning import Maze, MazeExplorer, NoWayError, fastest_run, shortest_run
from robot_vision.planning.pictures import steps_to_goal

QUICK = 8
"""Every so many-th maze is enough for a look."""


def run(quick: bool) -> list[Table]:
    """Explore all mazes whose goal can be reached, every eighth when it is to be quick.

    Raises:
        MissingSetError: the mazes are not there.
    """
    folder = data_set("mazes", "LICENSE")
    names = sorted(path.stem for path in folder.glob("*.maze"))[:: QUICK if quick else 1]
    found: dict[str, list[float]] = {
        name: [] for name in ("plain", "proof", "worse", "goal", "gain", "wrong")
    }
    unreachable = 0
    for name in names:
        maze = Maze.read(folder / f"{name}.maze")
        known = Maze(maze.walls_east, maze.walls_north, maze.start, maze.goals)
        try:
            told = MazeExplorer(maze).explore()
        except NoWayError:
            unreachable += 1
            continue
        found["wrong"].append(len(told.shortest_path) - 1 != int(steps_to_goal(known)[maze.start]))
        goal, plain = flood_fill(maze)
        _, proof = flood_fill(maze, optimistic_proof=True)
        found["goal"].append(told.steps_to_goal / goal)
        found["plain"].append(told.steps_to_proof / plain)
        found["proof"].append(told.steps_to_proof / proof)
        found["worse"].append(told.steps_to_proof > plain)
        found["gain"].append(1 - fastest_run(known).time_s / shortest_run(known).time_s)
    rows = [
        Row("explored to proof", "", [Cell(len(found["wrong"]), at_least(79) if not quick else None)], 0),
        Row("goal out of reach", "", [Cell(unreachable)], 0),
        Row("with a way that is not the shortest", "", [Cell(sum(found["wrong"]), at_most(0))], 0),
        Row("steps to proof over flood fill's", "", [Cell(_mean(found["plain"]), at_most(0.95))], 3),
        Row("the same where flood fill knows the proof", "", [Cell(_mean(found["proof"]), at_most(0.95))], 3),
        Row("mazes with more steps than flood fill", "", [Cell(sum(found["worse"]))], 0),
        Row("steps to the goal over flood fill's", "", [Cell(_mean(found["goal"]))], 3),
        Row("time saved by weighing turns, mean", "%", [Cell(100 * float(np.mean(found["gain"])))]),
        Row("time saved by weighing turns, most", "%", [Cell(100 * max(found["gain"]))]),
    ]
    notes = [
        "geometric means; flood fill goes to the goal and back until its way has been driven from end to end",
        "or, where it knows the proof, until no unseen wall can make a shorter way",
    ]
    return [Table(f"Mazes: {len(names)} of contests, never seen before", ["explorer"], rows, notes)]


def _mean(ratios: list[float]) -> float:
    return float(np.exp(np.mean(np.log(ratios))))
