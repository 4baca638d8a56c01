# SPDX-License-Identifier: Apache-2.0
"""Shapes made of rectangles, cut-outs and exact ellipses: what is seen of them is what geometry says."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.simulation import Renderer, SimulationError, optical_pose
from robot_vision.simulation.scene import Ellipse, Quad, Scene, billboard, cylinder, disc, quad
from robot_vision.simulation.texture import Texture

WHITE = Texture.plain((1.0, 1.0, 1.0))
CAMERA = Camera(230.0, 230.0, 159.5, 119.5, 320, 240, height_m=1.0)


def seen(
    *items: Quad, pose: NDArray[np.float64] | None = None, camera: Camera = CAMERA
) -> NDArray[np.float64]:
    """Share of each pixel (H, W) that white things cover."""
    where = optical_pose(camera, 0.0, 0.0, 0.0) if pose is None else pose
    return Renderer(Scene(items), camera).render(where)[..., 0].astype(float)


def centroid(picture: NDArray[np.float64]) -> NDArray[np.float64]:
    """Centre of gravity (u, v) of a picture's light."""
    v, u = np.indices(picture.shape)
    return np.array([(u * picture).sum(), (v * picture).sum()]) / picture.sum()


def leaf(alpha: NDArray[np.float32], size: tuple[float, float]) -> Texture:
    """White where there is material, and a colour that must never be seen where there is none."""
    texels = np.where(alpha[..., None] > 0, 1.0, 1e4).repeat(3, axis=2).astype(np.float32)
    return Texture(texels, size, repeat=False, alpha=alpha)


