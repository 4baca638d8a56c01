# SPDX-License-Identifier: Apache-2.0
"""What a mouse in a maze is about, step by step: to the goal, on until the way is proven, home, and the run."""

from __future__ import annotations

from typing import Literal

from robot_vision.planning.grid import Cell, NoWayError
from robot_vision.planning.known_maze import KnownMaze, Steps

Stage = Literal["goal", "proof", "home", "run", "done"]


class Quest:
    """Says where to step next, from what is known of the maze at that moment.

    1. `goal`: until a goal is reached, down the distance function of the goals over what may be open (flood fill).
    2. `proof`: while a way shorter than the best one known may still be hoped for, to the nearest cell beside an
       unseen wall that lies on one of the ways hoped for: whatever is found there settles a question that has to be
       settled.
    3. `home`: when no wall that is unseen can make a shorter way, back to the start on openings that are known.
    4. `run`: the shortest way to a goal. Then it is `done`.

    Args:
        known: the maze as far as it is known; whoever sees walls notes them there.
    """

    def __init__(self, known: KnownMaze) -> None:
        self._known = known
        self._stage: Stage = "goal"

    @property
    def stage(self) -> Stage:
        """What the last step asked for belongs to."""
        return self._stage

    def field(self, cell: Cell) -> Steps | None:
        """Steps from each cell (R, C) to where the mouse that is in `cell` wants to be; None when all is done.

        -1 where no way leads. The stage goes on as far as this cell and what is known allow.
        """
        known = self._known
        if self._stage == "goal" and cell in known.goals:
            self._stage = "proof"
        if self._stage == "proof" and known.is_proven():
            self._stage = "home"
        if self._stage == "home" and cell == known.start:
            self._stage = "run"
        if self._stage == "run" and cell in known.goals:
            self._stage = "done"
        if self._stage == "done":
            return None
        if self._stage == "proof":
            return known.steps_from(known.open_questions())
        if self._stage == "home":
            return known.steps_from([known.start], surely=True)
        return known.steps_from(known.goals, surely=self._stage == "run")

    def direction(self, cell: Cell, heading: int) -> int | None:
        """Which of the `DIRECTIONS` to step to, straight on if possible; None when all is done.

        Raises:
            NoWayError: no way leads to where the mouse has to go.
        """
        steps = self.field(cell)
        if steps is None:
            return None
        direction = self._known.downhill(steps, cell, heading)
        if direction is None:
            raise NoWayError(f"no way leads from the start {self._known.start} to a goal of the maze")
        return direction
