# SPDX-License-Identifier: Apache-2.0
"""What grows in a field: seedlings, cabbages, bushes that nearly close, and the weeds between them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robot_vision.geometry import rotation_from_rpy
from robot_vision.simulation.leaves import Leaf, Picture, Random, blade, bunch, paint, tuft, whorl
from robot_vision.simulation.materials import linear
from robot_vision.simulation.plants import Blade, Specimen, leaf, sheet, specimen
from robot_vision.simulation.texture import Colour

Album = dict[str, list[Picture]]
"""Paintings of one plant's parts, several of each, in one colour."""

_WITHERED = (136, 116, 82)
_HERBS, _GRASSES = ((98, 128, 66), (112, 132, 72), (88, 116, 68)), ((106, 134, 72), (118, 138, 78))
_WEED_RADIUS_M = (0.018, 0.03, 0.085)
"""Smallest, most frequent, largest."""


@dataclass(frozen=True)
class Sort:
    """How a crop is sown and grows.

    Attributes:
        step: between plants in a row, metres.
        radius: usual radius of a plant, metres.
        spread: standard deviation of the radii, as a share of the usual one.
        lean: standard deviation of the plants' lean about each axis, radians.
        weeds: size of the weeds among it, which are as old as the crop, as a share of the usual one.
        far_blades: how many of its blades are drawn of a plant that is never near.
        colour: red, green, blue as on a screen.
    """

    step: float
    radius: float
    spread: float
    lean: float
    weeds: float
    far_blades: int
    colour: tuple[int, int, int]


SORTS: dict[str, Sort] = {
    "seedlings": Sort(0.16, 0.045, 0.22, 0.10, 0.7, 1, (106, 138, 70)),
    "cabbages": Sort(0.40, 0.165, 0.16, 0.07, 1.0, 3, (98, 124, 86)),
    "canopy": Sort(0.30, 0.25, 0.10, 0.06, 1.2, 4, (72, 104, 52)),
}
"""The three sets of a crop field."""


class Nursery:
    """Grows specimens of one set and of its weeds; leaves are painted once and used for many.

    Args:
        random: of all shapes and colours.
        name: one of SORTS.
    """

    def __init__(self, random: Random, name: str) -> None:
        self._random = random
        self.sort = SORTS[name]
        self._grow, album = _GROWERS[name]
        greens = [
            np.clip(np.array(self.sort.colour) + random.normal(0, 4, 3) + shift, 30, 200) for shift in (-4, 6)
        ]
        self._green = [album(random, linear(*(int(part) for part in green))) for green in greens]
        self._brown = album(random, linear(*_WITHERED))
        self._weeds: list[tuple[Grower, Album]] = [
            *((_herb, _herb_album(random, linear(*colour))) for colour in _HERBS),
            *((_grass, _grass_album(random, linear(*colour))) for colour in _GRASSES),
        ]

    def crop(self, size: float = 1.0) -> Specimen:
        """A plant of the crop, `size` times as large as one of its age should be."""
        radius = self.sort.radius * size * float(np.clip(self._random.normal(1, self.sort.spread), 0.55, 1.5))
        album = self._green[int(self._random.integers(len(self._green)))]
        return self._leaning(self._grow(self._random, album, radius))

    def dead(self) -> Specimen:
        """A withered plant of the crop: small and brown."""
        radius = self.sort.radius * float(self._random.uniform(0.35, 0.7))
        return self._leaning(self._grow(self._random, self._brown, radius))

    def weed(self) -> Specimen:
        """A weed of any kind: most are small."""
        grow, album = self._weeds[int(self._random.integers(len(self._weeds)))]
        radius = self.sort.weeds * float(self._random.triangular(*_WEED_RADIUS_M))
        return self._leaning(grow(self._random, album, radius))

    def _leaning(self, blades: list[Blade]) -> Specimen:
        """Tilt a plant about its stem's foot."""
        roll, pitch = self._random.normal(0, self.sort.lean, 2)
        return specimen(blades, rotation_from_rpy(float(roll), float(pitch), 0.0))


def _any(random: Random, pictures: list[Picture]) -> Picture:
    return pictures[int(random.integers(len(pictures)))]


def _circle(random: Random) -> float:
    return float(random.uniform(0, 2 * np.pi))


def _seedling_album(random: Random, colour: Colour) -> Album:
    oval = blade(random, 0.42, 0.6, 0.03)
    return {
        "whorl": [paint(random, whorl(random, oval, n), colour, 48) for n in (2, 3, 4, 4)],
        "leaf": [paint(random, [blade(random, 0.6, 0.6, 0.04)], colour, 32) for _ in range(4)],
    }


def _seedling(random: Random, album: Album, r: float) -> list[Blade]:
    """Seed leaves spread out, and two to four leaves that rise above them."""
    turn, count = _circle(random), int(random.integers(2, 5))
    low = _any(random, album["whorl"])
    blades = [sheet(low, (0, 0, 0.35 * r), turn, random.normal(0, 0.1), 1.9 * r, 0.9)]
    for n in range(count):
        azimuth = turn + 2 * np.pi * n / count + random.normal(0, 0.3)
        length, rise = r * random.uniform(0.75, 1.1), random.uniform(0.5, 1.0)
        size = 0.75 * length, length
        blades.append(leaf(_any(random, album["leaf"]), (0, 0, 0.3 * r), azimuth, rise, size, (0.75, 1.05)))
    return blades


