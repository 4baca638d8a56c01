# SPDX-License-Identifier: Apache-2.0
"""What grows and stands beside a country road: hedges with ragged tops, trees, posts and poles."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation import materials
from robot_vision.simulation.lane import Lane
from robot_vision.simulation.scene import Quad, billboard, box, quad
from robot_vision.simulation.texture import Texture

PIECE = 2.0
"""Metres along the road of one flat piece of a hedge."""
DEPTH = 0.9
"""Metres from a hedge's front to its back."""
_LAYERS = ((0.0, 0.80, 0.95), (0.35, 0.95, 1.0), (0.7, 1.08, 1.1))
"""Metres behind the front, height and brightness of the screens of leaves that make a hedge."""
_RAGGED = 0.75
"""Metres below its top down to which a screen of leaves has gaps."""
_SCREEN = 8.0
"""Metres of hedge before its picture repeats."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HedgeLine:
    """One hedge along a lane.

    Attributes:
        lane: along which it grows.
        side: +1 on the left of the lane, -1 on the right.
        distance: of its front from the centre line, metres.
        along: (N,) places along the lane where the height is known, metres.
        height: (N,) metres.
    """

    lane: Lane
    side: int
    distance: float
    along: Floats
    height: Floats

    @classmethod
    def grown(
        cls,
        random: np.random.Generator,
        lane: Lane,
        side: int,
        distance: float,
        span: tuple[float, float],
        height: float,
    ) -> HedgeLine:
        """A hedge cut to about `height` metres, here and there lower, from span[0] to span[1] along the lane."""
        along = np.arange(span[0], span[1] + PIECE / 2, PIECE)
        waves = sum(
            size * np.sin(2 * np.pi * along / length + random.uniform(0, 2 * np.pi))
            for size, length in ((0.10, 61.0), (0.07, 23.0), (0.04, 7.3))
        )
        low = np.zeros(len(along))
        for place in np.arange(span[0] + 25, span[1], 70.0):
            low += np.exp(-(((along - place - random.uniform(-20, 20)) / random.uniform(3, 8)) ** 2))
        grown = height * (1 + waves) * (1 - 0.42 * np.clip(low, 0, 1))
        return cls(lane, side, distance, along, np.asarray(grown))

    def place(self, along: float, behind: float = 0.0) -> Floats:
        """Point (2,) of its front, or so many metres behind it."""
        x, y, yaw, _ = self.lane.point(along)
        away = self.side * (self.distance + behind)
        return np.array([x - away * np.sin(yaw), y + away * np.cos(yaw)])

    def line(self, behind: float = 0.0) -> Floats:
        """(N, 2) points of its front or of what lies behind it, in the order of `along`."""
        return np.array([self.place(float(at), behind) for at in self.along])

    def quads(self, screens: list[Texture], brightness: float) -> list[Quad]:
        """Screens of leaves one behind the other, the farther the taller, seen from the road and from behind."""
        tall = screens[0].size[1]
        solid = [Texture(screen.texels, screen.size) for screen in screens]
        found = []
        for layer, (behind, share, light) in enumerate(_LAYERS):
            points = self.line(behind)
            for number, (a, b) in enumerate(zip(points, points[1:], strict=False)):
                if self.side > 0:  # columns run to the right as seen from the road
                    a, b = b, a
                spare = 0.02 * (b - a)
                height = share * float(self.height[number : number + 2].mean())
                kind = (layer + number // 4) % len(screens)
                start = (PIECE * number + 2.7 * layer) % _SCREEN
                start = start if self.side < 0 else _SCREEN - start
                cut = max(height - _RAGGED, -0.05)
                parts = [(cut, height, screens[kind])]
                if layer < 2 and cut > 0:  # of the farthest only the top is seen
                    parts.append((-0.05, cut, solid[kind]))
                for low, high, texture in parts:
                    item = quad(
                        (*(a - spare), low),
                        (*(b - a + 2 * spare), 0.0),
                        (0.0, 0.0, high - low),
                        texture,
                        (start, tall - height + low),
                        both_sides=True,
                    )
                    shade = np.interp(np.linspace(low, high, 5) / height, (0.0, 0.5, 1.0), (0.45, 0.9, 1.0))
                    shade *= light * brightness
                    found.append(replace(item, light=np.repeat(shade[:, None, None], 3, axis=2)))
        return found

    def shadow(self, random: np.random.Generator, away: Floats) -> list[Floats]:
        """Outlines (K, 2) of its shadow on the ground, a stretch each; `away` (2,) is that of a 1 m post."""
        fine = np.arange(self.along[0], self.along[-1], 0.4)
        height = np.interp(fine, self.along, self.height) * (0.97 + 0.07 * random.standard_normal(len(fine)))
        outlines = []
        for start in range(0, len(fine) - 1, 20):
            part = slice(start, start + 21)
            foot = np.array([self.place(float(at)) for at in fine[part]])
            back = np.array([self.place(float(at), DEPTH / 2) for at in fine[part]])
            outlines.append(np.concatenate([foot, (back + height[part, None] * away)[::-1]]))
        return outlines


def leaf_screens(random: np.random.Generator, height: float) -> list[Texture]:
    """Hedge leaves, ragged at the top: pictures 8 m wide that repeat, tall enough for a hedge of `height`."""
    rows, columns = 256, 1024
    tall = 1.45 * height
    up = (np.arange(rows)[:, None] + 0.5) / rows * tall
    screens = []
    for tint in ((82, 108, 46), (92, 112, 50), (76, 100, 48)):
        leaves, twigs, clumps = (
            materials.grain(random, (rows, columns), (w, 2.2 * w))  # wide, because they are seen aslant
            for w in (1.5, 6, 30)
        )
        value = np.clip(0.80 + 0.22 * leaves + 0.20 * twigs + 0.30 * clumps, 0.12, 2.0)
        picture = materials.tinted(materials.linear(*tint), value)
        young = np.clip((leaves + 0.6 * clumps - 1.2) / 0.8, 0, 1)[..., None]
        picture = picture * (1 - 0.6 * young) + 0.6 * young * np.array(materials.linear(166, 186, 96))
        top = tall - 0.16 + 0.05 * materials.grain(random, (1, columns), (1, 60))
        top = top + 0.05 * materials.grain(random, (1, columns), (1, 14)) + 0.03 * twigs + 0.02 * leaves
        alpha = np.clip((top - up) / 0.06 + 0.5, 0, 1)
        alpha = np.minimum(alpha, np.clip(1.3 + 0.8 * leaves + 7 * (top - 0.12 - up), 0, 1))
        alpha[-2:] = 0.0
        screens.append(
            Texture(
                picture.astype(np.float32),
                (_SCREEN, tall),
                alpha=np.ascontiguousarray(alpha, np.float32),
            )
        )
    return screens


def tree_pictures(random: np.random.Generator, size: float) -> list[Texture]:
    """Broad-leaved trees, `size` metres wide and high, lit from the upper right."""
    side = 384
    right, up = np.meshgrid((np.arange(side) + 0.5) / side - 0.5, (np.arange(side) + 0.5) / side)
    pictures = []
    for tint in ((84, 108, 52), (96, 114, 50), (72, 98, 56)):
        leaves, twigs, clumps = (materials.grain(random, (side, side), (w, w)) for w in (1.8, 6, 24))
        crown = np.full((side, side), -1.0)
        shade = np.full((side, side), 0.6)
        for _ in range(60):
            angle, out = random.uniform(0, 2 * np.pi), np.sqrt(random.uniform(0, 1))
            x, y = 0.27 * out * np.cos(angle), 0.62 + 0.22 * out * np.sin(angle)
            radius = random.uniform(0.05, 0.12)
            inside = 1 - np.hypot(right - x, up - y) / radius
            ball = 0.75 + 0.9 * ((right - x) * 0.5 + (up - y) * 0.85) / radius * 0.5
            shade = np.where(inside > np.maximum(crown, 0), ball, shade)
            crown = np.maximum(crown, inside)
        crown = crown + 0.10 * clumps + 0.10 * twigs + 0.10 * leaves
        trunk = np.clip((0.022 * (1.3 - up) - np.abs(right + 0.02 * np.sin(5 * up))) / 0.004 + 0.5, 0, 1)
        trunk = trunk * (up < 0.62)
        value = np.clip(shade * (0.9 + 0.3 * leaves + 0.2 * twigs), 0.1, 2)
        picture = materials.tinted(materials.linear(*tint), value)
        bark = materials.tinted(materials.linear(86, 74, 60), 0.8 + 0.2 * twigs)
        picture = np.where((trunk > 0.5)[..., None] & (crown < 0.02)[..., None], bark, picture)
        alpha = np.maximum(np.clip(crown / 0.12 + 0.5, 0, 1), trunk)
        alpha[:, :2] = alpha[:, -2:] = alpha[-2:] = 0.0
        pictures.append(
            Texture(picture.astype(np.float32), (size, size), repeat=False, alpha=alpha.astype(np.float32))
        )
    return pictures


def tree(picture: Texture, place: Floats, yaw: float, share: float) -> Quad:
    """A tree at `place` (x, y), its front turned to `yaw`, at a share of its picture's size."""
    size = share * picture.size[0]
    grown = Texture(picture.texels, (size, size), repeat=False, alpha=picture.alpha)
    return billboard((*place, -0.3), size, size, grown, yaw)


