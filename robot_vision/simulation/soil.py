# SPDX-License-Identifier: Apache-2.0
"""The ground that crops grow in: clods lit from one side, stones, straw, furrows, and grass at its end."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation.field_plan import FieldSettings
from robot_vision.simulation.leaves import Floats, Random
from robot_vision.simulation.materials import grain, linear, tinted
from robot_vision.simulation.texture import Colour, Texture

TEXEL_M = 0.005
_SIDE = 512
_REACH = 16
"""Texels from a clod's middle to the end of its shadow, at most."""
SOILS: tuple[Colour, ...] = (
    linear(138, 124, 103),
    linear(120, 104, 84),
    linear(130, 124, 114),
    linear(130, 113, 95),
)
"""Loess, loam, grey silt and red marl, moderately dry."""


def clods(random: Random, colour: Colour, sun: Floats, roughness: float = 1.0) -> Texture:
    """Tilled soil, a tile of 2.56 m that repeats.

    Args:
        random: where the clods lie.
        colour: of the soil in full light.
        sun: (3,) towards the sun; lights one side of each clod. Straight up where there is none.
        roughness: of the surface; 1 is a seed bed, 0.4 rolled ground.
    """
    shape = (_SIDE, _SIDE)
    height = np.zeros(shape)
    for wavelength, floor, size in ((22, 0.8, 3.0), (8, 0.4, 1.8), (3, 0.0, 0.8)):
        height += size * np.sqrt(np.maximum(grain(random, shape, (wavelength, wavelength)) - floor, 0))
    slope_x, slope_y = ((np.roll(height, -1, axis) - np.roll(height, 1, axis)) / 2 for axis in (1, 0))
    facing = -(sun[0] * slope_x + sun[1] * slope_y) / max(float(sun[2]), 0.3)
    value = 1 + roughness * 0.30 * np.tanh(0.8 * facing) + 0.06 * grain(random, shape, (40, 40))
    lumps = np.ascontiguousarray(value, np.float32)
    _strew_clods(random, lumps, sun, int(3_500 * roughness))
    picture = tinted(colour, lumps * (1 + 0.07 * grain(random, shape, (1, 1))))
    _strew_straw(random, picture, int(42 * roughness))
    return Texture(picture, (_SIDE * TEXEL_M, _SIDE * TEXEL_M))


def meadow(random: Random) -> Texture:
    """Grass that has been driven over, a tile of 5.12 m that repeats."""
    shape = (512, 512)
    value = 1 + 0.22 * grain(random, shape, (1.5, 1.5)) + 0.14 * grain(random, shape, (60, 60))
    dry = np.clip(0.35 + 0.3 * grain(random, shape, (25, 25)), 0, 1)[..., None]
    picture = (1 - dry) * tinted(linear(96, 118, 58), value) + dry * tinted(linear(140, 136, 88), value)
    return Texture(np.ascontiguousarray(picture, np.float32), (5.12, 5.12))


def _strew_clods(random: Random, value: NDArray[np.float32], sun: Floats, count: int) -> None:
    """Draw clods of 6 mm to 6 cm, most of them small, each with its shadow, over the borders as well."""
    radii = np.minimum(0.6 * random.pareto(1.6, count) + 0.6, 6.0)
    places = random.uniform(0, _SIDE, (count, 2))
    away = -0.7 * sun[:2] / max(float(sun[2]), 0.3)
    for place, radius, shade, turn, flat in zip(
        places,
        radii,
        random.normal(1.06, 0.13, count),
        random.uniform(0, 180, count),
        random.uniform(0.6, 1.0, count),
        strict=True,
    ):
        axes = (int(radius * 16), int(radius * flat * 16))
        for middle in _over_borders(place):
            for centre, brightness in (
                (middle + radius * away, 0.68),
                (middle, 0.92 * shade),
                (middle - 0.25 * radius * away, 1.12 * shade),
            ):
                at = (int(centre[0] * 16), int(centre[1] * 16))
                size = axes if brightness < shade else (axes[0] * 2 // 3, axes[1] * 2 // 3)
                cv2.ellipse(value, at, size, float(turn), 0, 360, float(brightness), -1, cv2.LINE_8, 4)


def _over_borders(place: Floats) -> Iterator[Floats]:
    """Where something near a border of the tile has to be drawn, so that it goes on at the opposite one."""
    for shift in product((-_SIDE, 0, _SIDE), repeat=2):
        middle = place + shift
        if -_REACH < middle.min() and middle.max() < _SIDE + _REACH:
            yield middle


def _strew_straw(random: Random, picture: NDArray[np.float32], count: int) -> None:
    """Draw stubble of 2 to 8 cm; none over the border, where it would be cut off."""
    straw = np.array(linear(186, 172, 132))
    for _ in range(count):
        start = random.uniform(20, _SIDE - 20, 2)
        angle, length = random.uniform(0, np.pi), random.uniform(4, 16)
        end = start + length * np.array([np.cos(angle), np.sin(angle)])
        a, b = ((int(round(place[0])), int(round(place[1]))) for place in (start, end))
        shade = straw * random.uniform(0.6, 1.0)
        cv2.line(picture, a, b, (float(shade[0]), float(shade[1]), float(shade[2])), 1, cv2.LINE_AA)


def furrows(random: Random, plan: FieldSettings) -> Callable[[Floats], Floats]:
    """How light the soil is (N,) at points (N, 3): drill lines, streaks, wheel tracks, damp spots.

    Args:
        random: of tracks and damp.
        plan: of the field.
    """
    tracks = random.random(plan.rows + 1) < 0.25
    across = np.linspace(plan.sides[0] - 1, plan.sides[1] + 1, 20 * plan.rows + 200)
    streaks = 0.045 * grain(random, (1, len(across)), (1, 3))[0]
    waves, phases = 1.2 * random.uniform(-1, 1, (6, 2)), random.uniform(0, 2 * np.pi, 6)

    def shade(points: Floats) -> Floats:
        along, left = plan.ways(points)
        row = left / plan.spacing + plan.rows // 2
        from_row = row - np.round(row)
        value = 1 - 0.09 * np.exp(-((from_row / 0.09) ** 2)) + 0.06 * np.cos(2 * np.pi * from_row)
        inside = (row > -0.7) & (row < plan.rows - 0.3) & (along < plan.length + 0.3)
        value = np.where(inside, value, 0.97)
        worn = inside & tracks[np.clip(np.floor(row).astype(int) + 1, 0, plan.rows)]
        value += 0.09 * worn * np.exp(-(((np.abs(from_row) - 0.5) / 0.22) ** 4))
        value += inside * np.interp(left, across, streaks)
        damp = np.sin(points[:, :2] @ waves.T + phases).sum(axis=1)
        return np.asarray(value * (1 + 0.025 * damp))

    return shade
