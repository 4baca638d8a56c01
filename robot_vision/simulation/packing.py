# SPDX-License-Identifier: Apache-2.0
"""A scene as the flat arrays that compiled loops read, laid out once and used for every picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation.scene import Ellipse, Quad, Scene
from robot_vision.simulation.texture import Texture

SOLID, CUT_OUT, ROUND = 0, 1, 2
"""Kinds of surface: all of its rectangle; where its texture's alpha says; within exact ellipses."""


class Materials(NamedTuple):
    """What surfaces are made of, for all pictures of a scene."""

    textures: NDArray[np.int64]  # (T, 3): number of levels, repeat flag, alpha's place before its texel's
    mips: NDArray[np.int64]  # (T, L, 3): offset into texels, rows, columns
    texels: NDArray[np.float32]  # (N, 3)
    alphas: NDArray[np.float32]  # (A,)
    clearances: NDArray[np.float32]  # (A,): see Texture.clearance; of the finest levels, 0 for all others
    lights: NDArray[np.float32]  # (M, 3)
    ellipses: NDArray[np.float64]  # (E, 7): centre (s, t), 2x2 from (s, t) to the unit circle, 1 for a hole


class Surfaces(NamedTuple):
    """The rectangles that can be in one picture."""

    forms: NDArray[np.float64]  # (Q, 3, 3): linear forms of s', t', w' in (u, v, 1)
    bounds: NDArray[np.int64]  # (Q, 2): first and last image row touched
    windows: NDArray[np.float64]  # (Q, 4): texels per unit of s and t, texel at s = t = 0
    textures: NDArray[np.int64]  # (Q,)
    lights: NDArray[np.int64]  # (Q, 3): offset, rows, columns
    kinds: NDArray[np.int64]  # (Q,): SOLID, CUT_OUT, ROUND
    ellipses: NDArray[np.int64]  # (Q, 2): first, count
    gloss: NDArray[np.float64]  # (Q,): reflectance at perpendicular view
    normals: NDArray[np.float64]  # (Q, 3): unit normals in the optical frame
    mirror_of: NDArray[np.int64]  # (Q,): index into Lamps.mirrors, or -1


class Lamps(NamedTuple):
    """Lamps as they mirror in the glossy rectangles of one picture."""

    mirrors: NDArray[np.float64]  # (P, G, 3, 3): forms of G lamps mirrored in P rectangles
    colours: NDArray[np.float64]  # (G, 3)
    sizes: NDArray[np.float64]  # (G, 2): metres
    roughness: float  # angle (rad) by which mirrored light is smeared


class Surroundings(NamedTuple):
    """What is seen where no rectangle is, and how the air between pales what is far."""

    rays: NDArray[np.float64]  # (3, 3): optical direction (x, y, 1) of a pixel (u, v, 1)
    turn: NDArray[np.float64]  # (3, 3): rotation from the optical frame into the world's
    background: NDArray[np.float64]  # (3,)
    sky: NDArray[np.float32]  # (R, C, 3): row from sin(elevation) 0 to 1, column by azimuth; R = 0 for none
    extinction: float  # share of light lost a metre


@dataclass(frozen=True, eq=False)
class Packed:
    """All rectangles of a scene in the world frame, and their materials."""

    vertices: NDArray[np.float64]  # (Q, 3, 3): rows first edge, second edge, origin; metres
    windows: NDArray[np.float64]
    textures: NDArray[np.int64]
    lights: NDArray[np.int64]
    kinds: NDArray[np.int64]
    ellipses: NDArray[np.int64]
    gloss: NDArray[np.float64]
    both_sides: NDArray[np.bool_]
    materials: Materials
    lamps: NDArray[np.float64]  # (G, 3, 3) like vertices
    lamp_colours: NDArray[np.float64]
    lamp_sizes: NDArray[np.float64]


def pack(scene: Scene) -> Packed:
    """Lay out a scene; textures and lights that several rectangles share are stored once."""
    quads = scene.quads
    numbers: dict[int, int] = {}
    pictures: list[Texture] = []
    for item in quads:
        if id(item.texture) not in numbers:
            numbers[id(item.texture)] = len(pictures)
            pictures.append(item.texture)
    light_of, places, lights = _lights(quads)
    ellipses, round_places = _ellipses(quads)
    textures, mips, texels, alphas, clearances = _textures(pictures)
    lamps = [item for item in quads if item.shines]
    return Packed(
        vertices=_vertices(quads),
        windows=np.array([_window(item) for item in quads]),
        textures=np.array([numbers[id(item.texture)] for item in quads]),
        lights=places[light_of],
        kinds=np.array([_kind(item) for item in quads]),
        ellipses=round_places,
        gloss=np.array([item.gloss for item in quads]),
        both_sides=np.array([item.both_sides for item in quads]),
        materials=Materials(textures, mips, texels, alphas, clearances, lights, ellipses),
        lamps=_vertices(lamps),
        lamp_colours=np.array([item.texture.texels.mean(axis=(0, 1)) for item in lamps]).reshape(-1, 3),
        lamp_sizes=np.array(
            [(np.linalg.norm(item.first), np.linalg.norm(item.second)) for item in lamps]
        ).reshape(-1, 2),
    )


