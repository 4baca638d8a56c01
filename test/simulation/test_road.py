# SPDX-License-Identifier: Apache-2.0
"""The country road: what is painted lies where the lane's truth puts it, and the bends are those asked for."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.lane import PolyLane
from robot_vision.simulation.renderer import Renderer, optical_pose
from robot_vision.simulation.road import SIDES, RoadSettings, SideOfRoad, road, winding
from robot_vision.simulation.road_surface import DASH, DASH_PERIOD, LINE_INSET, LINE_WIDTH, Surface
from robot_vision.simulation.world import World

SHAPE = RoadSettings(length=60.0, wear=0.0, curvature=0.03, bend=30.0)


@pytest.fixture(scope="module")
def fresh() -> World:
    """A short road whose paint is new."""
    return road(SHAPE, seed=2)


def whole_road(world: World) -> PolyLane:
    assert isinstance(world.lane, SideOfRoad)
    return world.lane.road


def beside(lane: PolyLane, along: float, offset: float) -> tuple[float, float]:
    """A place (x, y) by its way along the centre line and its offset to the left of it."""
    x, y, yaw, _ = lane.point(along)
    return x - offset * np.sin(yaw), y + offset * np.cos(yaw)


@pytest.mark.parametrize("seed", range(6))
def test_the_road_winds_to_both_sides_within_its_curvature(seed: int) -> None:
    settings = RoadSettings(length=500.0)
    points = winding(settings, seed)
    lane = PolyLane(points, settings.width)
    assert lane.length == pytest.approx(500.0, abs=0.5)
    curvature = np.array([lane.point(along).curvature for along in np.arange(2.0, 498.0, 1.0)])
    assert np.abs(curvature).max() <= 1.02 * settings.curvature
    assert curvature.max() > 0.6 * settings.curvature
    assert curvature.min() < -0.6 * settings.curvature
    bends = np.flatnonzero(np.diff(np.sign(curvature[np.abs(curvature) > 0.002])))
    assert len(bends) >= 6
    yaw = np.unwrap([lane.point(along).yaw for along in np.arange(0.0, 500.0, 2.0)])
    assert np.abs(yaw).max() < np.pi / 3
    assert (np.diff(points[:, 0]) > 0).all()  # it never comes back
    np.testing.assert_array_equal(points[0], (0.0, 0.0))


def test_a_road_without_curvature_is_straight() -> None:
    points = winding(RoadSettings(curvature=0.0), seed=1)
    np.testing.assert_allclose(points[:, 1], 0.0, atol=1e-12)


@pytest.mark.parametrize("side", sorted(SIDES))
def test_the_vehicle_keeps_to_its_side_and_is_told_from_the_centre_line(side: str) -> None:
    settings = RoadSettings(length=60.0, curvature=0.04, bend=25.0, side=side)
    whole = PolyLane(winding(settings, 0), settings.width)
    lane = SideOfRoad(whole, 0.25 * settings.width * SIDES[side])
    assert lane.length == whole.length
    for along in (3.0, 20.0, 41.0):
        x, y, yaw, curvature = lane.point(along)
        pose = lane.locate(x, y, yaw + 0.1)
        assert pose.offset == pytest.approx(1.4 * SIDES[side], abs=1e-6)
        assert pose.yaw == pytest.approx(0.1, abs=1e-6)
        assert pose.along == pytest.approx(along, abs=1e-3)
        assert pose.width == settings.width
        near = lane.point(along - 0.05), lane.point(along + 0.05)
        turned = (near[1].yaw - near[0].yaw) / np.hypot(near[1].x - near[0].x, near[1].y - near[0].y)
        assert curvature == pytest.approx(turned, abs=2e-4)


def test_paint_is_seen_where_the_truth_of_the_lane_puts_it(fresh: World) -> None:
    """Verge lines in the picture lie within a pixel of where the curve projects them, near and far."""
    whole = whole_road(fresh)
    x, y, yaw, _ = whole.point(4.0)
    pose = optical_pose(fresh.camera, x, y, yaw)
    light = Renderer(fresh.scene, fresh.camera).render(pose).mean(axis=2)
    errors = []
    for along in np.arange(9.0, 24.0, 0.5):
        for side in (-1, 1):
            line = side * (SHAPE.width / 2 - LINE_INSET)
            place = np.array([[*beside(whole, float(along), line), 0.0]])
            inner, outer = (
                np.array([[*beside(whole, float(along), line + away), 0.0]]) for away in (-0.25, 0.25)
            )
            pixels = [fresh.camera.pixels((p - pose[:3, 3]) @ pose[:3, :3])[0] for p in (inner, place, outer)]
            if not all(0 <= u < 639 and 0 <= v < 479 for u, v in pixels):
                continue
            across = np.linspace(0, 1, 61)[:, None]
            places = (pixels[0] + across * (pixels[2] - pixels[0])).astype(np.float32)
            profile = cv2.remap(light, places[None, :, 0], places[None, :, 1], cv2.INTER_LINEAR)[0]
            weight = np.maximum(profile - np.percentile(profile, 60), 0)
            middle = float((weight * across[:, 0]).sum() / weight.sum())
            errors.append(np.hypot(*(pixels[0] + middle * (pixels[2] - pixels[0]) - pixels[1])))
    assert len(errors) > 20
    assert np.median(errors) < 0.6
    assert np.max(errors) < 2.0


def test_worn_paint_has_gaps() -> None:
    """Worn lines have less white than new ones, but some; of new ones all of it is there."""
    white = []
    for wear in (0.0, 0.8):
        stretches = Surface(5.6, 4.0, wear).stretches(np.random.default_rng(3))
        white.append(np.mean([(painted.texels.min(axis=2) > 0.45).mean() for painted in stretches]))
    painted = (2 + DASH / DASH_PERIOD) * LINE_WIDTH / 8.0
    assert white[0] == pytest.approx(painted, rel=0.15)
    assert 0 < white[1] < 0.7 * white[0]


def test_the_floor_between_the_hedges_is_free(fresh: World) -> None:
    whole = whole_road(fresh)
    (floor,) = fresh.floor
    kinds = {item.kind for item in fresh.objects}
    assert kinds == {"wall", "object"}
    for along in np.arange(0.0, 60.0, 2.5):
        for offset in (-2.7, 0.0, 2.7):
            place = tuple(float(100 * value) for value in beside(whole, float(along), offset))
            assert cv2.pointPolygonTest((100 * floor).astype(np.float32), place, False) > 0
            for item in fresh.objects:
                assert cv2.pointPolygonTest((100 * item.footprint).astype(np.float32), place, False) < 0
        hedge = tuple(float(100 * value) for value in beside(whole, float(along), 4.8))
        assert any(
            cv2.pointPolygonTest((100 * item.footprint).astype(np.float32), hedge, False) >= 0
            for item in fresh.objects
            if item.kind == "wall"
        )


def test_the_ground_is_dark_where_shadows_are_told(fresh: World) -> None:
    deep, open_ = [], []
    for item in fresh.scene.quads:
        if item.texture.size[0] != 16.0 or item.light is None:
            continue
        places = item.lattice(item.light.shape[1], item.light.shape[0])[..., :2].reshape(-1, 2)
        light = item.light.mean(axis=2).reshape(-1)
        for place, value in zip(places[::17], light[::17], strict=True):
            depth = max(
                cv2.pointPolygonTest((100 * line).astype(np.float32), tuple(100 * place), True) / 100
                for line in fresh.shadows
            )
            if depth > 0.4:
                deep.append(value)
            elif depth < -0.4:
                open_.append(value)
    assert len(deep) > 50
    assert len(open_) > 50
    assert max(deep) < 0.5
    assert min(open_) > 0.98


def test_land_sky_and_hedges_fill_the_picture(fresh: World) -> None:
    camera = fresh.camera.resized(160, 120)
    renderer = Renderer(fresh.scene, camera)
    for yaw in np.arange(0.0, 2 * np.pi, 0.7):
        light: NDArray[np.float32] = renderer.render(optical_pose(camera, 0.0, 0.0, float(yaw)))
        assert (light[:30, :, 0] > light[:30, :, 2]).mean() > 0.5  # the sky is blue
        assert np.isfinite(light).all()
        assert light.min() > 0.0


def test_the_same_seed_makes_the_same_road(fresh: World) -> None:
    again = road(SHAPE, seed=2)
    assert len(again.scene.quads) == len(fresh.scene.quads)
    for a, b in zip(fresh.scene.quads, again.scene.quads, strict=True):
        np.testing.assert_array_equal(a.corners, b.corners)
    pictures = [{id(q.texture): q.texture for q in world.scene.quads}.values() for world in (fresh, again)]
    for first, second in zip(*pictures, strict=True):
        np.testing.assert_array_equal(first.texels, second.texels)
    assert not np.array_equal(winding(SHAPE, 2), winding(SHAPE, 3))


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"length": 10.0}, "length must be between 40.0 and 3000.0 m"),
        ({"width": float("nan")}, "width must be between"),
        ({"curvature": 0.2}, "curvature must be between 0.0 and 0.05 1/m"),
        ({"wear": 1.5}, "wear must be between"),
        ({"side": "up"}, "side must be one of left, middle, right, not 'up'"),
        ({"curvature": 0.04, "bend": 150.0}, "lead back"),
    ],
)
def test_impossible_roads_are_refused(asked: dict[str, float], words: str) -> None:
    with pytest.raises(SimulationError, match=words):
        RoadSettings(**asked)  # type: ignore[arg-type]
