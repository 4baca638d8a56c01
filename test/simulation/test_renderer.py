# SPDX-License-Identifier: Apache-2.0
"""Rendered pictures against geometry: where edges lie, what hides what, what a texture shows from afar."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.simulation import Renderer, SimulationError, optical_pose
from robot_vision.simulation.renderer import sample_places
from robot_vision.simulation.scene import Quad, Scene, box, quad
from robot_vision.simulation.texture import Texture

WHITE = Texture.plain((1.0, 1.0, 1.0))
CAMERA = Camera(230.0, 230.0, 159.5, 119.5, 320, 240, height_m=1.0)
VGA = Camera(460.0, 460.0, 319.5, 239.5, 640, 480, height_m=1.0)
ANGLES = st.floats(-0.3, 0.3)


def in_world(
    pixels_of: Camera, pose: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Pixels (N, 2) of world points (N, 3)."""
    return np.asarray(pixels_of.pixels((points - pose[:3, 3]) @ pose[:3, :3]))


def edge_columns(
    picture: NDArray[np.float32], rows: NDArray[np.int64], guess: NDArray[np.float64], reach: int = 6
) -> NDArray[np.float64]:
    """Column (N,) of a white-to-black (left to right) edge per row: the light in a window is its place."""
    columns = np.empty(len(rows))
    for number, (row, column) in enumerate(zip(rows, guess, strict=True)):
        start = round(column) - reach
        columns[number] = start - 0.5 + picture[row, start : start + 2 * reach + 1, 0].sum()
    return columns


