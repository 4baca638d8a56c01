# SPDX-License-Identifier: Apache-2.0
"""What a world says of itself, and what is told of it as truth."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from robot_vision.bags import clouds
from robot_vision.bags.messages import yaw_of
from robot_vision.geometry import Camera
from robot_vision.geometry.rotation import quaternion_to_rotation
from robot_vision.simulation import SimulationError
from robot_vision.simulation.asked import settings_of, sort_out, split_settings
from robot_vision.simulation.body import BodyState
from robot_vision.simulation.drive import FollowSettings
from robot_vision.simulation.follow import following
from robot_vision.simulation.record import RecordingSettings
from robot_vision.simulation.scene import Scene, quad
from robot_vision.simulation.sky import Clouds
from robot_vision.simulation.texture import Texture
from robot_vision.simulation.truth import TruthTeller
from robot_vision.simulation.world import (
    Plant,
    PolyLane,
    SceneObject,
    StartPose,
    StraightLane,
    World,
    walls_around,
)

SCENE = Scene((quad((0, 0, 0), (1, 0, 0), (0, 1, 0), Texture.plain((0.5, 0.5, 0.5))),))
WAY = np.linspace(0, 60, 30)
BENDS = PolyLane(np.column_stack([WAY, 3 * np.sin(WAY / 6)]), 3.0)


def told(world: World, state: BodyState) -> dict[str, Any]:
    return {said.topic: said.message for said in TruthTeller(world, world.camera).at(0, state)}


def test_walls_stand_outside_their_floor() -> None:
    floor = np.array([(0, 0), (4, 0), (4, 2), (0, 2)], np.float64)
    walls = walls_around(floor, thickness=0.2)
    assert [wall.kind for wall in walls] == ["wall"] * 4
    spans = [(wall.footprint.min(axis=0).tolist(), wall.footprint.max(axis=0).tolist()) for wall in walls]
    assert spans[0] == ([0, -0.2], [4, 0])
    assert spans[1] == ([4, 0], [4.2, 2])
    assert len(walls_around(floor, closed=False)) == 3


def test_a_robot_begins_where_the_world_says_or_on_its_lane() -> None:
    lane = StraightLane(20, 2, 3, 1, np.pi / 2)
    drive = FollowSettings(start=2.0)
    assert World("a", SCENE, "row", lane, drive=drive).beginning == pytest.approx((3, 3, np.pi / 2))
    assert World("a", SCENE, "row", lane, start=StartPose(1, 2, 3)).beginning == (1, 2, 3)
    assert World("a", SCENE, "row").beginning == (0, 0, 0)


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: World("a", SCENE, "row", floor=(np.zeros((2, 2)),)), "a: floor: an outline must be"),
        (lambda: World("a", SCENE, "row", clouds=1.0), "clouds must be between"),
        (lambda: SceneObject("bin", np.full((4, 2), np.nan), 1.0), "bin: an outline must be finite"),
        (lambda: Plant(3, 0, "tree", 0, 0, 1, 1, 1), "plant 3: its kind is one of crop, weed"),
        (lambda: FollowSettings(speed=-1.0), "speed must be between"),
        (lambda: FollowSettings(vehicle="tank"), "vehicle must be one of"),
        (lambda: RecordingSettings(rate=7), "divide 600, not 7"),
    ],
)
def test_what_makes_no_sense_is_refused(made: Any, words: str) -> None:
    with pytest.raises(SimulationError, match=words):
        made()


def test_heading_and_place_are_told_in_the_lane_and_in_the_world() -> None:
    world = World("bends", SCENE, "road", BENDS)
    x, y, yaw, _ = BENDS.point(20.0)
    state = BodyState(x - 0.4 * np.sin(yaw), y + 0.4 * np.cos(yaw), yaw + 0.1, 0.7, -0.2)
    said = told(world, state)
    heading, odometry = said["truth/heading"], said["truth/odom"]
    assert heading.header.frame_id == odometry.header.frame_id == "road"
    assert heading.pose.pose.position.y == pytest.approx(0.4, abs=1e-6)
    assert yaw_of(heading.pose.pose.orientation) == pytest.approx(0.1, abs=1e-6)
    assert (odometry.pose.pose.position.x, odometry.pose.pose.position.y) == (state.x, state.y)
    assert (odometry.twist.twist.linear.x, odometry.twist.twist.angular.z) == (0.7, -0.2)
    assert "truth/heading" not in told(replace(world, lane=None), state)


def test_the_camera_is_tilted_as_told() -> None:
    """World-up in the camera, from the picture's pose, is up turned by the attitude and the bare axes."""
    camera = Camera(460, 460, 319.5, 239.5, 640, 480, height_m=0.6, pitch=0.3, roll=-0.1)
    state = BodyState(1, 2, 0.7, roll=0.04, pitch=-0.06)
    turn = told(World("a", SCENE, "road", camera=camera), state)["truth/attitude"].orientation
    tilt = quaternion_to_rotation([turn.x, turn.y, turn.z, turn.w])
    bare = replace(camera, pitch=0.0, roll=0.0).optical_to_base
    np.testing.assert_allclose(state.camera_pose(camera)[2, :3], (tilt @ bare)[2], atol=1e-9)


