# SPDX-License-Identifier: Apache-2.0
"""The true plan of a floor: as a grid of what is free, and as the room a robot has to all sides."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.world import World

FREE, OCCUPIED, UNKNOWN = 0, 100, -1
MOST_CELLS = 4_000_000
"""A message with more is of no use to anybody; plans of larger worlds are coarser by powers of two."""
_FINE = 4
"""An object takes a cell when it covers a quarter of it: thin walls do, touching corners do not."""


@dataclass(frozen=True, eq=False)
class Plan:
    """Cells of a floor, row 0 at the smallest y, column 0 at the smallest x.

    Attributes:
        cells: (rows, columns) int8, as nav_msgs/OccupancyGrid has them.
        resolution: side of a cell, metres.
        origin: x, y of the corner of cell (0, 0) in the world, metres.
    """

    cells: NDArray[np.int8]
    resolution: float
    origin: tuple[float, float]


def occupancy(world: World) -> Plan:
    """The plan of a world: 0 free floor, 100 objects and walls, -1 elsewhere.

    Raises:
        SimulationError: the world has no floor.
    """
    plan = _empty(world, UNKNOWN)
    for outline in world.floor:
        _paint(plan, outline, FREE)
    for item in world.objects:
        _paint(plan, item.footprint, OCCUPIED, _FINE)
    return plan


def shadows(world: World) -> Plan:
    """Where shadows lie on the free floor of a world: 100 in shadow, 0 in light, -1 no free floor.

    Raises:
        SimulationError: the world has no floor.
    """
    plan = occupancy(world)
    free = plan.cells == FREE
    for outline in world.shadows:
        _paint(plan, outline, OCCUPIED)
    plan.cells[~free] = UNKNOWN
    return plan


def _empty(world: World, value: int) -> Plan:
    if not world.floor:
        raise SimulationError(f"{world.name}: it says nothing of its floor, so there is no plan of it")
    corners = np.concatenate([*world.floor, *(item.footprint for item in world.objects)])
    low, high = corners.min(axis=0), corners.max(axis=0)
    resolution = world.resolution
    while np.prod((high - low) / resolution + 1) > MOST_CELLS:
        resolution *= 2
    first = np.floor(np.round(low / resolution, 6))
    columns, rows = (np.ceil(np.round(high / resolution, 6)) - first).astype(int)
    origin = (float(first[0] * resolution), float(first[1] * resolution))
    return Plan(np.full((max(rows, 1), max(columns, 1)), value, np.int8), resolution, origin)


def _paint(plan: Plan, outline: NDArray[np.float64], value: int, fine: int = 1) -> None:
    """Set the cells of which an outline covers 1 / `fine` or more; with 1 those whose centre is inside."""
    corners = (outline - plan.origin) / plan.resolution
    shape = np.array(plan.cells.shape)[::-1]
    low = np.clip(np.floor(corners.min(axis=0)).astype(int), 0, shape)
    high = np.clip(np.ceil(corners.max(axis=0)).astype(int) + 1, 0, shape)
    if (high <= low).any():
        return
    columns, rows = high - low
    inside = _filled((corners - low) * fine, int(rows) * fine, int(columns) * fine)
    covered = inside.reshape(rows, fine, columns, fine).sum(axis=(1, 3)) >= fine
    plan.cells[low[1] : high[1], low[0] : high[0]][covered] = value


def _filled(corners: NDArray[np.float64], rows: int, columns: int) -> NDArray[np.bool_]:
    """Which cell centres (rows, columns) lie inside an outline (K, 2) in cells, by the even-odd rule.

    Each side toggles, in every row it crosses, all cells to the right of the crossing.
    """
    toggles = np.zeros((rows, columns + 1), np.uint8)
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if y0 > y1:
            x0, y0, x1, y1 = x1, y1, x0, y0
        crossed = np.arange(max(int(np.ceil(y0 - 0.5)), 0), min(int(np.ceil(y1 - 0.5)), rows))
        if len(crossed) == 0:
            continue
        places = x0 + (crossed + 0.5 - y0) / (y1 - y0) * (x1 - x0)
        toggles[crossed, np.clip(np.ceil(places - 0.5), 0, columns).astype(int)] ^= 1
    return np.asarray(np.bitwise_xor.accumulate(toggles, axis=1)[:, :columns].astype(bool))


@dataclass(frozen=True)
class Room:
    """The room about a robot: metres to the nearest object (0: it is touched) and the name of that."""

    clearance: float
    nearest: str


class Surroundings:
    """Measures how far a robot's footprint is from the objects of a world.

    Args:
        world: whose objects matter.
        width: of the footprint, metres.
        length: of the footprint, metres; base_link is its middle.

    Raises:
        SimulationError: a footprint without extent.
    """

    def __init__(self, world: World, width: float | None = None, length: float | None = None) -> None:
        width = world.robot_width if width is None else width
        length = world.robot_length if length is None else length
        if not (0 < width < np.inf and 0 < length < np.inf):
            raise SimulationError(f"robot: width and length must be positive, not {width} and {length} m")
        self._half = np.array([length / 2, width / 2])
        self._names = [item.name for item in world.objects]
        self._outlines = [item.footprint for item in world.objects]
        self._starts = _stacked(self._outlines)
        self._ends = _stacked(np.roll(outline, -1, axis=0) for outline in self._outlines)
        self._owner = np.repeat(np.arange(len(self._names)), [len(outline) for outline in self._outlines])

    def at(self, x: float, y: float, yaw: float) -> Room:
        """The room about a robot at x, y (m), yaw (rad); infinite where nothing stands."""
        if not self._names:
            return Room(np.inf, "nothing")
        cos, sin = np.cos(yaw), np.sin(yaw)
        into_robot = np.array([[cos, -sin], [sin, cos]])
        starts = (self._starts - (x, y)) @ into_robot
        ends = (self._ends - (x, y)) @ into_robot
        around = _holds_origin(starts, ends, self._owner, len(self._names))
        if around.any():
            return Room(0.0, self._names[int(around.argmax())])
        distances = self._distances(starts, ends)
        nearest = int(distances.argmin())
        return Room(float(distances[nearest]), self._names[self._owner[nearest]])

    def _distances(self, starts: NDArray[np.float64], ends: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distances (N,) between sides in the robot's frame and its footprint; 0 where they meet."""
        half = self._half
        beyond = np.maximum(np.abs(starts) - half, 0.0)
        distances = np.hypot(beyond[:, 0], beyond[:, 1])
        corners = half * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])
        sides = ends - starts
        squares = np.maximum((sides**2).sum(axis=1), 1e-18)
        for corner in corners:
            shares = np.clip(((corner - starts) * sides).sum(axis=1) / squares, 0.0, 1.0)
            away = starts + shares[:, None] * sides - corner
            distances = np.minimum(distances, np.hypot(away[:, 0], away[:, 1]))
        distances[_enters(starts, sides, half)] = 0.0
        return np.asarray(distances)


