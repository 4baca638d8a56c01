# SPDX-License-Identifier: Apache-2.0
"""A room with an inspection plate: holes of known centres, to judge how well circles are found in pictures."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation import materials
from robot_vision.simulation.drive import WeavingSettings
from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.lighting import RoomLight
from robot_vision.simulation.scene import Ellipse, Quad, Scene, box, quad
from robot_vision.simulation.texture import Texture
from robot_vision.simulation.world import SceneObject, StraightLane, World, walls_around

ROOM_LENGTH, ROOM_WIDTH, ROOM_HEIGHT = 5.0, 4.0, 2.6
PLATE_X, PLATE_Z = 3.1, 0.56
"""Metres: where the middle of the plate stands, on the middle of the room."""
BACKING = 0.03
"""Metres from the plate to the black board behind it, so that holes are dark from every side."""
_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class PlateSettings:
    """Shape and stand of the plate.

    Attributes:
        width: metres.
        height: metres.
        slant: angle by which it is turned about the upright, radians; positive shows its right end farther.
        lean: angle by which it leans back, radians.
        columns: of holes.
        rows: of holes.
        ellipses: share of holes that are ellipses and not circles.
        smallest: radius of the smallest hole, metres.
        largest: radius of the largest hole, metres.
    """

    width: float = 0.80
    height: float = 0.60
    slant: float = 0.6
    lean: float = 0.35
    columns: int = 4
    rows: int = 3
    ellipses: float = 0.25
    smallest: float = 0.035
    largest: float = 0.075

    def __post_init__(self) -> None:
        for name, low, high in (
            ("width", 0.2, 2.0),
            ("height", 0.2, 1.0),
            ("slant", -1.2, 1.2),
            ("lean", -0.2, 1.2),
            ("columns", 1, 12),
            ("rows", 1, 12),
            ("ellipses", 0.0, 1.0),
            ("smallest", 0.005, 0.5),
            ("largest", 0.005, 0.5),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise SimulationError(f"plate: {name} must be between {low} and {high}, not {value}")
        if self.largest < self.smallest:
            raise SimulationError(
                f"plate: the largest hole ({self.largest} m) is smaller than the smallest ({self.smallest} m)"
            )
        room = min(self.width / self.columns, self.height / self.rows)
        if 2 * self.largest > 0.9 * room:
            raise SimulationError(
                f"plate: {self.columns} x {self.rows} holes of up to {self.largest} m do not fit on "
                f"{self.width} m x {self.height} m; give fewer or smaller ones"
            )


@dataclass(frozen=True, eq=False)
class Plate:
    """A flat plate and its holes, with borders exact to the renderer's samples.

    Attributes:
        world_from_plate: (4, 4) pose; its frame has x to the right and y up as seen from the front, z towards
            the viewer, origin in the lower left corner; metres.
        width: metres along x.
        height: metres along y.
        holes: in plate coordinates; circles have equal axes.
    """

    world_from_plate: NDArray[np.float64]
    width: float
    height: float
    holes: tuple[Ellipse, ...]

    @property
    def centres(self) -> NDArray[np.float64]:
        """Centres (N, 3) of the holes in the world, metres."""
        flat = np.array([(*hole.centre, 0.0) for hole in self.holes]).reshape(-1, 3)
        return np.asarray(flat @ self.world_from_plate[:3, :3].T + self.world_from_plate[:3, 3])

    @property
    def normal(self) -> NDArray[np.float64]:
        """Unit normal (3,) towards the viewer, in the world."""
        return np.asarray(self.world_from_plate[:3, 2])

    def border(self, hole: int, count: int = 360) -> NDArray[np.float64]:
        """Points (count, 3) on the border of a hole in the world, metres."""
        shape = self.holes[hole]
        turn = np.linspace(0, 2 * np.pi, count, endpoint=False)
        x, y = shape.axes[0] * np.cos(turn), shape.axes[1] * np.sin(turn)
        cosine, sine = np.cos(shape.angle), np.sin(shape.angle)
        flat = np.column_stack(
            [shape.centre[0] + cosine * x - sine * y, shape.centre[1] + sine * x + cosine * y, 0 * x]
        )
        return np.asarray(flat @ self.world_from_plate[:3, :3].T + self.world_from_plate[:3, 3])


@dataclass(frozen=True, eq=False)
class PlateWorld(World):
    """The room, and in it the plate with the truth about its holes."""

    plate: Plate = field(kw_only=True)


def plate(settings: PlateSettings | None = None, seed: int = 0) -> PlateWorld:
    """Build the room; the same settings and seed give the same one.

    Its frame has x towards the plate, y to the left, z up, origin on the floor in the middle of the wall
    behind the start.
    """
    shape = settings or PlateSettings()
    random = np.random.default_rng((seed, 6))
    made = Plate(_pose(shape), shape.width, shape.height, _holes(random, shape))
    light = RoomLight(np.array([1.2, 3.4]), ROOM_WIDTH, ROOM_HEIGHT, 100.0)
    quads = [item.lit(light) for item in [*_room(random), *_stand(made)]]
    quads += [item.lit(light, 0.05) for item in _sheet(random, made)]
    outline = np.array([(0, -1), (ROOM_LENGTH, -1), (ROOM_LENGTH, 1), (0, 1)]) * (1, ROOM_WIDTH / 2)
    return PlateWorld(
        "plate",
        Scene((*quads, *_lamps())),
        "corridor",
        StraightLane(ROOM_LENGTH, ROOM_WIDTH),
        objects=(*walls_around(outline), SceneObject("plate on its stand", _footprint(made), 1.0)),
        floor=(outline,),
        drive=WeavingSettings(speed=0.05, sway=0.10, swing=0.10, start=1.8),
        plate=made,
    )


def _pose(shape: PlateSettings) -> NDArray[np.float64]:
    """Pose of the plate: its front looks to the robot, -x, then is turned and leaned."""
    out = np.array(
        [
            -np.cos(shape.slant) * np.cos(shape.lean),
            -np.sin(shape.slant) * np.cos(shape.lean),
            np.sin(shape.lean),
        ]
    )
    right = np.cross(_UP, out)
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([right, np.cross(out, right), out])
    middle = np.array([PLATE_X, 0.0, PLATE_Z])
    pose[:3, 3] = middle - pose[:3, :2] @ (shape.width / 2, shape.height / 2)
    return pose


def _holes(random: np.random.Generator, shape: PlateSettings) -> tuple[Ellipse, ...]:
    """One hole in each field of a grid, of any size, a little off the field's middle."""
    fields = np.array([shape.width / shape.columns, shape.height / shape.rows])
    holes = []
    for row in range(shape.rows):
        for column in range(shape.columns):
            long = random.uniform(shape.smallest, shape.largest)
            narrow = random.uniform(0.5, 0.8) if random.random() < shape.ellipses else 1.0
            free = fields / 2 - long - 0.04 * fields.min()
            centre = (np.array([column, row]) + 0.5) * fields + random.uniform(-0.7, 0.7, 2) * free
            angle = float(random.uniform(0, np.pi)) if narrow < 1 else 0.0
            holes.append(Ellipse((float(centre[0]), float(centre[1])), (long, narrow * long), angle))
    return tuple(holes)