def _textures(
    pictures: list[Texture],
) -> tuple[
    NDArray[np.int64], NDArray[np.int64], NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]
]:
    """All mip levels one after another; the alpha of a texel lies `textures[t, 2]` before it."""
    deepest = max(len(texture.levels) for texture in pictures)
    mips = np.zeros((len(pictures), deepest, 3), np.int64)
    textures = np.empty((len(pictures), 3), np.int64)
    texels: list[NDArray[np.float32]] = []
    alphas: list[NDArray[np.float32]] = [np.zeros(0, np.float32)]
    clearances: list[NDArray[np.float32]] = [np.zeros(0, np.float32)]
    filled = masked = 0
    for number, texture in enumerate(pictures):
        textures[number] = (len(texture.levels), texture.repeat, filled - masked)
        for level, array in enumerate(texture.levels):
            mips[number, level] = (filled, *array.shape[:2])
            texels.append(array.reshape(-1, 3))
            filled += len(texels[-1])
        for level, array in enumerate(texture.alpha_levels):
            alphas.append(array.reshape(-1))
            clear = texture.clearance if level == 0 else np.zeros(array.shape, np.float32)
            clearances.append(clear.reshape(-1))
            masked += len(alphas[-1])
    return textures, mips, np.concatenate(texels), np.concatenate(alphas), np.concatenate(clearances)


def _lights(
    quads: tuple[Quad, ...],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float32]]:
    """Which light each rectangle has, where each light lies (offset, rows, columns), and all their nodes."""
    full = np.ones((1, 1, 3), np.float32)
    numbers: dict[int, int] = {}
    lights: list[NDArray[np.floating]] = []
    light_of = np.empty(len(quads), np.int64)
    for index, item in enumerate(quads):
        light = full if item.light is None else item.light
        if id(light) not in numbers:
            numbers[id(light)] = len(lights)
            lights.append(light)
        light_of[index] = numbers[id(light)]
    sizes = [light.shape[0] * light.shape[1] for light in lights]
    offsets = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    places = np.array([(at, *light.shape[:2]) for at, light in zip(offsets, lights, strict=True)], np.int64)
    nodes = np.empty((sum(sizes), 3), np.float32)
    for at, size, light in zip(offsets, sizes, lights, strict=True):
        nodes[at : at + size] = light.reshape(-1, 3)
    return light_of, places, nodes


def _kind(item: Quad) -> int:
    if item.texture.alpha is not None:
        return CUT_OUT
    return ROUND if item.holes or item.outline is not None else SOLID


def _ellipses(quads: tuple[Quad, ...]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """All ellipses of all rectangles, and the first and number of each rectangle's."""
    rows: list[NDArray[np.float64]] = []
    places = np.zeros((len(quads), 2), np.int64)
    for index, item in enumerate(quads):
        places[index, 0] = len(rows)
        if item.outline is not None:
            rows.append(_ellipse(item, item.outline, 0.0))
        rows += [_ellipse(item, hole, 1.0) for hole in item.holes]
        places[index, 1] = len(rows) - places[index, 0]
    return np.array(rows, np.float64).reshape(-1, 7), places


def _ellipse(item: Quad, shape: Ellipse, hole: float) -> NDArray[np.float64]:
    """Centre in (s, t), the matrix from (s, t) to the unit circle, and whether it is a hole."""
    sides = np.array([np.linalg.norm(item.first), np.linalg.norm(item.second)])
    cosine, sine = np.cos(shape.angle), np.sin(shape.angle)
    to_axes = np.array([[cosine, sine], [-sine, cosine]]) / np.asarray(shape.axes)[:, None] * sides
    return np.concatenate([np.asarray(shape.centre) / sides, to_axes.ravel(), [hole]])


def _vertices(quads: tuple[Quad, ...] | list[Quad]) -> NDArray[np.float64]:
    return np.array([(item.first, item.second, item.origin) for item in quads], np.float64).reshape(-1, 3, 3)


def _window(item: Quad) -> tuple[float, float, float, float]:
    """Texels per unit of s and of t, and the texel at s = t = 0."""
    rows, columns = item.texture.texels.shape[:2]
    per_metre = columns / item.texture.size[0], rows / item.texture.size[1]
    return (
        float(np.linalg.norm(item.first)) * per_metre[0],
        float(np.linalg.norm(item.second)) * per_metre[1],
        item.texture_origin[0] * per_metre[0],
        item.texture_origin[1] * per_metre[1],
    )
