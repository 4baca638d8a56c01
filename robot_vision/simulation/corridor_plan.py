# SPDX-License-Identifier: Apache-2.0
"""Corridors seen from above: where walls, floor and lane of one lie follows from its settings alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation.corridor_parts import Palette, Wall, lamp_places
from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.furniture import BOX_SIZE
from robot_vision.simulation.scene import Quad, quad
from robot_vision.simulation.world import Lane, PolyLane, StraightLane


@dataclass(frozen=True)
class CorridorSettings:
    """Shape of the corridor, in metres, and what stands in it.

    Attributes:
        length: from the wall behind the start to the window at the end, along the middle.
        width: between the walls.
        height: of the ceiling.
        door_spacing: mean distance between doors in one wall; each lies somewhere else.
        turn: quarter turns to the left: 1 to the left, -1 to the right, 0 straight on.
        turn_after: where the middles of both legs meet, from the wall behind the start.
        narrow_at: middle of a narrowed entrance, from the wall behind the start; 0: there is none.
        narrow_width: between its jambs.
        box_at: middle of a person-sized box in the way, along the middle line; 0: there is none.
        box_offset: of the box, to the left of the middle line.
        bins: number of waste bins along the walls.
        chairs: number of chairs along the walls.
        crates: number of plain crates along the walls, each of another size and colour.
        disguised: number of crates along the walls that are clad with the very floor they stand on.
    """

    length: float = 24.0
    width: float = 2.0
    height: float = 2.6
    door_spacing: float = 3.4
    turn: float = 0.0
    turn_after: float = 10.0
    narrow_at: float = 0.0
    narrow_width: float = 1.2
    box_at: float = 0.0
    box_offset: float = 0.0
    bins: float = 0
    chairs: float = 0
    crates: float = 0
    disguised: float = 0

    def __post_init__(self) -> None:
        for name, low, high in (
            ("length", 4.0, 200.0),
            ("width", 1.0, 6.0),
            ("height", 2.2, 6.0),
            ("door_spacing", 1.6, 50.0),
        ):
            self._check(name, low, high, " m")
        if self.turn not in (-1, 0, 1):
            raise SimulationError(
                f"corridor: turn must be 1 (to the left), -1 (to the right) or 0, not {self.turn:g}"
            )
        if self.turn:
            self._check("turn_after", self.width + 2.0, self.length - self.width - 1.0, " m here")
        if self.narrow_at:
            end = self.turn_after - self.width / 2 if self.turn else self.length
            self._check("narrow_at", 2.0, end - 1.0, " m here")
            self._check("narrow_width", 0.7, self.width - 0.2, " m here")
        if self.box_at:
            self._check("box_at", max(2.5, self.length - 90.0), self.length - 1.0, " m here")
            side = (self.width - BOX_SIZE[1]) / 2
            self._check("box_offset", -side, side, " m here")
        for name in ("bins", "chairs", "crates", "disguised"):
            self._check(name, 0, 50, "")
            if getattr(self, name) != int(getattr(self, name)):
                raise SimulationError(f"corridor: {name} must be a whole number, not {getattr(self, name)}")

    def _check(self, name: str, low: float, high: float, unit: str) -> None:
        value = getattr(self, name)
        if not low <= value <= high:
            raise SimulationError(
                f"corridor: {name} must be between {low:g} and {high:g}{unit}, not {value:g}"
            )


@dataclass(frozen=True)
class BlockedSettings(CorridorSettings):
    """A corridor with a box in the way, 9 m from where the robot starts, and things along its walls."""

    length: float = 18.0
    box_at: float = 10.2
    bins: float = 4
    chairs: float = 1


class Leg(NamedTuple):
    """A straight part: its rectangle of floor begins at the middle `start` and leads along `direction`."""

    start: NDArray[np.float64]
    direction: NDArray[np.float64]
    length: float

    def floor_and_ceiling(self, width: float, height: float, palette: Palette) -> tuple[Quad, Quad]:
        """Both surfaces, without light."""
        along = self.length * np.append(self.direction, 0.0)
        across = width * np.array([-self.direction[1], self.direction[0], 0.0])
        middle = np.append(self.start, 0.0)
        ceiling = middle + across / 2 + (0.0, 0.0, height)
        return (
            quad(middle - across / 2, along, across, palette.floor, gloss=0.035),
            quad(ceiling, along, -across, palette.ceiling),
        )

    def lamps(self) -> NDArray[np.float64]:
        """Middles (N, 2) of its lamps, metres."""
        return np.asarray(self.start + lamp_places(self.length)[:, None] * self.direction)


class Plan(NamedTuple):
    """What a corridor looks like from above.

    Attributes:
        outline: (K, 2) of the floor, counter-clockwise, metres.
        legs: one, or two with a turn between them.
        lane: along the middle.
        walls: one a side of the outline, in its order.
        sides: numbers of the walls beside the way: those on the left, then those on the right.
        ahead: number of the wall with the window; the last one is behind the start.
    """

    outline: NDArray[np.float64]
    legs: tuple[Leg, ...]
    lane: Lane
    walls: tuple[Wall, ...]
    sides: tuple[int, ...]
    ahead: int


def plan_of(shape: CorridorSettings) -> Plan:
    """Where everything of a corridor lies; see `corridor` for its frame."""
    half, sign = shape.width / 2, float(shape.turn)
    if not sign:
        end = shape.length
        outline = np.array([(0.0, -half), (end, -half), (end, half), (0.0, half)])
        legs: tuple[Leg, ...] = (Leg(np.zeros(2), np.array([1.0, 0.0]), end),)
        return Plan(outline, legs, StraightLane(end, shape.width), _walls(outline, shape.height), (2, 0), 1)
    near, far = shape.turn_after - half, shape.turn_after + half
    end = sign * (shape.length - shape.turn_after)
    if sign > 0:
        corners = [(0.0, -half), (far, -half), (far, end), (near, end), (near, half), (0.0, half)]
    else:
        corners = [(0.0, -half), (near, -half), (near, end), (far, end), (far, half), (0.0, half)]
    outline = np.array(corners)
    legs = (
        Leg(np.zeros(2), np.array([1.0, 0.0]), far),
        Leg(np.array([shape.turn_after, sign * half]), np.array([0.0, sign]), abs(end) - half),
    )
    lane = PolyLane(_middle(shape.turn_after, end, half, sign), shape.width)
    return Plan(outline, legs, lane, _walls(outline, shape.height), (4, 3, 0, 1), 2)


def _middle(corner: float, end: float, radius: float, sign: float) -> NDArray[np.float64]:
    """Points (N, 2) along the middle of both legs, about the inner corner at half a width from it."""
    before, after = (np.linspace(0, 1, int(np.ceil(way / 0.3)) + 1) for way in (corner, abs(end)))
    angle = np.linspace(0, np.pi / 2, 8)
    start = corner - radius
    first = np.column_stack([start * before[:-1], np.zeros(len(before) - 1)])
    bend = np.column_stack([start + radius * np.sin(angle), sign * radius * (1 - np.cos(angle))])
    second = np.column_stack(
        [np.full(len(after) - 1, corner), sign * (radius + (abs(end) - radius) * after[1:])]
    )
    return np.vstack([first, bend, second])


def _walls(outline: NDArray[np.float64], height: float) -> tuple[Wall, ...]:
    """One wall along each side of the floor; their right hand, seen from inside, is against its order."""
    walls = []
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        length = float(np.linalg.norm(b - a))
        walls.append(Wall(np.append(b, 0.0), np.append((a - b) / length, 0.0), height, length))
    return tuple(walls)