def test_plants_in_the_picture_are_told_where_they_are_seen() -> None:
    random = np.random.default_rng(1)
    plants = tuple(
        Plant(i, i % 4, "crop" if i % 3 else "weed", *random.uniform(-15, 15, 2), 0.1, 0.01 * i, 0.2)
        for i in range(400)
    )
    camera = Camera(460, 460, 319.5, 239.5, 640, 480, height_m=1.4, pitch=0.5, x_m=0.3)
    world = World("field", SCENE, "row", plants=plants, camera=camera)
    state = BodyState(2.0, -1.0, 2.2)
    message = told(world, state)["truth/plants"]
    assert message.header.frame_id == "base_link"
    seen = clouds.points(message)
    assert 10 < len(seen) < 200
    by_id = {plant.id: plant for plant in plants}
    cos, sin = np.cos(state.yaw), np.sin(state.yaw)
    for point in seen:
        plant = by_id[int(point["id"])]
        x = state.x + cos * point["x"] - sin * point["y"]
        y = state.y + sin * point["x"] + cos * point["y"]
        assert (x, y) == pytest.approx((plant.x, plant.y), abs=1e-5)
        assert (point["kind"], point["row"]) == (plant.kind == "weed", plant.row)
        assert point["area"] == pytest.approx(plant.area)
    pose = state.camera_pose(camera)
    stems = np.array([(plant.x, plant.y, 0.0) for plant in plants])
    u, v = camera.pixels((stems - pose[:3, 3]) @ pose[:3, :3]).T
    visible = (np.abs(u - 319.5) < 320) & (np.abs(v - 239.5) < 240)
    near = np.hypot(stems[:, 0] - state.x, stems[:, 1] - state.y) < 12
    assert {int(number) for number in seen["id"]} == set(np.flatnonzero(visible & near).tolist())


def test_plans_are_told_once_where_there_is_a_floor() -> None:
    floor = np.array([(0, 0), (4, 0), (4, 2), (0, 2)], np.float64)
    teller = TruthTeller(World("hall", SCENE, "corridor", floor=(floor,)), Camera.uncalibrated(64, 48))
    plans = {said.topic: said.message for said in teller.lasting(5)}
    assert set(plans) == {"truth/map", "truth/shadows"}
    grid = plans["truth/map"]
    assert (grid.header.frame_id, grid.info.width, grid.info.height) == ("corridor", 80, 40)
    assert (grid.data == 0).all()
    assert not list(TruthTeller(World("void", SCENE, "road"), Camera.uncalibrated(64, 48)).lasting(5))


