# SPDX-License-Identifier: Apache-2.0
"""The crop field: rows lie where the lane says, plants stand where they are told, and so they are seen."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_vision.geometry import Camera, GroundPlane
from robot_vision.simulation import Renderer, SimulationError, optical_pose
from robot_vision.simulation.crops import SORTS
from robot_vision.simulation.field import IN_ROW_M, field
from robot_vision.simulation.field_plan import FieldSettings
from robot_vision.simulation.world import World

SMALL = {"length": 8.0, "rows": 5, "missing": 0.0, "dead": 0.0, "stunted": 0.0, "weeds": 0.0}


@cache
def small(**changes: float | str) -> World:
    return field(FieldSettings(**{**SMALL, **changes}), seed=4)  # type: ignore[arg-type]


@settings(max_examples=60)
@given(st.floats(-0.05, 0.05), st.floats(-1.0, 20.0), st.floats(-6.0, 6.0))
def test_ways_along_the_rows_and_points_of_the_world_tell_the_same(
    c: float, along: float, left: float
) -> None:
    plan = FieldSettings(curvature=c if abs(c) > 1e-6 else 0.0, length=8.0, rows=11)
    points = plan.points(np.array([along]), np.array([left]))
    assert np.concatenate(plan.ways(points)) == pytest.approx([along, left], abs=1e-6)


@pytest.mark.parametrize("curvature", [0.0, 0.04, -0.04])
def test_the_lane_is_the_middle_row_and_bends_as_asked(curvature: float) -> None:
    plan = FieldSettings(length=12.0, rows=5, curvature=curvature)
    lane = plan.lane
    assert lane.length == pytest.approx(12.0, abs=1e-4)
    for along, left in ((1.0, -0.3), (6.0, 0.0), (11.0, 1.2)):
        (point,) = plan.points(np.array([along]), np.array([left]))
        pose = lane.locate(point[0], point[1], curvature * along)
        assert pose.along == pytest.approx(along, abs=1e-4)
        assert pose.offset == pytest.approx(left, abs=1e-5)
        assert pose.yaw == pytest.approx(0.0, abs=1e-5)
        assert pose.curvature == pytest.approx(curvature, abs=1e-4)


@pytest.mark.parametrize("curvature", [0.0, 0.03])
def test_crop_stands_in_rows_counted_from_the_right_and_scatters_as_asked(curvature: float) -> None:
    world = small(curvature=curvature, scatter=0.02, length=20.0)
    assert world.lane is not None
    for row in range(5):
        own = [plant for plant in world.plants if plant.row == row]
        left = np.array([world.lane.locate(plant.x, plant.y, 0.0).offset for plant in own])
        away = left - 0.5 * (row - 2)
        assert len(own) == pytest.approx(20.0 / SORTS["cabbages"].step, abs=2)
        assert abs(away.mean()) < 3 * 0.02 / np.sqrt(len(own))
        assert 0.013 < away.std() < 0.028


def test_missing_plants_and_gaps_leave_holes_and_nothing_grows_beyond_the_headland() -> None:
    all_there, holes = small(length=20.0), small(length=20.0, missing=0.2, gap=3.0, weeds=1.0)
    crop = [plant for plant in holes.plants if plant.kind == "crop"]
    assert 0.70 < len(crop) / (len(all_there.plants) * 17 / 20) < 0.90
    along = np.array([plant.x for plant in crop])
    assert not np.any((along > 6.0) & (along < 9.0))
    assert 0.0 <= along.min() and 18.0 < along.max() <= 20.0
    weeds = [plant for plant in holes.plants if plant.kind == "weed"]
    assert any(6.0 < plant.x < 9.0 for plant in weeds)
    assert any(plant.x > 20.5 for plant in weeds)


def test_weeds_are_as_dense_as_asked_and_not_hidden_under_the_crop() -> None:
    world = small(weeds=1.0, length=20.0)
    weeds = [plant for plant in world.plants if plant.kind == "weed"]
    crop = [plant for plant in world.plants if plant.kind == "crop"]
    ground = (4 * 0.5 + 2 * 1.0) * (20.0 + 6.0 + 1.0)
    assert 0.6 < len(weeds) / (ground / (0.5 * SORTS["cabbages"].step)) < 1.0
    places = np.array([(plant.x, plant.y) for plant in crop])
    for weed in weeds:
        away = np.hypot(*(places - (weed.x, weed.y)).T)
        nearest = int(away.argmin())
        assert away[nearest] >= 0.74 * crop[nearest].radius
        line = 0.5 * np.round(weed.y / 0.5).clip(-2, 2)
        in_row = abs(weed.y - line) <= IN_ROW_M and 0 <= weed.x <= 20.0
        assert weed.row == (int(line / 0.5) + 2 if in_row else -1)


def test_every_plant_has_a_number_of_its_own_and_the_same_seed_gives_the_same_field() -> None:
    shape = FieldSettings(length=5.0, rows=3, set="seedlings")
    one, again, other = (field(shape, seed) for seed in (1, 1, 2))
    assert len({plant.id for plant in one.plants}) == len(one.plants)
    assert one.plants == again.plants
    assert one.plants != other.plants
    pose = optical_pose(one.camera, 1.0, 0.0, 0.0)
    tiny = one.camera.resized(80, 60)
    first, second = (Renderer(world.scene, tiny).render(pose) for world in (one, again))
    assert np.array_equal(first, second)


def test_dead_plants_are_seen_but_are_no_plants_of_the_world() -> None:
    living, dying = small(), small(dead=0.5)
    assert 0.3 < len(dying.plants) / len(living.plants) < 0.7
    assert len(dying.scene.quads) > 0.9 * len(living.scene.quads)


@pytest.mark.parametrize(("kind", "curvature"), [("seedlings", 0.0), ("cabbages", 0.0), ("seedlings", 0.04)])
def test_green_seen_by_the_camera_lies_on_the_rows(kind: str, curvature: float) -> None:
    """Of low plants; those that stand high seem farther off than they are."""
    world = small(set=kind, curvature=curvature, scatter=0.0)
    camera = world.camera.resized(320, 240)
    assert world.lane is not None
    x, y, yaw, _ = world.lane.point(1.5)
    seen = Renderer(world.scene, camera).render(optical_pose(camera, x, y, yaw))
    blue, green, red = np.moveaxis(seen.astype(np.float64), 2, 0)
    rows, columns = np.nonzero((2 * green - red - blue) > 0.25 * (red + green + blue))
    ground = GroundPlane(camera).from_pixels(np.column_stack([columns, rows]).astype(np.float64))
    near = (ground[:, 0] < 4.0) & (np.abs(ground[:, 1]) < 0.2)
    cos, sin = np.cos(yaw), np.sin(yaw)
    ahead, left = ground[near].T
    off = np.array(
        [
            world.lane.locate(x + cos * a - sin * b, y + sin * a + cos * b, yaw).offset
            for a, b in zip(ahead, left, strict=True)
        ]
    )
    assert len(off) > 300
    assert abs(off[np.abs(off) < 0.2].mean()) < 0.012


def test_the_sun_casts_shadows_away_from_itself_and_an_overcast_sky_none() -> None:
    """Soil 0.26 to 0.36 m to both sides of a row of bushes 0.3 m high, the sun on the left at 45 degrees."""
    brightness = {}
    for sun in (0.0, 0.7):
        low = {"sun": sun, "sun_azimuth": np.pi / 2, "sun_elevation": np.pi / 4}
        world = small(set="canopy", rows=1, length=6.0, **low)
        camera = Camera(200.0, 200.0, 49.5, 49.5, 100, 100, height_m=5.0)
        pose = np.eye(4)
        pose[:3, :3] = np.diag([1.0, -1.0, -1.0])  # columns along x, rows to the right, looking down
        pose[:3, 3] = (3.0, 0.0, 5.0)
        seen = Renderer(world.scene, camera).render(pose)[..., 2]
        brightness[sun] = float(seen[60:64].mean() / seen[36:40].mean())
    assert 0.9 < brightness[0.0] < 1.1
    assert brightness[0.7] < 0.75


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("set", "trees"),
        ("length", 1.0),
        ("rows", 0),
        ("spacing", 0.0),
        ("curvature", 0.2),
        ("missing", 1.0),
        ("weeds", -1.0),
        ("camera_pitch", float("nan")),
    ],
)
def test_settings_without_meaning_are_refused_by_name(name: str, value: float | str) -> None:
    with pytest.raises(SimulationError, match=name):
        FieldSettings(**{name: value})  # type: ignore[arg-type]


def test_rows_that_would_cross_or_turn_back_are_refused() -> None:
    with pytest.raises(SimulationError, match="fewer rows or less curvature"):
        FieldSettings(curvature=0.05, rows=101)
    with pytest.raises(SimulationError, match="less length or less curvature"):
        FieldSettings(curvature=0.05, length=100.0, rows=5)
