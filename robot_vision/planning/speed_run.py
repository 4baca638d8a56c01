# SPDX-License-Identifier: Apache-2.0
"""The fastest run through a known maze: not the fewest cells but the least time, turns and diagonals weighed.

The robot drives from the middle of one opening between cells to the middle of the next: straight through a cell, or
diagonally across its corner, in eight headings. On each straight piece it speeds up and brakes as hard as it may; every
turn is passed at `turn_speed`, whatever its angle, and costs time for turning. Dijkstra's rule over (opening, heading)
finds the run that takes the least time under that model.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from robot_vision.planning.grid import Cell, NoWayError, checked_positive
from robot_vision.planning.known_maze import KnownMaze
from robot_vision.planning.maze import Maze

Place = tuple[int, int]
"""Row and column in half cells: cell middles at even numbers, openings where one is odd."""
_HEADINGS = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))
"""Half cells to the north and east, clockwise from north."""


@dataclass(frozen=True)
class Racer:
    """What a robot can do in a run.

    Attributes:
        speed: greatest, m/s.
        acceleration: also of braking, m/s^2.
        turn_speed: in turns, m/s.
        turn_rate: in turns, rad/s.
        cell: side of a cell, metres.

    Raises:
        PlanningError: one is not a positive number.
    """

    speed: float = 3.0
    acceleration: float = 8.0
    turn_speed: float = 0.7
    turn_rate: float = 12.0
    cell: float = 0.18

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            checked_positive(value, name)

    def straight_time(self, length: float, begin: float, end: float) -> float:
        """Least seconds for a straight piece in metres, from one speed to another (m/s), braking in time."""
        peak = sqrt(self.acceleration * length + (begin**2 + end**2) / 2)
        if peak <= self.speed:
            return (2 * peak - begin - end) / self.acceleration
        way_changing = (2 * self.speed**2 - begin**2 - end**2) / (2 * self.acceleration)
        changing = (2 * self.speed - begin - end) / self.acceleration
        return changing + (length - way_changing) / self.speed

    def time_of(self, points: NDArray[np.float64]) -> float:
        """Seconds for a run along straight pieces (M, 2), cells, from standstill to standstill."""
        pieces = np.diff(points, axis=0)
        lengths = self.cell * np.hypot(pieces[:, 0], pieces[:, 1])
        angles = np.arctan2(pieces[:, 0], pieces[:, 1])
        turns = np.abs((np.diff(angles) + pi) % (2 * pi) - pi)
        corner = min(self.turn_speed, self.speed)
        total = float(turns.sum()) / self.turn_rate
        for number, length in enumerate(lengths):
            begin = corner if number else 0.0
            end = corner if number < len(lengths) - 1 else 0.0
            total += self.straight_time(float(length), *self._within_reach(float(length), begin, end))
        return total

    def _within_reach(self, length: float, begin: float, end: float) -> tuple[float, float]:
        """Speeds of a piece too short to change from the one to the other: the greater one gives way."""
        gain = 2 * self.acceleration * length
        return min(begin, sqrt(end**2 + gain)), min(end, sqrt(begin**2 + gain))


@dataclass(frozen=True, eq=False)
class SpeedRun:
    """A run through a maze.

    Attributes:
        points: float64 (M, 2) row, column where it begins, turns and ends; cell middles are whole numbers.
        time_s: what it takes.
        cells: how many steps from cell to cell it has.
    """

    points: NDArray[np.float64]
    time_s: float
    cells: int


def fastest_run(maze: Maze, racer: Racer | None = None) -> SpeedRun:
    """The run from the start to a goal that takes the least time; walls that are unknown count as walls.

    Raises:
        NoWayError: no known way leads to a goal.
    """
    how = racer or Racer()
    known = KnownMaze.all_of(maze)
    begin = (2 * maze.start[0], 2 * maze.start[1])
    times: dict[tuple[Place, int], float] = {}
    came: dict[tuple[Place, int], tuple[Place, int] | None] = {}
    queue: list[tuple[float, Place, int]] = []
    corner = min(how.turn_speed, how.speed)
    for heading in (0, 2, 4, 6):
        times[begin, heading] = 0.0
        came[begin, heading] = None
        queue.append((0.0, begin, heading))
    while queue:
        time, place, heading = heapq.heappop(queue)
        if time > times[place, heading]:
            continue
        if _is_middle(place) and place != begin:
            return _run(came, (place, heading), time)
        for there, length, ends in _straights(known, place, heading, begin):
            piece = how.straight_time(
                how.cell * length,
                *how._within_reach(
                    how.cell * length, 0.0 if place == begin else corner, 0.0 if ends else corner
                ),
            )
            turns = (0,) if ends else (-3, -2, -1, 1, 2, 3)
            for turn in turns:
                state = there, (heading + turn) % 8
                arrival = time + piece + abs(turn) * pi / 4 / how.turn_rate
                if arrival < times.get(state, np.inf):
                    times[state] = arrival
                    came[state] = place, heading
                    heapq.heappush(queue, (arrival, *state))
    raise NoWayError(f"no known way leads from the start {maze.start} to a goal of the maze")


def shortest_run(maze: Maze, racer: Racer | None = None) -> SpeedRun:
    """The run over the fewest cells, driven by the same racer from cell middle to cell middle, diagonals cut.

    Raises:
        NoWayError: no known way leads to a goal.
    """
    known = KnownMaze.all_of(maze)
    path = known.shortest_path()
    if not path:
        raise NoWayError(f"no known way leads from the start {maze.start} to a goal of the maze")
    cells = np.array(path, np.float64)
    points = np.concatenate([cells[:1], (cells[:-1] + cells[1:]) / 2, cells[-1:]])
    points = _without_straights(points)
    return SpeedRun(points, (racer or Racer()).time_of(points), len(path) - 1)


def _is_middle(place: Place) -> bool:
    return place[0] % 2 == 0 and place[1] % 2 == 0


def _straights(known: KnownMaze, place: Place, heading: int, begin: Place) -> list[tuple[Place, float, bool]]:
    """Where a straight piece may end: the place, its length in cells, and whether the run ends there."""
    down, right = _HEADINGS[heading]
    straight = down == 0 or right == 0
    found: list[tuple[Place, float, bool]] = []
    length = 0.0
    while True:
        cell = _cell_ahead(place, heading, begin)
        if cell is None or not (0 <= cell[0] < known.size[0] and 0 <= cell[1] < known.size[1]):
            return found
        if straight and not _is_middle(place) and cell in known.goals:
            found.append(((2 * cell[0], 2 * cell[1]), length + 0.5, True))
        step = (2 if straight else 1) if not _is_middle(place) else 1
        place = place[0] + step * down, place[1] + step * right
        length += step * (0.5 if straight else sqrt(0.5))
        if not _is_opening(known, place, cell):
            return found
        found.append((place, length, False))


def _cell_ahead(place: Place, heading: int, begin: Place) -> Cell | None:
    """The cell a robot in an opening is about to drive into; None if the heading leads along the wall."""
    down, right = _HEADINGS[heading]
    row, column = place
    if _is_middle(place):
        return (row // 2, column // 2) if place == begin else None
    if row % 2:
        return None if down == 0 else ((row + down) // 2, column // 2)
    return None if right == 0 else (row // 2, (column + right) // 2)


def _is_opening(known: KnownMaze, place: Place, cell: Cell) -> bool:
    """Whether there is no wall at a place on the border of a cell."""
    down, right = place[0] - 2 * cell[0], place[1] - 2 * cell[1]
    direction = {(1, 0): 0, (0, 1): 1, (-1, 0): 2, (0, -1): 3}[down, right]
    return known.is_open(cell, direction)


def _run(
    came: dict[tuple[Place, int], tuple[Place, int] | None], last: tuple[Place, int], time: float
) -> SpeedRun:
    states: list[tuple[Place, int]] = []
    state: tuple[Place, int] | None = last
    while state is not None:
        states.append(state)
        state = came[state]
    points = np.array([place for place, _ in states[::-1]], np.float64) / 2
    pieces = np.abs(np.diff(points, axis=0))
    # an opening is passed every cell on a straight, every half cell (in rows and columns) on a diagonal
    steps = np.where(pieces.min(axis=1) > 0, 2 * pieces.max(axis=1), pieces.max(axis=1))
    return SpeedRun(points, time, int(round(float(steps.sum()))))


def _without_straights(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Only the points where a chain (M, 2) turns, and its ends."""
    pieces = np.diff(points, axis=0)
    headings = pieces / np.linalg.norm(pieces, axis=1, keepdims=True)
    turns = np.abs(np.diff(headings, axis=0)).max(axis=1) > 1e-9
    return np.asarray(points[np.concatenate([[True], turns, [True]])])
