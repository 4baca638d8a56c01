# SPDX-License-Identifier: Apache-2.0
"""Daylight: a sun that casts shadows and a sky that fills them, baked into light maps when a world is built."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.packing import Packed, pack
from robot_vision.simulation.scene import Quad, Scene
from robot_vision.simulation.texture import Colour

if TYPE_CHECKING:
    from robot_vision.simulation.shadows import Patches

_SUBSAMPLES = 4
"""Rays along each side of the patch of surface that a node of a light map stands for."""
_BACKLIGHT = 0.6
"""Light that comes through what is thin enough to have two sides, of what falls on its other side."""
_LIFT = 2e-3
"""Metres between a surface and what may cast a shadow on it."""


@dataclass(frozen=True)
class Sun:
    """Light from outside.

    Attributes:
        azimuth: direction in which the sun stands, radians, counter-clockwise from +x.
        elevation: of the sun above the horizon, radians.
        colour: light of the sun on a surface that faces it, linear blue, green, red.
        sky: light of the whole sky on level ground.
        ground: light that the ground sends to what faces down, as from below.
    """

    azimuth: float = 2.2
    elevation: float = 0.8
    colour: Colour = (0.80, 0.92, 1.0)
    sky: Colour = (0.36, 0.30, 0.26)
    ground: Colour = (0.09, 0.12, 0.12)

    def __post_init__(self) -> None:
        if not 0.03 <= self.elevation <= np.pi / 2:
            raise SimulationError(
                f"sun: elevation must be between 0.03 and {np.pi / 2:.4f} rad, not {self.elevation}"
            )

    @property
    def direction(self) -> NDArray[np.float64]:
        """Unit vector (3,) from any place towards the sun."""
        flat = np.cos(self.elevation)
        return np.array([flat * np.cos(self.azimuth), flat * np.sin(self.azimuth), np.sin(self.elevation)])

    def shadow(self, points: ArrayLike, ground: float = 0.0) -> NDArray[np.float64]:
        """Where on level ground (N, 2) the shadows of points (N, 3) fall, metres."""
        places = np.asarray(points, np.float64)
        towards = self.direction
        return np.asarray(places[:, :2] - (places[:, 2:] - ground) / towards[2] * towards[:2])

    def sky_light(self, normals: NDArray[np.float64]) -> NDArray[np.float64]:
        """Light (N, 3) of sky and ground on surfaces with unit normals (N, 3) that nothing stands before."""
        up = (0.5 + 0.5 * normals[..., 2])[..., None]
        return np.asarray(up * np.asarray(self.sky) + (1 - up) * np.asarray(self.ground))


def sunlit(
    quads: Sequence[Quad],
    sun: Sun,
    spacing: float = 0.05,
    casters: Sequence[Quad] | None = None,
    openness: int = 0,
) -> tuple[Quad, ...]:
    """The same rectangles in daylight, with the shadows they cast on each other.

    A node of a light map holds the mean over the patch around it, so that a shadow's border, read off
    where the light is half, lies within about a tenth of `spacing` of where the sun puts it. Rectangles
    seen from both sides are lit from both. What shines is left as it is.

    Args:
        quads: of the world.
        sun: direction and colours.
        spacing: metres between nodes of the light maps; a ground of 500 m x 8 m at 0.05 m has 1.6 million.
        casters: what casts shadows; all of `quads` if None (cut-outs by their alpha, holes let light through).
        openness: directions of sky by which surfaces are darkened where others stand before it (16 look
            well); 0 for a sky that is the same everywhere. Each costs about as much as a sparse sun.

    Raises:
        SimulationError: a spacing that is not positive, or a negative number of directions.
    """
    if spacing <= 0 or openness < 0:
        raise SimulationError(
            f"sunlit: spacing must be above 0 m and openness not negative, not {spacing} and {openness}"
        )
    lit = [item for item in quads if not item.shines]
    if not lit:
        return tuple(quads)
    patches, count = _lattices(lit, spacing)
    direct, sky = np.ones(count, np.float32), np.ones(count, np.float32)
    shades = tuple(item for item in (quads if casters is None else casters) if not item.shines)
    if shades:
        from robot_vision.simulation import shadows  # numba: slow to import, needed for daylight only

        blockers = pack(Scene(shades))
        shapes = shadows.Shapes.of(blockers)
        shadows.reach(
            patches, shadows.look_along(sun.direction, blockers), shapes, _SUBSAMPLES, _LIFT, direct
        )
        if openness:
            sky = _sky_share(patches, count, blockers, openness)
    lights = iter(
        _light(item, sun, direct[at : at + rows * columns], sky[at : at + rows * columns], rows, columns)
        for item, (at, rows, columns) in zip(lit, patches.sizes, strict=True)
    )
    return tuple(item if item.shines else replace(item, light=next(lights)) for item in quads)


def _lattices(quads: list[Quad], spacing: float) -> tuple[Patches, int]:
    """Nodes at most `spacing` apart on all rectangles, and how many there are."""
    from robot_vision.simulation.shadows import Patches

    vertices = np.array([(item.first, item.second, item.origin) for item in quads], np.float64)
    lengths = np.linalg.norm(vertices[:, :2], axis=2)
    columns, rows = (np.ceil(lengths / spacing - 1e-9).astype(np.int64) + 1).T
    ends = np.cumsum(rows * columns)
    return Patches(vertices, np.column_stack([ends - rows * columns, rows, columns])), int(ends[-1])


def _sky_share(patches: Patches, count: int, blockers: Packed, directions: int) -> NDArray[np.float32]:
    """Share (N,) of the light of an even sky that reaches each node, compared with an open field.

    The directions wind up the hemisphere by the golden angle, spaced as light on level ground weighs them.
    """
    from robot_vision.simulation import shadows

    shapes = shadows.Shapes.of(blockers)
    total, one = np.zeros(count, np.float32), np.empty(count, np.float32)
    for number in range(directions):
        height = np.sqrt((number + 0.5) / directions)
        azimuth = number * np.pi * (3 - np.sqrt(5))
        flat = np.sqrt(1 - height**2)
        towards = np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), height])
        shadows.reach(patches, shadows.look_along(towards, blockers), shapes, 1, _LIFT, one)
        total += one
    return total / np.float32(directions)


def _light(
    item: Quad,
    sun: Sun,
    direct: NDArray[np.float32],
    sky: NDArray[np.float32],
    rows: int,
    columns: int,
) -> NDArray[np.float32]:
    """Light map (rows, columns, 3) of one rectangle; a single node if it is the same everywhere."""
    if item.rounding is None:
        normals = item.normal[None]
    else:
        along = np.linspace(0, 1, columns)[:, None]
        normals = (1 - along) * item.rounding[0] + along * item.rounding[1]
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    facing = normals @ sun.direction
    if item.both_sides:
        facing = np.where(facing < 0, -_BACKLIGHT * facing, facing)
        normals = np.column_stack([normals[:, :2], np.abs(normals[:, 2])])
    beam = np.maximum(facing, 0)[:, None] * np.asarray(sun.colour)
    light = direct.reshape(rows, columns, 1) * beam + sky.reshape(rows, columns, 1) * sun.sky_light(normals)
    if np.ptp(light, axis=(0, 1)).max() < 1e-4:
        light = light[:1, :1]
    return np.asarray(light, np.float32)
