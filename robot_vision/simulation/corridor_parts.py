# SPDX-License-Identifier: Apache-2.0
"""What corridors are built of, so that their plan can be read without their doors, lamps and windows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation import materials
from robot_vision.simulation.scene import Quad, box, quad
from robot_vision.simulation.texture import Texture

DOOR_WIDTH, DOOR_HEIGHT, DOOR_RECESS = 0.90, 2.03, 0.08
FRAME_WIDTH, FRAME_DEPTH = 0.06, 0.015
SKIRTING_HEIGHT, SKIRTING_DEPTH = 0.07, 0.01
LAMP_LENGTH, LAMP_WIDTH, LAMP_SPACING = 1.2, 0.3, 2.4
PORTAL_DEPTH, PORTAL_HEIGHT = 0.30, 2.10
GAP = 0.004
"""Metres between a wall and what hangs flat on it, so that the one in front is seen."""


@dataclass(frozen=True)
class Wall:
    """One wall with its own directions: right and up as seen from inside, out of the wall into the room."""

    corner: NDArray[np.float64]  # lower left one as seen from inside
    right: NDArray[np.float64]
    height: float
    length: float

    @property
    def out(self) -> NDArray[np.float64]:
        """Unit vector (3,) out of the wall into the room."""
        return np.cross(self.right, _UP)

    def at(self, along: float, up: float, out: float = 0.0) -> NDArray[np.float64]:
        """The point (3,) of the world that many metres from the wall's lower left corner."""
        return np.asarray(self.corner + along * self.right + up * _UP + out * self.out)

    def panel(
        self,
        along: tuple[float, float],
        up: tuple[float, float],
        out: float,
        texture: Texture,
        shines: bool = False,
    ) -> Quad:
        """A flat piece parallel to the wall; tiled textures keep to the wall's own metres."""
        origin = (along[0], up[0]) if texture.repeat else (0.0, 0.0)
        return quad(
            self.at(along[0], up[0], out),
            (along[1] - along[0]) * self.right,
            (up[1] - up[0]) * _UP,
            texture,
            origin,
            shines=shines,
        )

    def block(
        self, along: tuple[float, float], up: tuple[float, float], out: tuple[float, float], texture: Texture
    ) -> list[Quad]:
        """A box on the wall, without its back."""
        (a0, a1), (h0, h1), (d0, d1) = along, up, out
        return [
            self.panel(along, up, d1, texture),
            quad(self.at(a0, h0, d0), (d1 - d0) * self.out, (h1 - h0) * _UP, texture),
            quad(self.at(a1, h0, d1), (d0 - d1) * self.out, (h1 - h0) * _UP, texture),
            quad(self.at(a0, h1, d1), (a1 - a0) * self.right, (d0 - d1) * self.out, texture),
            quad(self.at(a0, h0, d0), (a1 - a0) * self.right, (d1 - d0) * self.out, texture),
        ]

    def pillar(
        self, along: tuple[float, float], up: tuple[float, float], out: tuple[float, float], texture: Texture
    ) -> list[Quad]:
        """A box before the wall, with its back."""
        back = quad(
            self.at(along[1], up[0], out[0]),
            (along[0] - along[1]) * self.right,
            (up[1] - up[0]) * _UP,
            texture,
        )
        return [*self.block(along, up, out, texture), back]

    def niche(
        self, along: tuple[float, float], up: tuple[float, float], depth: float, texture: Texture
    ) -> list[Quad]:
        """The sides, the upper and the lower side of a hole in the wall."""
        (a0, a1), (h0, h1) = along, up
        return [
            quad(self.at(a0, h0), -depth * self.out, (h1 - h0) * _UP, texture),
            quad(self.at(a1, h0, -depth), depth * self.out, (h1 - h0) * _UP, texture),
            quad(self.at(a0, h1, -depth), (a1 - a0) * self.right, depth * self.out, texture),
            quad(self.at(a0, h0), (a1 - a0) * self.right, -depth * self.out, texture),
        ]


_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Palette:
    """The materials one corridor is built from."""

    wall: Texture
    end_wall: Texture
    floor: Texture
    ceiling: Texture
    frame: Texture
    metal: Texture
    skirting: Texture
    lamp: Texture
    leaves: tuple[Texture, ...]

    @classmethod
    def choose(cls, random: np.random.Generator, width: float) -> Palette:
        """Materials for a corridor of a width (m)."""
        leaf = (DOOR_WIDTH, DOOR_HEIGHT)
        leaves = [
            materials.wood(random, materials.linear(*c), leaf)
            for c in ((196, 150, 96), (182, 134, 84), (205, 163, 112))
        ]
        leaves.append(Texture.plain(materials.linear(84, 112, 128)))
        return cls(
            wall=materials.plaster(random, materials.linear(226, 221, 206)),
            end_wall=materials.plaster(random, materials.linear(206, 212, 208)),
            floor=materials.linoleum(random, materials.linear(142, 140, 132), width),
            ceiling=materials.ceiling_tiles(random),
            frame=Texture.plain(materials.linear(120, 122, 126)),
            metal=Texture.plain(materials.linear(178, 180, 184)),
            skirting=Texture.plain(materials.linear(84, 80, 76)),
            lamp=materials.lamp_cover((LAMP_LENGTH, LAMP_WIDTH)),
            leaves=tuple(leaves),
        )


