# SPDX-License-Identifier: Apache-2.0
"""The ground of a country road: asphalt, worn paint and ragged verges, laid in pieces along a curve."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation import materials
from robot_vision.simulation.lane import Lane
from robot_vision.simulation.scene import Quad, quad
from robot_vision.simulation.texture import Texture

STRETCH = 16.0
"""Metres along the road that one painted stretch covers; it holds whole periods of the centre line."""
DASH, DASH_PERIOD = 3.0, 8.0
"""Metres painted and metres from one dash of the centre line to the next."""
LINE_WIDTH, LINE_INSET = 0.12, 0.22
"""Of the painted lines; from the asphalt's border to the middle of the verge line. Metres."""
VARIETY = 5
"""Stretches that are painted; the road is a random sequence of them."""
_COLUMNS, _ROWS_PER_METRE = 1024, 80
_SAGITTA = 0.0015
"""Metres by which a straight piece may leave the curve it stands for."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Surface:
    """How the ground is painted.

    Attributes:
        width: of the asphalt, metres.
        reach: metres from the centre line to where the ground of the road ends, verge included.
        wear: share of the paint that is gone, 0 to 1.
    """

    width: float
    reach: float
    wear: float

    def stretches(self, random: np.random.Generator) -> list[Texture]:
        """Different stretches that go on into each other in any order.

        Columns run along the road; row 0 is the right end of the verge. What repeats is the same in all of
        them; what differs ends before the ends of the stretch.
        """
        rows = round(2 * self.reach * _ROWS_PER_METRE)
        shape = (rows, _COLUMNS)
        along = (np.arange(_COLUMNS) + 0.5) / _COLUMNS * STRETCH
        left = (np.arange(rows) + 0.5) / rows * 2 * self.reach - self.reach
        ends = np.clip(np.minimum(along, STRETCH - along) / 0.8, 0, 1)
        fine, coarse, broad = (materials.grain(random, shape, (w, w)) for w in (1.2, 14, 150))
        ragged = 0.05 * materials.grain(random, (1, _COLUMNS), (1, 30))[0]
        ragged = ragged + 0.03 * materials.grain(random, (1, _COLUMNS), (1, 6))[0]
        border = np.abs(left)[:, None] - self.width / 2 - ragged + 0.015 * coarse
        grass = _grass(random, shape, coarse, broad)
        soil = _tinted((124, 110, 88), 0.85 + 0.22 * fine + 0.12 * coarse)
        painted = []
        for _ in range(VARIETY):
            ground = _asphalt(random, along, left, self.width, fine, broad, ends)
            paint = self._paint(random, along, left, ends)[..., None]
            white = _tinted((222, 220, 212), 0.88 + 0.06 * fine)
            ground = ground * (1 - paint) + white * paint
            ground = _blend(ground, soil, np.clip(border / 0.04 + 0.5, 0, 1))
            edge = border - 0.14 - 0.10 * materials.grain(random, shape, (9, 9)) * ends
            ground = _blend(ground, grass, np.clip(edge / 0.05 + 0.5, 0, 1))
            size = (STRETCH, 2 * self.reach)
            painted.append(Texture(ground.astype(np.float32), size, repeat=False))
        return painted

    def _paint(self, random: np.random.Generator, along: Floats, left: Floats, ends: Floats) -> Floats:
        """Cover of paint (rows, columns), 0 to 1: two verge lines and the dashes between them."""
        shape = (len(left), len(along))
        rubbed = materials.grain(random, shape, (5, 9)) + 0.9 * materials.grain(random, shape, (20, 90))
        limit = np.quantile(rubbed[::4, ::4], 0.55 * self.wear)
        cover = np.clip((rubbed - limit) / 0.35 + 0.5, 0, 1)
        paint = np.zeros(shape)
        verge = self.width / 2 - LINE_INSET
        for place in (-verge, verge):
            there = np.ones(len(along))
            for _ in range(3):
                if random.random() < self.wear:
                    middle, half = random.uniform(2, STRETCH - 2), random.uniform(0.4, 1.8)
                    there *= 1 - _between(along, middle - half, middle + half, 0.25)
            paint = np.maximum(paint, _stripe(left, place)[:, None] * there)
        for start in np.arange(1.0, STRETCH, DASH_PERIOD):
            there = _between(along, start, start + DASH, 0.02)
            if random.random() < 0.7 * self.wear:
                cut = start + DASH * random.uniform(0.0, 0.7)
                there *= 1 - _between(along, cut, cut + random.uniform(0.8, 3.0), 0.2)
            paint = np.maximum(paint, _stripe(left, 0.0)[:, None] * there)
        return np.asarray(paint * (0.93 * (1 - ends) + cover * ends))


def _grass(random: np.random.Generator, shape: tuple[int, int], coarse: Floats, broad: Floats) -> Floats:
    """Mown verge: blades, tufts and dry patches."""
    blades = materials.grain(random, shape, (2.5, 1.0))
    value = 0.9 + 0.30 * blades + 0.16 * coarse
    green = _tinted((102, 126, 58), value)
    dry = _tinted((164, 152, 96), value)
    return _blend(green, dry, np.clip(0.25 + 0.22 * broad + 0.10 * coarse, 0, 0.8))


def _asphalt(
    random: np.random.Generator,
    along: Floats,
    left: Floats,
    width: float,
    fine: Floats,
    broad: Floats,
    ends: Floats,
) -> Floats:
    """Asphalt polished in the wheel tracks, with cracks and mended places."""
    lane = width / 4
    tracks = sum(np.exp(-(((np.abs(left) - lane + side) / 0.28) ** 2)) for side in (-0.72, 0.72))
    value = (1 + 0.16 * fine + 0.05 * broad) * (1 + 0.10 * np.asarray(tracks))[:, None]
    value *= (1 - 0.12 * np.exp(-((left / 0.35) ** 2)) - 0.10 * (np.abs(left) > width / 2 - 0.45))[:, None]
    picture = np.ascontiguousarray(value, np.float32)
    per_row, per_column = len(left) / (left[-1] - left[0]), len(along) / STRETCH
    if random.random() < 0.5:  # a mended place
        low = np.array([random.uniform(2, 8), random.uniform(-width / 2, width / 4)])
        high = low + (random.uniform(1.5, 6.0), random.uniform(0.6, width / 4))
        inside = _between(along, low[0], high[0], 0.03) * ends
        picture *= 1 - 0.22 * _between(left, low[1], high[1], 0.03)[:, None] * inside
    for _ in range(int(random.integers(1, 4))):  # cracks, from one random place on
        steps = np.cumsum(random.normal((0.16, 0.0), (0.10, 0.10), (28, 2)), axis=0)
        start = (random.uniform(1.5, STRETCH - 6.5), random.uniform(-width / 2, width / 2))
        places = (steps + start - (0, left[0])) * (per_column, per_row)
        crack = np.ones_like(picture)
        cv2.polylines(crack, [np.round(16 * places).astype(np.int32)], False, 0.45, 1, cv2.LINE_AA, 4)
        picture *= np.where(ends > 0, crack, 1.0)
    return _tinted((122, 120, 116), picture.astype(np.float64))


def laid(lane: Lane, surface: Surface, random: np.random.Generator, begin: float, end: float) -> list[Quad]:
    """Pieces of painted ground along a lane, short where it bends, from `begin` to `end` metres along it."""
    stretches = surface.stretches(random)
    chosen: dict[int, Texture] = {}
    quads = []
    along = begin
    while along < end - 1e-6:
        number = int(np.floor(along / STRETCH + 1e-9))
        bend = max(abs(lane.point(along + ahead).curvature) for ahead in (0.0, 1.0, 2.0, 4.0))
        step = min(4.0, np.sqrt(8 * _SAGITTA / max(bend, 1e-6)), (number + 1) * STRETCH - along)
        if number not in chosen:
            chosen[number] = stretches[int(random.integers(len(stretches)))]
        a, b = (np.array(lane.point(place)[:2]) for place in (along, along + step))
        length = float(np.hypot(*(b - a)))
        ahead = (b - a) / length
        across = np.array([-ahead[1], ahead[0]])
        spare = 0.5 * bend * step * surface.reach + 1e-3  # closes the wedge on the outer side of the bend
        corner = a - spare * ahead - surface.reach * across
        quads.append(
            quad(
                (*corner, 0.0),
                (*((length + 2 * spare) * ahead), 0.0),
                (*(2 * surface.reach * across), 0.0),
                chosen[number],
                (along - number * STRETCH - spare, 0.0),
            )
        )
        along += step
    return quads


def _tinted(screen: tuple[int, int, int], value: Floats) -> Floats:
    """A colour as picked on a screen (red, green, blue), made lighter and darker (rows, columns)."""
    return materials.tinted(materials.linear(*screen), value).astype(np.float64)


def _blend(below: Floats, above: Floats, cover: Floats) -> Floats:
    return np.asarray(below * (1 - cover[..., None]) + above * cover[..., None])


def _between(x: Floats, low: float, high: float, soft: float) -> Floats:
    """1 from low to high, 0 outside, over `soft` metres at both ends."""
    return np.asarray(np.clip((x - low) / soft + 0.5, 0, 1) * np.clip((high - x) / soft + 0.5, 0, 1))


def _stripe(left: Floats, middle: float) -> Floats:
    """Cross-section (rows,) of a painted line, its borders exact to a part of a texel."""
    texel = left[1] - left[0]
    return np.asarray(np.clip((LINE_WIDTH / 2 - np.abs(left - middle)) / texel + 0.5, 0, 1))
