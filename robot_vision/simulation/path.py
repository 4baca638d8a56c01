# SPDX-License-Identifier: Apache-2.0
"""A paved path in a park: regular stones that a camera can be calibrated by, and shadows that are no objects."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation import materials, path_parts
from robot_vision.simulation.drive import FollowSettings
from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.furniture import (
    BOLLARD_RADIUS,
    LITTER_BIN_RADIUS,
    PLINTH_SIDE,
    Piece,
    Place,
    Solid,
    bollard,
    litter_bin,
    pillar,
)
from robot_vision.simulation.path_sides import KERB_HEIGHT, KERB_WIDTH, VERGE_HEIGHT, Sides
from robot_vision.simulation.scene import Quad, Scene, quad
from robot_vision.simulation.sun import Sun, sunlit
from robot_vision.simulation.world import SceneObject, StraightLane, World

BEYOND = 24.0
"""Metres the pavement goes on behind the end of the lane, so that it does not end in sight."""
BIN_AT, BIN_SPACING = 7.3, 14.0
BOLLARDS_AT, BOLLARD_SPACING = 5.4, 9.6
"""Metres along the path of the first and between the following ones."""


@dataclass(frozen=True)
class PathSettings:
    """Shape of the path and what stands along it.

    Attributes:
        length: of the lane, metres.
        stone_length: of a flagstone with one joint, along the path, metres.
        stone_width: likewise across the path, metres.
        stones_across: flagstones side by side: stone_width times these is the path's width.
        joint: width of the joints, metres.
        pillar_spacing: metres between the pillars of a row; 0: there are none.
        bollard_gap: metres between the axes of the two bollards of a gate; 0: there are none.
        litter_bins: their number, on the left side.
        sun_azimuth: direction to the sun, radians, counter-clockwise from the direction of the path.
        sun_elevation: of the sun, radians; 0: it is overcast, without shadows.
    """

    length: float = 30.0
    stone_length: float = 0.60
    stone_width: float = 0.40
    stones_across: int = 6
    joint: float = 0.012
    pillar_spacing: float = 3.6
    bollard_gap: float = 1.6
    litter_bins: int = 2
    sun_azimuth: float = -1.95
    sun_elevation: float = 0.75

    def __post_init__(self) -> None:
        for name, low, high, unit in (
            ("length", 6.0, 200.0, " m"),
            ("stone_length", 0.1, 2.0, " m"),
            ("stone_width", 0.1, 2.0, " m"),
            ("stones_across", 2, 24, ""),
            ("joint", 0.002, 0.04, " m"),
            ("pillar_spacing", 0.0, 50.0, " m"),
            ("bollard_gap", 0.0, 5.0, " m"),
            ("litter_bins", 0, 20, ""),
            ("sun_azimuth", -2 * np.pi, 2 * np.pi, " rad"),
            ("sun_elevation", 0.0, 1.5, " rad"),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise SimulationError(
                    f"path: {name} must be between {low:g} and {high:g}{unit}, not {value:g}"
                )
        for name in ("stones_across", "litter_bins"):
            if getattr(self, name) != int(getattr(self, name)):
                raise SimulationError(f"path: {name} must be a whole number, not {getattr(self, name)}")
        if not 1.2 <= self.width <= 8.0:
            raise SimulationError(
                f"path: {self.stones_across:g} stones of {self.stone_width:g} m make it {self.width:g} m wide; "
                "it must be 1.2 to 8 m"
            )
        if 0 < self.sun_elevation < 0.1:
            raise SimulationError(
                f"path: sun_elevation must be 0 (overcast) or at least 0.1 rad, not {self.sun_elevation:g}"
            )
        if 0 < self.pillar_spacing < 1.0:
            raise SimulationError(
                f"path: pillar_spacing must be 0 or at least 1 m, not {self.pillar_spacing:g}"
            )
        reach = self.width - 2 * (BOLLARD_RADIUS + 0.02)
        if self.bollard_gap and not 0.9 <= self.bollard_gap <= reach:
            raise SimulationError(
                f"path: bollard_gap must be 0 or between 0.9 and {reach:.2f} m here, not {self.bollard_gap:g}"
            )

    @property
    def width(self) -> float:
        """Between the kerbs, metres."""
        return float(self.stones_across * self.stone_width)


@dataclass(frozen=True, eq=False)
class PavedWorld(World):
    """A world whose floor is its own ruler.

    Attributes:
        stone_length: distance of the joints that run across the path, metres; one lies at x = 0.
        stone_width: distance of the joints that run along it, metres; the kerbs stand on two of them.
        joint: their width, metres.
    """

    stone_length: float = 0.0
    stone_width: float = 0.0
    joint: float = 0.0


def path(settings: PathSettings | None = None, seed: int = 0) -> PavedWorld:
    """Build a path; the same settings and seed give the same one.

    Its frame has x along the path, y to the left, z up, origin on the pavement in the middle of the path.
    """
    shape = settings or PathSettings()
    random = np.random.default_rng((seed, 8))
    things = [*_gates(shape), *_bins(random, shape), *_pillars(random, shape)]
    sides = Sides(shape.width / 2, shape.length, shape.length + BEYOND)
    stones = _pavement(random, shape)
    kerbs, walls = sides.kerbs(random), sides.walls(random)
    casters = [*kerbs, *walls, *(item for piece in things for item in piece.quads)]
    sun = _sun(shape)
    lit = [
        *sunlit([item for item in stones if item.origin[0] < shape.length], sun, 0.03, casters, openness=6),
        *sunlit([item for item in stones if item.origin[0] >= shape.length], sun, 0.08, casters),
        *sunlit([*sides.verges(random), *casters], sun, 0.08, casters, openness=6),
        *sunlit([*sides.land(random), *sides.sprigs(random), *sides.trees(random)], sun, 2.0, ()),
    ]
    footprints = sides.kerb_footprints()
    solids = [*sides.solids(), *(solid for piece in things for solid in piece.solids)]
    floor = np.array([(0.0, -1.0), (1.0, -1.0), (1.0, 1.0), (0.0, 1.0)]) * (shape.length, shape.width / 2)
    return PavedWorld(
        "path",
        Scene(tuple(lit), materials.linear(150, 168, 150), path_parts.sky(random), 500.0),
        "corridor",
        StraightLane(shape.length, shape.width),
        objects=(
            *(SceneObject(f"{side} kerb", kerb, KERB_HEIGHT, "wall") for side, kerb in footprints.items()),
            *(piece.thing for piece in things),
        ),
        shadows=tuple(shadow_outlines(solids, sun, floor)) if shape.sun_elevation else (),
        floor=(floor,),
        drive=FollowSettings(sway=_sway(shape), start=1.2),
        stone_length=shape.stone_length,
        stone_width=shape.stone_width,
        joint=shape.joint,
    )


def _sun(shape: PathSettings) -> Sun:
    """The sun, or an overcast sky that is the same in all directions."""
    if shape.sun_elevation:
        return Sun(shape.sun_azimuth, shape.sun_elevation)
    return Sun(elevation=np.pi / 2, colour=(0.0, 0.0, 0.0), sky=(0.84, 0.80, 0.78), ground=(0.2, 0.24, 0.24))


def _sway(shape: PathSettings) -> float:
    """How far a recording may weave between what stands on the path (m): a robot of 0.5 m keeps 0.1 m."""
    room = shape.width / 2
    if shape.bollard_gap:
        room = min(room, shape.bollard_gap / 2 - BOLLARD_RADIUS)
    if shape.litter_bins:
        room = min(room, _bin_offset(shape) - LITTER_BIN_RADIUS)
    return float(np.clip(room - 0.35, 0.0, 0.25))


def _pavement(random: np.random.Generator, shape: PathSettings) -> list[Quad]:
    """Flagstones, piece by piece, each with the pattern begun elsewhere so that it does not come again."""
    stones = path_parts.flagstones(
        random, shape.stone_length, shape.stone_width, int(shape.stones_across), shape.joint
    )
    piece = path_parts.STONES_ALONG * shape.stone_length
    end = shape.length + BEYOND
    quads = []
    for start in np.arange(-piece, end, piece):
        shift = random.integers(path_parts.STONES_ALONG), random.integers(int(shape.stones_across))
        quads.append(
            quad(
                (start, -shape.width / 2, 0.0),
                (piece, 0, 0),
                (0, shape.width, 0),
                stones,
                (float(shift[0] * shape.stone_length), float(shift[1] * shape.stone_width)),
            )
        )
    return quads


def _pillars(random: np.random.Generator, shape: PathSettings) -> list[Piece]:
    """A row of pillars on each verge."""
    if not shape.pillar_spacing:
        return []
    stone = path_parts.column_stone(random)
    y = shape.width / 2 + KERB_WIDTH + PLINTH_SIDE / 2 + 0.12
    places = np.arange(2.0, shape.length + BEYOND / 2, shape.pillar_spacing)
    return [
        pillar(stone, Place(float(x), side * y), f"pillar {number + 1} on the {name}", VERGE_HEIGHT)
        for side, name in ((-1.0, "right"), (1.0, "left"))
        for number, x in enumerate(places)
    ]


def _gates(shape: PathSettings) -> list[Piece]:
    """Pairs of bollards that keep cars away."""
    if not shape.bollard_gap:
        return []
    return [
        bollard(Place(float(x), side * shape.bollard_gap / 2), f"bollard {number + 1} on the {name}")
        for number, x in enumerate(np.arange(BOLLARDS_AT, shape.length, BOLLARD_SPACING))
        for side, name in ((-1.0, "right"), (1.0, "left"))
    ]


def _bin_offset(shape: PathSettings) -> float:
    return shape.width / 2 - LITTER_BIN_RADIUS - 0.06


def _bins(random: np.random.Generator, shape: PathSettings) -> list[Piece]:
    """Litter bins at the left edge of the pavement."""
    places = BIN_AT + BIN_SPACING * np.arange(int(shape.litter_bins))
    return [
        litter_bin(random, Place(float(x), _bin_offset(shape)), f"litter bin {number + 1}")
        for number, x in enumerate(places)
        if x < shape.length
    ]


def shadow_outlines(
    solids: Iterable[Solid], sun: Sun, floor: NDArray[np.float64]
) -> Iterator[NDArray[np.float64]]:
    """Outlines (K, 2) of the shadows that solids cast on a convex piece of floor (K, 2) at z = 0, metres.

    The shadow of an upright solid is the hull of the shadows of its lower and its upper end.
    """
    for solid in solids:
        ends = np.vstack(
            [
                sun.shadow(np.column_stack([solid.outline, np.full(len(solid.outline), height)]))
                for height in (solid.low, solid.high)
            ]
        )
        hull = cv2.convexHull(ends.astype(np.float32))
        area, outline = cv2.intersectConvexConvex(hull, floor.astype(np.float32))
        if area > 1e-4:
            yield outline.reshape(-1, 2).astype(np.float64)
