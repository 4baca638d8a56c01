# SPDX-License-Identifier: Apache-2.0
"""Leads a robot over a map that may grow and change: to a goal, or to wherever the map can be made to grow."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from robot_vision.planning.clearance import with_clearance
from robot_vision.planning.distance import distance_field
from robot_vision.planning.floor_map import FloorMap
from robot_vision.planning.frontiers import frontiers, nearest_frontier
from robot_vision.planning.grid import Cell, NoWayError, PlanningError
from robot_vision.planning.path import plan_path

Mode = Literal["explore", "go", "hold"]
MODES: tuple[Mode, ...] = ("explore", "go", "hold")


@dataclass(frozen=True, eq=False)
class Route:
    """Where to drive.

    Attributes:
        points: float64 (M, 2), x, y in metres in the frame of the map; () if there is no way.
        seen: metres of it from its beginning that lead over floor that is known to be free.
        reason: in plain words why there is no way, or what there is to say about it; empty if all is well.
        advice: what to try; may be empty.
        number: of the plan: another one means another way.
        done: there is no way because all is explored.
    """

    points: NDArray[np.float64]
    seen: float
    reason: str = ""
    advice: str = ""
    number: int = 0
    done: bool = False


_NOWHERE = np.zeros((0, 2))
_LEAST = {"radius": 0.0, "middle": 0.0, "frontier": 0.0, "astray": 1e-3, "arrival": 1e-3}
"""Metres."""


class _ExploredError(PlanningError):
    """There is nothing left to explore."""


@dataclass
class Navigator:
    """Plans where to drive; plans anew only if something that matters has changed.

    A way is kept as long as the map leaves all its cells free, no cell has become free that could lie on a shorter
    one, the goal is the same and the robot is on it. What nobody has seen is planned through only when there is no
    other way.

    Args:
        radius: of the robot, metres: the way keeps so far from every wall.
        middle: within this distance of walls the way is drawn to the middle, metres; 0: it is the shortest.
        frontier: narrowest piece of unknown border worth exploring, metres.
        astray: how far the robot may be off its way before a new one is planned, metres.
        arrival: within this distance of its end a way is done, metres.

    Raises:
        PlanningError: naming the setting that makes no sense.
    """

    radius: float = 0.25
    middle: float = 0.0
    frontier: float = 0.3
    astray: float = 0.3
    arrival: float = 0.1

    def __post_init__(self) -> None:
        for name, least in _LEAST.items():
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= least):
                raise PlanningError(f"{name} must be at least {least:g} m, not {getattr(self, name)}")
        self._mode: Mode = "go"
        self._map: FloorMap | None = None
        self._known = self._maybe = np.zeros((0, 0), np.bool_)
        self._goal: tuple[float, float] | None = None
        self._target: Cell | None = None
        self._given_up = np.zeros((0, 0), np.bool_)
        self._route = Route(_NOWHERE, 0.0, "no map yet")
        self._stale = True
        self._planned_at = (0.0, 0.0)

    @property
    def mode(self) -> Mode:
        """What the robot is about."""
        return self._mode

    def use(self, **settings: float) -> None:
        """Change settings by their names; the map is then looked at with new eyes, if they say otherwise."""
        if any(getattr(self, name) != value for name, value in settings.items()):
            for name, value in settings.items():
                setattr(self, name, value)
            self._stale = True
            if self._map is not None:
                self._measure(self._map)

    def set_mode(self, mode: Mode) -> None:
        """Explore, go to the goal, or hold."""
        if mode != self._mode:
            self._mode, self._target, self._stale = mode, None, True

    def set_goal(self, x: float, y: float) -> None:
        """Where to go, metres in the frame of the map."""
        self._goal, self._stale = (x, y), True

    def see_map(self, floor: FloorMap) -> None:
        """Take a new map, or a changed one."""
        known_before, maybe_before, before = self._known, self._maybe, self._map
        self._map = floor
        self._measure(floor)
        if before is None or not before.is_laid_out_as(floor):
            self._given_up = np.zeros(floor.cells.shape, np.bool_)
            self._target, self._stale = None, True
        elif self._mode == "explore":
            # the way there leads over known floor only; it is kept while its target is worth it
            self._stale = self._stale or bool((known_before & ~self._known).any())
            self._target = (
                None if self._target is None or not self._frontiers()[self._target] else self._target
            )
            self._stale = self._stale or self._target is None
        else:
            lost = (known_before & ~self._known) | (maybe_before & ~self._maybe)
            won = (self._known & ~known_before) | (self._maybe & ~maybe_before)
            self._stale = self._stale or self._blocks(lost) or self._shortens(won)

    def route(self, x: float, y: float) -> Route:
        """The way from where the robot is (m, frame of the map)."""
        if self._map is not None and self._mode == "explore" and len(self._route.points) and not self._stale:
            self._leave_behind(x, y)
        if self._stale or self._strays(x, y):
            self._stale, self._planned_at = False, (x, y)
            before = self._route
            try:
                self._route = Route(*self._planned(x, y), "", before.number + 1)
            except PlanningError as why:
                same = not len(before.points) and before.reason == str(why)
                number = before.number + (not same)
                done = isinstance(why, _ExploredError)
                self._route = Route(_NOWHERE, 0.0, str(why), _advice(why), number, done)
        return self._route

    def has_arrived(self, x: float, y: float) -> bool:
        """Whether the robot is at the end of its way."""
        points = self._route.points
        return len(points) > 0 and bool(np.hypot(*(points[-1] - (x, y))) <= self.arrival)

    def field(self) -> NDArray[np.float64] | None:
        """Metres from each cell to the end of the present way (R, C), with room for the robot; None without one."""
        points = self._route.points
        if self._map is None or not len(points):
            return None
        end = self._map.cell_at(float(points[-1, 0]), float(points[-1, 1]), "goal")
        roomy = self._known if self._known[end] and self._seen_all() else self._maybe
        return distance_field(roomy, end, self._map.resolution)

    def _measure(self, floor: FloorMap) -> None:
        self._maybe = with_clearance(~floor.occupied, self.radius, floor.resolution)
        self._known = self._maybe & ~floor.unknown

    def _planned(self, x: float, y: float) -> tuple[NDArray[np.float64], float, str]:
        if self._mode == "hold":
            raise PlanningError("holds")
        floor = self._map
        if floor is None:
            raise PlanningError("no map yet")
        robot = floor.cell_at(x, y, "the robot at")
        if floor.occupied[robot]:
            raise PlanningError(f"the robot at ({x:.2f}, {y:.2f}) m stands in a wall of the map")
        if floor.unknown[robot]:
            raise PlanningError(f"the map knows nothing of the place ({x:.2f}, {y:.2f}) m where the robot is")
        if self._mode == "explore":
            return self._to_frontier(floor, robot)
        if self._goal is None:
            raise PlanningError("no goal yet")
        goal = floor.cell_at(*self._goal, "the goal")
        if floor.occupied[goal]:
            raise NoWayError(f"the goal ({self._goal[0]:.2f}, {self._goal[1]:.2f}) m lies in a wall")
        return self._to(floor, robot, goal)

    def _to(self, floor: FloorMap, robot: Cell, goal: Cell) -> tuple[NDArray[np.float64], float, str]:
        """Over known floor if that is possible, else over what may be floor."""
        reason = ""
        passable = ~floor.occupied & ~floor.unknown
        try:
            way = self._plan(floor, passable, robot, goal)
        except NoWayError:
            if not floor.unknown.any():
                raise
            reason = "leads over floor nobody has seen yet"
            way = self._plan(floor, ~floor.occupied, robot, goal)
        return floor.to_world(way), self._seen_part(floor, way), reason

    def _to_frontier(self, floor: FloorMap, robot: Cell) -> tuple[NDArray[np.float64], float, str]:
        edge = self._frontiers()
        roomy = self._known.copy()
        roomy[robot] = True
        if self._target is None or not edge[self._target]:
            self._target = nearest_frontier(roomy, edge, robot)
        if self._target is None:
            raise _ExploredError("explored: nothing unseen can be reached any more")
        way = self._plan(floor, ~floor.occupied & ~floor.unknown, robot, self._target)
        return floor.to_world(way), np.inf, ""

    def _plan(
        self, floor: FloorMap, passable: NDArray[np.bool_], robot: Cell, goal: Cell
    ) -> NDArray[np.float64]:
        # what is unknown is no wall: the way need not keep away from it
        roomy = passable & self._maybe
        start = robot
        lead = np.zeros((0, 2))
        if not roomy[robot]:
            lead = _way_out(passable, roomy, robot)
            start = int(lead[-1, 0]), int(lead[-1, 1])
        way = plan_path(roomy, start, goal, floor.resolution, middle=max(self.middle - self.radius, 0.0))
        return np.concatenate([lead[:-1], way])

    def _frontiers(self) -> NDArray[np.bool_]:
        assert self._map is not None
        reach = int(np.ceil(self.radius / self._map.resolution)) + 1
        smallest = max(1, int(self.frontier / self._map.resolution))
        return frontiers(self._known, self._map.unknown, smallest, reach) & ~self._given_up

    def _leave_behind(self, x: float, y: float) -> None:
        """Give up a frontier that shows nothing new from close by; else the robot would wait there for ever."""
        assert self._map is not None
        if self._target is not None and self.has_arrived(x, y):
            rows, columns = np.ogrid[: self._given_up.shape[0], : self._given_up.shape[1]]
            wide = max(2 * self.radius, self.frontier) / self._map.resolution
            self._given_up |= np.hypot(rows - self._target[0], columns - self._target[1]) <= wide
            self._target, self._stale = None, True

    def _strays(self, x: float, y: float) -> bool:
        points = self._route.points
        if len(points):
            return distance_to_line(points, (x, y)) > self.astray
        moved = np.hypot(x - self._planned_at[0], y - self._planned_at[1])
        return self._map is not None and bool(moved > self._map.resolution)

    def _blocks(self, lost: NDArray[np.bool_]) -> bool:
        if not len(self._route.points):
            return False
        assert self._map is not None
        cells = _cells_near(self._map.to_cells(self._route.points))
        inside = (cells >= 0).all(axis=1) & (cells < lost.shape).all(axis=1)
        return bool(lost[tuple(cells[inside].T)].any())

    def _shortens(self, won: NDArray[np.bool_]) -> bool:
        """Whether a way over one of the cells could be shorter, even if nothing else stood in between."""
        if not won.any():
            return False
        if len(self._route.points) == 0 or self._route.reason:
            return True
        assert self._map is not None
        points = self._map.to_cells(self._route.points)
        length = float(np.hypot(*np.diff(points, axis=0).T).sum())
        cells = np.argwhere(won)
        least = np.hypot(*(cells - points[0]).T) + np.hypot(*(cells - points[-1]).T)
        return bool((least < length - 1.0).any())

    def _seen_part(self, floor: FloorMap, way: NDArray[np.float64]) -> float:
        """Metres from the beginning of a way to the first cell nobody has seen; inf if all are known."""
        along = 0.0
        for begin, end in zip(way, way[1:], strict=False):
            length = float(np.hypot(*(end - begin)))
            steps = max(1, int(np.ceil(4 * length)))
            places = begin + np.linspace(0, 1, steps + 1)[:, None] * (end - begin)
            cells = np.clip(np.rint(places), 0, np.array(floor.cells.shape) - 1).astype(int)
            hidden = floor.unknown[tuple(cells.T)]
            if hidden.any():
                return (along + length * float(np.argmax(hidden)) / steps) * floor.resolution
            along += length
        return np.inf

    def _seen_all(self) -> bool:
        return bool(np.isinf(self._route.seen))


def distance_to_line(points: NDArray[np.float64], place: tuple[float, float]) -> float:
    """Distance of a place from the nearest point of a chain of straight pieces (M, 2)."""
    if len(points) == 1:
        return float(np.hypot(*(points[0] - place)))
    pieces = np.diff(points, axis=0)
    squares = np.maximum((pieces**2).sum(axis=1), 1e-12)
    shares = np.clip(((place - points[:-1]) * pieces).sum(axis=1) / squares, 0.0, 1.0)
    nearest = points[:-1] + shares[:, None] * pieces
    return float(np.hypot(*(nearest - place).T).min())


def _way_out(passable: NDArray[np.bool_], roomy: NDArray[np.bool_], robot: Cell) -> NDArray[np.float64]:
    """From a place too close to a wall to the nearest one that is not."""
    from robot_vision.planning.distance import shortest_way

    far = distance_field(passable, robot)
    far[~roomy] = np.inf
    row, column = (int(part) for part in np.unravel_index(int(np.argmin(far)), far.shape))
    if not np.isfinite(far[row, column]):
        raise NoWayError("the robot has no room: every place it can reach is too close to a wall")
    return shortest_way(passable, robot, (row, column))


def _cells_near(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Cells that a way through points (M, 2) passes, and some beside them, (K, 2)."""
    found = []
    for begin, end in zip(points, points[1:], strict=False):
        steps = max(1, int(np.ceil(3 * np.hypot(*(end - begin)))))
        found.append(begin + np.linspace(0, 1, steps + 1)[:, None] * (end - begin))
    places = np.concatenate(found) if found else points
    return np.unique(np.concatenate([np.floor(places), np.ceil(places)]).astype(np.int64), axis=0)


def _advice(why: PlanningError) -> str:
    text = str(why)
    if text == "no map yet":
        return "look what says map"
    if text == "no goal yet":
        return "publish goal_pose, or call the service explore"
    return "give another goal, or a smaller radius" if isinstance(why, NoWayError) else ""
