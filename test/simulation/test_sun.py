# SPDX-License-Identifier: Apache-2.0
"""Daylight against geometry: shadows lie where the sun puts them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from robot_vision.geometry import Camera
from robot_vision.simulation import Renderer, SimulationError, optical_pose
from robot_vision.simulation.scene import Ellipse, Quad, Scene, box, cylinder, quad
from robot_vision.simulation.sun import Sun, sunlit
from robot_vision.simulation.texture import Texture

WHITE = Texture.plain((1.0, 1.0, 1.0))
GROUND = quad((-3, -3, 0), (6, 0, 0), (0, 6, 0), WHITE)
SPACING = 0.05
AZIMUTHS = st.floats(-np.pi, np.pi)


def sun_at(azimuth: float, elevation: float) -> Sun:
    """A sun under a black sky: what is dark is its shadow."""
    return Sun(azimuth, elevation, (1.0, 1.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def lit_share(ground: Quad, sun: Sun, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Light (N,) at points (N, 2) of the ground, read from its map as the renderer reads it; 1 in the sun."""
    assert ground.light is not None
    rows, columns = ground.light.shape[:2]
    x = (points[:, 0] + 3) / 6 * (columns - 1)
    y = (points[:, 1] + 3) / 6 * (rows - 1)
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    a, b = x - i, y - j
    light = ground.light[..., 0].astype(float) / np.sin(sun.elevation)
    upper = (1 - a) * light[j, i] + a * light[j, i + 1]
    lower = (1 - a) * light[j + 1, i] + a * light[j + 1, i + 1]
    return np.asarray((1 - b) * upper + b * lower)


