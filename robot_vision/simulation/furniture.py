# SPDX-License-Identifier: Apache-2.0
"""Things that stand about: a robot must see them, stop before them and find its way around them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_vision.simulation import materials
from robot_vision.simulation.scene import Illumination, Quad, box, cylinder, disc
from robot_vision.simulation.texture import Texture
from robot_vision.simulation.world import SceneObject


class Solid(NamedTuple):
    """An upright part of a thing: what lies over a convex outline (K, 2) from `low` to `high` (m)."""

    outline: NDArray[np.float64]
    low: float
    high: float


class Piece(NamedTuple):
    """A thing that stands about.

    Attributes:
        thing: what is true of it.
        quads: what is seen of it.
        solids: the parts that cast its shadow.
    """

    thing: SceneObject
    quads: list[Quad]
    solids: tuple[Solid, ...] = ()


BOX_SIZE = (0.4, 0.5, 1.7)
"""Depth, width, height (m) of the box that is as large as a person."""
CHAIR_SIDE, SEAT_HEIGHT, CHAIR_HEIGHT = 0.44, 0.45, 0.86
BIN_RADIUS, BIN_HEIGHT = 0.15, 0.38
PILLAR_RADIUS, PILLAR_HEIGHT, PLINTH_SIDE, PLINTH_HEIGHT = 0.20, 2.6, 0.52, 0.22
BOLLARD_RADIUS, BOLLARD_HEIGHT = 0.08, 0.90
LITTER_BIN_RADIUS, LITTER_BIN_HEIGHT = 0.22, 0.95


@dataclass(frozen=True)
class Place:
    """Where a thing stands and which way it looks: x, y (m), yaw (rad) in the world."""

    x: float
    y: float
    yaw: float = 0.0

    @property
    def rotation(self) -> NDArray[np.float64]:
        """From the thing's own directions into the world's, (3, 3)."""
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])

    def put(self, quads: Sequence[Quad]) -> list[Quad]:
        """Rectangles made about the origin, brought here."""
        turn, shift = self.rotation, np.array([self.x, self.y, 0.0])
        return [
            replace(
                q,
                origin=turn @ q.origin + shift,
                first=turn @ q.first,
                second=turn @ q.second,
                rounding=None if q.rounding is None else q.rounding @ turn.T,
            )
            for q in quads
        ]

    def outline(self, corners: ArrayLike) -> NDArray[np.float64]:
        """Corners (K, 2) made about the origin, brought here."""
        return np.asarray(np.asarray(corners, np.float64) @ self.rotation[:2, :2].T + (self.x, self.y))


def rectangle(depth: float, width: float) -> NDArray[np.float64]:
    """Corners (4, 2) about the origin, counter-clockwise, depth along x and width along y (m)."""
    return np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]) * (depth / 2, width / 2)


def circle(radius: float, count: int = 24) -> NDArray[np.float64]:
    """Corners (count, 2) of the regular polygon about the origin whose area is that of the circle (m)."""
    angle = 2 * np.pi * np.arange(count) / count
    reach = radius * math.sqrt((2 * math.pi / count) / math.sin(2 * math.pi / count))
    return np.column_stack([reach * np.cos(angle), reach * np.sin(angle)])


def person_sized_box(random: np.random.Generator, place: Place, name: str = "box") -> Piece:
    """A wardrobe carton of 0.5 x 0.4 x 1.7 m, taped, with a label and arrows that say which side is up."""
    depth, width, height = BOX_SIZE
    front, side = (carton(random, (w, height)) for w in (width, depth))
    lid = Texture.plain(materials.linear(196, 165, 124))
    low, high = (-depth / 2, -width / 2, 0.0), (depth / 2, width / 2, height)
    quads = [
        *box(low, high, front, without="-y +y -z +z"),
        *box(low, high, side, without="-x +x -z +z"),
        *box(low, high, lid, without="-x +x -y +y -z"),
    ]
    return Piece(SceneObject(name, place.outline(rectangle(depth, width)), height), place.put(quads))


def carton(random: np.random.Generator, size: tuple[float, float]) -> Texture:
    """One side of a cardboard box of `size` metres (width, height); row 0 is its lower border."""
    per_metre = 250
    columns, rows = (int(side * per_metre) for side in size)
    flutes = materials.grain(random, (rows, columns), (60, 2))
    clouds = materials.grain(random, (rows, columns), (60, 60))
    picture = materials.tinted(materials.linear(196, 165, 124), 1 + 0.015 * flutes + 0.04 * clouds)
    tape = int(0.025 * per_metre)
    picture[:, columns // 2 - tape : columns // 2 + tape] = materials.linear(214, 190, 146)
    picture[:, columns // 2 - 1 : columns // 2 + 1] *= np.float32(0.75)
    for edge in (picture[:3], picture[-3:], picture[:, :2], picture[:, -2:]):
        edge *= np.float32(0.55)
    print_ = np.zeros((rows, columns), np.uint8)  # row 0 above, as it is read
    x, y = columns // 2, int(0.30 * rows)
    for shift in (-columns // 4, columns // 4):
        cv2.arrowedLine(print_, (x + shift, y + 40), (x + shift, y - 40), 255, 6, cv2.LINE_AA, tipLength=0.35)
    cv2.rectangle(print_, (x - columns // 3, y + 56), (x + columns // 3, y + 64), 255, -1)
    cv2.putText(print_, "THIS SIDE UP", (x - 44, y + 90), cv2.FONT_HERSHEY_SIMPLEX, 0.42, 255, 1, cv2.LINE_AA)
    ink = print_[::-1, :, None].astype(np.float32) / 255
    picture *= 1 - np.float32(0.85) * ink
    label = (
        slice(int(0.38 * rows), int(0.38 * rows) + 34),
        slice(int(0.60 * columns), int(0.60 * columns) + 40),
    )
    picture[label] = 0.80
    for row in range(label[0].start + 5, label[0].stop - 4, 6):
        picture[row : row + 2, label[1].start + 4 : label[1].stop - 8] = 0.15
    return Texture(np.ascontiguousarray(picture, np.float32), size, repeat=False)


def waste_bin(random: np.random.Generator, place: Place, name: str = "waste bin") -> Piece:
    """A round open paper bin with a rim, a light bag folded over it and paper inside."""
    colour = ((62, 66, 72), (58, 84, 118), (150, 152, 156))[int(random.integers(3))]
    body = Texture.plain(materials.linear(*colour))
    bag = Texture.plain(materials.linear(222, 222, 216))
    shade = materials.grain(random, (32, 32), (5, 5))
    paper = Texture(materials.tinted(materials.linear(196, 194, 186), 1 + 0.25 * shade), (0.2, 0.2))
    rim = BIN_HEIGHT - 0.05
    quads = [
        *cylinder((0, 0, 0), (0, 0, rim), BIN_RADIUS, body),
        *(replace(q, both_sides=True) for q in cylinder((0, 0, rim), (0, 0, 0.05), BIN_RADIUS + 0.004, bag)),
        disc((0, 0, rim - 0.01), BIN_RADIUS, paper),
    ]
    return Piece(SceneObject(name, place.outline(circle(BIN_RADIUS + 0.004)), BIN_HEIGHT), place.put(quads))


def chair(random: np.random.Generator, place: Place, name: str = "chair") -> Piece:
    """A visitors' chair that looks along its place's yaw: four steel legs, a seat, a back on two posts."""
    colour = ((150, 58, 48), (54, 82, 120), (176, 132, 84))[int(random.integers(3))]
    shell = materials.wood(random, materials.linear(*colour), (CHAIR_SIDE, CHAIR_SIDE))
    blue, green, red = materials.linear(*colour)
    edge = Texture.plain((0.6 * blue, 0.6 * green, 0.6 * red))
    steel = Texture.plain(materials.linear(120, 122, 126))
    half, leg = CHAIR_SIDE / 2, 0.024
    quads: list[Quad] = []
    for x in (-half, half - leg):
        for y in (-half, half - leg):
            top = CHAIR_HEIGHT - 0.04 if x < 0 else SEAT_HEIGHT
            quads += box((x, y, 0.0), (x + leg, y + leg, top), steel, without="-z")
    seat = (-half, -half, SEAT_HEIGHT - 0.03), (half, half, SEAT_HEIGHT)
    back = (-half + leg, -half, SEAT_HEIGHT + 0.10), (-half + leg + 0.018, half, CHAIR_HEIGHT)
    quads += [*box(*seat, shell, without="-x +x -y +y -z"), *box(*seat, edge, without="+z")]
    quads += [*box(*back, shell, without="-y +y -z +z"), *box(*back, edge, without="-x +x")]
    for y in (-half + 0.004, half - leg + 0.004):  # rails under the seat
        quads += box((-half, y, 0.18), (half, y + 0.016, 0.196), steel)
    return Piece(
        SceneObject(name, place.outline(rectangle(CHAIR_SIDE, CHAIR_SIDE)), CHAIR_HEIGHT), place.put(quads)
    )


def crate(
    random: np.random.Generator, place: Place, name: str = "crate", cladding: Texture | None = None
) -> Piece:
    """A box with bare sides, 0.2 to 0.5 m high and as wide as a waste bin, dark, light, coloured or clad.

    One that is clad is 0.3 m high or more: what looks like its floor is seen by its motion, which needs height.
    """
    colours = ((66, 66, 68), (212, 208, 198), (58, 96, 74), (146, 84, 60), (96, 88, 128))
    colour = colours[int(random.integers(len(colours)))]
    lowest = 0.2 if cladding is None else 0.3
    height, half = float(random.uniform(lowest, 0.5)), BIN_RADIUS
    sides = cladding or Texture.plain(materials.linear(*colour))
    quads = box((-half, -half, 0.0), (half, half, height), sides, without="-z")
    thing = SceneObject(name, place.outline(rectangle(2 * half, 2 * half)), height)
    return Piece(thing, place.put(quads))


def pillar(stone: Texture, place: Place, name: str = "pillar", ground: float = 0.0) -> Piece:
    """A round column of stone on a square plinth, with a square slab on top; `ground` is the height it stands at."""
    half, top = PLINTH_SIDE / 2, PILLAR_HEIGHT - 0.14
    quads = [
        *box((-half, -half, ground), (half, half, PLINTH_HEIGHT), stone, without="-z"),
        *cylinder((0, 0, PLINTH_HEIGHT), (0, 0, top - PLINTH_HEIGHT), PILLAR_RADIUS, stone),
        *cylinder((0, 0, top - 0.09), (0, 0, 0.09), PILLAR_RADIUS + 0.03, stone),
        *box((-half, -half, top), (half, half, PILLAR_HEIGHT), stone),
    ]
    outline = place.outline(rectangle(PLINTH_SIDE, PLINTH_SIDE))
    solids = (
        Solid(outline, ground, PLINTH_HEIGHT),
        Solid(place.outline(circle(PILLAR_RADIUS)), PLINTH_HEIGHT, top),
        Solid(place.outline(circle(PILLAR_RADIUS + 0.03)), top - 0.09, top),
        Solid(outline, top, PILLAR_HEIGHT),
    )
    return Piece(SceneObject(name, outline, PILLAR_HEIGHT), place.put(quads), solids)


def bollard(place: Place, name: str = "bollard") -> Piece:
    """A round post of dark iron with two white bands and a cap."""
    iron, white = (Texture.plain(materials.linear(*c)) for c in ((52, 56, 60), (224, 224, 218)))
    quads = [
        *cylinder((0, 0, 0), (0, 0, 0.10), BOLLARD_RADIUS + 0.02, iron, top=iron),
        *cylinder((0, 0, 0.10), (0, 0, BOLLARD_HEIGHT - 0.14), BOLLARD_RADIUS, iron),
        *cylinder((0, 0, BOLLARD_HEIGHT - 0.04), (0, 0, 0.04), BOLLARD_RADIUS + 0.015, iron, top=iron),
    ]
    for height in (0.60, 0.72):
        quads += cylinder((0, 0, height), (0, 0, 0.06), BOLLARD_RADIUS + 0.003, white)
    outline = place.outline(circle(BOLLARD_RADIUS + 0.02))
    solids = (
        Solid(outline, 0.0, 0.10),
        Solid(place.outline(circle(BOLLARD_RADIUS)), 0.10, BOLLARD_HEIGHT),
        Solid(place.outline(circle(BOLLARD_RADIUS + 0.015)), BOLLARD_HEIGHT - 0.04, BOLLARD_HEIGHT),
    )
    return Piece(SceneObject(name, outline, BOLLARD_HEIGHT), place.put(quads), solids)


def litter_bin(random: np.random.Generator, place: Place, name: str = "litter bin") -> Piece:
    """A park bin: wooden slats around a drum, steel hoops, and a lid on posts above the opening."""
    slats = _slats(random, 2 * math.pi * LITTER_BIN_RADIUS)
    steel, dark = (Texture.plain(materials.linear(*c)) for c in ((70, 76, 74), (16, 16, 16)))
    lip = LITTER_BIN_HEIGHT - 0.20
    quads = [
        *cylinder((0, 0, 0.06), (0, 0, lip - 0.06), LITTER_BIN_RADIUS, slats),
        *cylinder((0, 0, 0), (0, 0, 0.06), LITTER_BIN_RADIUS - 0.05, steel),
        disc((0, 0, lip), LITTER_BIN_RADIUS, dark),
        *cylinder((0, 0, lip + 0.15), (0, 0, 0.05), LITTER_BIN_RADIUS + 0.02, steel, top=steel, bottom=dark),
    ]
    for height in (0.12, lip - 0.05):
        quads += cylinder((0, 0, height), (0, 0, 0.04), LITTER_BIN_RADIUS + 0.005, steel)
    for angle in np.pi / 4 * np.array([1, 3, 5, 7]):
        x, y = (LITTER_BIN_RADIUS - 0.02) * np.cos(angle), (LITTER_BIN_RADIUS - 0.02) * np.sin(angle)
        quads += box((x - 0.012, y - 0.012, lip), (x + 0.012, y + 0.012, lip + 0.15), steel, without="-z +z")
    outline = place.outline(circle(LITTER_BIN_RADIUS + 0.02))
    lid = lip + 0.15
    solids = (
        Solid(place.outline(circle(LITTER_BIN_RADIUS)), 0.06, lip),
        Solid(outline, lid, lid + 0.05),
    )
    return Piece(SceneObject(name, outline, LITTER_BIN_HEIGHT), place.put(quads), solids)


def _slats(random: np.random.Generator, around: float, count: int = 16) -> Texture:
    """Upright wooden slats with dark gaps, `count` of them in `around` metres."""
    columns = 32 * count
    shade = np.repeat(1 + 0.10 * random.standard_normal(count), 32)
    value = shade + 0.10 * materials.grain(random, (64, columns), (40, 2))
    picture = materials.tinted(materials.linear(128, 88, 56), value)
    picture[:, np.arange(columns) % 32 < 4] = 0.02
    return Texture(picture, (around, 1.0))


@dataclass(frozen=True, eq=False)
class ContactShade:
    """Light that things take from the floor close about them, so that they are seen to stand on it.

    Attributes:
        light: without them.
        footprints: (K, 2) outlines, metres.
        reach: metres over which the shade fades by a factor of e.
        depth: share of the light taken at the outline.
    """

    light: Illumination
    footprints: tuple[NDArray[np.float64], ...]
    reach: float = 0.10
    depth: float = 0.55

    def __call__(self, points: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Light (N, 3) on points (N, 3) of a surface with a unit normal (3,), linear blue, green, red."""
        shade = np.ones(len(points))
        for footprint in self.footprints:
            outline = footprint.astype(np.float32)
            low, high = footprint.min(axis=0) - 6 * self.reach, footprint.max(axis=0) + 6 * self.reach
            near = np.flatnonzero(((points[:, :2] > low) & (points[:, :2] < high)).all(axis=1))
            for index in near:
                x, y = (float(part) for part in points[index, :2])
                out = -cv2.pointPolygonTest(outline, (x, y), True)
                shade[index] *= 1 - self.depth * float(np.exp(-max(out, 0.0) / self.reach))
        return np.asarray(self.light(points, normal) * shade[:, None])
