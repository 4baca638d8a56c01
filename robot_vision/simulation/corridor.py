# SPDX-License-Identifier: Apache-2.0
"""The corridor of an office building: the mission's first scene, where every line tells the direction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation.corridor_light import TurnedLight
from robot_vision.simulation.corridor_parts import (
    DOOR_WIDTH,
    PORTAL_DEPTH,
    Palette,
    door_places,
    end_with_window,
    lamp,
    lamp_places,
    portal,
    wall_with_doors,
    window_pane,
)
from robot_vision.simulation.corridor_plan import BlockedSettings, CorridorSettings, Plan, plan_of
from robot_vision.simulation.drive import FollowSettings, WeavingSettings
from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.furniture import (
    BIN_RADIUS,
    BOX_SIZE,
    CHAIR_SIDE,
    ContactShade,
    Piece,
    Place,
    chair,
    crate,
    person_sized_box,
    waste_bin,
)
from robot_vision.simulation.lighting import RoomLight
from robot_vision.simulation.scene import Illumination, Scene
from robot_vision.simulation.texture import Texture
from robot_vision.simulation.world import SceneObject, World, walls_around

__all__ = ["BlockedSettings", "CorridorSettings", "corridor", "corridor_blocked"]

STOP_M = 1.0
"""Metres before the box in the way at which base_link of a recording comes to rest."""
CLEAR_M, ROBOT_HALF_WIDTH = 0.1, 0.25
"""Metres a recording keeps at least between the robot, half as wide as this, and what stands beside its way."""
SPACING_M = 0.9
"""Metres at least between the middles of things along the walls."""


def corridor(settings: CorridorSettings | None = None, seed: int = 0) -> World:
    """Build a corridor; the same settings and seed give the same one.

    Its frame has x along the (first leg of the) corridor, y to the left, z up, origin on the floor in the
    middle of the wall behind the start.

    Raises:
        SimulationError: there is no room for what is to stand along the walls.
    """
    shape = settings or CorridorSettings()
    random = np.random.default_rng((seed, 1))
    palette = Palette.choose(random, shape.width)
    plan = plan_of(shape)
    surfaces = [leg.floor_and_ceiling(shape.width, shape.height, palette) for leg in plan.legs]
    floors, quads = [floor for floor, _ in surfaces], [ceiling for _, ceiling in surfaces]
    gates = _portal_places(shape, plan)
    doors: dict[int, list[float]] = {}
    for count, side in enumerate(plan.sides):
        wall = plan.walls[side]
        places = door_places(random, wall.length, shape.door_spacing)
        doors[side] = [place for place in places if _clear_of(place, gates.get(side))]
        quads += wall_with_doors(random, wall, wall.length, doors[side], palette, 100 * (count + 1) + 1)
    behind, ahead = plan.walls[-1], plan.walls[plan.ahead]
    quads += [behind.panel((0, shape.width), (0, shape.height), 0.0, palette.end_wall)]
    quads += end_with_window(ahead, shape.width, palette)
    outside = window_pane(random, ahead, shape.width, mirrored=not (shape.turn or shape.box_at))

    jambs: tuple[NDArray[np.float64], ...] = ()
    if shape.narrow_at:
        pieces, jambs = portal(plan.walls[0], gates[0], shape.narrow_width, shape.width, palette)
        quads += pieces
    things = _furnish(np.random.default_rng((seed, 5)), shape, plan, doors, palette.floor)
    quads += [item for piece in things for item in piece.quads]
    objects = tuple(piece.thing for piece in things)

    light = _light(shape, plan)
    shaded, spacing = light, 0.15
    if objects:
        shaded, spacing = ContactShade(light, tuple(item.footprint for item in objects)), 0.05
    lit = [*(item.lit(shaded, spacing) for item in floors), *(item.lit(light) for item in quads)]
    for leg in plan.legs:
        # Mirrors know no walls between: of the second leg, nothing may shine into the floor of the first.
        first = leg is plan.legs[0]
        for place in leg.lamps():
            lit += lamp(place, not first, shape.height, palette, mirrored=first)
    walls = [
        *walls_around(plan.outline, height=shape.height),
        *(
            SceneObject(f"{side} jamb", jamb, shape.height, "wall")
            for side, jamb in zip(("right", "left"), jambs, strict=False)
        ),
    ]
    return World(
        "corridor",
        Scene((*lit, outside)),
        "corridor",
        plan.lane,
        objects=(*walls, *objects),
        floor=(plan.outline,),
        drive=_drive(shape, plan),
    )


def corridor_blocked(settings: BlockedSettings | None = None, seed: int = 0) -> World:
    """A corridor in which a person-sized box stands in the way; see `corridor`."""
    return replace(corridor(settings or BlockedSettings(), seed), name="corridor_blocked")


def _portal_places(shape: CorridorSettings, plan: Plan) -> dict[int, float]:
    """Where along a wall the narrowed entrance is, for the walls of the first leg on the right and left."""
    if not shape.narrow_at:
        return {}
    right, left = plan.sides[len(plan.sides) // 2], plan.sides[0]
    return {
        right: float(plan.walls[right].corner[0] - shape.narrow_at),
        left: float(shape.narrow_at - plan.walls[left].corner[0]),
    }


def _clear_of(place: float, gate: float | None) -> bool:
    """Whether a door whose left edge is at `place` has the jambs at `gate` beside it."""
    return gate is None or abs(place + DOOR_WIDTH / 2 - gate) > (DOOR_WIDTH + PORTAL_DEPTH) / 2 + 0.25


def _furnish(
    random: np.random.Generator,
    shape: CorridorSettings,
    plan: Plan,
    doors: dict[int, list[float]],
    floor: Texture,
) -> list[Piece]:
    """The box in the way, and what is spread along the walls, none of it before a door."""
    things: list[Piece] = []
    if shape.box_at:
        middle = plan.lane.point(shape.box_at)
        x = middle.x - shape.box_offset * np.sin(middle.yaw)
        y = middle.y + shape.box_offset * np.cos(middle.yaw)
        things.append(person_sized_box(random, Place(x, y, middle.yaw + np.pi)))
    kinds = ["waste bin"] * int(shape.bins) + ["chair"] * int(shape.chairs)
    kinds += ["crate"] * int(shape.crates) + ["disguised crate"] * int(shape.disguised)
    kinds = [kinds[index] for index in random.permutation(len(kinds))]
    free = _free_places(shape, plan, doors)
    start, end = 2.6, plan.lane.length - 1.2
    for number, kind in enumerate(kinds):
        share = np.array([number, number + 1]) / len(kinds)
        low, high = start + (end - start) * share
        here = [place for place in free if low <= place[0] <= high] or free
        if not here:
            raise SimulationError(
                f"corridor: there is no room along its walls for {len(kinds)} things; "
                "give a greater length, a greater door_spacing or fewer bins, chairs and crates"
            )
        along, (bin_place, chair_place) = here[int(random.integers(len(here)))]
        free = [other for other in free if abs(other[0] - along) > SPACING_M]
        name = f"{kind} {number + 1}"
        if kind == "chair":
            things.append(chair(random, chair_place, name))
        elif kind == "waste bin":
            things.append(waste_bin(random, bin_place, name))
        else:
            things.append(crate(random, bin_place, name, floor if kind == "disguised crate" else None))
    return things


def _free_places(
    shape: CorridorSettings, plan: Plan, doors: dict[int, list[float]]
) -> list[tuple[float, tuple[Place, Place]]]:
    """Where along the lane, and there the places of a bin and of a chair, with their backs to the wall."""
    free = []
    for side in plan.sides:
        wall = plan.walls[side]
        facing = float(np.arctan2(wall.out[1], wall.out[0]))
        for along in np.arange(0.4, wall.length - 0.4, 0.1):
            backs = (wall.at(along, 0.0, gap) for gap in (BIN_RADIUS + 0.04, CHAIR_SIDE / 2 + 0.04))
            bin_place, chair_place = (Place(float(back[0]), float(back[1]), facing) for back in backs)
            way = plan.lane.locate(bin_place.x, bin_place.y, 0.0).along
            far_enough = 2.6 <= way <= plan.lane.length - 1.2
            for other, gap in ((shape.box_at, 1.0), (shape.narrow_at, 0.8)):
                far_enough &= not other or abs(way - other) > gap
            beside_doors = all(not -0.35 < along - door < DOOR_WIDTH + 0.35 for door in doors[side])
            if far_enough and beside_doors:
                free.append((way, (bin_place, chair_place)))
    return free


def _light(shape: CorridorSettings, plan: Plan) -> Illumination:
    if len(plan.legs) == 1:
        return RoomLight(lamp_places(shape.length), shape.width, shape.height, shape.length)
    first, second = plan.legs
    near = shape.turn_after - shape.width / 2
    return TurnedLight(
        lamps=np.vstack([leg.lamps() for leg in plan.legs]),
        directions=np.vstack([np.tile(leg.direction, (len(leg.lamps()), 1)) for leg in plan.legs]),
        outline=plan.outline,
        corner=np.array([near, second.start[1]]),
        inwards=np.array([-first.direction, second.direction]),
        height=shape.height,
        window=second.start + second.length * second.direction,
        leaving=second.direction,
    )


def _drive(shape: CorridorSettings, plan: Plan) -> WeavingSettings | FollowSettings:
    """How a recording drives: the usual weaving where the way is straight and free, else with more care."""
    if not (shape.turn or shape.narrow_at or shape.box_at or shape.chairs):
        return WeavingSettings()
    room = shape.width / 2 - (CHAIR_SIDE + 0.04 if shape.chairs else 0.0)
    if shape.narrow_at:
        room = min(room, shape.narrow_width / 2)
    sway = float(np.clip(room - ROBOT_HALF_WIDTH - CLEAR_M, 0.0, 0.2))
    if not shape.box_at:
        return FollowSettings(sway=sway, start=1.2)
    stop = shape.box_at - BOX_SIZE[0] / 2 - STOP_M
    return FollowSettings(sway=sway, start=1.2, end=plan.lane.length - stop)