def half_lit(
    ground: Quad, sun: Sun, inside: NDArray[np.float64], out: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Metres (N,) from points (N, 2) along unit vectors (N, 2) to where the light crosses one half."""
    reach = np.linspace(-0.15, 0.15, 301)
    light = np.stack([lit_share(ground, sun, inside + step * out) for step in reach])
    assert (light[0] < 0.5).all() and (light[-1] > 0.5).all()
    last_dark = len(reach) - 1 - np.argmax(light[::-1] < 0.5, axis=0)
    return np.asarray(reach[last_dark])


@settings(max_examples=20)
@given(azimuth=AZIMUTHS, elevation=st.floats(0.6, 1.3), height=st.floats(0.5, 1.0))
def test_the_shadow_of_a_box_is_the_hull_of_its_projected_corners(
    azimuth: float, elevation: float, height: float
) -> None:
    sun = sun_at(azimuth, elevation)
    solid = box((-0.4, -0.3, 0.0), (0.4, 0.3, height), WHITE, without="-z")
    ground = sunlit((GROUND, *solid), sun, SPACING)[0]
    shadow = sun.shadow(np.concatenate([face.corners for face in solid]))
    hull = ConvexHull(shadow)
    for equation in hull.equations:
        on_edge = np.abs(shadow @ equation[:2] + equation[2]) < 1e-9
        ends = shadow[on_edge]
        along = np.array([-equation[1], equation[0]])
        places = ends @ along
        if np.ptp(places) < 0.45:
            continue
        steps = np.linspace(places.min() + 0.2, places.max() - 0.2, 9)  # 0.2 m from the corners
        middle = ends[0] - (ends[0] @ along) * along
        points = middle + steps[:, None] * along
        off = half_lit(ground, sun, points, np.tile(equation[:2], (len(points), 1)))
        assert np.abs(off).max() < 0.02


@settings(max_examples=20)
@given(
    azimuth=AZIMUTHS, elevation=st.floats(0.6, 1.2), radius=st.floats(0.1, 0.3)
)  # its tip is on the ground
def test_the_shadow_of_a_pillar_has_its_width_and_direction(
    azimuth: float, elevation: float, radius: float
) -> None:
    sun = sun_at(azimuth, elevation)
    pillar = cylinder((0, 0, 0), (0, 0, 1.5), radius, WHITE, top=WHITE)
    ground = sunlit((GROUND, *pillar), sun, SPACING)[0]
    length = 1.5 / np.tan(elevation)
    away = -np.array([np.cos(azimuth), np.sin(azimuth)])
    left = np.array([-away[1], away[0]])
    steps = np.linspace(radius + 0.1, max(length - radius, radius + 0.15), 9)[:, None]
    steps = steps[steps[:, 0] < length - 0.02]
    for side in (left, -left):
        off = half_lit(ground, sun, steps * away + radius * side, np.tile(side, (len(steps), 1)))
        assert np.abs(off).max() < 0.03
    tip = half_lit(ground, sun, (length + radius) * away[None], away[None])
    assert abs(tip[0]) < 0.03


def test_the_border_of_a_shadow_is_seen_where_it_projects() -> None:
    sun = sun_at(1.2, 0.7)
    wall = quad((0.0, -2.0, 0), (0, 4.0, 0), (0, 0, 0.5), WHITE)
    ground = sunlit((GROUND, wall), sun, SPACING)[0]
    camera = Camera(230.0, 230.0, 159.5, 119.5, 320, 240, height_m=1.0, pitch=0.4)
    pose = optical_pose(camera, -3.0, 0.0, 0.0)
    picture = Renderer(Scene((ground,)), camera).render(pose)[..., 0] / np.sin(sun.elevation)
    border = sun.shadow([[0, -0.5, 0.5], [0, 0.5, 0.5]])
    points = np.column_stack([border[0, 0] * np.ones(9), np.linspace(-0.5, 0.5, 9), np.zeros(9)])
    for u, v in camera.pixels((points - pose[:3, 3]) @ pose[:3, :3]):
        column = picture[:, round(u)]
        rows = np.arange(int(v) - 4, int(v) + 6)
        crossing = np.interp(0.5, column[rows], rows)  # light nearer by, dark beyond
        assert abs(crossing - v) < 0.3


def test_light_falls_through_holes_and_past_the_border_of_cut_outs() -> None:
    sun = sun_at(0.0, np.pi / 2)
    alpha = np.zeros((64, 64), np.float32)
    alpha[:, :32] = 1.0
    leaf = Texture(np.ones((64, 64, 3), np.float32), (1.0, 1.0), repeat=False, alpha=alpha)
    sheets = (
        quad((-2.0, -0.5, 0.5), (1, 0, 0), (0, 1, 0), leaf),
        quad((1.0, -0.5, 0.5), (1, 0, 0), (0, 1, 0), WHITE, holes=(Ellipse((0.5, 0.5), (0.3, 0.3)),)),
    )
    ground = sunlit((GROUND, *sheets), sun, SPACING)[0]
    points = np.array([(-1.75, 0.0), (-1.25, 0.0), (1.5, 0.0), (1.1, 0.0), (0.0, 0.0)])
    np.testing.assert_allclose(lit_share(ground, sun, points), [0, 1, 1, 0, 1], atol=1e-3)
    off = half_lit(ground, sun, np.array([(-1.5, 0.2)]), np.array([(1.0, 0.0)]))
    assert abs(off[0]) < 0.02


def test_a_face_away_from_the_sun_has_only_the_sky() -> None:
    sun = Sun(azimuth=0.0, elevation=0.7)
    ground, *faces = sunlit((GROUND, *box((-1, -1, 0), (1, 1, 1), WHITE, without="-z")), sun)
    for face in faces:
        assert face.light is not None
        expected = max(float(face.normal @ sun.direction), 0) * np.array(sun.colour)
        expected = expected + sun.sky_light(face.normal)
        np.testing.assert_allclose(face.light[-1, face.light.shape[1] // 2], expected, atol=1e-5)


def test_the_sky_is_darker_beside_a_wall_and_whole_in_the_open() -> None:
    sun = Sun(azimuth=0.0, elevation=1.2, colour=(0, 0, 0))
    wall = box((-0.1, -3, 0), (0.1, 3, 2.0), WHITE, without="-z")
    light = sunlit((GROUND, *wall), sun, 0.1, openness=64)[0].light
    assert light is not None
    middle = light.shape[0] // 2
    beside, open_field = light[middle, light.shape[1] // 2 + 3, 0], light[middle, -1, 0]
    assert beside == pytest.approx(0.5 * sun.sky[0], abs=0.12 * sun.sky[0])
    assert open_field > 0.85 * sun.sky[0]


def test_what_shines_is_left_as_it_is_and_nonsense_is_refused() -> None:
    lamp = quad((0, 0, 2), (1, 0, 0), (0, -1, 0), WHITE, shines=True)
    assert sunlit((lamp,), Sun())[0] is lamp
    with pytest.raises(SimulationError, match="elevation"):
        Sun(elevation=-0.1)
    with pytest.raises(SimulationError, match="spacing"):
        sunlit((GROUND,), Sun(), 0.0)
