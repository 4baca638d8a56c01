# SPDX-License-Identifier: Apache-2.0
"""Corridors of all shapes: what is told of floor, lane and things is what was built and what is seen."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from robot_vision.bags import BagReader, decode
from robot_vision.bags.messages import yaw_of
from robot_vision.geometry import Camera
from robot_vision.geometry.rotation import quaternion_to_rotation, rpy_from_rotation
from robot_vision.simulation import Renderer, SimulationError, optical_pose, standard_camera
from robot_vision.simulation.corridor import BlockedSettings, CorridorSettings, corridor, corridor_blocked
from robot_vision.simulation.corridor_light import TurnedLight
from robot_vision.simulation.corridor_parts import DOOR_RECESS
from robot_vision.simulation.corridor_plan import plan_of
from robot_vision.simulation.drive import FollowSettings
from robot_vision.simulation.floor_plan import Surroundings
from robot_vision.simulation.follow import following
from robot_vision.simulation.furniture import BOX_SIZE
from robot_vision.simulation.sensors import CameraSensor
from robot_vision.simulation.world import SceneObject, World

RECORDED = Path(__file__).resolve().parents[2] / "bags" / "corridor.mcap"


def inside(outline: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Metres (N,) from points (N, 2) to the nearest side of an outline, negative outside."""
    corners = outline.astype(np.float32)
    return np.array([cv2.pointPolygonTest(corners, (float(x), float(y)), True) for x, y in points])


def things(world: World) -> list[SceneObject]:
    """What stands on the floor of a world."""
    return [item for item in world.objects if item.kind == "object"]


def test_the_corridor_in_the_house_still_looks_as_it_was_recorded() -> None:
    found = {}
    for message in BagReader(RECORDED).messages():
        found.setdefault(message.topic, decode(message.cdr, message.type_name))
        if {"/truth/odom", "/truth/attitude", "/image/compressed"} <= found.keys():
            break
    place, leaning = found["/truth/odom"].pose.pose, found["/truth/attitude"].orientation
    camera = standard_camera()
    roll, pitch, _ = rpy_from_rotation(quaternion_to_rotation([leaning.x, leaning.y, leaning.z, leaning.w]))
    pose = optical_pose(
        camera, place.position.x, place.position.y, yaw_of(place.orientation), roll, pitch - camera.pitch
    )
    seen = CameraSensor(1).capture(Renderer(corridor(seed=1).scene, camera).render(pose))
    recorded = cv2.imdecode(found["/image/compressed"].data, cv2.IMREAD_COLOR)
    assert recorded is not None
    assert np.abs(seen.astype(float) - recorded).mean() < 2.5  # noise, JPEG


@settings(max_examples=40)
@given(st.sampled_from([-1, 0, 1]), st.floats(1.2, 4.0), st.floats(6.5, 14.0), st.floats(20.0, 40.0))
def test_the_lane_keeps_half_a_width_from_all_walls(
    turn: int, width: float, after: float, length: float
) -> None:
    plan = plan_of(CorridorSettings(turn=turn, width=width, turn_after=after, length=length))
    ways = np.linspace(width / 2, plan.lane.length - width / 2, 60)
    points = np.array([plan.lane.point(float(way))[:2] for way in ways])
    gaps = inside(plan.outline, points)
    np.testing.assert_allclose(gaps, width / 2, atol=0.004 * width)
    start, end = plan.lane.point(0.0), plan.lane.point(plan.lane.length)
    assert start[:3] == pytest.approx((0.0, 0.0, 0.0), abs=2e-3)
    assert end.yaw == pytest.approx(turn * np.pi / 2, abs=2e-3)
    wanted = (after, turn * (length - after)) if turn else (length, 0.0)
    assert end[:2] == pytest.approx(wanted, abs=1e-9)
    x, y = plan.outline.T
    area = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2  # positive: counter-clockwise
    assert area == pytest.approx(width * length, rel=1e-9)


