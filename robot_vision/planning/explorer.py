# SPDX-License-Identifier: Apache-2.0
"""A mouse in a maze it has never seen: to the goal, on until its shortest way is proven, and home.

1. At each cell it sees the walls around it. What it has not seen counts as open.
2. Until a goal is reached, it steps down the distance function of the goals over what may be open (flood fill).
3. Then the shortest way one may still hope for is compared with the shortest way known. While the first is
   shorter, it goes to the nearest cell beside an unseen wall that lies on one of the ways hoped for: whatever it
   finds there settles a question that has to be settled.
4. When both are equal, no wall that is unseen can make a shorter way. It goes home on openings it knows.
"""

from __future__ import annotations

from dataclasses import dataclass

from robot_vision.planning.grid import Cell, NoWayError
from robot_vision.planning.known_maze import DIRECTIONS, KnownMaze, beside
from robot_vision.planning.maze import Maze


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
        look_around(maze, known, cell)
        to_goal: int | None = 0 if cell in maze.goals else None
        to_proof: int | None = None
        while True:
            if to_goal is None:
                targets = list(maze.goals)
            elif to_proof is None and not known.is_proven():
                targets = known.open_questions()
            else:
                to_proof = len(track) - 1 if to_proof is None else to_proof
                if cell == maze.start:
                    break
                targets = [maze.start]
            steps = known.steps_from(targets, surely=to_proof is not None)
            direction = known.downhill(steps, cell, heading)
            if direction is None:
                raise NoWayError(f"no way leads from the start {maze.start} to a goal of the maze")
            heading, cell = direction, beside(cell, direction)
            track.append(cell)
            look_around(maze, known, cell)
            if to_goal is None and cell in maze.goals:
                to_goal = len(track) - 1
        return Exploration(to_goal, to_proof, len(track) - 1, known.shortest_path(), track, known.as_maze())


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
