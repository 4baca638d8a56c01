# SPDX-License-Identifier: Apache-2.0
"""The rule of most contest mice, to measure the explorer against: down the flood to the goal, back, and so on."""

from __future__ import annotations

from robot_vision.planning import Maze, NoWayError
from robot_vision.planning.explorer import look_around
from robot_vision.planning.known_maze import KnownMaze, beside


def flood_fill(maze: Maze, optimistic_proof: bool = False) -> tuple[int, int]:
    """Explore by flood fill: to the goal, to the start, and so on until the shortest way is known.

    Args:
        maze: with a goal that can be reached.
        optimistic_proof: stop as soon as no unseen wall can make a shorter way; else when the way down the flood has
            been driven from end to end, as mice do that know only that.

    Returns:
        Steps to the goal, and until the rule stops.

    Raises:
        NoWayError: no way leads to the goal.
    """
    known = KnownMaze(maze.size, maze.start, maze.goals)
    cell, heading, steps = maze.start, 0, 0
    visited = {cell}
    look_around(maze, known, cell)
    to_goal: int | None = None
    homewards = False
    while True:
        done = known.is_proven() if optimistic_proof else _was_driven(known, visited)
        if to_goal is not None and done:
            return to_goal, steps
        field = known.steps_from([maze.start] if homewards else maze.goals)
        direction = known.downhill(field, cell, heading)
        if direction is None:
            raise NoWayError(f"no way leads from {cell}")
        heading, cell = direction, beside(cell, direction)
        steps += 1
        visited.add(cell)
        look_around(maze, known, cell)
        if cell in maze.goals and not homewards:
            to_goal = steps if to_goal is None else to_goal
            homewards = True
        elif cell == maze.start:
            homewards = False


def _was_driven(known: KnownMaze, visited: set[tuple[int, int]]) -> bool:
    """Whether every cell of the way down the flood has been visited, the goal aside."""
    field = known.steps_from(known.goals)
    cell, heading = known.start, 0
    while cell not in known.goals:
        direction = known.downhill(field, cell, heading)
        if direction is None or cell not in visited:
            return False
        heading, cell = direction, beside(cell, direction)
    return True
