# SPDX-License-Identifier: Apache-2.0
"""What mazes are made of and what stands around them: a contest's hall for mice, a sports hall for robots."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation import materials
from robot_vision.simulation.scene import Quad, box, quad
from robot_vision.simulation.texture import Texture

HALL_MARGIN, HALL_HEIGHT = 7.0, 5.0
"""Metres from the maze to the walls of the hall, and from its floor to the ceiling."""
HALL_LIGHT = 0.62
"""Of the hall, as a share of that on the maze, above which the lamps hang."""
_CELLS = 4
"""Cells covered by one tile of the wall's and of the floor's texture."""


@dataclass(frozen=True, eq=False)
class Look:
    """Materials of one maze.

    Attributes:
        wall: sides of the walls; starts at a post, one tile is as high as the wall.
        top: of the walls.
        floor: inside the maze; starts at the south-western post.
        base: metres by which the maze stands above the floor of the hall.
    """

    wall: Texture
    top: Texture
    floor: Texture
    base: float


def contest_look(random: np.random.Generator, cell: float, height: float) -> Look:
    """White walls with red tops slotted into posts, on boards painted black."""
    white = _panels(random, materials.linear(238, 237, 232), cell, height, seam=0.62, soot=0.10)
    shape = (1024, 1024)
    value = (
        1 + 0.16 * materials.grain(random, shape, (2, 2)) + 0.10 * materials.grain(random, shape, (90, 90))
    )
    value += 1.3 * (materials.grain(random, shape, (2, 2)) > 3.1)  # dust
    scratches = materials.grain(random, shape, (120, 1.5)) + materials.grain(random, shape, (1.5, 120))
    value += 0.5 * np.maximum(scratches - 2.9, 0)
    board = 3
    value[:board] *= 0.45
    value[:, :board] *= 0.45
    tile = (_CELLS * cell, _CELLS * cell)
    floor = Texture(materials.tinted(materials.linear(68, 68, 70), value), tile)
    red = 1 + 0.05 * materials.grain(random, (256, 256), (3, 3))
    top = Texture(materials.tinted(materials.linear(206, 42, 34), red), (cell, cell))
    return Look(white, top, floor, base=0.02)


def room_look(random: np.random.Generator, cell: float, height: float) -> Look:
    """Panels of plywood with blue edges, on light linoleum."""
    wood = _panels(random, materials.linear(205, 172, 126), cell, height, seam=0.55, soot=0.12)
    rows, columns = wood.texels.shape[:2]
    rings = materials.grain(random, (rows, columns), (6, 260)) + 0.5 * materials.grain(
        random, (rows, columns), (2, 120)
    )
    veneer = 1 + 0.06 * np.sin(2.4 * rings)
    wall = Texture(np.asarray(wood.texels * veneer[..., None], np.float32), wood.size)
    floor = materials.linoleum(random, materials.linear(160, 162, 158), 4 * cell, 2 * cell)
    return Look(wall, Texture.plain(materials.linear(40, 74, 140)), floor, base=0.0)


def _panels(
    random: np.random.Generator,
    colour: tuple[float, float, float],
    cell: float,
    height: float,
    seam: float,
    soot: float,
) -> Texture:
    """Panels between posts, a dark seam beside each post, scuffed where wheels touch them."""
    rows, columns = 64, 1024
    value = 1 + 0.012 * materials.grain(random, (rows, columns), (2, 2))
    value += 0.018 * materials.grain(random, (rows, columns), (60, 200))
    along = (np.arange(columns) + 0.5) / columns * _CELLS
    from_post = np.abs((along + 0.5) % 1 - 0.5) / (0.006 / 0.18)
    value *= np.where(np.abs(from_post - 1) < 0.09, seam, 1.0)
    value *= np.where(from_post < 1, 1.03, 1.0)
    up = (np.arange(rows) + 0.5) / rows
    scuffs = np.maximum(materials.grain(random, (rows, columns), (3, 40)), 0)
    value -= soot * scuffs * np.exp(-(((up - 0.3) / 0.16) ** 2))[:, None]
    return Texture(materials.tinted(colour, value), (_CELLS * cell, height))


def hall(random: np.random.Generator, look: Look, size: tuple[float, float], cell: float) -> list[Quad]:
    """The base of the maze and the hall around it, with windows, doors, tables and benches.

    Args:
        random: where things stand.
        look: of the maze.
        size: of the maze from west to east and from south to north, metres.
        cell: metres.
    """
    low = np.array([-HALL_MARGIN, -HALL_MARGIN])
    high = np.asarray(size) + HALL_MARGIN
    boards = materials.wood(random, materials.linear(176, 138, 92), (1.0, 1.0))
    parquet = Texture(np.ascontiguousarray(boards.texels[:256, :256]), (1.6, 0.8))
    ground = -look.base - 0.001
    quads = [quad((*low, ground), (high[0] - low[0], 0, 0), (0, high[1] - low[1], 0), parquet)]
    if look.base > 0:
        rim = 0.3 * cell
        quads += box(
            (-rim, -rim, ground),
            (size[0] + rim, size[1] + rim, -0.001),
            Texture.plain(materials.linear(46, 46, 48)),
            without="-z",
        )
    quads += _hall_walls(random, low, high, ground)
    quads += _furniture(random, size, ground)
    return [_dimmed(item) for item in quads]


def _hall_walls(
    random: np.random.Generator, low: NDArray[np.float64], high: NDArray[np.float64], ground: float
) -> list[Quad]:
    """Four walls with a wooden lower part, windows or doors and banners, and a ceiling."""
    plaster = materials.plaster(random, materials.linear(214, 212, 200))
    veneer = materials.wood(random, materials.linear(150, 118, 86), (1.2, 1.1)).texels.copy()
    veneer[:, :4] *= 0.4  # joint between boards
    panel = Texture(veneer, (1.2, 1.2))
    window = materials.outdoors(random, (1.8, 2.2), 1.4)
    corners = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    quads = [
        quad(
            (low[0], high[1], HALL_HEIGHT),
            (high[0] - low[0], 0, 0),
            (0, low[1] - high[1], 0),
            Texture.plain(materials.linear(196, 196, 192)),
        )
    ]
    for number, (a, b) in enumerate(zip(corners, corners[1:] + corners[:1], strict=True)):
        length = float(np.hypot(b[0] - a[0], b[1] - a[1]))
        along = -np.subtract(b, a) / length  # to the right as seen from inside
        inward = np.array([along[1], -along[0]])
        right = np.array([*along, 0.0])
        foot = np.array([*b, ground])
        rise = np.array([0.0, 0.0, 1.0])
        shade = (1.0, 0.82, 0.9, 0.74)[number]
        quads.append(_shaded(quad(foot, length * right, (HALL_HEIGHT - ground) * rise, plaster), shade))
        deep = np.array([*inward, 0.0])
        quads.append(_shaded(quad(foot + 0.03 * deep, length * right, 1.1 * rise, panel), shade))
        spot = 1.2
        while spot + 2.4 < length:
            origin = foot + spot * right + 0.04 * deep
            if number % 2 == 0:
                quads.append(quad(origin + 1.5 * rise, 1.8 * right, 2.2 * rise, window, shines=True))
            else:
                shade_of = materials.linear(
                    *(int(c) for c in random.integers(60, 120) + random.integers(-35, 36, 3))
                )
                wide, tall = random.uniform(0.9, 1.8), random.uniform(1.2, 2.1)
                up = 0.02 if random.random() < 0.5 else 1.3
                quads.append(quad(origin + up * rise, wide * right, tall * rise, Texture.plain(shade_of)))
            spot += random.uniform(2.6, 3.6)
    return quads


def _furniture(random: np.random.Generator, size: tuple[float, float], ground: float) -> list[Quad]:
    """Tables and benches along the sides of the maze, at least 1.2 m away from it."""
    quads: list[Quad] = []
    for _ in range(14):
        side = int(random.integers(4))
        out = random.uniform(1.4, 4.5)
        along = random.uniform(-2.0, 2.0 + size[side % 2])
        x, y = ((along, -out), (-out, along), (along, size[1] + out), (size[0] + out, along))[side]
        wide, deep = (random.uniform(0.5, 1.6), 0.5)[:: 1 if side % 2 == 0 else -1]
        tall = float(random.choice([0.42, 0.45, 0.74]))
        colour = [(176, 150, 114), (92, 98, 108), (128, 84, 66), (78, 92, 110)][int(random.integers(4))]
        light, dark = (
            Texture.plain(materials.linear(*colour)),
            Texture.plain(materials.linear(*(c // 2 for c in colour))),
        )
        low, high = (x - wide / 2, y - deep / 2), (x + wide / 2, y + deep / 2)
        quads += box((*low, ground + tall - 0.05), (*high, ground + tall), light)
        for corner in ((low[0], low[1]), (high[0], low[1]), low[:1] + high[1:], high):
            post = np.clip(corner, np.add(low, 0.05), np.subtract(high, 0.05))
            quads += box((*(post - 0.025), ground), (*(post + 0.025), ground + tall - 0.05), dark, "-z +z")
    return quads


def _dimmed(item: Quad) -> Quad:
    light = np.ones((1, 1, 3)) if item.light is None else item.light
    return replace(item, light=HALL_LIGHT * light)


def _shaded(item: Quad, value: float) -> Quad:
    return item.lit(lambda points, normal: np.full((len(points), 3), value), 1e3)
