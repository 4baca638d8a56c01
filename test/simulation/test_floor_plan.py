# SPDX-License-Identifier: Apache-2.0
"""True plans of floors: areas come out as areas, distances as distances."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from robot_vision.simulation import SimulationError
from robot_vision.simulation.floor_plan import FREE, OCCUPIED, UNKNOWN, Plan, Surroundings, occupancy, shadows
from robot_vision.simulation.scene import Scene, quad
from robot_vision.simulation.texture import Texture
from robot_vision.simulation.world import SceneObject, World, walls_around

SCENE = Scene((quad((0, 0, 0), (1, 0, 0), (0, 1, 0), Texture.plain((0.5, 0.5, 0.5))),))


def oblong(x: float, y: float, length: float, width: float) -> NDArray[np.float64]:
    return np.array([(x, y), (x + length, y), (x + length, y + width), (x, y + width)])


def hall(*objects: SceneObject, shade: tuple[NDArray[np.float64], ...] = (), **more: float) -> World:
    """A hall of 10 by 2 m between walls of 0.1 m."""
    floor = oblong(0, -1, 10, 2)
    return World(
        "hall",
        SCENE,
        "corridor",
        floor=(floor,),
        objects=(*walls_around(floor), *objects),
        shadows=shade,
        **more,  # type: ignore[arg-type]
    )


def cell(plan: Plan, x: float, y: float) -> int:
    row, column = (
        int(np.floor((place - origin) / plan.resolution))
        for place, origin in zip((y, x), plan.origin[::-1], strict=True)
    )
    return int(plan.cells[row, column])


def test_a_plan_has_the_areas_of_its_world() -> None:
    plan = occupancy(hall(SceneObject("box", oblong(5, 0, 0.4, 0.4), 1.0)))
    assert plan.resolution == 0.05
    assert plan.origin == pytest.approx((-0.1, -1.1))
    assert plan.cells.shape == (44, 204)
    area = plan.resolution**2
    assert (plan.cells == FREE).sum() * area == pytest.approx(20 - 0.16)
    assert cell(plan, 5.2, 0.2) == OCCUPIED
    assert cell(plan, 5.0, 1.05) == OCCUPIED
    assert cell(plan, 4.97, 0.2) == FREE
    assert cell(plan, -0.05, -1.05) == UNKNOWN  # a corner that no wall covers


def test_a_thin_thing_does_not_vanish() -> None:
    plan = occupancy(hall(SceneObject("pole", oblong(3.01, 0.01, 0.02, 0.5), 1.0)))
    assert cell(plan, 3.02, 0.3) == OCCUPIED


def test_shadows_lie_on_free_floor_only() -> None:
    box = SceneObject("box", oblong(2, 0, 0.5, 0.5), 1.0)
    plan = shadows(hall(box, shade=(oblong(1, -3, 2, 6),)))
    assert (plan.cells == OCCUPIED).sum() * plan.resolution**2 == pytest.approx(4 - 0.25)
    assert cell(plan, 2.2, 0.2) == UNKNOWN
    assert cell(plan, 5.0, 0.0) == FREE


def test_a_large_world_has_a_plan_that_fits_a_message() -> None:
    plan = occupancy(World("plain", SCENE, "road", floor=(oblong(0, 0, 900, 700),)))
    assert plan.cells.size <= 4_000_000
    assert plan.resolution == pytest.approx(0.05 * 2 ** round(np.log2(plan.resolution / 0.05)))
    assert (plan.cells == FREE).mean() > 0.99


def test_a_world_that_knows_no_floor_has_no_plan() -> None:
    with pytest.raises(SimulationError, match="nothing of its floor"):
        occupancy(World("void", SCENE, "road"))


@given(st.floats(0.0, 6.28), st.floats(-0.1, 0.1))
def test_room_to_a_wall_is_that_of_the_nearest_corner(yaw: float, y: float) -> None:
    """Between two long walls the nearest point of the footprint is one of its corners."""
    reach = 0.3 * abs(np.sin(yaw)) + 0.25 * abs(np.cos(yaw))
    room = Surroundings(hall(), 0.5, 0.6).at(5.0, y, yaw)
    assert room.clearance == pytest.approx(1.0 - abs(y) - reach, abs=1e-9)


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(0, 6.28), st.floats(0, 6.28))
def test_room_is_the_least_distance_of_points(x: float, y: float, yaw: float, turned: float) -> None:
    """Of a turned box, against many points of both outlines."""
    turn = np.array([[np.cos(turned), np.sin(turned)], [-np.sin(turned), np.cos(turned)]])
    box = oblong(-0.5, -0.2, 1.0, 0.4) @ turn
    world = World("box", SCENE, "road", objects=(SceneObject("box", box, 1.0),))
    room = Surroundings(world, 0.5, 0.6).at(x, y, yaw)
    into = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    robot = oblong(-0.3, -0.25, 0.6, 0.5) @ into + (x, y)
    shares = np.linspace(0, 1, 60)[:, None]
    outlines = [
        np.concatenate([a + shares * (b - a) for a, b in zip(shape, np.roll(shape, -1, axis=0), strict=True)])
        for shape in (box, robot)
    ]
    between = outlines[0][:, None] - outlines[1][None]
    least = float(np.hypot(between[..., 0], between[..., 1]).min())
    if room.clearance > 0:
        assert room.clearance == pytest.approx(least, abs=0.02)
    else:
        inside = np.abs((outlines[0] - (x, y)) @ into.T) <= (0.3001, 0.2501)
        around = np.abs(outlines[1] @ turn.T) <= (0.5001, 0.2001)
        assert least < 0.02 or inside.all(axis=1).any() or around.all(axis=1).any()


def test_who_stands_inside_something_touches_it() -> None:
    big = World("big", SCENE, "road", objects=(SceneObject("house", oblong(-9, -9, 18, 18), 3.0),))
    room = Surroundings(big, 0.5, 0.6).at(0, 0, 0.3)
    assert (room.clearance, room.nearest) == (0.0, "house")


def test_where_nothing_stands_there_is_room() -> None:
    assert Surroundings(World("void", SCENE, "road")).at(0, 0, 0).clearance == np.inf
    with pytest.raises(SimulationError, match="must be positive"):
        Surroundings(hall(), 0.0, 0.6)
