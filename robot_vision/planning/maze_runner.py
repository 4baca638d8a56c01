# SPDX-License-Identifier: Apache-2.0
"""A robot with one camera in a maze it has never seen: from plans of the floor and odometry to the way to drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.mapping import PlanView, Pose
from robot_vision.mapping.grid_pose import GridPose
from robot_vision.planning.fresh_sight import FreshSight
from robot_vision.planning.grid import Cell, PlanningError, checked_positive
from robot_vision.planning.known_maze import KnownMaze, beside
from robot_vision.planning.maze import Maze
from robot_vision.planning.navigator import Route
from robot_vision.planning.quest import Quest, Stage
from robot_vision.planning.wall_evidence import WallEvidence

_ABOUT: dict[Stage, str] = {
    "goal": "looks for the goal",
    "proof": "proves the shortest way",
    "home": "goes home",
    "run": "runs the shortest way",
    "done": "the run is over",
}
_NOWHERE = np.zeros((0, 2))
_ENTERED = 0.1
"""Cells behind its border at which a robot is in the next cell."""
_CREEP = 0.15
"""Cells behind its border up to which a robot may drive into a cell of which it has not seen all walls."""
_AHEAD = 3
"""Cells of the way that are told beyond the next one, so that the robot need not stop at each."""
_MIDDLE = 0.04
"""Cells before the middle of its cell at which the robot has come to it: it turns off there and not before, for its
corners reach far when it turns on the spot."""
_OFF_AXIS = 0.15
"""Cells from the middle of its cell from which the robot goes back to it before it turns off."""


@dataclass
class MazeRunner:
    """Explores a maze by what its camera shows and then runs its shortest way.

    Its frame has x to the east (columns), y to the north (rows), and its origin where the middle lines of the outer
    walls meet in the south-west. Walls count as seen from any cell, not only from the one they belong to: a camera
    sees them from afar.

    Args:
        size: rows, columns of the maze.
        goals: cells of which any ends a run.
        start: cell in whose middle the robot stands at first.
        heading: to where it looks there: 0 north, 1 east, 2 south, 3 west.
        cell: side of a cell, m.
        wall: thickness of the walls, cells.

    Raises:
        PlanningError: a start or goal outside, or settings that make no sense.
    """

    size: Cell
    goals: Sequence[Cell]
    start: Cell = (0, 0)
    heading: int = 0
    cell: float = 1.0
    wall: float = 0.067
    track: list[Cell] = field(init=False)
    """Every cell the robot was in, one a step; the first is the start."""
    steps: dict[Stage, int] = field(init=False)
    """Taken in each stage (see `Quest`)."""

    def __post_init__(self) -> None:
        for what, place in [("start", self.start), *(("goal", goal) for goal in self.goals)]:
            if not (0 <= place[0] < self.size[0] and 0 <= place[1] < self.size[1]):
                raise PlanningError(f"the {what} {place} lies outside a maze of {self.size} cells")
        checked_positive(self.wall, "wall")
        if self.size[0] < 1 or self.size[1] < 1:
            raise PlanningError(f"a maze has rows and columns, not {self.size}")
        if not self.goals:
            raise PlanningError("the maze has no goal")
        self._known = KnownMaze(self.size, self.start, self.goals)
        self._evidence = WallEvidence(self.size, self.cell)
        self._quest = Quest(self._known)
        begin = Pose(*self._middle(self.start), float(np.pi / 2 * (1 - self.heading)))
        self._pose = GridPose(begin, self.cell, self.wall * self.cell)
        self._place, self._towards, self._came = self.start, self.heading, True
        self._blind = ""
        self._odometry = Pose(0.0, 0.0, 0.0)
        self._sight = FreshSight(self.cell)
        self._ahead: list[Cell] = []
        self._looks, self._caution, self._reason, self._walled_in = False, False, "", 0
        self._route = Route(_NOWHERE, 0.0, "no odometry yet")
        self._stale = True
        self.track, self.steps = [self.start], {}

    @property
    def stage(self) -> Stage:
        """What the robot is about."""
        return self._quest.stage

    @property
    def pose(self) -> Pose | None:
        """Where it believes to be; None before there is odometry."""
        return self._pose.pose

    @property
    def sigma(self) -> NDArray[np.float64]:
        """Standard deviations (3,) of its pose: x and y (m), yaw (rad)."""
        return self._pose.sigma

    @property
    def summary(self) -> str:
        """What it is about and how many steps it took in each stage, in one line."""
        steps = ", ".join(f"{stage} {count}" for stage, count in self.steps.items()) or "none yet"
        return f"{_ABOUT[self.stage]}; in the cell {self._place}; steps: {steps}"

    @property
    def seen(self) -> Maze:
        """What it knows of the maze."""
        return self._known.as_maze()

    @property
    def shortest_path(self) -> list[Cell]:
        """Cells of the shortest way from the start to a goal that is known by now; empty if none is."""
        return self._known.shortest_path()

    def warm_up(self) -> None:
        """Compile what plans."""
        self._known.steps_from(self.goals)

    def move(self, stamp_s: float, odometry: Pose) -> None:
        """Take in a pose that odometry tells, in a frame of its own."""
        self._pose.move(stamp_s, odometry)
        self._odometry = odometry

    def see_directions(
        self, stamp_s: float, directions: NDArray[np.float64], sigma: NDArray[np.float64], camera: Camera
    ) -> None:
        """Take in vanishing points of a picture; see `GridPose.see_directions`."""
        self._pose.see_directions(stamp_s, directions, sigma, camera)

    def see_plan(self, stamp_s: float, plan: PlanView, eye: float) -> None:
        """Take in the plan of the floor of a picture: where the robot is among walls, and which walls there are.

        Args:
            stamp_s: of the picture, s.
            plan: in base_link.
            eye: of the camera ahead of base_link, m.
        """
        pose = self._pose.at(stamp_s)
        self._blind = self._sight.fault(plan, self._odometry)
        if pose is None:
            self._blind = "no odometry of the time of the picture"
        if pose is None or self._blind:
            return
        trust = self._sight.trust(pose)
        self._pose.see_plan(stamp_s, plan, eye, trust)
        self._evidence.see(plan, self._pose.at(stamp_s) or pose, trust)
        self._stale = self._evidence.tell(self._known) or self._stale

    def route(self) -> Route:
        """Where to drive from here, in the frame of the maze."""
        pose = self.pose
        if pose is None:
            return self._route
        self._step(pose)
        number = self._route.number + self._stale
        if self._stale:
            self._stale = False
            self._plan()
            self._caution = self._cautious()
        if self.stage == "done":
            points, reason, seen = self._last_piece(pose), "the run is over", np.inf
        elif not self._ahead:
            points, reason, seen = _NOWHERE, self._reason, 0.0
        else:
            points, reason, seen = self._points(pose), "", np.inf
            if self._caution:
                seen = self._up_to_border(pose)
            if self._looks:
                reason, seen = "looks whether a wall stands there", _way(points[:-1])
            points = _up_to_turn(points)
        if self._blind:
            points, reason, seen = _NOWHERE, self._blind, 0.0
        self._route = Route(points, seen, reason, number=number, done=self.stage == "done")
        return self._route

    def _plan(self) -> None:
        """The cells ahead; where there are none, the walls least sure are doubted, once in each cell."""
        self._look_ahead()
        if self._ahead or self.stage == "done":
            return
        if self._walled_in != len(self.track):
            self._walled_in = len(self.track)
            while not self._ahead and self._evidence.forget_weakest(self._known):
                self._look_ahead()
        if not self._ahead:
            self._reason = f"no way leads on from the cell {self._place} by what is known of the maze"

    def _look_ahead(self) -> None:
        """The cells ahead, as far as nothing unseen lies between them."""
        self._ahead, self._looks = [], False
        known, place, towards = self._known, self._place, self._towards
        steps = self._quest.field(place)
        if steps is None:
            return
        for number in range(_AHEAD + 1):
            direction = known.downhill(steps, place, towards)
            if direction is None and number == 0 and self.stage == "proof":
                direction = self._unseen(place)  # the question is one of this cell's own walls
            if direction is None:
                return
            if not known.is_seen(place, direction):
                if number == 0:
                    self._ahead, self._looks = [beside(place, direction)], True
                return
            place, towards = beside(place, direction), direction
            self._ahead.append(place)

    def _cautious(self) -> bool:
        """Whether what is seen of the next cell can still change the way: then the robot must be able to stop."""
        if self.stage not in ("goal", "proof") or not self._ahead or self._looks:
            return False
        return any(not self._known.is_seen(self._ahead[0], direction) for direction in range(4))

    def _up_to_border(self, pose: Pose) -> float:
        """Metres of the way to just behind the border of the next cell, from where the way begins."""
        points = self._points(pose)
        return _way(points[: len(points) - len(self._ahead)]) + (0.5 + _CREEP) * self.cell

    def _unseen(self, place: Cell) -> int | None:
        """To where a cell has a wall that has not been seen, the least turn first; None if all have been."""
        turns = ((self._towards + turn) % 4 for turn in (0, 1, 3, 2))
        return next((way for way in turns if not self._known.is_seen(place, way)), None)

    def _step(self, pose: Pose) -> None:
        """Note that the robot is in another cell once it is well inside."""
        row, column = self._place
        off = np.array([pose.y, pose.x]) / self.cell - (row + 0.5, column + 0.5)
        axis = int(np.argmax(np.abs(off)))
        if abs(off[axis]) < 0.5 + _ENTERED:
            return
        direction = (0 if off[0] > 0 else 2) if axis == 0 else (1 if off[1] > 0 else 3)
        there = beside(self._place, direction)
        if not (0 <= there[0] < self.size[0] and 0 <= there[1] < self.size[1]):
            return
        self._known.see(self._place, direction, False)
        self.steps[self.stage] = self.steps.get(self.stage, 0) + 1
        self._place, self._towards, self._came, self._stale = there, direction, False, True
        self.track.append(there)

    def _points(self, pose: Pose) -> NDArray[np.float64]:
        """Middles of the cells ahead, from the robot's own on, led back to its middle where the way turns off."""
        here = np.array(self._middle(self._place))
        points = [here, *(np.array(self._middle(place)) for place in self._ahead)]
        off = np.array([pose.x, pose.y]) - here
        axis = int(np.argmax(np.abs(off)))
        before = -off[0] * (0, 1, 0, -1)[self._towards] - off[1] * (1, 0, -1, 0)[self._towards]
        self._came = self._came or before < _MIDDLE * self.cell
        if not self._came:
            axis = 1 - self._towards % 2
        on_its_way = len(points) > 1 and float(off @ (points[1] - here)) > 0.7 * np.hypot(*off) * self.cell
        if not on_its_way and (not self._came or abs(off[axis]) > _OFF_AXIS * self.cell):
            beginning = here.copy()
            beginning[axis] += off[axis]
            points.insert(0, beginning)
        return np.array(points)

    def _last_piece(self, pose: Pose) -> NDArray[np.float64]:
        """To the middle of the goal cell; nothing once the robot is about there."""
        middle = self._middle(self._place)
        left = np.hypot(middle[0] - pose.x, middle[1] - pose.y)
        return self._points(pose) if left > _OFF_AXIS * self.cell else _NOWHERE

    def _middle(self, place: Cell) -> tuple[float, float]:
        return (place[1] + 0.5) * self.cell, (place[0] + 0.5) * self.cell


def _up_to_turn(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The part of a way (M, 2) before it turns off."""
    pieces = np.diff(points, axis=0)
    crossed = pieces[:-1, 0] * pieces[1:, 1] - pieces[:-1, 1] * pieces[1:, 0]
    turns = np.flatnonzero(np.abs(crossed) > 1e-9)
    return points[: turns[0] + 2] if len(turns) else points


def _way(points: NDArray[np.float64]) -> float:
    """Length of a way (M, 2)."""
    return float(np.hypot(*np.diff(points, axis=0).T).sum())
