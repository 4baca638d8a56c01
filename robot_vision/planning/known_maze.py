# SPDX-License-Identifier: Apache-2.0
"""What a mouse knows of a maze: each wall seen, from whichever side, or not yet; and what follows for the way."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from robot_vision.planning.grid import Cell
from robot_vision.planning.maze import Maze

DIRECTIONS = ((1, 0), (0, 1), (-1, 0), (0, -1))
"""Row and column steps to the north, east, south and west."""
Steps = NDArray[np.int32]


class KnownMaze:
    """Walls as far as they have been seen; nothing but the outer walls at first.

    Args:
        size: rows, columns.
        start: cell where runs begin.
        goals: cells of which any ends a run.
    """

    def __init__(self, size: Cell, start: Cell, goals: Sequence[Cell]) -> None:
        self.size, self.start, self.goals = size, start, tuple(goals)
        self._open = np.ones((2, *size), np.bool_)
        """As far as is known: to the east [0] and to the north [1] of each cell."""
        self._seen = np.zeros((2, *size), np.bool_)
        self._open[0, :, -1] = self._open[1, -1] = False
        self._seen[0, :, -1] = self._seen[1, -1] = True

    @classmethod
    def all_of(cls, maze: Maze) -> KnownMaze:
        """A maze that is known as drawn; walls the drawing leaves unknown count as walls."""
        known = cls(maze.size, maze.start, maze.goals)
        known._open[0] = ~(maze.walls_east | maze.unknown_east)
        known._open[1] = ~(maze.walls_north | maze.unknown_north)
        known._seen[:] = True
        return known

    def see(self, cell: Cell, direction: int, wall: bool) -> None:
        """Note whether a wall stands beside a cell; direction counts `DIRECTIONS`."""
        place = self._place(cell, direction)
        if place is not None:
            self._open[place] = not wall
            self._seen[place] = True

    def forget(self, cell: Cell, direction: int) -> None:
        """Take back what was noted of a wall within the maze: it counts as open and has not been seen."""
        place = self._place(cell, direction)
        there = beside(cell, direction)
        if place is not None and there[0] < self.size[0] and there[1] < self.size[1]:
            self._open[place] = True
            self._seen[place] = False

    def is_seen(self, cell: Cell, direction: int) -> bool:
        """Whether it is known if a wall stands there."""
        place = self._place(cell, direction)
        return place is None or bool(self._seen[place])

    def is_open(self, cell: Cell, direction: int) -> bool:
        """Whether one can go on there for all that is known: what was not seen is open."""
        place = self._place(cell, direction)
        return place is not None and bool(self._open[place])

    def steps_from(self, cells: Sequence[Cell], surely: bool = False) -> Steps:
        """Steps from the nearest of some cells (R, C); -1 where no way leads.

        Args:
            cells: one or more.
            surely: count only on openings that have been seen; else what was not seen is open.
        """
        from robot_vision.planning.flooding import flood  # numba: slow to import

        seeds = np.zeros(self.size, np.bool_)
        seeds[tuple(np.transpose(cells))] = True
        ways = self._open & self._seen if surely else self._open
        found: Steps = flood(ways[0], ways[1], seeds)
        return found

    def downhill(self, steps: Steps, cell: Cell, heading: int) -> int | None:
        """The direction that leads down a field of steps, straight on if possible; None at its foot."""
        for turn in (0, 1, 3, 2):
            direction = (heading + turn) % 4
            if self.is_open(cell, direction):
                ahead = steps[beside(cell, direction)]
                if 0 <= ahead < steps[cell]:
                    return direction
        return None

    def shortest_path(self) -> list[Cell]:
        """Cells of the shortest way from the start to a goal that is known to be open; empty if none is."""
        known = KnownMaze(self.size, self.start, self.goals)
        known._open, known._seen = self._open & self._seen, self._seen
        steps = known.steps_from(self.goals)
        if steps[self.start] < 0:
            return []
        path, heading = [self.start], 0
        while True:
            direction = known.downhill(steps, path[-1], heading)
            if direction is None:
                return path
            heading = direction
            path.append(beside(path[-1], direction))

    def is_proven(self) -> bool:
        """Whether no wall that has not been seen can make a shorter way than the best one known, or any at all."""
        hoped = self.steps_from(self.goals)[self.start]
        return bool(hoped == self.steps_from(self.goals, surely=True)[self.start])

    def open_questions(self) -> list[Cell]:
        """Cells beside unseen walls that lie on one of the shortest ways one may still hope for."""
        from_start, from_goal = self.steps_from([self.start]), self.steps_from(self.goals)
        hoped = from_goal[self.start]
        asked = []
        for side, (down, right) in enumerate(((0, 1), (1, 0))):
            rows, columns = self.size[0] - down, self.size[1] - right
            here, there = np.s_[:rows, :columns], np.s_[down:, right:]
            unseen = ~self._seen[(side, *here)]
            forth = (from_start[here] >= 0) & (from_start[here] + 1 + from_goal[there] == hoped)
            back = (from_start[there] >= 0) & (from_start[there] + 1 + from_goal[here] == hoped)
            for row, column in np.argwhere(unseen & (forth | back)):
                asked += [(int(row), int(column)), (int(row) + down, int(column) + right)]
        return asked

    def as_maze(self) -> Maze:
        """The same as a `Maze`, what has not been seen marked unknown."""
        return Maze(~self._open[0], ~self._open[1], self.start, self.goals, ~self._seen[0], ~self._seen[1])

    def _place(self, cell: Cell, direction: int) -> tuple[int, int, int] | None:
        """Where a wall beside a cell is kept; None for the outer walls in the south and west."""
        row, column = cell
        if direction == 2:
            row -= 1
        elif direction == 3:
            column -= 1
        return (1 - direction % 2, row, column) if row >= 0 and column >= 0 else None


def beside(cell: Cell, direction: int) -> Cell:
    """The neighbour of a cell in one of the `DIRECTIONS`."""
    return cell[0] + DIRECTIONS[direction][0], cell[1] + DIRECTIONS[direction][1]
