# SPDX-License-Identifier: Apache-2.0
"""Plants as a few tilted cut-out leaves each: their true outline on the ground is known, not guessed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.leaves import Floats, Picture, filled
from robot_vision.simulation.scene import Quad
from robot_vision.simulation.texture import Texture

_MEASURE_CELLS = 192
"""Across a plant, when the ground it covers is measured: good for 0.5 % of its area."""
_CLEARANCE_M = 0.004
"""Between the ground and the lowest point of a plant's leaves."""


@dataclass(frozen=True, eq=False)
class Blade:
    """A picture of leaves in the frame of its plant (origin at the stem on the ground, z up), metres.

    Attributes:
        picture: what is painted on it.
        origin: (3,) corner.
        first: (3,) edge across the picture.
        second: (3,) edge along it, perpendicular to the first.
        light: share of the light that reaches the start and the end of its second edge inside the plant.
    """

    picture: Picture
    origin: Floats
    first: Floats
    second: Floats
    light: tuple[float, float]

    def points(self, outline: Floats) -> Floats:
        """Corners (K, 3) in the plant's frame of an outline (K, 2) in the picture."""
        return self.origin + outline[:, :1] * self.first + outline[:, 1:] * self.second


@dataclass(frozen=True, eq=False)
class Specimen:
    """A plant that can be set into the ground many times, turned about its stem.

    Attributes:
        blades: the largest and lowest first.
        textures: one for each blade.
        hulls: (K, 3) of each blade, metres.
        radius: of the circle about the stem that holds its leaves, metres.
        area: of ground they cover as seen from above, square metres.
        height: metres.
    """

    blades: tuple[Blade, ...]
    textures: tuple[Texture, ...]
    hulls: tuple[Floats, ...]
    radius: float
    area: float
    height: float


def leaf(
    picture: Picture,
    foot: tuple[float, float, float],
    azimuth: float,
    rise: float,
    size: tuple[float, float],
    light: tuple[float, float] = (0.6, 1.0),
) -> Blade:
    """A picture that points away from its foot.

    Args:
        picture: whose lower border's middle is the foot.
        foot: (x, y, z), metres.
        azimuth: where it points to, radians.
        rise: above the horizontal, radians.
        size: width and length, metres.
        light: see `Blade`.
    """
    ahead, right = np.array([np.cos(azimuth), np.sin(azimuth)]), np.array([np.sin(azimuth), -np.cos(azimuth)])
    second = size[1] * np.array([*(np.cos(rise) * ahead), np.sin(rise)])
    first = size[0] * np.array([*right, 0.0])
    return Blade(picture, np.asarray(foot) - first / 2, first, second, light)


def sheet(
    picture: Picture,
    middle: tuple[float, float, float],
    azimuth: float,
    rise: float,
    side: float,
    light: float,
) -> Blade:
    """A square picture about its middle, tilted up by `rise` towards `azimuth` (rad); see `leaf`."""
    level, up = side / 2 * np.cos(rise), side / 2 * np.sin(rise)
    foot = (middle[0] - level * np.cos(azimuth), middle[1] - level * np.sin(azimuth), middle[2] - up)
    return leaf(picture, foot, azimuth, rise, (side, side), (light, light))


def specimen(blades: Sequence[Blade], lean: Floats) -> Specimen:
    """Tilt blades by a rotation (3, 3) about the stem's foot, lift them out of the ground, and measure them.

    Raises:
        SimulationError: there is no blade.
    """
    if not blades:
        raise SimulationError("plants: a plant needs at least one leaf")
    tilted = [
        Blade(item.picture, lean @ item.origin, lean @ item.first, lean @ item.second, item.light)
        for item in blades
    ]
    lowest = min(float(item.points(item.picture.hull)[:, 2].min()) for item in tilted)
    rise = np.array([0.0, 0.0, max(_CLEARANCE_M - lowest, 0.0)])
    risen = tuple(Blade(b.picture, b.origin + rise, b.first, b.second, b.light) for b in tilted)
    outlines = [item.points(outline) for item in risen for outline in item.picture.outlines]
    corners = np.concatenate(outlines)
    return Specimen(
        risen,
        tuple(_texture(item) for item in risen),
        tuple(item.points(item.picture.hull) for item in risen),
        float(np.hypot(corners[:, 0], corners[:, 1]).max()),
        covered_area([outline[:, :2] for outline in outlines]),
        float(corners[:, 2].max()),
    )


def placed(
    plant: Specimen, place: tuple[float, float, float], light: Callable[[Floats], Floats], blades: int
) -> list[Quad]:
    """Set a specimen into the ground.

    Args:
        plant: what to set.
        place: x, y of its stem (m) and its turn about it (rad).
        light: from upward unit normals (N, 3) to the light (N, 3) on leaves.
        blades: how many of its blades are drawn.
    """
    around, foot = _turn(place[2]), np.array([place[0], place[1], 0.0])
    shown = plant.blades[:blades]
    vectors = np.array([(item.origin, item.first, item.second) for item in shown]) @ around
    normals = np.cross(vectors[:, 1], vectors[:, 2])
    normals *= (np.where(normals[:, 2] < 0, -1, 1) / np.linalg.norm(normals, axis=1))[:, None]
    lights = np.array([item.light for item in shown])[:, :, None, None] * light(normals)[:, None, None, :]
    return [
        Quad(origin + foot, first, second, texture, light=shine, both_sides=True)
        for (origin, first, second), texture, shine in zip(vectors, plant.textures, lights, strict=False)
    ]


def shade_on_ground(plant: Specimen, place: tuple[float, float, float], slope: Floats) -> list[Floats]:
    """Outlines (K, 2) in metres of the ground that a plant's leaves keep from the light.

    Gaps between leaves of one picture are counted as leaf.

    Args:
        plant: the specimen.
        place: x, y of its stem (m) and its turn about it (rad).
        slope: (2,) way of the light in x and y while it falls by 1.
    """
    around = _turn(place[2])[:2, :2]
    return [hull[:, :2] @ around + hull[:, 2:] * slope + place[:2] for hull in plant.hulls]


def covered_area(outlines: Sequence[Floats]) -> float:
    """Area (m²) of the union of outlines (K, 2) in metres."""
    corners = np.concatenate(outlines)
    low, high = corners.min(axis=0), corners.max(axis=0)
    side = float((high - low).max())
    covered = np.zeros((_MEASURE_CELLS, _MEASURE_CELLS), np.bool_)
    for outline in outlines:
        covered |= filled((outline - low) / side, _MEASURE_CELLS)
    return float(covered.mean()) * side**2


def _turn(angle: float) -> Floats:
    """Matrix (3, 3) that turns row vectors about z, counter-clockwise."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])


def _texture(item: Blade) -> Texture:
    size = float(np.linalg.norm(item.first)), float(np.linalg.norm(item.second))
    return Texture(item.picture.texels, size, repeat=False, alpha=item.picture.alpha)