def door_places(random: np.random.Generator, length: float, spacing: float) -> list[float]:
    """Left edges of doors along a wall, none within 0.5 m of its ends, at least 0.5 m of wall between."""
    places, along = [], 0.5 + random.uniform(0, 1.2)
    while along + DOOR_WIDTH + 0.5 < length:
        places.append(along)
        along += max(DOOR_WIDTH + 0.5, spacing * random.uniform(0.7, 1.3))
    return places


def wall_with_doors(
    random: np.random.Generator,
    wall: Wall,
    length: float,
    doors: list[float],
    palette: Palette,
    number: int,
) -> list[Quad]:
    """Wall pieces between doors, the doors, skirting boards, and what hangs on the wall."""
    quads: list[Quad] = []
    start = 0.0
    for place in [*doors, length]:
        end = place
        quads.append(wall.panel((start, end), (0, wall.height), 0.0, palette.wall))
        reach = (start + (FRAME_WIDTH if start else 0), end - (FRAME_WIDTH if end < length else 0))
        quads += wall.block(reach, (0, SKIRTING_HEIGHT), (0, SKIRTING_DEPTH), palette.skirting)
        if end - start > 1.5 and random.random() < 0.6:
            quads += _hung(random, wall, (start + end) / 2 + random.uniform(-0.15, 0.15), palette)
        if place < length:
            quads += _door(random, wall, place, palette, number)
            number += 1
        start = place + DOOR_WIDTH
    return quads


def _door(random: np.random.Generator, wall: Wall, place: float, palette: Palette, number: int) -> list[Quad]:
    """A leaf set back in its frame, with handle and number plate, and the wall above it."""
    a0, a1, top = place, place + DOOR_WIDTH, DOOR_HEIGHT
    leaf = palette.leaves[int(random.choice(len(palette.leaves), p=(0.4, 0.25, 0.2, 0.15)))]
    quads = [
        wall.panel((a0, a1), (top, wall.height), 0.0, palette.wall),
        wall.panel((a0, a1), (0, top), -DOOR_RECESS, leaf),
    ]
    quads += wall.niche((a0, a1), (0, top), DOOR_RECESS, palette.frame)
    out = (0.0, FRAME_DEPTH)
    quads += wall.block((a0 - FRAME_WIDTH, a0), (0, top + FRAME_WIDTH), out, palette.frame)
    quads += wall.block((a1, a1 + FRAME_WIDTH), (0, top + FRAME_WIDTH), out, palette.frame)
    quads += wall.block((a0, a1), (top, top + FRAME_WIDTH), out, palette.frame)
    hinge_left = random.random() < 0.5
    knob = a1 - 0.07 if hinge_left else a0 + 0.07
    tip = knob - 0.12 if hinge_left else knob + 0.12
    leaf_out = -DOOR_RECESS
    quads += wall.block(
        (knob - 0.022, knob + 0.022), (0.93, 1.12), (leaf_out, leaf_out + 0.008), palette.metal
    )
    quads += wall.block(
        (min(knob - 0.01, tip), max(knob + 0.01, tip)),
        (1.04, 1.06),
        (leaf_out + 0.04, leaf_out + 0.06),
        palette.metal,
    )
    plate = materials.door_sign(number, (0.18, 0.12))
    side = a1 + FRAME_WIDTH + 0.08 if hinge_left else a0 - FRAME_WIDTH - 0.26
    quads.append(wall.panel((side, side + 0.18), (1.50, 1.62), GAP, plate))
    return quads


def _hung(random: np.random.Generator, wall: Wall, middle: float, palette: Palette) -> list[Quad]:
    """A notice board with sheets, or a fire extinguisher box."""
    if random.random() < 0.3:
        red = Texture.plain(materials.linear(178, 58, 50))
        return wall.block((middle - 0.15, middle + 0.15), (0.75, 1.45), (0, 0.10), red)
    size = (0.42, 0.594)
    quads = wall.block((middle - 0.24, middle + 0.24), (1.20, 1.83), (0, 0.02), palette.metal)
    sheet = materials.notice(random, size)
    return [
        *quads,
        wall.panel((middle - size[0] / 2, middle + size[0] / 2), (1.22, 1.22 + size[1]), 0.02 + GAP, sheet),
    ]