def _enters(
    starts: NDArray[np.float64], sides: NDArray[np.float64], half: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Which segments (N,) pass through the rectangle of half extents (2,) about the origin, by slabs."""
    safe = np.where(np.abs(sides) < 1e-12, 1e-12, sides)
    first, second = (-half - starts) / safe, (half - starts) / safe
    enter = np.minimum(first, second).max(axis=1)
    leave = np.maximum(first, second).min(axis=1)
    return np.asarray((enter <= leave) & (enter <= 1.0) & (leave >= 0.0))


def _holds_origin(
    starts: NDArray[np.float64], ends: NDArray[np.float64], owner: NDArray[np.int64], count: int
) -> NDArray[np.bool_]:
    """Which outlines (count,) hold the origin: their sides cross the positive x axis an odd number of times."""
    crossing = (starts[:, 1] > 0) != (ends[:, 1] > 0)
    rise = np.where(crossing, ends[:, 1] - starts[:, 1], 1.0)
    ahead = starts[:, 0] - starts[:, 1] * (ends[:, 0] - starts[:, 0]) / rise > 0
    return np.asarray(np.bincount(owner, weights=crossing & ahead, minlength=count) % 2 == 1)


def _stacked(outlines: Iterable[NDArray[np.float64]]) -> NDArray[np.float64]:
    return np.concatenate([np.zeros((0, 2)), *outlines])
