# SPDX-License-Identifier: Apache-2.0
"""Mazes to drive through, from any maze file or grown from a seed, at the size of mice and at that of rooms."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from itertools import groupby
from math import radians

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.planning import Maze, MazeError
from robot_vision.simulation.drive import FollowSettings
from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.maze_hall import Look, contest_look, hall, room_look
from robot_vision.simulation.scene import Quad, Scene, box, quad
from robot_vision.simulation.shadow_map import ShadowMap
from robot_vision.simulation.world import PolyLane, SceneObject, StartPose, World

Cell = tuple[int, int]

WALL_HEIGHT, WALL_THICKNESS = 0.05 / 0.18, 0.012 / 0.18
"""In cells, as the rules of micromouse contests have them: 18 cm cells, walls 5 cm high and 12 mm thick."""
EYE_HEIGHT, EYE_AHEAD, EYE_PITCH = 0.06 / 0.18, 0.02 / 0.18, radians(15.0)
"""Of the camera: cells above the floor, cells ahead of the robot's middle, radians downwards."""
ROOM_CELL_M = 0.5
"""Cells from this size on look like a room's, smaller ones like a contest's."""
SUN_ELEVATION, SUN_AZIMUTH = radians(50.0), radians(62.0)
"""Where the light of the hall's windows comes from."""
SHADE = 0.45
"""Share of the light that a shadow takes away."""