@pytest.mark.parametrize(("turn", "seed"), [(-1, 0), (0, 1), (1, 3)])
def test_things_stand_on_free_floor_before_no_door(turn: int, seed: int) -> None:
    world = corridor(
        CorridorSettings(turn=turn, length=22.0, bins=5, chairs=3, box_at=16.0, narrow_at=5.0), seed
    )
    standing = things(world)
    assert sorted(item.name.rstrip(" 0123456789") for item in standing) == sorted(
        ["box"] + 3 * ["chair"] + 5 * ["waste bin"]
    )
    (floor,) = world.floor
    for number, item in enumerate(standing):
        assert inside(floor, item.footprint).min() > 0.01, item.name
        for other in [*standing[number + 1 :], *(wall for wall in world.objects if "jamb" in wall.name)]:
            shared, _ = cv2.intersectConvexConvex(
                item.footprint.astype(np.float32), other.footprint.astype(np.float32)
            )
            assert shared == 0.0, (item.name, other.name)


def test_a_narrowed_entrance_is_as_wide_as_it_says() -> None:
    world = corridor(CorridorSettings(length=9.0, door_spacing=50.0, narrow_at=6.0, narrow_width=1.1), 2)
    right, left = (
        next(item for item in world.objects if item.name == f"{side} jamb") for side in ("right", "left")
    )
    assert right.footprint[:, 1].max() == pytest.approx(-0.55)
    assert left.footprint[:, 1].min() == pytest.approx(0.55)
    for jamb in (right, left):
        assert jamb.footprint[:, 0].mean() == pytest.approx(6.0)
        assert np.abs(jamb.footprint[:, 1]).max() == pytest.approx(1.0)
    camera = standard_camera().resized(320, 240)
    picture = Renderer(world.scene, camera).render(optical_pose(camera, 3.0, 0.0, 0.0))
    rear = 6.0 + 0.15 + 0.015  # where the steel that lines it ends: the narrowest part of it to be seen
    for side in (-1, 1):
        u, v = projected(camera, [[rear, side * 0.55, 1.0]], 3.0)[0]
        row = picture[round(v)].mean(axis=1)
        step = int(np.sign(camera.cx - u))
        steel, beyond = row[round(u) - 2 * step], row[round(u) + 2 * step]
        assert steel < 0.7 * beyond


def test_the_box_in_the_way_is_seen_where_it_stands() -> None:
    world = corridor_blocked(BlockedSettings(box_offset=0.3), 1)
    (box,) = (item for item in things(world) if item.name == "box")
    assert box.height == BOX_SIZE[2]
    assert np.ptp(box.footprint, axis=0) == pytest.approx(BOX_SIZE[:2])
    assert box.footprint.mean(axis=0) == pytest.approx((10.2, 0.3))
    camera = standard_camera()
    picture = Renderer(world.scene, camera).render(optical_pose(camera, 7.0, 0.0, 0.0))
    cardboard = picture[..., 2] > 1.7 * picture[..., 0]
    corners = projected(camera, [[10.0, y, z] for y in (0.55, 0.05) for z in (0.0, 1.0)], 7.0)
    row, middle = round(corners[1, 1]), round(corners[:, 0].mean())
    columns = np.flatnonzero(~cardboard[row])
    assert columns[columns < middle].max() + 0.5 == pytest.approx(corners[1, 0], abs=1.0)
    assert columns[columns > middle].min() - 0.5 == pytest.approx(corners[3, 0], abs=1.0)
    rows = np.flatnonzero(~cardboard[:, middle])
    assert rows[rows > row].min() - 0.5 == pytest.approx(corners[0, 1], abs=1.5)


def test_a_recording_of_the_blocked_corridor_rests_a_metre_before_the_box() -> None:
    world = corridor_blocked(seed=1)
    assert isinstance(world.drive, FollowSettings)
    motion = following(world, 11.0, world.drive, 1)
    assert motion.x[0] == pytest.approx(1.2, abs=0.05)
    assert motion.speed[-1] == pytest.approx(0.0, abs=0.01)
    assert 10.0 - motion.x[-1] == pytest.approx(1.0, abs=0.1)
    assert np.ptp(motion.y) > 0.03


@pytest.mark.parametrize(
    "shape",
    [
        CorridorSettings(turn=1, turn_after=6.0, chairs=3, bins=2, length=13.0),
        CorridorSettings(turn=-1, turn_after=7.0, narrow_at=3.5, narrow_width=0.9, length=13.0),
    ],
)
def test_a_recording_touches_nothing(shape: CorridorSettings) -> None:
    world = corridor(shape, 3)
    assert isinstance(world.drive, FollowSettings)
    motion = following(world, 10.0, world.drive, 3)
    assert motion.yaw[-1] == pytest.approx(shape.turn * np.pi / 2, abs=0.2)  # past the turn
    around = Surroundings(world)
    rooms = [
        around.at(*pose).clearance
        for pose in zip(motion.x[::60], motion.y[::60], motion.yaw[::60], strict=True)
    ]
    assert min(rooms) > 0.05


