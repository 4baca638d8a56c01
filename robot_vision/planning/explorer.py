# SPDX-License-Identifier: Apache-2.0
"""A mouse in a maze it has never seen: to the goal, on until its shortest way is proven, and home.

At each cell it sees the walls around it. What it has not seen counts as open. Where it goes says `quest`.
"""

from __future__ import annotations

from dataclasses import dataclass

from robot_vision.planning.grid import Cell
from robot_vision.planning.known_maze import DIRECTIONS, KnownMaze, beside
from robot_vision.planning.maze import Maze
from robot_vision.planning.quest import Quest


@dataclass(frozen=True)
class Exploration:
    """How a maze was explored.

    Attributes:
        steps_to_goal: steps from cell to cell until the first goal was reached.
        steps_to_proof: steps until the shortest way was proven, those to the goal included.
        steps_home: steps until the mouse was back at the start, all included.
        shortest_path: cells from the start to the nearest goal.
        track: every cell the mouse was in, one a step; the first is the start.
        seen: what it knows of the maze in the end.
    """

    steps_to_goal: int
    steps_to_proof: int
    steps_home: int
    shortest_path: list[Cell]
    track: list[Cell]
    seen: Maze


class MazeExplorer:
    """Explores a maze, seeing only the walls of the cells it has been in.

    Args:
        maze: what the mouse finds; walls its drawing leaves unknown are not there.
        heading: to which it looks at the start: 0 north, 1 east, 2 south, 3 west.
    """

    def __init__(self, maze: Maze, heading: int = 0) -> None:
        self._maze = maze
        self._heading = heading

    def explore(self) -> Exploration:
        """Run through the maze until the shortest way is proven and the mouse is home.

        Raises:
            NoWayError: no way leads from the start to a goal.
        """
        maze = self._maze
        known = KnownMaze(maze.size, maze.start, maze.goals)
        cell, heading, track = maze.start, self._heading, [maze.start]
        quest, steps = Quest(known), {"goal": 0, "proof": 0, "home": 0}
        look_around(maze, known, cell)
        while (direction := quest.direction(cell, heading)) is not None and quest.stage in steps:
            steps[quest.stage] += 1
            heading, cell = direction, beside(cell, direction)
            track.append(cell)
            look_around(maze, known, cell)
        to_proof = steps["goal"] + steps["proof"]
        return Exploration(
            steps["goal"], to_proof, len(track) - 1, known.shortest_path(), track, known.as_maze()
        )


def look_around(maze: Maze, known: KnownMaze, cell: Cell) -> None:
    """Note the walls around a cell of a maze, as a mouse in it sees them."""
    row, column = cell
    walls = (
        maze.walls_north[row, column],
        maze.walls_east[row, column],
        row == 0 or maze.walls_north[row - 1, column],
        column == 0 or maze.walls_east[row, column - 1],
    )
    for direction in range(len(DIRECTIONS)):
        known.see(cell, direction, bool(walls[direction]))
