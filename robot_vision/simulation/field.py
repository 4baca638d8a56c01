# SPDX-License-Identifier: Apache-2.0
"""A field of row crops: the mission's case study, where a robot steers by plants and knows each of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from robot_vision.geometry import Camera
from robot_vision.simulation import soil
from robot_vision.simulation.crops import SORTS, Nursery, Sort
from robot_vision.simulation.drive import FollowSettings
from robot_vision.simulation.field_plan import HEADLAND_M, MARGIN_M, FieldSettings
from robot_vision.simulation.leaves import Floats, Random
from robot_vision.simulation.materials import linear
from robot_vision.simulation.plants import Specimen, placed, shade_on_ground
from robot_vision.simulation.scene import Quad, Scene, quad
from robot_vision.simulation.shadow_map import ShadowMap
from robot_vision.simulation.world import Plant, World

IN_ROW_M = 0.05
"""A weed this near to a row's line counts as one in the row."""
NEAR_M = 3.0
"""Distance from the lane up to which plants are drawn with all their leaves."""
NODES = 900_000
"""Of the light on the ground, at most."""
FINEST_NODE_M = 0.025
SPECIMENS = 28
"""Of each kind of plant; all that grow are these, turned."""
FAR_M = 150.0
"""Half the side of the meadow around."""
SKY_LIGHT, SUN_LIGHT = np.array([1.10, 1.0, 0.94]), np.array([0.95, 1.0, 1.02])
"""Blue, green, red."""


class Growing(NamedTuple):
    """A plant in its place.

    Attributes:
        row: -1 between rows.
        kind: "crop", "weed" or "dead".
        place: x, y of its stem (m) and its turn about it (rad).
        specimen: its shape.
        lateral: its distance to the left of the middle row, metres.
    """

    row: int
    kind: str
    place: tuple[float, float, float]
    specimen: Specimen
    lateral: float


def field(settings: FieldSettings | None = None, seed: int = 0) -> World:
    """Build a field; the same settings and seed give the same one.

    Its frame has its origin where the middle row begins, x along that row, y to the left. The lane is the
    line of the middle row, as it was sown, from its first plant to where all rows end; it is as wide as the
    rows are apart.
    """
    shape = settings or FieldSettings()
    sort = SORTS[shape.set]
    nursery = Nursery(np.random.default_rng((seed, 1)), shape.set)
    growing = _sow(np.random.default_rng((seed, 5)), shape, nursery)
    random = np.random.default_rng((seed, 8))
    sun = shape.to_sun
    light = _light_on_leaves(sun, shape.sun)
    quads = [
        item for plant in growing for item in placed(plant.specimen, plant.place, light, _blades(plant, sort))
    ]
    ground = _ground(random, shape, growing, sun)
    haze = linear(196, 206, 212)
    return World(
        "field",
        Scene((*ground, *quads), haze, np.full((2, 1, 3), haze, np.float32)),
        "row",
        shape.lane,
        plants=_plants(growing),
        floor=(shape.border(-MARGIN_M, shape.length + HEADLAND_M),),
        camera=_camera(shape),
        drive=FollowSettings(speed=1.6, sway=0.06, wavelength=7.0, start=0.5, end=0.3, shake=np.radians(2.0)),
        clouds=shape.clouds,
    )


def _camera(shape: FieldSettings) -> Camera:
    return Camera(
        460.0, 460.0, 319.5, 239.5, 640, 480, height_m=shape.camera_height, pitch=shape.camera_pitch
    )