@dataclass(frozen=True)
class MazeSettings:
    """Which maze, and how large it is built.

    Attributes:
        file: drawing of the maze in either text format (see `robot_vision.planning.Maze`); "": grown from
            the seed. Walls the drawing leaves unknown are left out.
        rows: cells from south to north of a maze that is grown.
        columns: cells from west to east of a maze that is grown.
        loops: share of the walls that are taken out again after growing, so that there is more than one way.
        cell: side of a cell, metres; the walls, the robot and its camera are in proportion. From 0.5 m on
            it is a maze for robots that walk among people, below it one for mice.
    """

    file: str = ""
    rows: int = 8
    columns: int = 8
    loops: float = 0.12
    cell: float = 0.18

    def __post_init__(self) -> None:
        for name, low, high, unit in (
            ("rows", 2, 64, ""),
            ("columns", 2, 64, ""),
            ("loops", 0.0, 1.0, ""),
            ("cell", 0.06, 5.0, " m"),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise SimulationError(f"maze: {name} must be between {low} and {high}{unit}, not {value}")
        for name in ("rows", "columns"):
            if getattr(self, name) != int(getattr(self, name)):
                raise SimulationError(f"maze: {name} must be a whole number, not {getattr(self, name)}")


def maze(settings: MazeSettings | None = None, seed: int = 0) -> World:
    """Build a maze; the same settings and seed give the same one.

    Its frame has x to the east (columns), y to the north (rows), z up, and its origin on the floor where the
    outer walls' middle lines meet in the south-west. The lane leads from the start to the nearest goal, or
    as far as one gets if no goal can be reached.

    Raises:
        SimulationError: the file cannot be read or is no maze.
    """
    shape = settings or MazeSettings()
    if shape.file:
        try:
            plan = Maze.read(shape.file)
        except MazeError as error:
            raise SimulationError(f"maze: {error}") from error
    else:
        plan = grown(int(shape.rows), int(shape.columns), shape.loops, seed)
    return maze_world(plan, shape.cell, seed)


def maze_world(plan: Maze, cell: float = 0.18, seed: int = 0) -> World:
    """Build a given maze with cells of `cell` metres; see `maze`."""
    random = np.random.default_rng((seed, 1))
    look = (room_look if cell >= ROOM_CELL_M else contest_look)(random, cell, WALL_HEIGHT * cell)
    runs = _runs(plan, cell)
    height, half = WALL_HEIGHT * cell, WALL_THICKNESS * cell / 2
    rows, columns = plan.size
    shadows = tuple(_shadow(run, height) for run in runs)
    light = _Light(shadows, (columns * cell, rows * cell), cell, height)
    walls = [face for run in runs for face in _wall(run, height, half, look)]
    spacing = cell / 16
    quads = [item.lit(light, spacing if item.normal[2] < 0.5 else cell) for item in walls]
    ground = quad(
        (-half, -half, 0.0),
        (columns * cell + 2 * half, 0, 0),
        (0, rows * cell + 2 * half, 0),
        look.floor,
        (-half, -half),
    )
    quads += [ground.lit(light, spacing), *hall(random, look, (columns * cell, rows * cell), cell)]
    way = _way(plan)
    ahead = np.subtract(way[1], way[0]) if len(way) > 1 else np.array([1, 0])
    start = StartPose(*_middle(way[0], cell), float(np.arctan2(ahead[0], ahead[1])))
    return World(
        "maze",
        Scene(tuple(quads)),
        "corridor",
        _lane(way, cell),
        objects=tuple(
            SceneObject(f"wall {number + 1}", run, height, "wall") for number, run in enumerate(runs)
        ),
        shadows=shadows,
        floor=(np.array([(0, 0), (columns, 0), (columns, rows), (0, rows)]) * cell,),
        start=start,
        camera=Camera(
            460.0,
            460.0,
            319.5,
            239.5,
            640,
            480,
            height_m=EYE_HEIGHT * cell,
            pitch=EYE_PITCH,
            x_m=EYE_AHEAD * cell,
        ),
        drive=FollowSettings(
            speed=min(1.0 * cell, 0.8),
            sway=0.03 * cell,
            wavelength=max(6 * cell, 0.2),
            start=0.0,
            end=0.1 * cell,
            shake=radians(0.25),
        ),
        resolution=cell / 36,
        robot_width=0.45 * cell,
        robot_length=0.55 * cell,
    )


def grown(rows: int, columns: int, loops: float, seed: int) -> Maze:
    """A maze after the customs of contests: start in the south-west, open to the north only; goal in the middle.

    Passages grow depth first from the start; then a share of the walls goes, so that there are loops.

    Args:
        rows: 2 or more.
        columns: 2 or more.
        loops: share of the walls left after growing that is taken out.
        seed: the same one gives the same maze.
    """
    random = np.random.default_rng((seed, 11))
    east, north = np.ones((rows, columns), np.bool_), np.ones((rows, columns), np.bool_)
    north[0, 0] = False
    seen = {(0, 0), (1, 0)}
    trail = [(1, 0)]
    while trail:
        here = trail[-1]
        fresh = [cell for cell in _beside(here, (rows, columns)) if cell not in seen]
        if not fresh:
            trail.pop()
            continue
        there = fresh[int(random.integers(len(fresh)))]
        _open(east, north, here, there)
        seen.add(there)
        trail.append(there)
    goals = _goals(rows, columns)
    for goal in goals:
        for other in goals:
            if abs(goal[0] - other[0]) + abs(goal[1] - other[1]) == 1:
                _open(east, north, goal, other)
    removable = random.random((2, rows, columns)) >= loops
    removable[0, :, -1] = removable[1, -1] = removable[0, 0, 0] = True  # outer walls, and the start's
    return Maze(east & removable[0], north & removable[1], (0, 0), goals)


def _goals(rows: int, columns: int) -> tuple[Cell, ...]:
    """The four cells in the middle; in a maze too small for that the far corner."""
    if min(rows, columns) < 4:
        return ((rows - 1, columns - 1),)
    middle = [(rows // 2 - down, columns // 2 - left) for down in (1, 0) for left in (1, 0)]
    return tuple(middle)


def _beside(cell: Cell, size: Cell) -> list[Cell]:
    steps = ((1, 0), (0, 1), (-1, 0), (0, -1))
    around = [(cell[0] + down, cell[1] + right) for down, right in steps]
    return [(r, c) for r, c in around if 0 <= r < size[0] and 0 <= c < size[1]]


def _open(east: NDArray[np.bool_], north: NDArray[np.bool_], a: Cell, b: Cell) -> None:
    """Take out the wall between two neighbours."""
    low = min(a, b)
    (north if a[1] == b[1] else east)[low] = False


def _way(plan: Maze) -> list[Cell]:
    """Cells of a shortest way from the start to the nearest goal, or to the farthest cell there is a way to."""
    came: dict[Cell, Cell | None] = {plan.start: None}
    queue = deque([plan.start])
    last = plan.start
    while queue:
        last = queue.popleft()
        if last in plan.goals:
            break
        for cell in _beside(last, plan.size):
            low = min(last, cell)
            wall = (plan.walls_north if cell[1] == last[1] else plan.walls_east)[low]
            if not wall and cell not in came:
                came[cell] = last
                queue.append(cell)
    way: list[Cell] = []
    step: Cell | None = last
    while step is not None:
        way.append(step)
        step = came[step]
    return way[::-1]


def _lane(way: list[Cell], cell: float) -> PolyLane | None:
    """Along the middles of the cells, bends rounded to quarter circles through the middles of their sides."""
    if len(way) < 2:
        return None
    middles = [np.array(_middle(place, cell)) for place in way]
    points = [middles[0]]
    for before, here, after in zip(middles, middles[1:], middles[2:], strict=False):
        entry, leave = (before + here) / 2, (here + after) / 2
        if np.allclose(leave - here, here - entry):
            points += [entry + share * (leave - entry) for share in np.arange(8) / 8]
            continue
        centre = entry + leave - here
        angles = np.pi / 2 * np.arange(8) / 8
        points += [centre + np.cos(a) * (entry - centre) + np.sin(a) * (leave - centre) for a in angles]
    points += [(middles[-2] + middles[-1]) / 2, middles[-1]]
    return PolyLane(np.array(points), cell * (1 - WALL_THICKNESS))


def _middle(place: Cell, cell: float) -> tuple[float, float]:
    return (place[1] + 0.5) * cell, (place[0] + 0.5) * cell


def _runs(plan: Maze, cell: float) -> list[NDArray[np.float64]]:
    """Footprints (4, 2) of straight walls, as long as they go on, posts at both ends included."""
    half = WALL_THICKNESS / 2
    found = []
    for axis, walls in ((0, plan.across), (1, plan.upright.T)):
        for line, row in enumerate(walls):
            at = 0
            for stands, group in groupby(row):
                length = len(list(group))
                if stands:
                    low, high = (at - half, line - half), (at + length + half, line + half)
                    corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
                    found.append(cell * (corners if axis == 0 else corners[[0, 3, 2, 1]][:, ::-1]))
                at += length
    return found


def _wall(run: NDArray[np.float64], height: float, half: float, look: Look) -> list[Quad]:
    """A wall with white sides, posts at every cell, and a coloured top."""
    low, high = (*run.min(axis=0), 0.0), (*run.max(axis=0), height)
    sides = box(low, high, look.wall, without="-z +z")
    (x0, y0, _), (x1, y1, _) = low, high
    top = quad((x0, y0, height), (x1 - x0, 0, 0), (0, y1 - y0, 0), look.top)
    return [*(Quad(s.origin, s.first, s.second, s.texture, (-half, 0.0)) for s in sides), top]


def _shadow(run: NDArray[np.float64], height: float) -> NDArray[np.float64]:
    """Outline of the shadow of a wall on the floor, the wall's own footprint included."""
    away = -np.array([np.cos(SUN_AZIMUTH), np.sin(SUN_AZIMUTH)]) * height / np.tan(SUN_ELEVATION)
    corners = np.concatenate([run, run + away]).astype(np.float32)
    return np.asarray(cv2.convexHull(corners)[:, 0], np.float64)


class _Light:
    """Daylight from high windows on one side and lamps above: shadows on the floor, walls darker at their foot.

    Args:
        shadows: outlines on the floor, metres.
        size: of the maze from west to east and from south to north, metres.
        cell: metres.
        height: of the walls, metres.
    """

    def __init__(
        self, shadows: tuple[NDArray[np.float64], ...], size: tuple[float, float], cell: float, height: float
    ) -> None:
        self._height = height
        edges = np.array([-cell / 2, -cell / 2]), np.asarray(size) + cell / 2
        self._shadows = ShadowMap(shadows, *edges, cell / 48, cell / 32)
        self._corners = ShadowMap(shadows, *edges, cell / 48, cell / 10)

    def __call__(self, points: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Light (N, 3) on points (N, 3) of a surface with a unit normal (3,)."""
        sun = np.array([np.cos(SUN_AZIMUTH), np.sin(SUN_AZIMUTH)])
        if normal[2] < 0.5:
            rise = np.clip(points[:, 2] / self._height, 0.0, 1.0)
            value = (0.62 + 0.15 * float(normal[:2] @ sun)) * (0.72 + 0.28 * np.sqrt(rise))
        elif points[0, 2] > 0:
            value = np.full(len(points), 1.05)
        else:
            value = 1 - SHADE * self._shadows.share(points) - 0.25 * self._corners.share(points)
        return np.asarray(value[:, None] * np.array([0.98, 1.0, 1.01]))
