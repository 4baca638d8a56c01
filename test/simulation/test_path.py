# SPDX-License-Identifier: Apache-2.0
"""The paved path: its stones are a ruler, its shadows lie where the sun puts them, its way is free."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from robot_vision.geometry import Camera, GroundPlane
from robot_vision.simulation import Renderer, SimulationError, optical_pose
from robot_vision.simulation.drive import FollowSettings
from robot_vision.simulation.floor_plan import Surroundings
from robot_vision.simulation.follow import following
from robot_vision.simulation.furniture import (
    BOLLARD_HEIGHT,
    BOLLARD_RADIUS,
    PILLAR_HEIGHT,
    PILLAR_RADIUS,
    PLINTH_HEIGHT,
)
from robot_vision.simulation.path import PathSettings, PavedWorld, path
from robot_vision.simulation.path_parts import flagstones
from robot_vision.simulation.sun import Sun
from robot_vision.simulation.world import SceneObject

BARE = {"pillar_spacing": 0.0, "bollard_gap": 0.0, "litter_bins": 0, "length": 8.0}
DOWN = Camera(700.0, 700.0, 319.5, 239.5, 640, 480, height_m=2.2, pitch=float(np.radians(60.0)))


@pytest.fixture(scope="module")
def sunny() -> PavedWorld:
    return path(PathSettings(length=12.0), 1)


def ground_picture(
    world: PavedWorld, camera: Camera, x: float, places: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Brightness (...) at places (..., 2) of the ground, in metres ahead and to the left of a robot at x."""
    picture = Renderer(world.scene, camera).render(optical_pose(camera, x, 0.0, 0.0)).mean(axis=2)
    pixels = GroundPlane(camera).to_pixels(places.reshape(-1, 2)).astype(np.float32).reshape(places.shape)
    return np.asarray(cv2.remap(picture, pixels[..., 0], pixels[..., 1], cv2.INTER_LINEAR), np.float64)


@pytest.mark.parametrize(("length", "width", "across"), [(0.60, 0.40, 6), (0.45, 0.30, 8)])
def test_joints_are_seen_where_the_stones_are_said_to_end(length: float, width: float, across: int) -> None:
    world = path(
        PathSettings(**BARE, stone_length=length, stone_width=width, stones_across=across, sun_elevation=0.0),
        2,
    )
    assert (world.stone_length, world.stone_width, world.joint) == (length, width, 0.012)
    assert isinstance(world.lane.width, float) and world.lane.width == pytest.approx(across * width)
    x = 2.0
    along, left = np.arange(0.55, 2.2, 0.003), np.arange(-0.8, 0.8, 0.003)
    seen = ground_picture(world, DOWN, x, np.stack(np.meshgrid(along, left), axis=-1))
    for place, brightness, pitch in (
        (x + along, seen.mean(axis=0), length),
        (left, seen.mean(axis=1), width),
    ):
        joints = pitch * np.arange(
            np.ceil((place[0] + 0.02) / pitch), np.floor((place[-1] - 0.02) / pitch) + 1
        )
        assert len(joints) >= 2
        for joint in joints:
            near = np.abs(place - joint) < 0.02
            dark = np.maximum(np.median(brightness) * 0.93 - brightness[near], 0.0)
            assert dark.sum() > 0, joint
            assert (dark * place[near]).sum() / dark.sum() == pytest.approx(joint, abs=0.002)


def points_of(item: SceneObject) -> NDArray[np.float64]:
    """Points (N, 3) of the axis of a pillar or bollard, at all heights."""
    middle = item.footprint.mean(axis=0)
    return np.array([(*middle, height) for height in np.linspace(0.02, item.height, 40)])


def inside(outlines: tuple[NDArray[np.float64], ...], place: NDArray[np.float64]) -> float:
    """Metres that a place (2,) lies inside one of some outlines; negative: outside of all."""
    where = float(place[0]), float(place[1])
    return max(cv2.pointPolygonTest(outline.astype(np.float32), where, True) for outline in outlines)


