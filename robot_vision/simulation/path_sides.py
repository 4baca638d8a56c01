# SPDX-License-Identifier: Apache-2.0
"""What lies on both sides of a paved path: it bounds the way, throws shadows on it and leads the eye."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation import materials, path_parts
from robot_vision.simulation.furniture import Solid, rectangle
from robot_vision.simulation.materials import Random
from robot_vision.simulation.scene import Quad, billboard, box, quad

KERB_WIDTH, KERB_HEIGHT = 0.14, 0.10
VERGE_WIDTH, VERGE_HEIGHT = 1.9, 0.08
WALL_HEIGHT, WALL_DEPTH, COPING = 1.15, 0.24, 0.06
HEDGE_HEIGHT, HEDGE_DEPTH = 1.5, 0.8
BEHIND = 12.0
"""Metres before the beginning of the lane where everything but the land begins."""
FAR = 60.0
"""Metres of land to all sides."""


@dataclass(frozen=True)
class Sides:
    """Both sides of a path along x: a kerb and a verge each, a brick wall on the right, a hedge on the left.

    Attributes:
        edge: from the middle of the path to the kerbs, metres.
        length: of the lane, metres.
        paved: x where the pavement ends, metres.
    """

    edge: float
    length: float
    paved: float

    @property
    def verge(self) -> float:
        """From the middle of the path to the verges, metres."""
        return self.edge + KERB_WIDTH

    @property
    def border(self) -> float:
        """From the middle of the path to wall and hedge, metres."""
        return self.verge + VERGE_WIDTH

    def kerb_footprints(self) -> dict[str, NDArray[np.float64]]:
        """Outlines (4, 2) of the kerbs beside the lane."""
        middle = self.edge + KERB_WIDTH / 2
        strip = rectangle(self.length, KERB_WIDTH) + (self.length / 2, 0.0)
        return {"right": strip - (0.0, middle), "left": strip + (0.0, middle)}

    def solids(self) -> list[Solid]:
        """What casts shadows all along the path."""
        middle, long = (self.paved - BEHIND) / 2, self.paved + BEHIND
        strips = (
            (self.edge + KERB_WIDTH / 2, KERB_WIDTH, 0.0, KERB_HEIGHT),
            (-self.edge - KERB_WIDTH / 2, KERB_WIDTH, 0.0, KERB_HEIGHT),
            (-self.border - WALL_DEPTH / 2, WALL_DEPTH, 0.0, WALL_HEIGHT),
            (-self.border - WALL_DEPTH / 2, WALL_DEPTH + 0.08, WALL_HEIGHT, WALL_HEIGHT + COPING),
            (self.border + HEDGE_DEPTH / 2, HEDGE_DEPTH, 0.0, HEDGE_HEIGHT),
        )
        return [Solid(rectangle(long, depth) + (middle, y), low, high) for y, depth, low, high in strips]

    def kerbs(self, random: Random) -> list[Quad]:
        """Blocks of granite on both sides."""
        stone = path_parts.granite(random)
        return [
            side
            for low, high in ((-self.verge, -self.edge), (self.edge, self.verge))
            for side in box((-BEHIND, low, 0.0), (self.paved, high, KERB_HEIGHT), stone, without="-x -z")
        ]

    def walls(self, random: Random) -> list[Quad]:
        """The brick wall with its coping on the right, the hedge's body on the left."""
        stone, brick = path_parts.granite(random), path_parts.bricks(random)
        hedge = path_parts.leaves(random, (1.6, 1.6))
        far, near, end = -self.border - WALL_DEPTH, -self.border, self.paved + FAR / 2
        top = WALL_HEIGHT + COPING
        return [
            *box((-BEHIND, far, 0.0), (end, near, WALL_HEIGHT), brick, without="-z"),
            *box((-BEHIND, far - 0.04, WALL_HEIGHT), (end, near + 0.04, top), stone),
            *box(
                (-BEHIND, self.border, 0.0),
                (end, self.border + HEDGE_DEPTH, HEDGE_HEIGHT),
                hedge,
                without="-z",
            ),
        ]

    def verges(self, random: Random) -> list[Quad]:
        """Lawn from the kerbs to wall and hedge."""
        lawn = path_parts.grass(random)
        return [
            quad((-BEHIND, low, VERGE_HEIGHT), (self.paved + BEHIND, 0, 0), (0, VERGE_WIDTH, 0), lawn)
            for low in (-self.border, self.verge)
        ]

    def land(self, random: Random) -> list[Quad]:
        """Lawn beyond wall, hedge and both ends of the path."""
        lawn = path_parts.grass(random)
        start, end = -FAR, self.paved + FAR
        strips = (
            (start, end, -FAR, -self.border),
            (start, end, self.border, FAR),
            (start, -BEHIND, -self.border, self.border),
            (self.paved, end, -self.border, self.border),
        )
        return [
            quad((x0, y0, VERGE_HEIGHT), (x1 - x0, 0, 0), (0, y1 - y0, 0), lawn) for x0, x1, y0, y1 in strips
        ]

    def sprigs(self, random: Random) -> list[Quad]:
        """Tips along the hedge's upper edges, so that it does not look like a box."""
        size = (1.6, 0.22)
        rows, columns = 64, 512
        height = np.linspace(0.0, 1.0, rows)[:, None]
        ragged = 0.30 + 0.16 * materials.grain(random, (1, columns), (1, 7))
        ragged = ragged + 0.10 * materials.grain(random, (rows, columns), (5, 5))
        grown = cv2.GaussianBlur((height < ragged).astype(np.float32), (0, 0), 0.8)
        sprig = path_parts.leaves(random, size, np.asarray(grown, np.float32))
        return [
            billboard((along, y, HEDGE_HEIGHT - 0.02), *size, sprig, yaw=-np.pi / 2)
            for along in np.arange(-BEHIND + size[0] / 2, self.paved, size[0])
            for y in (self.border + 0.01, self.border + 0.25)
        ]

    def trees(self, random: Random) -> list[Quad]:
        """Trees behind wall and hedge and at the far end, each a cut-out that faces the path."""
        sizes = ((4.2, 5.4), (5.0, 6.5), (6.0, 8.0))
        kinds = [(size, path_parts.tree(random, size)) for size in sizes]
        places = [
            (x + random.uniform(-2.5, 2.5), side * (self.border + random.uniform(3.0, 14.0)))
            for side in (-1.0, 1.0)
            for x in np.arange(8.0, self.paved + FAR / 2, 7.0)
        ]
        places += [(self.paved + FAR / 2 - random.uniform(0, 6), y) for y in np.arange(-30.0, 31.0, 3.0)]
        trees = []
        for x, y in places:
            (width, height), kind = kinds[int(random.integers(len(kinds)))]
            trees.append(billboard((x, y, 0.0), width, height, kind, yaw=float(np.arctan2(-y, -x))))
        return trees