def _cabbage_album(random: Random, colour: Colour) -> Album:
    def wide() -> Leaf:
        return blade(random, random.uniform(0.78, 0.9), 0.58, 0.06)

    return {
        "whorl": [paint(random, whorl(random, wide(), n), colour, 128, 0.5) for n in (6, 7, 7, 8)],
        "leaf": [paint(random, [wide()], colour, 64, 0.5) for _ in range(4)],
        "heart": [paint(random, whorl(random, wide(), 4, 0.0), colour, 48, 0.4) for _ in range(2)],
    }


def _cabbage(random: Random, album: Album, r: float) -> list[Blade]:
    """A whorl of lower leaves, five that rise from it, two steep ones, and a heart."""
    turn = _circle(random)
    low, heart = _any(random, album["whorl"]), _any(random, album["heart"])
    blades = [sheet(low, (0, 0, 0.24 * r), turn, random.normal(0, 0.08), 1.96 * r, 0.75)]
    for count, out, rise, share, height in ((5, 0.10, 0.55, 0.82, 0.2), (2, 0.05, 1.05, 0.55, 0.25)):
        for n in range(count):
            azimuth = turn + out + 2 * np.pi * (n + random.uniform(-0.2, 0.2)) / count
            length = r * share * random.uniform(0.85, 1.12)
            foot = (out * r * np.cos(azimuth), out * r * np.sin(azimuth), height * r)
            slope, size = rise + random.normal(0, 0.12), (0.85 * length, length)
            blades.append(leaf(_any(random, album["leaf"]), foot, azimuth, slope, size, (0.5, 1.08)))
        turn += 0.6
    blades.append(sheet(heart, (0, 0, 0.5 * r), turn, random.normal(0, 0.2), 0.62 * r, 1.0))
    return blades


def _bush_album(random: Random, colour: Colour) -> Album:
    def oval() -> Leaf:
        return blade(random, random.uniform(0.62, 0.74), 0.42, 0.02)

    return {
        "bunch": [paint(random, bunch(random, oval(), n, 0.30), colour, 128, 0.3) for n in (13, 15, 17, 19)],
    }


def _bush(random: Random, album: Album, r: float) -> list[Blade]:
    """Bunches of leaves in three storeys, the lower ones in the shade of the upper."""
    turn, height = _circle(random), r * random.uniform(0.95, 1.25)
    low, top = _any(random, album["bunch"]), _any(random, album["bunch"])
    blades = [sheet(low, (0, 0, 0.5 * height), turn, random.normal(0, 0.1), 2.0 * r, 0.5)]
    for n in range(3):
        azimuth = turn + 2 * np.pi / 3 * (n + random.uniform(-0.2, 0.2))
        out, light = 0.42 * r, random.uniform(0.75, 1.0)
        middle = (out * np.cos(azimuth), out * np.sin(azimuth), height * random.uniform(0.62, 0.78))
        tilt, side = -random.uniform(0.35, 0.75), r * random.uniform(1.15, 1.35)
        blades.append(sheet(_any(random, album["bunch"]), middle, azimuth, tilt, side, light))
    crown = (random.normal(0, 0.08) * r, random.normal(0, 0.08) * r, height)
    blades.append(sheet(top, crown, turn, random.normal(0, 0.25), 0.85 * r, 1.1))
    return blades


def _herb_album(random: Random, colour: Colour) -> Album:
    shape = blade(random, random.uniform(0.3, 0.55), random.uniform(0.45, 0.65), 0.08)
    return {
        "whorl": [paint(random, whorl(random, shape, n), colour, 64) for n in (5, 6, 7)],
        "leaf": [paint(random, [shape], colour, 32) for _ in range(2)],
    }


def _herb(random: Random, album: Album, r: float) -> list[Blade]:
    """A flat rosette with a few leaves above it."""
    turn, foot = _circle(random), (0.0, 0.0, 0.2 * r)
    blades = [sheet(_any(random, album["whorl"]), foot, turn, random.normal(0, 0.12), 2 * r, 0.9)]
    for n in range(int(random.integers(1, 3))):
        rise, size = random.uniform(0.5, 1.1), (0.8 * r, 0.9 * r)
        blades.append(leaf(_any(random, album["leaf"]), foot, turn + 2.4 * n, rise, size))
    return blades


def _grass_album(random: Random, colour: Colour) -> Album:
    narrow = blade(random, 0.09, 0.35)
    return {"tuft": [paint(random, tuft(random, narrow, n, 0.7), colour, 64, 0.1) for n in (6, 8, 9)]}


def _grass(random: Random, album: Album, r: float) -> list[Blade]:
    """Three fans of narrow leaves that lean outwards."""
    turn, size = _circle(random), (1.3 * r, 1.25 * r)
    rises = random.uniform(0.6, 1.0, 3)
    return [
        leaf(_any(random, album["tuft"]), (0, 0, 0), turn + 2 * np.pi * n / 3, rise, size, (0.7, 1.05))
        for n, rise in enumerate(rises)
    ]


Grower = Callable[[Random, Album, float], list[Blade]]
_GROWERS: dict[str, tuple[Grower, Callable[[Random, Colour], Album]]] = {
    "seedlings": (_seedling, _seedling_album),
    "cabbages": (_cabbage, _cabbage_album),
    "canopy": (_bush, _bush_album),
}