@pytest.mark.parametrize("vehicle", ["differential", "ackermann"])
def test_a_drive_follows_its_lane_with_the_weave_it_was_asked_for(vehicle: str) -> None:
    how = FollowSettings(sway=0.25, wavelength=8.0, stop_every=8.0, stop=1.0, vehicle=vehicle)
    motion = following(World("bends", SCENE, "road", BENDS, drive=how), 20.0, how, seed=3)
    poses = [BENDS.locate(*motion.state(step)[:3]) for step in range(0, len(motion.x), 60)]
    offsets = np.array([pose.offset for pose in poses])
    assert 0.2 < np.abs(offsets).max() < 0.3
    assert offsets.std() == pytest.approx(0.25 / np.sqrt(2), rel=0.2)
    assert 10 < poses[-1].along < 20
    standing = (np.abs(motion.speed[600:]) < 0.05).sum() / 600
    assert 1.0 < standing < 4.0  # two stops, and the last of braking
    np.testing.assert_allclose(
        np.hypot(np.diff(motion.x), np.diff(motion.y)) * 600, motion.speed[:-1], atol=1e-3
    )


def test_a_drive_comes_to_rest_at_the_end_and_refuses_to_stand_there_for_long() -> None:
    how = FollowSettings(end=3.0)
    world = World("short", SCENE, "corridor", StraightLane(9.0, 2.0), drive=how)
    motion = following(world, 8.5, how)
    assert motion.x[-1] == pytest.approx(6.0, abs=0.1)
    assert motion.speed[-1] == pytest.approx(0.0, abs=0.02)
    with pytest.raises(SimulationError, match="lane of 9.0 m is over after"):
        following(world, 30.0, how)


def test_without_a_lane_the_robot_stands_and_looks() -> None:
    world = World("plate", SCENE, "plate", start=StartPose(1, 2, 0.5), drive=FollowSettings(shake=0.01))
    assert isinstance(world.drive, FollowSettings)
    motion = following(world, 2.0, world.drive)
    assert np.ptp(motion.x) == np.ptp(motion.yaw) == 0.0
    assert motion.pitch.std() > 0


def test_clouds_take_no_more_light_than_asked() -> None:
    shares = np.array([Clouds(0.4, seed=2).brightness(time) for time in np.linspace(0, 300, 3000)])
    assert 0.6 <= shares.min() < 0.7
    assert 0.9 < shares.max() <= 1.0
    assert np.abs(np.diff(shares)).max() < 0.03  # smoothly: in a tenth of a second
    light = np.ones((4, 4, 3), np.float32)
    Clouds(0.0).dim(light, 3.0)
    assert (light == 1).all()


def test_settings_are_read_from_texts_by_the_type_of_their_default() -> None:
    given = split_settings(["speed=2", " vehicle = ackermann", ""])
    how = settings_of(FollowSettings, given)
    assert (how.speed, how.vehicle, how.sway) == (2.0, "ackermann", FollowSettings().sway)
    assert settings_of(RecordingSettings, {"quality": "60"}).quality == 60
    assert sort_out("x", {"rate": 15, "speed": 1.0}, (RecordingSettings, FollowSettings)) == [
        {"rate": 15},
        {"speed": 1.0},
    ]


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        (["speed"], "write it as name=value"),
        (["=3"], "write it as name=value"),
        (["speed=1", "speed=2"], "'speed' is given twice"),
        (["speed=fast"], "speed must be a number, not 'fast'"),
        (["speed=inf"], "speed must be a finite number"),
        (["quality=70.5"], "quality must be a whole number"),
        (["colour=red"], "thing has no parameter 'colour'; it has: end, "),
    ],
)
def test_settings_that_are_none_are_refused(texts: list[str], words: str) -> None:
    kinds = (FollowSettings, RecordingSettings)
    with pytest.raises(SimulationError, match=words):
        for kind, given in zip(kinds, sort_out("thing", split_settings(texts), kinds), strict=True):
            settings_of(kind, given)
