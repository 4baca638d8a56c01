# SPDX-License-Identifier: Apache-2.0
"""A country road that winds between hedges: bends, worn paint and a horizon, for heading without straight lines."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.simulation import countryside, hedge
from robot_vision.simulation.drive import FollowSettings
from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.hedge import HedgeLine
from robot_vision.simulation.lane import LanePoint, LanePose, PolyLane
from robot_vision.simulation.road_surface import Surface, laid
from robot_vision.simulation.scene import Quad, Scene
from robot_vision.simulation.shadow_map import ShadowMap
from robot_vision.simulation.world import SceneObject, World

SIDES = {"left": 1, "middle": 0, "right": -1}
"""Of the road on which a vehicle drives, and which way from the centre line that is."""
VERGE = 1.5
"""Metres of grass between the asphalt and a hedge."""
BEHIND, BEYOND = 10.0, 120.0
"""Metres that are built before the lane's beginning and beyond its end."""
SUN_AZIMUTH, SUN_ELEVATION = radians(-118.0), radians(40.0)
"""From behind on the right of a road that leads along x."""
SHADE = 0.58
"""Share of the light on the ground that a shadow takes away."""
TREE_SIZE, MARKER_SPACING, POLE_SPACING = 9.0, 25.0, 45.0
"""Metres."""
KNOT = 2.0
"""Metres between the points through which the centre line is laid."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class RoadSettings:
    """Shape and state of the road.

    Attributes:
        length: along the centre line, metres.
        width: of the asphalt with both lanes, metres.
        curvature: of the sharpest bends, 1/m; 0: a straight road.
        bend: usual length of a bend, metres.
        wear: share of the painted lines that is rubbed off, 0 to 1.
        hedge: usual height of the hedges, metres.
        side: "left", "right" or "middle": where on the road the vehicle drives.
    """

    length: float = 300.0
    width: float = 5.6
    curvature: float = 0.022
    bend: float = 42.0
    wear: float = 0.35
    hedge: float = 1.7
    side: str = "right"

    def __post_init__(self) -> None:
        for name, low, high, unit in (
            ("length", 40.0, 3000.0, " m"),
            ("width", 3.0, 9.0, " m"),
            ("curvature", 0.0, 0.05, " 1/m"),
            ("bend", 15.0, 200.0, " m"),
            ("wear", 0.0, 1.0, ""),
            ("hedge", 0.6, 4.0, " m"),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise SimulationError(f"road: {name} must be between {low} and {high}{unit}, not {value}")
        if self.side not in SIDES:
            raise SimulationError(f"road: side must be one of {', '.join(SIDES)}, not {self.side!r}")
        if self.curvature * self.bend > 2.2:
            raise SimulationError(
                f"road: bends of {self.bend} m with curvature {self.curvature} 1/m lead back; "
                "their product must be at most 2.2"
            )


def road(settings: RoadSettings | None = None, seed: int = 0) -> World:
    """Build a country road; the same settings and seed give the same one.

    Its frame has x along the road's general direction, y to the left, z up, origin on the centre line where
    the road begins. The lane is the whole road from verge to verge: offsets count from its centre line, also
    where the vehicle keeps to one side.
    """
    shape = settings or RoadSettings()
    random = np.random.default_rng((seed, 1))
    lane = PolyLane(winding(shape, seed), shape.width)
    kept = 0.25 * shape.width * SIDES[shape.side]
    span = (-BEHIND, lane.length + BEYOND)
    front = shape.width / 2 + VERGE
    hedges = [HedgeLine.grown(random, lane, side, front, span, shape.hedge) for side in (1, -1)]
    trees = _trees(random, hedges)
    away = -np.array([np.cos(SUN_AZIMUTH), np.sin(SUN_AZIMUTH)]) / np.tan(SUN_ELEVATION)
    shadows = [outline for line in hedges for outline in line.shadow(random, away)]
    shadows += [hedge.tree_shadow(random, place, share, TREE_SIZE, away) for place, _, share in trees]
    surface = Surface(shape.width, front + 0.4, shape.wear)
    ground = laid(lane, surface, random, *span)
    corners = np.concatenate([line.line(1.0) for line in hedges])
    low, high = corners.min(axis=0), corners.max(axis=0)
    light = _Ground(ShadowMap(shadows, low - 5, high + 5, 0.08, 0.10))
    quads = [item.lit(light, 0.2) for item in ground]
    quads += countryside.fields(random, low, high, _radius(low, high))
    quads += countryside.horizon(random, (low + high) / 2, _radius(low, high))
    screens = hedge.leaf_screens(random, shape.hedge)
    for line, brightness in zip(hedges, (1.0, 0.62), strict=True):
        quads += line.quads(screens, brightness)
    pictures = hedge.tree_pictures(random, TREE_SIZE)
    for number, (place, yaw, share) in enumerate(trees):
        quads.append(hedge.tree(pictures[number % len(pictures)], place, yaw, share))
    markers = _markers(lane, shape.width)
    quads += [face for place, yaw in markers for face in hedge.marker_post(place, yaw)]
    quads += _poles(random, hedges[0])
    return World(
        "road",
        Scene(tuple(quads), countryside.SKY),
        "road",
        SideOfRoad(lane, kept),
        objects=(*_hedge_objects(hedges), *_marker_objects(markers)),
        shadows=tuple(shadows),
        floor=(np.concatenate([hedges[1].line(), hedges[0].line()[::-1]]),),
        camera=Camera(460.0, 460.0, 319.5, 239.5, 640, 480, height_m=1.3, pitch=radians(3.0)),
        drive=FollowSettings(
            speed=8.0,
            sway=0.18,
            wavelength=55.0,
            start=6.0,
            end=10.0,
            shake=radians(0.3),
            vehicle="ackermann",
        ),
        resolution=0.1,
        robot_width=1.5,
        robot_length=3.0,
    )


def winding(settings: RoadSettings, seed: int) -> Floats:
    """Points (N, 2) of a centre line whose bends lead to the left and to the right by turns, from the origin.

    Each bend is half a wave of curvature, so that the curve has no corners and the direction stays within a
    bend's turn of the x axis.
    """
    random = np.random.default_rng((seed, 12))
    step = 0.25
    curvature = [np.zeros(int(8 / step))]
    side = int(random.choice([-1, 1]))
    turned = 0.0
    while sum(len(part) for part in curvature) * step < settings.length + KNOT:
        first = len(curvature) == 1
        length = settings.bend * (0.5 if first else random.uniform(0.8, 1.25))  # the others swing about x
        sharp = settings.curvature * (1.0 if first else random.uniform(0.65, 1.0))
        along = (np.arange(int(length / step)) + 0.5) * step / length
        part = side * sharp * np.sin(np.pi * along)
        curvature.append(part)
        turned += float(part.sum()) * step
        side = -1 if turned > 0 else 1
    bends = np.concatenate(curvature)
    yaw = np.concatenate([[0.0], np.cumsum(bends)]) * step
    middle = (yaw[1:] + yaw[:-1]) / 2
    path = np.cumsum(step * np.column_stack([np.cos(middle), np.sin(middle)]), axis=0)
    every = int(KNOT / step)
    points = np.concatenate([[(0.0, 0.0)], path])[::every]
    return np.asarray(points[: int(settings.length / KNOT) + 1])


@dataclass(frozen=True, eq=False)
class SideOfRoad:
    """A road as a vehicle drives it that keeps to one side: where it is counts from the road's centre line.

    Attributes:
        road: the whole road.
        kept: metres from its centre line to the line that is driven, positive to the left.
    """

    road: PolyLane
    kept: float

    @property
    def length(self) -> float:
        """Of the centre line, metres."""
        return self.road.length

    def locate(self, x: float, y: float, yaw: float) -> LanePose:
        """Where a vehicle is on the road, its offset from the road's centre line."""
        return self.road.locate(x, y, yaw)

    def point(self, along: float) -> LanePoint:
        """The line that is driven, beside the centre line `along` metres from its beginning."""
        x, y, yaw, curvature = self.road.point(along)
        x, y = x - self.kept * np.sin(yaw), y + self.kept * np.cos(yaw)
        return LanePoint(float(x), float(y), yaw, curvature / (1 - self.kept * curvature))


