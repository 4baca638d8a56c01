# SPDX-License-Identifier: Apache-2.0
"""What lies around a road in the country: fields, a ring of hills on the horizon, and the sky above it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation import materials
from robot_vision.simulation.scene import Quad, quad
from robot_vision.simulation.texture import Colour, Texture

SKY: Colour = materials.linear(116, 158, 212)
"""Of the upper sky, where nothing else is drawn."""
HAZE: Colour = materials.linear(206, 219, 230)
_FACETS = 24
_LOWEST, _HIGHEST = -0.025, 0.68
"""Of the painted ring, in radii: up to 34 degrees above the horizon."""
_COLUMNS, _ROWS, _LAND_ROWS = 3072, 384, 128
"""Of the ring's picture, and of its lower part, above which no hill rises."""

Floats = NDArray[np.float64]


def horizon(random: np.random.Generator, middle: Floats, radius: float) -> list[Quad]:
    """A ring of painted hills and clouds around `middle` (x, y), seen from inside.

    Its lowest row of hills stands on the horizon of an eye on the ground, wherever that eye is in the ring's
    inner third.
    """
    angles = -2 * np.pi * np.arange(_FACETS + 1) / _FACETS  # clockwise, so that its inside is seen
    rim = middle + radius / np.cos(np.pi / _FACETS) * np.column_stack([np.cos(angles), np.sin(angles)])
    width = float(np.hypot(*(rim[1] - rim[0])))
    size = (_FACETS * width, (_HIGHEST - _LOWEST) * radius)
    picture = Texture(_panorama(random).astype(np.float32), size, repeat=False)
    rise = (0.0, 0.0, size[1])
    return [
        quad((*rim[n], _LOWEST * radius), (*(rim[n + 1] - rim[n]), 0.0), rise, picture, (n * width, 0.0))
        for n in range(_FACETS)
    ]


def fields(random: np.random.Generator, low: Floats, high: Floats, radius: float) -> list[Quad]:
    """Meadows all around, and ploughed and sown fields on them, from corner to corner of the land."""
    shape = (512, 512)
    value = (
        1
        + 0.16 * materials.grain(random, shape, (1.5, 1.5))
        + 0.10 * materials.grain(random, shape, (40, 40))
    )
    middle = (low + high) / 2
    meadow = Texture(materials.tinted(materials.linear(112, 138, 66), value), (24.0, 24.0))
    side = 2.1 * radius
    quads = [quad((*(middle - side / 2), -0.30), (side, 0, 0), (0, side, 0), meadow)]
    colours = ((176, 164, 92), (128, 108, 80), (190, 178, 60), (92, 128, 62), (150, 160, 84))
    crops = [Texture(materials.tinted(materials.linear(*c), value), (18.0, 18.0)) for c in colours]
    count = int(np.clip(np.prod(high - low + 600.0) / 25_000, 10, 160))
    for number in range(count):
        corner = random.uniform(low - 300, high + 200)
        along, across = random.uniform(60, 220, 2)
        turn = random.uniform(-0.3, 0.3)
        first = along * np.array([np.cos(turn), np.sin(turn), 0])
        second = across * np.array([-np.sin(turn), np.cos(turn), 0])
        crop = crops[int(random.integers(len(crops)))]
        quads.append(quad((*corner, -0.28 + 0.2 * number / count), first, second, crop))
    return quads


def _panorama(random: np.random.Generator) -> Floats:
    """Sky, clouds and four ranges of hills (rows, columns, 3), without a seam; row 0 is the lowest."""
    shape = (_ROWS, _COLUMNS)
    height = np.linspace(_LOWEST, _HIGHEST, _ROWS)[:, None]  # tangent of the elevation
    up = np.clip(height / _HIGHEST, 0, 1)[..., None] ** 0.6
    picture = np.array(HAZE) * (1 - up) + np.array(SKY) * up + np.zeros((*shape, 3))
    wisps = materials.grain(random, shape, (26, 150)) + 0.6 * materials.grain(random, shape, (9, 50))
    wisps += 0.2 * materials.grain(random, shape, (3, 14))
    cloud = np.clip((wisps - 0.35) / 1.6, 0, 1) * np.clip((height - 0.03) / 0.10, 0, 1)
    picture += 0.75 * cloud[..., None] * (np.array(materials.linear(250, 250, 250)) - picture)
    picture[:_LAND_ROWS] = _with_hills(random, picture[:_LAND_ROWS], height[:_LAND_ROWS])
    return picture


def _with_hills(random: np.random.Generator, picture: Floats, height: Floats) -> Floats:
    """The lower sky (rows, columns, 3) with hills in it; `height` (rows, 1) is the tangent of the elevation."""
    shape = picture.shape[0], picture.shape[1]
    for distance, ridge, swing, tint in (
        (0.76, 0.098, 0.034, (96, 124, 104)),
        (0.54, 0.064, 0.022, (98, 128, 82)),
        (0.32, 0.036, 0.012, (104, 136, 72)),
        (0.15, 0.014, 0.005, (94, 126, 62)),
    ):
        crest = ridge + swing * materials.grain(random, (1, _COLUMNS), (1, 700 - 500 * (1 - distance)))
        woods = np.clip(materials.grain(random, (1, _COLUMNS), (1, 120)) - 0.2, 0, 1)
        crowns = 1 + 0.3 * materials.grain(random, (1, _COLUMNS), (1, 6))
        crest = crest + 0.006 * (1.2 - distance) * woods * crowns
        land = _patchwork(random, shape, tint)
        forest = np.clip((height - crest + 0.010 * woods + 0.001) / 0.003, 0, 1) * (woods > 0.05)
        leaves = 1 + 0.25 * materials.grain(random, shape, (3, 3))
        land = land * (1 - forest[..., None]) + forest[..., None] * materials.tinted(
            materials.linear(58, 80, 46), leaves
        )
        land = land * (1 - distance) + np.array(HAZE) * distance
        inside = np.clip((crest - height) / 0.0012 + 0.5, 0, 1)[..., None]
        picture = picture * (1 - inside) + land * inside
    return picture


def _patchwork(random: np.random.Generator, shape: tuple[int, int], tint: tuple[int, int, int]) -> Floats:
    """Fields on a far slope: patches of different green and yellow with dark hedges between them."""
    patch = np.round(1.5 * materials.grain(random, shape, (5, 90))).astype(int)
    shades = np.array([materials.linear(*c) for c in (tint, (150, 152, 84), (88, 116, 60), (168, 160, 104))])
    shades = (shades + np.array(materials.linear(*tint))) / 2
    land = shades[patch % len(shades)]
    hedge = (np.diff(patch, axis=0, prepend=patch[:1]) != 0) | (
        np.diff(patch, axis=1, prepend=patch[:, :1]) != 0
    )
    land = np.where(hedge[..., None], np.array(materials.linear(62, 84, 48)), land)
    return land * (1 + 0.05 * materials.grain(random, shape, (2, 6)))[..., None]
