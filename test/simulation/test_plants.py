# SPDX-License-Identifier: Apache-2.0
"""Plants: what is told of their place, size and shade is what is seen of them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from robot_vision.geometry import Camera, rotation_from_rpy
from robot_vision.simulation import Renderer, SimulationError
from robot_vision.simulation.crops import SORTS, Nursery
from robot_vision.simulation.leaves import Leaf, Picture, paint
from robot_vision.simulation.plants import (
    Specimen,
    covered_area,
    leaf,
    placed,
    shade_on_ground,
    sheet,
    specimen,
)
from robot_vision.simulation.scene import Scene, quad
from robot_vision.simulation.texture import Texture

KINDS = (*SORTS, "weed", "dead")


def square_picture() -> Picture:
    """One square leaf from 0.25 to 0.75 of its picture both ways."""
    corners = np.array([(0.25, 0.25), (0.75, 0.25), (0.75, 0.75), (0.25, 0.75)])
    only = Leaf(corners, np.array([0.5, 0.25]), np.array([0.5, 0.75]))
    return paint(np.random.default_rng(0), [only], (0.1, 0.3, 0.1), 64)


def grown(kind: str, seed: int = 0) -> Specimen:
    nursery = Nursery(np.random.default_rng(seed), kind if kind in SORTS else "cabbages")
    return {"weed": nursery.weed, "dead": nursery.dead}.get(kind, nursery.crop)()


def seen_from_above(plant: Specimen, place: tuple[float, float, float], side: float) -> NDArray[np.float64]:
    """Share of each pixel (128, 128) that a plant covers, seen from 60 m above a white floor."""
    up, size = 60.0, 128
    focal = size * up / side
    camera = Camera(focal, focal, (size - 1) / 2, (size - 1) / 2, size, size, height_m=up)
    floor = quad((-side, -side, 0), (2 * side, 0, 0), (0, 2 * side, 0), Texture.plain((1.0, 1.0, 1.0)))
    black = placed(plant, place, lambda normals: np.zeros_like(normals), len(plant.blades))
    pose = np.eye(4)
    pose[:3, :3] = np.diag([1.0, -1.0, -1.0])  # columns along x, rows against y, looking down
    pose[2, 3] = up
    picture = Renderer(Scene((floor, *black)), camera).render(pose)
    return np.asarray(1 - picture.mean(axis=2), np.float64)


@pytest.mark.parametrize("kind", KINDS)
def test_the_area_of_a_plant_is_what_a_camera_sees_of_it_from_above(kind: str) -> None:
    plant = grown(kind)
    side = 2.4 * plant.radius
    seen = seen_from_above(plant, (0.0, 0.0, 0.7), side)
    assert seen.sum() * (side / 128) ** 2 == pytest.approx(plant.area, rel=0.03)


@pytest.mark.parametrize("kind", KINDS)
def test_the_circle_about_its_stem_holds_a_plant_and_is_no_larger_than_it_must(kind: str) -> None:
    plant = grown(kind)
    side = 2.4 * plant.radius
    seen = seen_from_above(plant, (0.0, 0.0, -1.1), side)
    rows, columns = np.nonzero(seen > 0.5)
    reach = np.hypot(columns - 63.5, rows - 63.5).max() * side / 128
    pixel = side / 128
    assert plant.radius - 3 * pixel < reach < plant.radius + pixel


def test_a_plant_is_drawn_where_it_is_placed_and_turned_counter_clockwise() -> None:
    flag = specimen([leaf(square_picture(), (0, 0, 0.01), 0.0, 0.0, (0.1, 0.2))], np.eye(3))
    seen = seen_from_above(flag, (0.05, 0.1, np.pi / 2), 0.6)
    rows, columns = np.indices(seen.shape)
    x, y = ((columns * seen).sum() / seen.sum() - 63.5, 63.5 - (rows * seen).sum() / seen.sum())
    assert np.array([x, y]) * 0.6 / 128 == pytest.approx([0.05, 0.2], abs=5e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_no_leaf_is_below_the_ground_and_the_height_is_that_of_the_highest(kind: str) -> None:
    plant = grown(kind, seed=3)
    corners = np.concatenate([item.points(line) for item in plant.blades for line in item.picture.outlines])
    assert corners[:, 2].min() > 0
    assert corners[:, 2].max() == pytest.approx(plant.height)


def test_a_shadow_falls_as_far_as_the_leaf_is_high_and_the_sun_is_low() -> None:
    high = specimen([sheet(square_picture(), (0.0, 0.0, 0.3), 0.0, 0.0, 0.2, 1.0)], np.eye(3))
    (shadow,) = shade_on_ground(high, (2.0, 1.0, 0.4), np.array([0.5, -1.0]))
    assert shadow.mean(axis=0) == pytest.approx([2.0 + 0.15, 1.0 - 0.3], abs=1e-6)
    assert covered_area([shadow]) == pytest.approx(0.1**2, rel=0.02)


def test_a_leaning_plant_leans_its_leaves_about_its_foot() -> None:
    upright = [sheet(square_picture(), (0.0, 0.0, 0.3), 0.0, 0.0, 0.2, 1.0)]
    leaning = specimen(upright, rotation_from_rpy(0.0, 0.2, 0.0))
    middle = leaning.hulls[0].mean(axis=0)
    assert middle == pytest.approx([0.3 * np.sin(0.2), 0.0, 0.3 * np.cos(0.2)], abs=1e-6)
    assert leaning.area == pytest.approx(0.1**2 * np.cos(0.2), rel=0.01)


def test_what_leaves_cover_together_is_counted_once() -> None:
    unit = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    assert covered_area([unit, unit + (0.5, 0.0)]) == pytest.approx(1.5, rel=0.01)
    angles = np.linspace(0, 2 * np.pi, 100)
    assert covered_area([np.column_stack([np.cos(angles), np.sin(angles)])]) == pytest.approx(np.pi, rel=0.01)


@settings(max_examples=30)
@given(st.floats(0.01, 3.0), st.floats(-50, 50), st.floats(-50, 50))
def test_area_grows_with_the_square_of_the_size_wherever_it_lies(scale: float, x: float, y: float) -> None:
    triangle = np.array([(0.0, 0.0), (1.0, 0.2), (0.3, 0.9)])
    area = 0.5 * abs(1.0 * 0.9 - 0.2 * 0.3)
    assert covered_area([scale * triangle + (x, y)]) == pytest.approx(area * scale**2, rel=0.015)


def test_crops_of_one_sort_are_of_uneven_size_and_the_dead_are_brown() -> None:
    nursery = Nursery(np.random.default_rng(1), "cabbages")
    radii = np.array([nursery.crop().radius for _ in range(40)])
    assert radii.std() / radii.mean() > 0.1
    assert nursery.crop(0.5).radius < 0.75 * radii.mean()

    def greenness(plant: Specimen) -> float:
        texture = plant.textures[0]
        assert texture.alpha is not None
        b, g, r = texture.texels[texture.alpha > 0.5].mean(axis=0)
        return float((2 * g - r - b) / (r + g + b))

    assert greenness(nursery.crop()) > 0.2 > 0.1 > greenness(nursery.dead())
    assert min(greenness(nursery.weed()) for _ in range(20)) > 0.2


def test_a_plant_without_leaves_is_refused() -> None:
    with pytest.raises(SimulationError, match="at least one leaf"):
        specimen([], np.eye(3))
