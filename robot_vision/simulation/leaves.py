# SPDX-License-Identifier: Apache-2.0
"""Leaves cut out of paper: what is drawn, casts shadows and is measured comes from the same corners."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation.materials import grain
from robot_vision.simulation.texture import Colour

Floats = NDArray[np.float64]
Random = np.random.Generator

_FINER = 3
"""Pictures are painted this much larger than they are kept, so that borders lie between texels."""


@dataclass(frozen=True, eq=False)
class Leaf:
    """A leaf in a picture of side 1.

    Attributes:
        outline: (K, 2) corners, across and along the picture.
        base: (2,) where it is joined to its stalk.
        tip: (2,) its far end.
        brightness: factor of its colour.
    """

    outline: Floats
    base: Floats
    tip: Floats
    brightness: float = 1.0

    def placed(self, middle: Floats, angle: float, size: float, brightness: float) -> Leaf:
        """The same leaf with its base at `middle`, turned clockwise by `angle` (rad) and resized."""
        cos, sin = np.cos(angle), np.sin(angle)
        turn = size * np.array([[cos, -sin], [sin, cos]])
        outline, tip = ((part - self.base) @ turn + middle for part in (self.outline, self.tip))
        return Leaf(outline, middle, tip, brightness)


@dataclass(frozen=True, eq=False)
class Picture:
    """Leaves painted side by side and over each other.

    Attributes:
        texels: float32 (N, N, 3), linear blue, green, red.
        alpha: float32 (N, N), 1 where there is a leaf.
        outlines: (K, 2) each, in sides of the picture, across and along.
    """

    texels: NDArray[np.float32]
    alpha: NDArray[np.float32]
    outlines: tuple[Floats, ...]

    @cached_property
    def hull(self) -> Floats:
        """What a thread around all leaves would enclose, (K, 2) like an outline."""
        corners = np.concatenate(self.outlines).astype(np.float32)
        return np.asarray(cv2.convexHull(corners)[:, 0], np.float64)


def blade(random: Random, width: float, widest: float = 0.5, wave: float = 0.0) -> Leaf:
    """An upright leaf from (0.5, 0) to (0.5, 1).

    Args:
        random: of its waves.
        width: in lengths.
        widest: how far along it is widest, 0 to 1.
        wave: of its border, in widths.
    """
    along = (1 - np.cos(np.linspace(0, np.pi, 13))) / 2
    power = np.array([widest, 1 - widest]) * 1.3
    shape = along ** power[0] * (1 - along) ** power[1]
    half = width / 2 * shape / shape.max()
    left, right = (half * (1 + wave * random.standard_normal(13)) for _ in range(2))
    across = 0.5 + np.concatenate([-left, right[-2:0:-1]])
    outline = np.column_stack([across, np.concatenate([along, along[-2:0:-1]])])
    return Leaf(np.clip(outline, 0.0, 1.0), np.array([0.5, 0.0]), np.array([0.5, 1.0]))


def whorl(random: Random, leaf: Leaf, count: int, inner: float = 0.04) -> list[Leaf]:
    """`count` leaves that point to all sides from the middle of the picture."""
    turns = 2 * np.pi * (np.arange(count) + random.uniform(-0.22, 0.22, count)) / count
    turns += random.uniform(0, 2 * np.pi)
    sizes = random.uniform(0.78, 1.0, count) * (0.495 - inner)
    middle = np.array([0.5, 0.5])
    return [
        leaf.placed(
            middle + inner * np.array([np.sin(turns[n]), np.cos(turns[n])]),
            float(turns[n]),
            float(sizes[n]),
            float(random.uniform(0.85, 1.12)),
        )
        for n in random.permutation(count)
    ]


def tuft(random: Random, leaf: Leaf, count: int, spread: float, size: float = 0.9) -> list[Leaf]:
    """`count` leaves that fan out from the middle of the lower border, up to `spread` (rad) to both sides."""
    angles = np.linspace(-spread, spread, count) + random.uniform(-0.3, 0.3, count) * spread / count
    return [
        leaf.placed(
            np.array([0.5 + random.uniform(-0.04, 0.04), 0.01]),
            float(angles[n]),
            float(size * random.uniform(0.7, 1.0)),
            float(random.uniform(0.8, 1.15)),
        )
        for n in random.permutation(count)
    ]


def bunch(random: Random, leaf: Leaf, count: int, size: float) -> list[Leaf]:
    """`count` leaves of a bush, spread over the picture, most of them hanging outwards."""
    leaves = []
    for n in range(count):
        angle = 2.4 * n + random.uniform(-0.5, 0.5)  # the golden angle, as buds sit on a stem
        reach = 0.34 * np.sqrt((n + 0.5) / count)
        middle = np.array([0.5, 0.5]) + reach * np.array([np.sin(angle), np.cos(angle)])
        long = size * random.uniform(0.8, 1.15)
        away = angle + random.uniform(-0.7, 0.7)
        base = middle - 0.35 * long * np.array([np.sin(away), np.cos(away)])
        leaves.append(leaf.placed(base, float(away), float(long), float(random.uniform(0.72, 1.15))))
    return leaves[::-1]


def paint(random: Random, leaves: list[Leaf], colour: Colour, side: int, rib: float = 0.35) -> Picture:
    """Paint leaves one over the other, with ribs, veins, and a little shade where one lies on another.

    Args:
        random: of the mottling.
        leaves: the first lies lowest.
        colour: linear blue, green, red.
        side: texels along the picture's sides.
        rib: how much lighter the middle rib is than the leaf.
    """
    fine = side * _FINER
    columns, rows = np.meshgrid((np.arange(fine) + 0.5) / fine, (np.arange(fine) + 0.5) / fine)
    value, alpha = np.zeros((fine, fine)), np.zeros((fine, fine), np.bool_)
    mottling = 1 + 0.07 * grain(random, (fine, fine), (fine / 20, fine / 20))
    for leaf in leaves:
        inside = filled(leaf.outline, fine)
        value *= 1 - 0.55 * cv2.GaussianBlur(inside.astype(np.float32), (0, 0), fine / 40)
        value[inside] = (leaf.brightness * _veins(leaf, columns[inside], rows[inside], rib)) * mottling[
            inside
        ]
        alpha |= inside
    covered = alpha.astype(np.float32)
    kept = cv2.resize(covered, (side, side), interpolation=cv2.INTER_AREA)
    light = cv2.resize((value * covered).astype(np.float32), (side, side), interpolation=cv2.INTER_AREA)
    light = np.where(kept > 0.02, light / np.maximum(kept, 0.02), 1.0)
    pale = np.clip(light - 1.15, 0, None)[..., None]  # ribs are not only lighter, but less green
    texels = light[..., None] * np.asarray(colour) + pale * np.array([0.10, 0.02, 0.06])
    outlines = tuple(leaf.outline for leaf in leaves)
    return Picture(np.ascontiguousarray(texels, np.float32), np.ascontiguousarray(kept), outlines)


def filled(outline: Floats, cells: int) -> NDArray[np.bool_]:
    """Which cells (N, N) of a picture of side 1 have their middle inside an outline (K, 2).

    OpenCV's polygons are half a pixel to a pixel too wide on all sides, which doubles a blade of grass.
    """
    inside = np.zeros((cells, cells), np.bool_)
    low = np.clip(np.ceil(cells * outline.min(axis=0) - 0.5), 0, cells).astype(int)
    high = np.clip(np.ceil(cells * outline.max(axis=0) - 0.5), 0, cells).astype(int)
    start = cells * outline - 0.5 - low  # so that middles are whole numbers
    end = np.roll(start, -1, axis=0)
    rows = np.arange(high[1] - low[1])[:, None]
    row, edge = np.nonzero((start[:, 1] > rows) != (end[:, 1] > rows))
    a, b = start[edge], end[edge]
    column = a[:, 0] + (row - a[:, 1]) * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    turns = np.zeros((len(rows), high[0] - low[0] + 1), np.uint8)
    np.add.at(turns, (row, np.clip(np.ceil(column), 0, high[0] - low[0]).astype(int)), 1)
    odd = np.bitwise_xor.accumulate(turns[:, :-1] & 1, axis=1)
    inside[low[1] : high[1], low[0] : high[0]] = odd == 1
    return inside


def _veins(leaf: Leaf, columns: Floats, rows: Floats, rib: float) -> Floats:
    """Brightness at places of one leaf: darker at its base, lighter along its rib and veins."""
    axis = leaf.tip - leaf.base
    length = float(np.hypot(*axis))
    axis = axis / length
    dx, dy = columns - leaf.base[0], rows - leaf.base[1]
    along = (dx * axis[0] + dy * axis[1]) / length
    across = np.abs(dx * axis[1] - dy * axis[0]) / length
    middle = rib * np.exp(-((across / 0.025) ** 2)) * (1.15 - along)
    side = 0.5 * rib * np.exp(-((np.mod(5 * (along - 0.7 * across), 1.0) - 0.5) ** 2) / 0.008)
    return np.asarray(0.72 + 0.32 * np.clip(along, 0, 1) + middle + side)