def half(side: int = 64) -> NDArray[np.float32]:
    """Material in the left half."""
    alpha = np.zeros((side, side), np.float32)
    alpha[:, : side // 2] = 1.0
    return alpha


@settings(max_examples=25)
@given(yaw=st.floats(-0.2, 0.2), depth=st.floats(0.8, 60.0))
def test_the_border_of_a_cut_out_lies_where_its_alpha_is_one_half(yaw: float, depth: float) -> None:
    sheet = quad((depth, 0.3, 0.7), (0, -0.6, 0), (0, 0, 0.6), leaf(half(), (0.6, 0.6)))
    whole = quad((depth, 0.3, 0.7), (0, -0.3, 0), (0, 0, 0.6), WHITE)
    pose = optical_pose(CAMERA, 0.0, 0.0, yaw)
    cut, truth = (seen(item, pose=pose) for item in (sheet, whole))
    assert cut.sum() == pytest.approx(truth.sum(), rel=0.02, abs=1 / 4 + 0.15 * 0.6 * 230 / depth)
    np.testing.assert_allclose(centroid(cut), centroid(truth), atol=0.1)


def test_a_fine_mesh_from_afar_lets_through_its_share() -> None:
    alpha = np.zeros((256, 256), np.float32)
    alpha[::4] = alpha[:, ::4] = 1.0
    texture = Texture(np.ones((256, 256, 3), np.float32), (0.4, 0.4), alpha=alpha)
    for depth in (2.0, 5.0, 20.0):
        mesh = quad((depth, 5, -4), (0, -10, 0), (0, 0, 10), texture)
        middle = seen(mesh)[100:140, 140:180]
        assert middle.mean() == pytest.approx(7 / 16, abs=0.03)


def test_nothing_of_the_colour_beyond_the_border_is_seen() -> None:
    alpha = np.zeros((64, 64), np.float32)
    alpha[20:44, 20:44] = 1.0
    for depth in (0.5, 3.0, 40.0):
        picture = seen(quad((depth, 0.3, 0.7), (0, -0.6, 0), (0, 0, 0.6), leaf(alpha, (0.6, 0.6))))
        assert 0 < picture.max() <= 1.001


def test_only_what_has_two_sides_is_seen_from_behind() -> None:
    behind = (2.0, -0.3, 0.7), (0, 0.6, 0), (0, 0, 0.6)
    assert seen(quad(*behind, WHITE)).sum() == 0
    front = seen(quad((2.0, 0.3, 0.7), (0, -0.6, 0), (0, 0, 0.6), WHITE))
    np.testing.assert_array_equal(seen(quad(*behind, WHITE, both_sides=True)), front)
    for yaw in (0.0, np.pi):
        board = billboard((2.0, 0.0, 0.7), 0.6, 0.6, WHITE, yaw)
        np.testing.assert_allclose(seen(board), front, atol=1e-6)


@settings(max_examples=25)
@given(
    depth=st.floats(1.0, 5.0),
    side=st.floats(-0.5, 0.5),
    yaw=st.floats(-0.2, 0.2),
    radius=st.floats(0.03, 0.3),
)
def test_a_cylinder_stands_between_its_tangents(depth: float, side: float, yaw: float, radius: float) -> None:
    pose = optical_pose(CAMERA, 0.0, 0.0, yaw)
    row = seen(*cylinder((depth, side, 0), (0, 0, 2.0), radius, WHITE, facets=48), pose=pose)[120]
    towards, half_angle = np.arctan2(side, depth) - yaw, np.arcsin(radius / np.hypot(depth, side))
    left, right = (159.5 - 230 * np.tan(towards + half_angle * sign) for sign in (1, -1))
    if left < 2 or right > 317:
        return
    assert row.sum() == pytest.approx(right - left, rel=0.004, abs=0.07)
    assert (row * np.arange(320)).sum() / row.sum() == pytest.approx((left + right) / 2, abs=0.1)


def test_a_cylinder_is_lit_as_if_it_were_round() -> None:
    sides = cylinder((2.0, 0, 0), (0, 0, 2.0), 0.5, WHITE, facets=16)
    lit = tuple(
        item.lit(lambda points, normal: np.full((len(points), 3), 0.5 - 0.5 * normal[0])) for item in sides
    )
    row = seen(*lit)[120]
    inside = np.flatnonzero(row > 0)[4:-4]
    steps = np.abs(np.diff(row[inside], 2))
    assert steps.max() < 0.02  # no crease between facets
    assert row[159] == pytest.approx(1.0, abs=0.02) and row[inside[0]] < 0.8


def test_a_cylinder_has_the_ends_it_is_given() -> None:
    pose = optical_pose(CAMERA, 0.0, 0.0, 0.0, 0.0, 0.5)
    black = Texture.plain((0.0, 0.0, 0.0))
    closed = cylinder((1.5, 0, 0), (0, 0, 0.4), 0.3, black, top=WHITE)
    lid = disc((1.5, 0, 0.4), 0.3, WHITE)
    np.testing.assert_allclose(seen(*closed, pose=pose).sum(), seen(lid, pose=pose).sum(), rtol=0.02)


def ellipse_points(item: Quad, shape: Ellipse, count: int = 2000) -> NDArray[np.float64]:
    """Points (N, 3) on the border of an ellipse of a quad, metres."""
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    x, y = shape.axes[0] * np.cos(angle), shape.axes[1] * np.sin(angle)
    along = shape.centre[0] + x * np.cos(shape.angle) - y * np.sin(shape.angle)
    across = shape.centre[1] + x * np.sin(shape.angle) + y * np.cos(shape.angle)
    first, second = (edge / np.linalg.norm(edge) for edge in (item.first, item.second))
    return np.asarray(item.origin + along[:, None] * first + across[:, None] * second)


def area_and_centroid(outline: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """Area and centre of gravity of a polygon (N, 2)."""
    after = np.roll(outline, -1, axis=0)
    pieces = outline[:, 0] * after[:, 1] - after[:, 0] * outline[:, 1]
    return abs(pieces.sum()) / 2, ((outline + after) * pieces[:, None]).sum(axis=0) / (3 * pieces.sum())


@settings(max_examples=40)
@given(
    yaw=st.floats(-0.1, 0.1),
    roll=st.floats(-0.5, 0.5),
    slant=st.floats(-1.2, 1.2),
    axes=st.tuples(st.floats(0.1, 0.3), st.floats(0.1, 0.3)),
    angle=st.floats(-2, 2),
)
def test_a_hole_is_seen_exactly_where_its_border_projects(
    yaw: float, roll: float, slant: float, axes: tuple[float, float], angle: float
) -> None:
    hole = Ellipse((0.4, 0.35), axes, angle)
    across = np.array([np.sin(slant), -np.cos(slant), 0.0])
    origin = np.array([1.5, 0.0, 1.0]) - 0.4 * across - (0, 0, 0.35)
    plate = quad(origin, 0.8 * across, (0, 0, 0.7), WHITE, holes=(hole,))
    full = quad(origin, 0.8 * across, (0, 0, 0.7), WHITE)
    only = quad(origin, 0.8 * across, (0, 0, 0.7), WHITE, outline=hole)
    pose = optical_pose(CAMERA, 0.0, 0.0, yaw, roll)
    border = CAMERA.pixels((ellipse_points(plate, hole) - pose[:3, 3]) @ pose[:3, :3])
    area, centre = area_and_centroid(border)
    missing = seen(full, pose=pose) - seen(plate, pose=pose)
    np.testing.assert_allclose(centroid(missing), centre, atol=0.03)
    assert missing.sum() == pytest.approx(area, rel=0.01)
    np.testing.assert_allclose(missing, seen(only, pose=pose), atol=1e-6)


def test_a_hole_that_reaches_behind_the_camera_is_still_a_hole() -> None:
    pose = optical_pose(CAMERA, 0.0, 0.0, 0.0)
    hole = Ellipse((50.0, 50.0), (8.0, 8.0))
    floor = quad((-50, -50, 0), (100, 0, 0), (0, 100, 0), WHITE, holes=(hole,))
    lake = quad((-50, -50, 0), (100, 0, 0), (0, 100, 0), WHITE, outline=hole)
    column = seen(floor, pose=pose)[:, 160]
    edge = 119.5 + 230 / 8.0  # the floor begins 8 m ahead of the camera, which stands 1 m up in the middle
    np.testing.assert_allclose(column[120:].sum(), edge - (119.5 + 230 / 50.0), atol=0.1)
    assert column[int(edge) + 2 :].max() == 0
    assert seen(lake, pose=pose)[int(edge) + 2 :, 160].min() == 1


def test_nonsense_shapes_are_refused() -> None:
    with pytest.raises(SimulationError, match="semi-axes"):
        Ellipse((0, 0), (0.1, 0.0))
    with pytest.raises(SimulationError, match="cylinder"):
        cylinder((0, 0, 0), (0, 0, 0), 0.1, WHITE)
    with pytest.raises(SimulationError, match="alpha"):
        Texture(np.ones((4, 4, 3), np.float32), alpha=np.ones((4, 2), np.float32))
    with pytest.raises(SimulationError, match="cut-out"):
        quad((0, 0, 0), (1, 0, 0), (0, 1, 0), leaf(half(4), (1, 1)), holes=(Ellipse((0.5, 0.5), (0.1, 0.1)),))


@settings(max_examples=15)
@given(seed=st.integers(0, 1000), depth=st.floats(0.3, 6.0), slant=st.floats(-1.3, 1.3), repeat=st.booleans())
def test_pixels_taken_whole_are_those_whose_samples_agree(
    seed: int, depth: float, slant: float, repeat: bool
) -> None:
    random = np.random.default_rng(seed)
    v, u = np.indices((64, 64)) / 64
    middle = random.uniform(0.2, 0.8, (2, 6))
    blobs = np.min([np.hypot(u - a, v - b) for a, b in middle.T], axis=0)
    alpha = np.clip(0.5 + 30 * (0.15 - blobs), 0, 1).astype(np.float32)
    texture = Texture(np.ones((64, 64, 3), np.float32), (0.3, 0.3), repeat, alpha)
    across = 0.6 * np.array([np.sin(slant), -np.cos(slant), 0.0])
    item = quad((depth, 0.3, 0.7) - 0.5 * (across + (0, 0.6, 0)), across, (0, 0, 0.6), texture)
    fast = seen(item)
    texture.__dict__["clearance"] = np.zeros_like(texture.clearance)  # nothing is taken whole any more
    np.testing.assert_array_equal(fast, seen(item))