def _window_span(width: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Along and up (metres) from where to where the window in the far wall goes."""
    half = min(0.6, width / 2 - 0.2)
    return (width / 2 - half, width / 2 + half), (0.85, 2.15)


def end_with_window(wall: Wall, width: float, palette: Palette) -> list[Quad]:
    """The far wall around a window with frame, cross bar and sill."""
    (a0, a1), (h0, h1) = _window_span(width)
    quads = [
        wall.panel((0, a0), (0, wall.height), 0.0, palette.end_wall),
        wall.panel((a1, width), (0, wall.height), 0.0, palette.end_wall),
        wall.panel((a0, a1), (0, h0), 0.0, palette.end_wall),
        wall.panel((a0, a1), (h1, wall.height), 0.0, palette.end_wall),
    ]
    white = Texture.plain(materials.linear(225, 225, 225))
    quads += wall.niche((a0, a1), (h0, h1), 0.12, white)
    out, bar = (-0.12, -0.08), 0.05
    middle = (a0 + a1) / 2
    for along in ((a0, a0 + bar), (middle - bar / 2, middle + bar / 2), (a1 - bar, a1)):
        quads += wall.block(along, (h0, h1), out, white)
    for up in ((h0, h0 + bar), (h1 - bar, h1)):
        quads += wall.block((a0, a1), up, out, white)
    quads += wall.block((a0 - 0.05, a1 + 0.05), (h0 - 0.03, h0), (-0.12, 0.10), white)
    quads += wall.block((0, width), (0, SKIRTING_HEIGHT), (0, SKIRTING_DEPTH), palette.skirting)
    return quads


def window_pane(random: np.random.Generator, wall: Wall, width: float, mirrored: bool = True) -> Quad:
    """What is seen through the window in a wall of a width (m), and whether the floor mirrors it."""
    along, up = _window_span(width)
    size = (along[1] - along[0], up[1] - up[0])
    return wall.panel(along, up, -0.12, materials.outdoors(random, size), shines=mirrored)


def lamp_places(length: float) -> NDArray[np.float64]:
    """Middle of each lamp along a leg of a corridor (metres)."""
    count = max(int(length / LAMP_SPACING), 1)
    return (np.arange(count) + 0.5) * length / count


def lamp(
    place: NDArray[np.float64], across: bool, height: float, palette: Palette, mirrored: bool = True
) -> list[Quad]:
    """A light panel in a metal rim, a little below the ceiling.

    Args:
        place: (2,) its middle, metres.
        across: whether it lies along the world's y axis instead of x.
        height: of the ceiling, metres.
        palette: of the corridor.
        mirrored: whether the floor mirrors it.
    """
    cover = palette.lamp
    drop, rim = 0.04, 0.025
    half = np.array([LAMP_LENGTH, LAMP_WIDTH]) / 2
    first, second = np.array([2 * half[0], 0, 0]), np.array([0, -2 * half[1], 0])
    corner = place + half * (-1, 1)
    if across:
        half = half[::-1]
        first, second = np.array([0, LAMP_LENGTH, 0]), np.array([LAMP_WIDTH, 0, 0])
        corner = place - half
    panel = quad((*corner, height - drop - GAP), first, second, cover, shines=mirrored)
    (x0, y0), (x1, y1) = place - half, place + half
    low, high = (x0 - rim, y0 - rim, height - drop), (x1 + rim, y1 + rim, height)
    return [panel, *box(low, high, palette.metal, without="+z")]


def portal(
    wall: Wall, along: float, opening: float, width: float, palette: Palette
) -> tuple[list[Quad], tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """A narrowed entrance: jambs that stand out from both walls, a lintel, and a steel frame about the way.

    Args:
        wall: the one on the right of the way through; the other is opposite.
        along: middle of the jambs along that wall, metres.
        opening: between the jambs, metres.
        width: of the corridor, metres.
        palette: of the corridor.

    Returns:
        Rectangles, and the footprints (4, 2) of the right and the left jamb.
    """
    a0, a1 = along - PORTAL_DEPTH / 2, along + PORTAL_DEPTH / 2
    depth, top = (width - opening) / 2, PORTAL_HEIGHT
    reaches = ((0.0, depth), (width - depth, width))
    quads: list[Quad] = []
    inset = 0.02  # of the jambs behind the steel that lines the way
    for near, far in ((0.0, depth - inset), (width - depth + inset, width)):
        quads += wall.pillar((a0, a1), (0, wall.height), (near, far), palette.end_wall)
    quads += wall.pillar(
        (a0, a1), (top + inset, wall.height), (depth - inset, width - depth + inset), palette.end_wall
    )
    b0, b1 = a0 - FRAME_DEPTH, a1 + FRAME_DEPTH
    sides = ((depth - FRAME_WIDTH, depth), (width - depth, width - depth + FRAME_WIDTH))
    for side in sides:
        quads += wall.pillar((b0, b1), (0, top), side, palette.frame)
    quads += wall.pillar((b0, b1), (top, top + FRAME_WIDTH), (sides[0][0], sides[1][1]), palette.frame)
    right, left = (
        np.array([wall.at(a, 0.0, out)[:2] for a, out in ((a1, near), (a0, near), (a0, far), (a1, far))])
        for near, far in reaches
    )
    return quads, (right, left)