def tree_shadow(
    random: np.random.Generator, place: Floats, share: float, size: float, away: Floats
) -> Floats:
    """Outline (K, 2) of the shadow of a tree's crown; `away` (2,) is the shadow of a 1 m post."""
    angles = 2 * np.pi * np.arange(28) / 28
    radius = share * size * 0.34 * (1 + 0.10 * random.standard_normal(28))
    along = away / np.hypot(*away)
    across = np.array([-along[1], along[0]])
    longer = np.hypot(1.0, np.hypot(*away))  # a ball's shadow is an ellipse
    middle = place + 0.62 * share * size * away
    ring = longer * np.cos(angles)[:, None] * along + np.sin(angles)[:, None] * across
    return np.asarray(middle + radius[:, None] * ring)


def marker_post(place: Floats, yaw: float) -> list[Quad]:
    """A white post with a black band, 1 m high, that marks the border of the road; turned by `yaw`."""
    rows = 64
    picture = np.full((rows, 8, 3), 0.80, np.float32)
    picture[44:58] = 0.03
    picture[48:54, 2:6] = 0.65
    texture = Texture(picture, (0.12, 1.0), repeat=False)
    ahead, left = np.array([np.cos(yaw), np.sin(yaw)]), np.array([-np.sin(yaw), np.cos(yaw)])
    corners = [place + 0.06 * (a * ahead + b * left) for a, b in ((-1, 1), (-1, -1), (1, -1), (1, 1))]
    sides = []
    for number, light in enumerate((0.8, 1.0, 0.7, 0.55)):
        a, b = corners[number], corners[(number + 1) % 4]
        side = quad((*a, 0.0), (*(b - a), 0.0), (0, 0, 1.0), texture)
        sides.append(replace(side, light=np.full((1, 1, 3), light)))
    return sides


def pole(place: Floats, height: float) -> list[Quad]:
    """A wooden pole with a cross-arm, as telephone lines have them."""
    x, y = place
    wood = Texture.plain(materials.linear(104, 90, 76))
    quads = box((x - 0.11, y - 0.11, 0), (x + 0.11, y + 0.11, height), wood, without="-z")
    arm = box((x - 0.05, y - 0.8, height - 0.7), (x + 0.05, y + 0.8, height - 0.58), wood)
    return [
        item.lit(lambda points, normal: np.full((len(points), 3), 0.75 + 0.25 * float(normal[0])), 1e3)
        for item in (*quads, *arm)
    ]
