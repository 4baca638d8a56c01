# SPDX-License-Identifier: Apache-2.0
"""What lies along a paved path: stones, grass, hedges, walls, trees and the sky, painted from a seed."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation import materials
from robot_vision.simulation.materials import Random
from robot_vision.simulation.texture import Texture

STONES_ALONG = 8
"""Flagstones along the path after which the pattern of their colours comes again."""


def flagstones(random: Random, length: float, width: float, across: int, joint: float) -> Texture:
    """Sawn stones in rows and columns with joints of sand between; every stone has its own shade and grain.

    Args:
        random: where shades and grain come from.
        length: of a stone with one joint, along the texture's columns, metres.
        width: likewise along its rows, metres.
        across: stones along the rows.
        joint: width of the joints, metres; their middles lie at multiples of length and width.
    """
    shape = (512, 1024)
    size = (STONES_ALONG * length, across * width)
    wander = 0.0012 * materials.grain(random, shape, (24, 24))
    gaps = []
    for axis, (count, pitch) in enumerate(((across, width), (STONES_ALONG, length))):
        metres = (np.arange(shape[axis]) + 0.5) * count * pitch / shape[axis]
        gap = np.abs(metres - pitch * np.round(metres / pitch))
        gaps.append(gap[:, None] if axis == 0 else gap[None, :])
    texel = max(size[0] / shape[1], size[1] / shape[0])
    gap = np.minimum(*np.broadcast_arrays(*gaps))
    sand = np.clip((joint / 2 - gap + wander) / texel + 0.5, 0, 1)
    rows, columns = (
        np.arange(n) * count // n for n, count in zip(shape, (across, STONES_ALONG), strict=True)
    )
    stone = rows[:, None], columns[None, :]
    shade = (1 + 0.07 * random.standard_normal((across, STONES_ALONG)))[stone]
    warmth = (0.025 * random.standard_normal((across, STONES_ALONG)))[stone]
    value = shade + 0.045 * materials.grain(random, shape, (1.5, 1.5))
    value += 0.05 * materials.grain(random, shape, (14, 30)) + 0.03 * materials.grain(random, shape, (90, 90))
    value -= 0.10 * np.exp(-(((gap - joint / 2) / 0.012) ** 2))  # edges are worn and dirty
    picture = materials.tinted(materials.linear(176, 170, 156), value)
    picture[..., 0] *= 1 - warmth
    picture[..., 2] *= 1 + warmth
    moss = np.clip(0.5 + 0.7 * materials.grain(random, shape, (50, 50)), 0, 1)[..., None]
    filling = (1 - moss) * np.array(materials.linear(92, 84, 70)) + moss * np.array(
        materials.linear(70, 78, 48)
    )
    filling = filling * (1 + 0.15 * materials.grain(random, shape, (1, 1)))[..., None]
    picture = picture * (1 - sand[..., None]) + filling * sand[..., None]
    return Texture(np.asarray(np.maximum(picture, 0), np.float32), size)


def granite(random: Random, joint_every: float = 1.0, height: float = 1.0) -> Texture:
    """Speckled light stone with a joint across once in a tile."""
    shape = (128, 512)
    value = (
        1 + 0.10 * materials.grain(random, shape, (1, 1)) + 0.04 * materials.grain(random, shape, (20, 60))
    )
    value[:, :5] *= 0.45
    return Texture(materials.tinted(materials.linear(168, 168, 166), value), (joint_every, height))


def column_stone(random: Random) -> Texture:
    """Warm sandstone with faint beds."""
    shape = (512, 256)
    beds = materials.grain(random, shape, (10, 160))
    value = 1 + 0.05 * beds + 0.05 * materials.grain(random, shape, (3, 3))
    return Texture(materials.tinted(materials.linear(200, 184, 152), value), (1.28, 2.56))


def grass(random: Random) -> Texture:
    """Mown lawn: blades, tufts, dry patches; tile of 2.56 m."""
    shape = (512, 512)
    blades = materials.grain(random, shape, (2.5, 1.0))
    dry = np.clip(0.5 + 0.35 * materials.grain(random, shape, (60, 60)), 0, 1)[..., None]
    value = (1 + 0.30 * blades + 0.15 * materials.grain(random, shape, (14, 14))).clip(0.25)
    colour = dry * np.array(materials.linear(122, 128, 66)) + (1 - dry) * np.array(
        materials.linear(78, 112, 44)
    )
    return Texture(np.asarray(colour * value[..., None], np.float32), (2.56, 2.56))


def bricks(random: Random) -> Texture:
    """Garden wall of red bricks in stretcher bond; tile of 1 m by 0.6 m (8 courses)."""
    rows, columns, courses, along = 256, 512, 8, 4
    y, x = np.arange(rows)[:, None], np.arange(columns)[None, :]
    course = y * courses // rows
    shifted = (x + (course % 2) * columns // along // 2) % columns
    which = shifted * along // columns
    shade = (1 + 0.16 * random.standard_normal((courses, along)))[course, which]
    value = shade * (1 + 0.08 * materials.grain(random, (rows, columns), (2, 2)))
    picture = materials.tinted(materials.linear(158, 86, 66), value.clip(0.3))
    mortar = (y % (rows // courses) < 4) | (shifted % (columns // along) < 5)
    picture[mortar] = np.array(materials.linear(176, 168, 154)) * 0.9
    return Texture(picture, (1.0, 0.6))


def leaves(random: Random, size: tuple[float, float], alpha: NDArray[np.float32] | None = None) -> Texture:
    """A hedge's or a tree's leaves seen from outside: light tips over dark depths.

    Args:
        random: where the leaves grow.
        size: metres that the picture covers.
        alpha: (R, C) outline for cut-outs; None: a tile of 512 x 512.
    """
    shape = (512, 512) if alpha is None else (alpha.shape[0], alpha.shape[1])
    tips = materials.grain(random, shape, (4, 4)) + 0.7 * materials.grain(random, shape, (9, 9))
    boughs = materials.grain(random, shape, (45, 45))
    value = np.exp(0.42 * tips + 0.22 * boughs).clip(0.15, 3.0)
    picture = materials.tinted(materials.linear(66, 96, 42), value)
    return Texture(picture, size, repeat=alpha is None, alpha=alpha)


def tree(random: Random, size: tuple[float, float]) -> Texture:
    """A broad tree as a cut-out of `size` metres (width, height): trunk below, crown of leaves above."""
    rows, columns = 256, 256
    y, x = np.mgrid[0:rows, 0:columns] / np.array([rows, columns])[:, None, None]
    crown = np.full((rows, columns), -np.inf)
    for _ in range(7):
        middle = random.uniform(0.30, 0.70), random.uniform(0.42, 0.78)
        reach = random.uniform(0.16, 0.26)
        crown = np.maximum(crown, 1 - np.hypot(x - middle[0], y - middle[1]) / reach)
    edge = 0.10 * materials.grain(random, (rows, columns), (5, 5)) + 0.10 * materials.grain(
        random, (rows, columns), (16, 16)
    )
    green = crown + edge > 0
    trunk = (np.abs(x - 0.5) < 0.035 - 0.015 * y) & (y < 0.5)
    alpha = cv2.GaussianBlur((green | trunk).astype(np.float32), (0, 0), 0.7)
    texture = leaves(random, size, alpha)
    lighter = (0.65 + 0.5 * y)[..., None]
    fissures = 1 + 0.2 * materials.grain(random, (rows, columns), (20, 2))
    bark = materials.tinted(materials.linear(84, 70, 56), fissures)
    picture = np.where((trunk & ~green)[..., None], bark, texture.texels * lighter)
    return Texture(np.asarray(picture, np.float32), size, repeat=False, alpha=alpha)


def sky(random: Random) -> NDArray[np.float32]:
    """Summer sky (R, C, 3) for a Scene: paler towards the horizon, with thin clouds."""
    shape = (192, 1024)
    height = np.linspace(0, 1, shape[0])[:, None, None]
    low, high = np.array(materials.linear(206, 222, 236)), np.array(materials.linear(112, 158, 214))
    blue = low + (high - low) * height**0.45
    cloud = materials.grain(random, shape, (10, 60)) + 0.6 * materials.grain(random, shape, (5, 18))
    veil = (0.75 * np.clip(0.35 * cloud - 0.10, 0, 1) * (1 - np.exp(-height[..., 0] / 0.05)))[..., None]
    return np.asarray(1.15 * (blue * (1 - veil) + veil * 0.96), np.float32)