def _sow(random: Random, shape: FieldSettings, nursery: Nursery) -> list[Growing]:
    """All plants, those of the crop row by row, then the weeds."""
    usual = [nursery.crop() for _ in range(SPECIMENS)]
    small = [nursery.crop(float(random.uniform(0.35, 0.65))) for _ in range(SPECIMENS // 3)]
    dead = [nursery.dead() for _ in range(4)]
    growing: list[Growing] = []
    step = nursery.sort.step
    for row, left in enumerate(shape.row_places):
        along = np.arange(random.uniform(0.0, step), shape.length, step)
        along = np.clip(along + random.normal(0, 0.06 * step, len(along)), 0.0, shape.length)
        sideways = left + random.normal(0, shape.scatter, len(along))
        fates, turns = random.random((2, len(along))), random.uniform(0, 2 * np.pi, len(along))
        picks = random.integers(0, 2**31, len(along))
        for n, (x, y) in enumerate(shape.points(along, sideways)):
            if fates[0, n] < shape.missing or shape.gap_at <= along[n] < shape.gap_at + shape.gap:
                continue
            kind, pool = "crop", usual
            if fates[1, n] < shape.dead:
                kind, pool = "dead", dead
            elif fates[1, n] < shape.dead + shape.stunted:
                pool = small
            chosen = pool[picks[n] % len(pool)]
            growing.append(
                Growing(row, kind, (float(x), float(y), float(turns[n])), chosen, float(sideways[n]))
            )
    return growing + _weeds(random, shape, nursery, growing)


def _weeds(random: Random, shape: FieldSettings, nursery: Nursery, crop: list[Growing]) -> list[Growing]:
    """Weeds anywhere on the worked ground but under the leaves of the crop."""
    from scipy.spatial import cKDTree

    kinds = [nursery.weed() for _ in range(SPECIMENS)]
    right, left = shape.sides
    wide, long = left - right, shape.length + HEADLAND_M + MARGIN_M
    count = int(round(shape.weeds * wide * long / (shape.spacing * nursery.sort.step)))
    along = random.uniform(-MARGIN_M, shape.length + HEADLAND_M, count)
    sideways = random.uniform(right, left, count)
    places = shape.points(along, sideways)
    turns, picks = random.uniform(0, 2 * np.pi, count), random.integers(0, len(kinds), count)
    hidden = np.zeros(count, bool)
    if crop and count:
        near = cKDTree([plant.place[:2] for plant in crop]).query(places)
        radii = np.array([plant.specimen.radius for plant in crop])
        hidden = near[0] < 0.75 * radii[near[1]]
    rows = shape.row_places
    weeds = []
    for n in np.flatnonzero(~hidden):
        nearest = int(np.abs(rows - sideways[n]).argmin())
        inside = abs(rows[nearest] - sideways[n]) <= IN_ROW_M and 0.0 <= along[n] <= shape.length
        weeds.append(
            Growing(
                nearest if inside else -1,
                "weed",
                (float(places[n, 0]), float(places[n, 1]), float(turns[n])),
                kinds[picks[n]],
                float(sideways[n]),
            )
        )
    return weeds


def _plants(growing: list[Growing]) -> tuple[Plant, ...]:
    """The living ones, numbered from 1."""
    living = [plant for plant in growing if plant.kind != "dead"]
    return tuple(
        Plant(
            number,
            plant.row,
            plant.kind,
            *plant.place[:2],
            plant.specimen.radius,
            plant.specimen.area,
            plant.specimen.height,
        )
        for number, plant in enumerate(living, 1)
    )


def _light_on_leaves(sun: Floats, share: float) -> Callable[[Floats], Floats]:
    """Light (N, 3) on leaves by their upward normals (N, 3): sun on the far side shines through a little."""

    def light(normals: Floats) -> Floats:
        facing = normals @ sun
        direct = share * np.where(facing > 0, facing, -0.4 * facing) / sun[2]
        sky = (1 - share) * (0.55 + 0.45 * normals[:, 2])
        return np.asarray(direct[:, None] * SUN_LIGHT + sky[:, None] * SKY_LIGHT)

    return light


def _ground(random: Random, shape: FieldSettings, growing: list[Growing], sun: Floats) -> list[Quad]:
    """Worked soil with the plants' shadows on it, and meadow around."""
    rim = shape.border(-MARGIN_M, shape.length + HEADLAND_M)
    low, high = rim.min(axis=0), rim.max(axis=0)
    width, depth = high - low
    spacing = max(FINEST_NODE_M, float(np.sqrt(width * depth / NODES)))
    colour = soil.SOILS[int(random.integers(len(soil.SOILS)))]
    lit_from = sun if shape.sun > 0.2 else np.array([0.0, 0.0, 1.0])
    earth = quad((*low, 0.0), (width, 0, 0), (0, depth, 0), soil.clods(random, colour, lit_from))
    wide = max(0.35 * SORTS[shape.set].radius, 0.5 * spacing)
    direct, above = (
        ShadowMap(
            [outline for item in growing for outline in shade_on_ground(item.specimen, item.place, slope)],
            low,
            high,
            spacing,
            softness,
        )
        for slope, softness in ((-sun[:2] / sun[2], 0.4 * spacing), (np.zeros(2), wide))
    )
    lightness = soil.furrows(random, shape)

    def light(points: Floats, normal: Floats) -> Floats:
        from_sun = shape.sun * (1 - direct.share(points))
        from_sky = (1 - shape.sun) * (1 - 0.5 * above.share(points))
        return np.asarray(
            (from_sun[:, None] * SUN_LIGHT + from_sky[:, None] * SKY_LIGHT) * lightness(points)[:, None]
        )

    grass = quad((-FAR_M, -FAR_M, -0.02), (2 * FAR_M, 0, 0), (0, 2 * FAR_M, 0), soil.meadow(random))
    return [earth.lit(light, spacing), grass]


def _blades(plant: Growing, sort: Sort) -> int:
    """How many leaves of a plant are drawn: all where the robot comes near."""
    if abs(plant.lateral) < NEAR_M:
        return len(plant.specimen.blades)
    return 1 if plant.kind == "weed" else sort.far_blades