@settings(max_examples=200)
@given(st.lists(st.floats(-3.0, 3.0), min_size=4, max_size=4), st.sampled_from([-1.0, 1.0]))
def test_lamps_do_not_shine_through_the_corner_of_the_building(ends: list[float], turn: float) -> None:
    inwards = np.array([(-1.0, 0.0), (0.0, turn)])
    light = TurnedLight(
        np.zeros((1, 2)), np.eye(2)[:1], np.eye(3, 2), np.zeros(2), inwards, 2.6, np.zeros(2), inwards[1]
    )
    place, source = np.array(ends[:2]), np.array(ends[2:])
    way = place + np.linspace(0, 1, 2001)[:, None] * (source - place)
    depth = ((way - (DOOR_RECESS + 0.01) * inwards.sum(axis=0)) @ inwards.T).min(axis=1).max()
    if abs(depth) > 0.01:  # else it passes too near the corner to tell by samples
        assert light.sees(place[None], source[None])[0, 0] == (depth < 0)


def test_a_turned_corridor_is_lit_like_a_straight_one_far_from_the_turn() -> None:
    straight, turned = (
        corridor(CorridorSettings(length=16.0), 1),
        corridor(CorridorSettings(length=13.0, turn=1, turn_after=8.0), 1),
    )
    camera = standard_camera().resized(160, 120)
    pictures = [
        Renderer(world.scene, camera).render(optical_pose(camera, 3.0, 0.0, np.pi / 2)).mean(axis=(0, 1))
        for world in (straight, turned)
    ]
    np.testing.assert_allclose(pictures[1], pictures[0], rtol=0.15)


def test_the_same_seed_gives_the_same_corridor_and_another_seed_another() -> None:
    shape = CorridorSettings(length=10.0, bins=2, chairs=1)
    first, again, other = (things(corridor(shape, seed)) for seed in (5, 5, 6))
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a.footprint, b.footprint)
    assert any(not np.array_equal(a.footprint, b.footprint) for a, b in zip(first, other, strict=True))


@pytest.mark.parametrize(
    ("given_", "named"),
    [
        ({"turn": 0.5}, "turn"),
        ({"turn": 1, "turn_after": 23.0}, "turn_after"),
        ({"narrow_at": 23.5}, "narrow_at"),
        ({"narrow_at": 5.0, "narrow_width": 1.9}, "narrow_width"),
        ({"box_at": 1.0}, "box_at"),
        ({"box_at": 9.0, "box_offset": 0.9}, "box_offset"),
        ({"bins": 1.5}, "bins"),
        ({"chairs": -1}, "chairs"),
        ({"length": float("nan")}, "length"),
    ],
)
def test_impossible_corridors_are_refused_by_name(given_: dict[str, float], named: str) -> None:
    with pytest.raises(SimulationError, match=f"corridor: {named} must be"):
        CorridorSettings(**given_)


def test_more_things_than_there_is_room_for_are_refused() -> None:
    with pytest.raises(SimulationError, match="no room along its walls for 40 things"):
        corridor(CorridorSettings(length=8.0, bins=40))


def projected(camera: Camera, points: ArrayLike, x: float) -> NDArray[np.float64]:
    """Pixels (N, 2) of points (N, 3) of the world, seen by a robot at x on the middle line, looking ahead."""
    pose = optical_pose(camera, x, 0.0, 0.0)
    return camera.pixels((np.asarray(points, np.float64) - pose[:3, 3]) @ pose[:3, :3])


def test_crates_stand_along_the_walls_and_disguised_ones_are_clad_with_the_floor() -> None:
    shape = CorridorSettings(length=14.0, crates=2, disguised=2)
    world, bare = corridor(shape, 3), corridor(CorridorSettings(length=14.0), 3)
    heights = {item.name: item.height for item in world.objects if item.kind == "object"}
    assert sorted(name.rstrip("0123456789 ") for name in heights) == ["crate"] * 2 + ["disguised crate"] * 2
    for name, height in heights.items():
        assert (0.3 if name.startswith("disguised") else 0.2) <= height <= 0.5
    assert len(world.scene.quads) == len(bare.scene.quads) + 4 * 5