def upright_edge(
    yaw: float, roll: float, pitch: float, item: Quad, ends: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Columns where an edge of `item` is seen, and where the line through `ends` (2, 3) projects."""
    pose = optical_pose(CAMERA, 0.0, 0.0, yaw, roll, pitch)
    picture = Renderer(Scene((item,)), CAMERA).render(pose)
    (u0, v0), (u1, v1) = in_world(CAMERA, pose, ends)
    rows = np.arange(max(int(min(v0, v1)) + 12, 0), min(int(max(v0, v1)) - 12, CAMERA.height - 1))
    expected = u0 + (u1 - u0) * (rows - v0) / (v1 - v0)
    inside = (expected > 12) & (expected < CAMERA.width - 12)
    rows, expected = rows[inside], expected[inside]
    assert len(rows) > 50
    return edge_columns(picture, rows, expected), expected


@settings(max_examples=40)
@given(yaw=ANGLES, roll=st.floats(-0.1, 0.1), pitch=st.floats(-0.1, 0.1))
def test_the_edge_of_a_plane_lies_where_it_projects(yaw: float, roll: float, pitch: float) -> None:
    wall = quad((2.0, 1.0, 0.2), (0.5, -1.0, 0.0), (0, 0, 1.6), WHITE)
    edge = np.array([[2.5, 0.0, 0.2], [2.5, 0.0, 1.8]])
    seen, expected = upright_edge(yaw, roll, pitch, wall, edge)
    assert np.abs(seen - expected).max() < 0.1
    assert abs((seen - expected).mean()) <= 1 / 32 + 1e-3  # an upright edge meets all rows alike


@settings(max_examples=40)
@given(yaw=ANGLES, roll=st.floats(-0.1, 0.1), pitch=st.floats(-0.1, 0.1), depth=st.floats(1.5, 6.0))
def test_an_edge_painted_on_a_plane_lies_where_it_projects(
    yaw: float, roll: float, pitch: float, depth: float
) -> None:
    halves = np.zeros((128, 128, 3), np.float32)
    halves[:, :64] = 1.0
    size = depth
    wall = quad(
        (depth, size / 2, 1 - size / 2),
        (0.3, -size, 0.0),
        (0, 0, size),
        Texture(halves, (float(np.hypot(0.3, size)), size), repeat=False),
    )
    edge = np.array([[depth + 0.15, 0.0, 1 - size / 2], [depth + 0.15, 0.0, 1 + size / 2]])
    seen, expected = upright_edge(yaw, roll, pitch, wall, edge)
    assert np.abs(seen - expected).max() < 0.1


@settings(max_examples=40)
@given(
    yaw=st.floats(-0.2, 0.2),
    roll=st.floats(-0.1, 0.1),
    pitch=st.floats(0.0, 0.2),
    offset=st.floats(-0.3, 0.3),
)
def test_the_vanishing_point_of_rendered_edges_is_true(
    yaw: float, roll: float, pitch: float, offset: float
) -> None:
    pose = optical_pose(VGA, 0.0, offset, yaw, roll, pitch)
    lines = []
    for border in (-0.7, 0.7):
        floor = quad((-1, border, 0), (40, 0, 0), (0, 8, 0), WHITE)  # its right edge is dark to the right
        picture = Renderer(Scene((floor,)), VGA).render(pose)
        near, far = in_world(VGA, pose, np.array([[2.0, border, 0.0], [20.0, border, 0.0]]))
        rows = np.arange(int(np.ceil(far[1])), min(int(near[1]), VGA.height - 1) + 1)
        guess = near[0] + (far[0] - near[0]) * (rows - near[1]) / (far[1] - near[1])
        inside = (guess > 60) & (guess < VGA.width - 60)
        rows = rows[inside]
        slope, start = np.polyfit(rows, edge_columns(picture, rows, guess[inside], 50), 1)
        lines.append((1.0, -slope, -start))
    meeting = np.cross(*np.array(lines))
    direction = VGA.rays((meeting[:2] / meeting[2])[None])[0]
    truth = pose[:3, :3].T @ np.array([1.0, 0.0, 0.0])
    assert np.degrees(np.arccos(min(direction @ truth, 1.0))) < 0.02


@pytest.mark.parametrize("count", [4, 16])
def test_samples_share_no_row_and_no_column(count: int) -> None:
    places = sample_places(count)
    ideal = (np.arange(count) + 0.5) / count - 0.5
    for axis in range(2):
        np.testing.assert_allclose(np.sort(places[:, axis]), ideal)


# No pose has angles of 1e-309 rad, of which the reciprocal is no number any more.
LEANS = st.floats(-0.1, 0.1, allow_subnormal=False)


@settings(max_examples=25)
@given(yaw=st.floats(-0.15, 0.15, allow_subnormal=False), roll=LEANS, pitch=LEANS)
def test_the_corner_of_a_box_lands_on_its_pixel(yaw: float, roll: float, pitch: float) -> None:
    pose = optical_pose(CAMERA, 0.0, 0.0, yaw, roll, pitch)
    faces = box((2.5, -0.1, 0.2), (3.5, 0.7, 1.3), WHITE, without="-y +y +z -z")
    picture = Renderer(Scene(faces), CAMERA).render(pose)
    ends = np.array([(2.5, -0.1, 0.2), (2.5, -0.1, 1.3), (2.5, 0.7, 0.2)])
    corner, below, beside = in_world(CAMERA, pose, ends)
    rows = np.arange(int(below[1]) + 12, int(corner[1]) - 12)
    columns = np.arange(int(beside[0]) + 12, int(corner[0]) - 12)
    right = corner[0] + (rows - corner[1]) * (below - corner)[0] / (below - corner)[1]
    bottom = corner[1] + (columns - corner[0]) * (beside - corner)[1] / (beside - corner)[0]
    assert min(len(rows), len(columns)) > 30
    a, b = np.polyfit(rows, edge_columns(picture, rows, right), 1)  # u = a v + b
    c, d = np.polyfit(columns, edge_columns(picture.transpose(1, 0, 2), columns, bottom), 1)  # v = c u + d
    u = (a * d + b) / (1 - a * c)
    np.testing.assert_allclose((u, c * u + d), corner, atol=0.1)


@settings(max_examples=25)
@given(yaw=ANGLES, roll=st.floats(-0.1, 0.1), place=st.floats(-0.4, 0.4))
def test_a_box_covers_the_hull_of_its_corners(yaw: float, roll: float, place: float) -> None:
    from scipy.spatial import ConvexHull

    pose = optical_pose(CAMERA, 0.0, 0.0, yaw, roll, 0.1)
    faces = box((3.0, place, 0.3), (3.6, place + 0.7, 1.1), WHITE)
    picture = Renderer(Scene(faces), CAMERA).render(pose)[..., 0]
    corners = in_world(CAMERA, pose, np.concatenate([face.corners for face in faces]))
    assume(corners.min() > 1 and corners[:, 0].max() < 318 and corners[:, 1].max() < 238)
    assert picture.sum() == pytest.approx(ConvexHull(corners).volume, rel=3e-3)


def nearest_quads(
    items: list[Quad], origin: NDArray[np.float64], rays: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Which rectangle each ray (N, 3) of depth 1 meets first, -1 for none: the plain geometry of it."""
    nearest, found = np.full(len(rays), np.inf), np.full(len(rays), -1)
    for number, item in enumerate(items):
        normal = np.cross(item.first, item.second)
        facing = rays @ normal
        with np.errstate(divide="ignore", invalid="ignore"):
            depth = (item.origin - origin) @ normal / facing
            points = origin + depth[:, None] * rays - item.origin
        s = points @ item.first / (item.first @ item.first)
        t = points @ item.second / (item.second @ item.second)
        met = (facing < 0) & (depth > 0.02) & (depth < nearest) & (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
        nearest[met], found[met] = depth[met], number
    return found


@settings(max_examples=25)
@given(seed=st.integers(0, 2**31), yaw=ANGLES, pitch=ANGLES)
def test_the_nearest_surface_is_seen_also_when_it_passes_behind_the_camera(
    seed: int, yaw: float, pitch: float
) -> None:
    random = np.random.default_rng(seed)
    items = [quad((-5, -3, 0), (20, 0, 0), (0, 6, 0), Texture.plain((0.1, 0.2, 0.3)))]
    for _ in range(9):
        first, second = random.normal(size=(2, 3))
        second -= second @ first / (first @ first) * first
        blue, green, red = random.uniform(0.2, 1.0, 3).tolist()
        items.append(
            quad(random.uniform((-1, -2, 0), (6, 2, 2)), first, second, Texture.plain((blue, green, red)))
        )
    small = Camera(60.0, 60.0, 39.5, 29.5, 80, 60, height_m=1.0)
    pose = optical_pose(small, 0.0, 0.0, yaw, 0.0, pitch)
    picture = Renderer(Scene(tuple(items), (9.0, 9.0, 9.0)), small).render(pose)
    pixels = random.integers((0, 0), (80, 60), (200, 2))
    hits = np.stack(
        [
            nearest_quads(items, pose[:3, 3], (rays / rays[:, 2:]) @ pose[:3, :3].T)
            for shift in ((0, 0), (1e-4, 0), (-1e-4, 0), (0, 1e-4), (0, -1e-4))
            for rays in [small.rays((pixels[:, None] + sample_places() + shift).reshape(-1, 2))]
        ]
    ).reshape(5, len(pixels), -1)
    clear = (hits == hits[0]).all(axis=(0, 2))  # no sample lies on an edge, where rounding decides
    assert clear.mean() > 0.5
    pixels, hits = pixels[clear], hits[0, clear]
    colours = np.array([*(item.texture.texels[0, 0] for item in items), (9.0, 9.0, 9.0)])
    expected = colours[hits].mean(axis=1)
    np.testing.assert_allclose(picture[pixels[:, 1], pixels[:, 0]], expected, atol=1e-4)


def test_walls_that_meet_leave_no_gap() -> None:
    left = quad((0, 1, 0), (10, 0, 0), (0, 0, 2), WHITE)
    right = quad((10, -1, 0), (-10, 0, 0), (0, 0, 2), WHITE)
    end = quad((10, 1, 0), (0, -2, 0), (0, 0, 2), WHITE)
    floor = quad((0, -1, 0), (10, 0, 0), (0, 2, 0), WHITE)
    ceiling = quad((0, 1, 2), (10, 0, 0), (0, -2, 0), WHITE)
    scene = Scene((left, right, end, floor, ceiling))
    for yaw in (0.0, 0.1):
        picture = Renderer(scene, CAMERA).render(optical_pose(CAMERA, 1.0, 0.0, yaw))
        np.testing.assert_allclose(picture, 1.0, atol=1e-5)


def test_a_fine_texture_seen_from_afar_is_its_mean_without_shimmer() -> None:
    checks = np.indices((256, 256)).sum(axis=0) % 2
    texture = Texture(np.repeat(checks[..., None], 3, axis=2).astype(np.float32), (0.5, 0.5))
    floor = quad((1, -50, 0), (200, 0, 0), (0, 100, 0), texture)
    renderer = Renderer(Scene((floor,)), CAMERA)
    pictures = [renderer.render(optical_pose(CAMERA, x, 0.0, 0.0)) for x in (0.0, 0.0137)]
    far = [picture[125:150, :, 0] for picture in pictures]  # 9 to 40 m: texels of 2 mm are far below a pixel
    for rows in far:
        np.testing.assert_allclose(rows, 0.5, atol=0.02)
    assert np.abs(far[0] - far[1]).max() < 0.02


def test_tiles_go_on_and_pieces_of_a_wall_show_one_pattern() -> None:
    random = np.random.default_rng(3)
    texture = Texture(random.uniform(0, 1, (64, 64, 3)).astype(np.float32), (1.0, 1.0))
    whole = quad((3, 2, 0), (0, -4, 0), (0, 0, 2), texture)
    pieces = (
        quad((3, 2, 0), (0, -1.3, 0), (0, 0, 2), texture),
        quad((3, 0.7, 0), (0, -2.7, 0), (0, 0, 2), texture, texture_origin=(1.3, 0.0)),
    )
    pose = optical_pose(CAMERA, 0.0, 0.0, 0.1)
    one, two = (Renderer(Scene(items), CAMERA).render(pose) for items in ((whole,), pieces))
    seam = in_world(CAMERA, pose, np.array([[3.0, 0.7, 1.0]]))[0, 0]
    away = np.abs(np.arange(CAMERA.width) - seam) > 1.5
    np.testing.assert_allclose(one[:, away], two[:, away], atol=1e-4)
    np.testing.assert_allclose(one, two, atol=0.1)


def test_light_multiplies_the_texture_and_is_linear_between_its_nodes() -> None:
    wall = quad((2, 1, 0), (0, -2, 0), (0, 0, 2), Texture.plain((0.5, 0.5, 0.5)))
    lit = wall.lit(lambda points, normal: np.repeat(points[:, 2:] - normal[0], 3, axis=1))
    pose = optical_pose(CAMERA, 0.0, 0.0, 0.0)
    picture = Renderer(Scene((lit,)), CAMERA).render(pose)
    for z in (0.4, 1.0, 1.7):
        u, v = in_world(CAMERA, pose, np.array([[2.0, 0.0, z]]))[0]
        column = picture[:, round(u), 1]
        assert np.interp(v, np.arange(CAMERA.height), column) == pytest.approx(0.5 * (z + 1.0), abs=2e-3)


def test_a_lamp_mirrors_in_a_glossy_floor_where_its_image_is() -> None:
    floor = quad((0, -5, 0), (20, 0, 0), (0, 10, 0), Texture.plain((0.0, 0.0, 0.0)), gloss=0.04)
    lamp = quad((5.8, 0.9, 2.5), (0.4, 0, 0), (0, -0.4, 0), WHITE, shines=True)
    pose = optical_pose(CAMERA, 0.0, 0.0, 0.0, 0.0, 0.2)
    picture = Renderer(Scene((floor, lamp)), CAMERA, roughness=0.005).render(pose)[..., 0].astype(float)
    image = in_world(CAMERA, pose, np.array([[6.0, 0.7, -2.5]]))[0]  # the lamp's middle below the floor
    below = np.arange(CAMERA.height) > image[1] - 30
    weights = picture * below[:, None]
    v, u = (np.average(axis, weights=weights) for axis in np.indices(picture.shape))
    assert weights.sum() > 1
    assert np.hypot(u - image[0], v - image[1]) < 1.0


def test_a_camera_with_distortion_is_refused() -> None:
    bent = replace(CAMERA, distortion=(0.1, 0.0, 0.0, 0.0, 0.0))
    with pytest.raises(SimulationError, match="distortion"):
        Renderer(Scene((quad((1, 0, 0), (0, 1, 0), (0, 0, 1), WHITE),)), bent)


def test_nonsense_shapes_are_refused() -> None:
    with pytest.raises(SimulationError, match="rectangle"):
        quad((0, 0, 0), (1, 0, 0), (1, 1, 0), WHITE)
    with pytest.raises(SimulationError, match="powers of two"):
        Texture(np.ones((3, 4, 3), np.float32))
    with pytest.raises(SimulationError, match="no surface"):
        Scene(())