def test_shadows_are_told_where_the_sun_puts_them(sunny: PavedWorld) -> None:
    shape = PathSettings(length=12.0)
    sun = Sun(shape.sun_azimuth, shape.sun_elevation)
    across = np.array([-np.sin(shape.sun_azimuth), np.cos(shape.sun_azimuth)])
    (floor,) = sunny.floor
    checked = 0
    for item in sunny.objects:
        if not item.name.startswith(("pillar", "bollard")):
            continue
        shaft = PILLAR_RADIUS if item.name.startswith("pillar") else BOLLARD_RADIUS
        for point in points_of(item):
            place = sun.shadow(point[None])[0]
            if inside((floor,), place) < shaft + 0.02:
                continue
            assert inside(sunny.shadows, place) > 0.5 * shaft
            if PLINTH_HEIGHT + 0.5 < point[2] < item.height - 0.5:
                checked += 1
                for side in (-1, 1):
                    assert inside(sunny.shadows, place + side * (shaft - 0.01) * across) > 0
    assert checked > 20
    assert {item.height for item in sunny.objects} >= {PILLAR_HEIGHT, BOLLARD_HEIGHT}


def test_shadows_are_seen_where_they_are_told(sunny: PavedWorld) -> None:
    overcast = path(PathSettings(length=12.0, sun_elevation=0.0), 1)
    assert overcast.shadows == ()
    places = np.stack(np.meshgrid(np.arange(0.5, 2.3, 0.02), np.arange(-0.84, 0.84, 0.02)), axis=-1)
    x = 2.0
    seen = [ground_picture(world, DOWN, x, places) for world in (sunny, overcast)]
    light = seen[0] / seen[1]
    assert np.isfinite(light).all()
    depth = np.array([inside(sunny.shadows, place + (x, 0.0)) for place in places.reshape(-1, 2)])
    depth = depth.reshape(light.shape)
    shade, sun = light[depth > 0.05], light[depth < -0.05]
    assert len(shade) > 500 and len(sun) > 500
    assert np.quantile(shade, 0.99) < 0.6 * np.quantile(sun, 0.01)
    dark = light < (np.median(shade) + np.median(sun)) / 2
    assert (dark & (depth > 0)).sum() / (dark | (depth > 0)).sum() > 0.97


def test_the_drive_keeps_clear_of_all_that_stands_about(sunny: PavedWorld) -> None:
    assert isinstance(sunny.drive, FollowSettings)
    motion = following(sunny, 9.0, sunny.drive, 1)
    around = Surroundings(sunny)
    poses = zip(motion.x[::60], motion.y[::60], motion.yaw[::60], strict=True)
    assert min(around.at(*pose).clearance for pose in poses) > 0.08
    assert motion.x[-1] > 8.0


def test_kerbs_bound_the_floor_and_things_stand_inside_or_beside_it(sunny: PavedWorld) -> None:
    (floor,) = sunny.floor
    half = floor[:, 1].max()
    kerbs = {item.name: item for item in sunny.objects if item.kind == "wall"}
    assert kerbs["left kerb"].footprint[:, 1].min() == pytest.approx(half)
    assert kerbs["right kerb"].footprint[:, 1].max() == pytest.approx(-half)
    for item in sunny.objects:
        if item.name.startswith(("bollard", "litter bin")):
            assert np.abs(item.footprint[:, 1]).max() < half
        if item.name.startswith("pillar"):
            assert np.abs(item.footprint[:, 1]).min() > half


@pytest.mark.parametrize(
    ("given_", "named"),
    [
        ({"length": 1.0}, "length must be"),
        ({"stones_across": 2.5}, "stones_across must be a whole"),
        ({"stones_across": 2}, "it must be 1.2 to 8 m"),
        ({"joint": 0.2}, "joint must be"),
        ({"pillar_spacing": 0.5}, "pillar_spacing must be"),
        ({"bollard_gap": 2.4}, "bollard_gap must be"),
        ({"sun_elevation": 0.05}, "sun_elevation must be"),
        ({"sun_azimuth": float("inf")}, "sun_azimuth must be"),
    ],
)
def test_impossible_paths_are_refused_by_name(given_: dict[str, float], named: str) -> None:
    with pytest.raises(SimulationError, match=f"path: .*{named}"):
        PathSettings(**given_)


def test_the_same_seed_gives_the_same_path_and_another_seed_other_stones(sunny: PavedWorld) -> None:
    again = path(PathSettings(length=12.0), 1)
    for first, second in zip(sunny.scene.quads, again.scene.quads, strict=True):
        np.testing.assert_array_equal(first.origin, second.origin)
        np.testing.assert_array_equal(first.texture.texels, second.texture.texels)
        np.testing.assert_array_equal(first.light, second.light)
    stones = [flagstones(np.random.default_rng(seed), 0.6, 0.4, 6, 0.012).levels[4] for seed in (1, 2)]
    assert np.abs(stones[0] - stones[1]).mean() > 0.01