class _Ground:
    """Sunlight on the ground, taken away in shadows but for the light of the sky."""

    def __init__(self, shadows: ShadowMap) -> None:
        self._shadows = shadows

    def __call__(self, points: Floats, normal: Floats) -> Floats:
        taken = SHADE * self._shadows.share(points)
        return np.asarray(1 - taken[:, None] * np.array([0.86, 0.97, 1.04]))  # the sky's light is blue


def _radius(low: Floats, high: Floats) -> float:
    """Of the ring of hills: so far that nobody comes near it, metres."""
    return max(1600.0, 1.6 * float(np.hypot(*(high - low))))


def _trees(random: np.random.Generator, hedges: list[HedgeLine]) -> list[tuple[Floats, float, float]]:
    """Trees behind the hedges: place, direction they face, share of the usual size."""
    trees = []
    for line in hedges:
        at = float(line.along[0]) + random.uniform(5, 25)
        while at < line.along[-1]:
            yaw = line.lane.point(at).yaw + np.pi + random.uniform(-0.2, 0.2)
            place = line.place(at, random.uniform(2.6, 5.0))
            trees.append((place, float(yaw), float(random.uniform(0.55, 1.1))))
            at += random.uniform(9, 42)
    return trees


def _markers(lane: PolyLane, width: float) -> list[tuple[Floats, float]]:
    """Places and directions of marker posts on both verges."""
    found = []
    for at in np.arange(MARKER_SPACING / 2, lane.length + BEYOND, MARKER_SPACING):
        x, y, yaw, _ = lane.point(float(at))
        for side in (-1, 1):
            out = side * (width / 2 + 0.6)
            found.append((np.array([x - out * np.sin(yaw), y + out * np.cos(yaw)]), yaw))
    return found


def _poles(random: np.random.Generator, line: HedgeLine) -> list[Quad]:
    """A telephone line's poles behind the left hedge."""
    places = np.arange(line.along[0] + random.uniform(5, 40), line.along[-1], POLE_SPACING)
    return [face for at in places for face in hedge.pole(line.place(float(at), 2.2), 6.8)]


def _hedge_objects(hedges: list[HedgeLine], pieces: int = 5) -> list[SceneObject]:
    """Footprints of the hedges, five pieces of screen each."""
    found = []
    for name, line in zip(("left", "right"), hedges, strict=True):
        front, back = line.line(), line.line(hedge.DEPTH)
        for number, start in enumerate(range(0, len(front) - 1, pieces)):
            part = slice(start, start + pieces + 1)
            outline = np.concatenate([front[part], back[part][::-1]])
            high = float(line.height[part].max())
            found.append(SceneObject(f"{name} hedge {number + 1}", outline, high, "wall"))
    return found


def _marker_objects(markers: list[tuple[Floats, float]]) -> list[SceneObject]:
    corners = 0.06 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    found = []
    for number, (place, yaw) in enumerate(markers):
        turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        found.append(SceneObject(f"marker post {number + 1}", place + corners @ turn.T, 1.0))
    return found