def _sheet(random: np.random.Generator, made: Plate) -> list[Quad]:
    """The plate of brushed metal, the black board behind it, and the rim between them."""
    right, up, out = made.world_from_plate[:3, :3].T
    corner = made.world_from_plate[:3, 3]
    brushed = 1 + 0.02 * materials.grain(random, (256, 256), (1, 60))
    metal = Texture(materials.tinted(materials.linear(206, 208, 210), brushed), (0.4, 0.4))
    black = Texture.plain(materials.linear(22, 22, 24))
    edge = Texture.plain(materials.linear(90, 92, 96))
    across, along, depth = made.width * right, made.height * up, BACKING * out
    behind = corner - depth
    return [
        quad(corner, across, along, metal, holes=made.holes),
        quad(behind, across, along, black),
        quad(behind, depth, along, edge, both_sides=True),
        quad(behind + across, depth, along, edge, both_sides=True),
        quad(behind, across, depth, edge, both_sides=True),
        quad(behind + along, across, depth, edge, both_sides=True),
    ]


def _stand(made: Plate) -> list[Quad]:
    """A post with a foot, behind the plate."""
    grey = Texture.plain(materials.linear(70, 74, 82))
    x, y = (made.world_from_plate @ (made.width / 2, made.height / 2, -BACKING - 0.08, 1.0))[:2]
    post = box((x - 0.04, y - 0.04, 0.0), (x + 0.04, y + 0.04, PLATE_Z), grey, without="-z")
    foot = box((x - 0.25, y - 0.25, 0.0), (x + 0.25, y + 0.25, 0.04), grey, without="-z")
    return [*post, *foot]


def _footprint(made: Plate) -> NDArray[np.float64]:
    """Outline (4, 2) on the floor of what the plate and its stand take up, along the axes."""
    flat = np.array([(x, y, z, 1.0) for x in (0, made.width) for y in (0, made.height) for z in (0, -0.15)])
    places = (flat @ made.world_from_plate.T)[:, :2]
    (x0, y0), (x1, y1) = places.min(axis=0), places.max(axis=0)
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def _room(random: np.random.Generator) -> list[Quad]:
    """Floor, ceiling and four walls, seen from inside."""
    wall = materials.plaster(random, materials.linear(188, 196, 200))
    floor = materials.linoleum(random, materials.linear(120, 116, 108), ROOM_WIDTH)
    ceiling = materials.ceiling_tiles(random)
    length, half, height = ROOM_LENGTH, ROOM_WIDTH / 2, ROOM_HEIGHT
    return [
        quad((0, -half, 0), (length, 0, 0), (0, 2 * half, 0), floor, gloss=0.035),
        quad((0, half, height), (length, 0, 0), (0, -2 * half, 0), ceiling),
        quad((0, half, 0), (length, 0, 0), (0, 0, height), wall),
        quad((length, -half, 0), (-length, 0, 0), (0, 0, height), wall),
        quad((length, half, 0), (0, -2 * half, 0), (0, 0, height), wall),
        quad((0, -half, 0), (0, 2 * half, 0), (0, 0, height), wall),
    ]


def _lamps() -> list[Quad]:
    """Two light panels below the ceiling."""
    cover = materials.lamp_cover((1.2, 0.3))
    return [
        quad((place - 0.6, 0.15, ROOM_HEIGHT - 0.05), (1.2, 0, 0), (0, -0.3, 0), cover, shines=True)
        for place in (1.2, 3.4)
    ]
