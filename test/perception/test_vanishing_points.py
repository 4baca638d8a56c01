# SPDX-License-Identifier: Apache-2.0
"""Directions are recovered from lines that lead to them, with an honest sigma, and none is invented."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from line_scenes import (
    CROOKED,
    LineScene,
    clutter,
    lines_to,
    nearest,
    random_axes,
    random_camera,
    scene,
    upright_axes,
)
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.geometry.sphere import angle_between, local_coordinates
from robot_vision.perception import (
    LineDetector,
    LineSegments,
    Role,
    VanishingPointEstimator,
    VanishingPoints,
)
from robot_vision.perception.vanishing.bundle import END_SIGMA

CAMERA = Camera(500.0, 500.0, 319.5, 239.5, 640, 480)
ESTIMATOR = VanishingPointEstimator()
seeds = st.integers(0, 2**32 - 1)


def estimate(found: LineScene) -> VanishingPoints:
    return ESTIMATOR.estimate(found.lines, found.camera)


def squared_error(points: VanishingPoints, k: int, direction: NDArray[np.float64]) -> float:
    """Squared error over the covariance claimed: 2 in the mean when honest."""
    offset = local_coordinates(points.directions[k], direction)
    return float(offset @ np.linalg.solve(points.covariance[k], offset))


@settings(max_examples=80, derandomize=True)
@given(seeds, st.integers(1, 3), st.floats(0.0, 0.6))
def test_directions_are_recovered_in_any_camera_and_any_attitude(seed, many, share):
    random = np.random.default_rng(seed)
    truth = scene(random, random_camera(random), random_axes(random)[:many], [30] * many, share)
    points = estimate(truth)
    for k, direction in enumerate(truth.directions):
        found, away = nearest(points, direction)
        assert away < 4.5 * points.sigma[found]
        assert away < math.radians(2.0)
        assert np.mean(points.labels[truth.labels == k] == found) > 0.75


def test_most_of_the_clutter_is_told_from_the_lines():
    called = []
    for seed in range(20):
        random = np.random.default_rng(seed)
        truth = scene(random, random_camera(random), random_axes(random), [30] * 3, 0.5)
        called.append(np.mean(estimate(truth).labels[truth.labels < 0] >= 0))
    # A line of any direction falls within two sigma (about 1 degree) of one of three directions often enough.
    assert np.mean(called) < 0.15


@settings(max_examples=80, derandomize=True)
@given(seeds, st.integers(1, 3), st.floats(0.0, 0.6))
def test_what_is_answered_fits_together(seed, many, share):
    random = np.random.default_rng(seed)
    truth = scene(random, random_camera(random), upright_axes(random)[:many], [25] * many, share)
    points = estimate(truth)
    assert points.directions.shape == (len(points), 3)
    assert points.covariance.shape == (len(points), 2, 2)
    assert points.labels.shape == (len(truth.lines),)
    assert points.labels.min() >= -1 and points.labels.max() < len(points)
    np.testing.assert_allclose(np.linalg.norm(points.directions, axis=1), 1.0, atol=1e-9)
    assert (points.directions[:, 2] >= 0.0).all()
    assert (np.linalg.eigvalsh(points.covariance) > 0.0).all()
    assert (points.weight > 0.0).all()
    assert (points.roles == Role.PRIMARY).sum() <= 1 and (points.roles == Role.VERTICAL).sum() <= 1
    if Role.PRIMARY in points.roles:
        assert points.roles[0] == Role.PRIMARY
    assert (points.ids == 0).all()
    assert points.camera == truth.camera and points.focal_sigma == 0.0
    pixels = points.pixels
    near = np.isfinite(pixels).all(axis=1)
    rays = truth.camera.rays(pixels[near])
    assert angle_between(rays, points.directions[near]).max(initial=0.0) < 1e-6


@pytest.mark.parametrize("noise", [0.3, END_SIGMA / math.sqrt(2.0)])
@pytest.mark.parametrize("axes", [random_axes, upright_axes])
def test_the_covariance_is_honest(axes, noise):
    # Lines as crooked as the estimator thinks real edges are; ends of 0.3 px are a little better than it thinks.
    errors = []
    for seed in range(60):
        random = np.random.default_rng(seed)
        truth = scene(random, random_camera(random), axes(random), [30] * 3, 0.3, noise, CROOKED)
        points = estimate(truth)
        errors += [squared_error(points, nearest(points, d)[0], d) for d in truth.directions]
    # Two degrees of freedom: 2 in the mean.
    assert 1.0 < np.mean(errors) < 5.0
    # The median of that distribution is 1.39.
    assert 0.7 < np.median(errors) < 2.2


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 1, 0), (1, 1, 0), (1, -2, 0)])
def test_a_vanishing_point_at_infinity(direction):
    direction = np.array(direction) / np.linalg.norm(direction)
    for seed in range(5):
        random = np.random.default_rng(seed)
        truth = scene(random, CAMERA, direction[None], [40], 0.3)
        points = estimate(truth)
        found, away = nearest(points, direction)
        assert away < 4 * points.sigma[found]
        assert np.abs(points.pixels[found] - 240).max() > 5000


def test_fronto_parallel_scene_has_two_at_infinity_and_one_ahead():
    points = estimate(scene(np.random.default_rng(1), CAMERA, np.eye(3), [30] * 3, 0.2))
    assert len(points) == 3
    for axis in np.eye(3):
        assert nearest(points, axis)[1] < math.radians(0.3)
    np.testing.assert_allclose(points.pixels[0], [319.5, 239.5], atol=3.0)


def test_exactly_at_infinity_the_pixel_says_so():
    points = VanishingPoints.none(CAMERA)
    points = replace(points, directions=np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [-0.6, 0.8, 0.0]]))
    np.testing.assert_array_equal(points.pixels, [[np.inf, 239.5], [319.5, -np.inf], [-np.inf, np.inf]])


@settings(max_examples=40, derandomize=True)
@given(seeds, st.floats(0.4, 1.4), st.booleans())
def test_directions_not_at_right_angles_are_left_so(seed, apart, with_third):
    random = np.random.default_rng(seed)
    axes = random_axes(random)
    second = math.cos(apart) * axes[0] + math.sin(apart) * axes[1]
    directions = np.array([axes[0], second, axes[2]])[: 2 + with_third]
    truth = scene(random, random_camera(random), directions, [40] * len(directions), 0.15)
    points = estimate(truth)
    found = [nearest(points, direction) for direction in truth.directions]
    assert len({k for k, _ in found}) == len(directions)
    for _, away in found:
        assert away < math.radians(1.5)
    between = angle_between(points.directions[found[0][0]], points.directions[found[1][0]])
    assert abs(between - angle_between(axes[0], second)) < math.radians(1.5)


def extra_points(apart: float | None, share: float, scenes: int = 60) -> float:
    """Share of scenes with one direction (or two, an angle apart) that get more points than that."""
    more = 0
    for seed in range(scenes):
        random = np.random.default_rng(seed)
        axes = random_axes(random)
        directions = axes[:1]
        if apart is not None:
            directions = np.array([axes[0], math.cos(apart) * axes[0] + math.sin(apart) * axes[1]])
        truth = scene(random, random_camera(random), directions, [35] * len(directions), share)
        more += len(estimate(truth)) > len(directions)
    return more / scenes


@pytest.mark.parametrize("share", [0.0, 0.3, 0.6])
def test_one_direction_gives_one_vanishing_point(share):
    assert extra_points(None, share) < 0.1


def test_two_directions_60_degrees_apart_give_two_vanishing_points():
    assert extra_points(math.radians(60.0), 0.2) < 0.1


def test_two_orthogonal_directions_name_the_third():
    random = np.random.default_rng(4)
    axes = upright_axes(random)
    points = estimate(scene(random, CAMERA, axes[:2], [30, 30], 0.2))
    assert len(points) == 3
    third, away = nearest(points, axes[2])
    assert away < 4 * points.sigma[third]
    others = [k for k in range(3) if k != third]
    assert points.weight[third] < points.weight[others].min()


def false_alarms(lines: int, pictures: int = 200) -> float:
    """Share of pictures of random segments in which some direction is believed."""
    found = 0
    for seed in range(pictures):
        segments = LineSegments.from_endpoints(clutter(np.random.default_rng(seed), lines))
        found += len(ESTIMATOR.estimate(segments, CAMERA)) > 0
    return found / pictures


@pytest.mark.parametrize("lines", [10, 30, 100, 300])
def test_clutter_has_no_vanishing_point(lines):
    assert false_alarms(lines) <= 0.05


def test_three_lines_are_no_witnesses():
    assert false_alarms(3, 50) <= 0.1


def grass(seed: int) -> NDArray[np.uint8]:
    random = np.random.default_rng(seed)
    picture = np.full((480, 640), 80, np.uint8)
    for root in random.uniform((0, 0), (640, 480), (2500, 2)):
        angle, length = random.normal(-math.pi / 2, 0.5), random.uniform(8, 45)
        tip = root + length * np.array([math.cos(angle), math.sin(angle)])
        ends = np.rint(np.array([root, tip]) * 16).astype(int).tolist()
        grey, thickness = int(random.integers(30, 200)), int(random.integers(1, 3))
        cv2.line(picture, ends[0], ends[1], grey, thickness, cv2.LINE_AA, 4)
    return picture


def texture(seed: int) -> NDArray[np.uint8]:
    random = np.random.default_rng(seed)
    field = cv2.GaussianBlur(random.normal(0, 1, (480, 640)), (0, 0), random.uniform(1, 5))
    return np.clip(128 + 50 * field / field.std(), 0, 255).astype(np.uint8)


def noise(seed: int) -> NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, (480, 640), np.uint8)


def gravel(seed: int) -> NDArray[np.uint8]:
    random = np.random.default_rng(seed)
    picture = np.full((480, 640), 90, np.uint8)
    for centre in random.uniform((0, 0), (640, 480), (3000, 2)):
        angles = np.sort(random.uniform(0, 2 * math.pi, 6))
        corners = random.uniform(3, 14) * np.column_stack([np.cos(angles), np.sin(angles)])
        stone = np.rint((centre + corners) * 16).astype(np.int32)
        cv2.fillPoly(picture, [stone], int(random.integers(40, 220)), cv2.LINE_AA, 4)
    return picture


@pytest.mark.parametrize("camera", [CAMERA, Camera.uncalibrated(640, 480)], ids=["known", "uncalibrated"])
@pytest.mark.parametrize("kind", [noise, texture, grass, gravel], ids=lambda kind: kind.__name__)
def test_texture_has_no_vanishing_point(kind, camera):
    detector = LineDetector()
    believed = [len(ESTIMATOR.estimate(detector.detect(kind(seed)), camera)) for seed in range(20)]
    # One in a hundred pictures of clutter may show one by chance.
    assert np.count_nonzero(believed) <= 1


@pytest.mark.parametrize("camera", [CAMERA, Camera.uncalibrated(640, 480)], ids=["known", "uncalibrated"])
@pytest.mark.parametrize("shape", [(16, 16), (6000, 8000)])
def test_pictures_of_any_size_are_answered(shape, camera):
    random = np.random.default_rng(8)
    picture = random.integers(0, 256, shape, np.uint8)
    assert len(ESTIMATOR.estimate(LineDetector().detect(picture), camera)) == 0


def test_copies_of_one_line_are_one_line():
    for count in (3, 1000):
        ends = np.tile([100.0, 100.0, 300.0, 250.0], (count, 1))
        assert len(ESTIMATOR.estimate(LineSegments.from_endpoints(ends), CAMERA)) == 0


def test_parallel_lines_alone_lead_nowhere_ahead():
    for along in ([600.0, 0.0], [0.0, 400.0], [200.0, 270.0]):
        start = np.array([[20.0 + i % 50, 30.0 + i] for i in range(200)])
        lines = LineSegments.from_endpoints(np.hstack([start, start + along]))
        for camera in (CAMERA, Camera.uncalibrated(640, 480)):
            assert ESTIMATOR.estimate(lines, camera).of(Role.PRIMARY) is None


def test_a_line_does_not_lead_to_a_point_within_it():
    # A star of lines through one place: they cross there, but none leads there.
    angles = np.linspace(0.0, math.pi, 60, endpoint=False)
    along = 150.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    place = np.array([350.0, 200.0])
    through = LineSegments.from_endpoints(np.hstack([place - along, place + along]))
    ahead = CAMERA.rays(place[None])[0]
    points = ESTIMATOR.estimate(through, CAMERA)
    assert angle_between(points.directions, ahead).min(initial=math.pi) > math.radians(1.0)
    # The same lines as far as they go towards it do.
    towards = LineSegments.from_endpoints(np.hstack([place - along, place - 0.2 * along]))
    assert nearest(ESTIMATOR.estimate(towards, CAMERA), ahead)[1] < math.radians(0.5)


def test_few_lines_confirm_what_is_expected():
    expected = np.array([0.05, 0.02, 1.0]) / np.linalg.norm([0.05, 0.02, 1.0])
    confirmed, unasked = [], []
    for seed in range(20):
        random = np.random.default_rng(seed)
        few = lines_to(random, CAMERA, expected, 7)
        lines = LineSegments.from_endpoints(np.concatenate([few, clutter(random, 40)]))
        confirmed.append(len(ESTIMATOR.estimate(lines, CAMERA, expected)))
        unasked.append(len(ESTIMATOR.estimate(lines, CAMERA)))
    assert np.count_nonzero(confirmed) > 15 > np.count_nonzero(unasked)


def test_what_is_expected_is_not_made_up():
    expected, made_up = np.array([0.0, 0.0, 1.0]), 0
    for seed in range(100):
        lines = LineSegments.from_endpoints(clutter(np.random.default_rng(seed), 60))
        made_up += len(ESTIMATOR.estimate(lines, CAMERA, expected)) > 0
    assert made_up <= 5


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_lines_give_none(count):
    lines = LineSegments.from_endpoints(lines_to(np.random.default_rng(0), CAMERA, np.eye(3)[2], count))
    points = ESTIMATOR.estimate(lines, CAMERA)
    assert len(points) == 0
    np.testing.assert_array_equal(points.labels, np.full(count, -1))
    assert points.pixels.shape == (0, 2) and points.sigma.shape == (0,)
    assert points.of(Role.PRIMARY) is None


@pytest.mark.parametrize("camera", [CAMERA, Camera.uncalibrated(640, 480)], ids=["known", "uncalibrated"])
@pytest.mark.parametrize(
    "ends",
    [
        np.tile([100.0, 100.0, 300.0, 250.0], (1000, 1)),
        np.array([[20.0 + i, 30.0, 220.0 + i, 300.0] for i in range(200)]),
        np.array([[20.0, 30.0 + i, 600.0, 30.0 + i] for i in range(200)]),
        np.array([[50.0 + i, 50.0, 50.0 + i, 50.0] for i in range(50)]),
        np.array([[319.5, 239.5, 319.5 + 200 * math.cos(a), 239.5 + 200 * math.sin(a)] for a in range(50)]),
        np.array([[0.0, 0.0, 1e7, 1e6 * i] for i in range(50)]),
    ],
    ids=["copies", "parallel", "level", "no length", "star", "far"],
)
def test_degenerate_lines_break_nothing(ends, camera):
    points = ESTIMATOR.estimate(LineSegments.from_endpoints(ends), camera)
    assert np.isfinite(points.directions).all() and np.isfinite(points.covariance).all()
    assert (points.directions[:, 2] >= 0.0).all()
    assert len(points.labels) == len(ends)
    assert np.isfinite(points.camera.fx) and points.camera.fx > 0.0


def test_parallel_lines_in_the_picture_lead_to_infinity():
    ends = np.array([[20.0 + 3 * i, 30.0, 220.0 + 3 * i, 300.0] for i in range(100)])
    points = ESTIMATOR.estimate(LineSegments.from_endpoints(ends), CAMERA)
    _, away = nearest(points, np.array([200.0, 270.0, 0.0]) / math.hypot(200, 270))
    assert away < math.radians(0.5)


@pytest.mark.parametrize("nonsense", [np.nan, np.inf, 1e5, -1e30])
def test_lines_that_no_camera_sees_are_clutter(nonsense):
    truth = scene(np.random.default_rng(5), CAMERA, upright_axes(np.random.default_rng(5)), [30] * 3, 0.2)
    ends = truth.lines.endpoints.copy()
    spoilt = np.arange(0, len(ends), 7)
    ends[spoilt, spoilt % 4] = nonsense
    points = ESTIMATOR.estimate(LineSegments.from_endpoints(ends), CAMERA)
    assert (points.labels[spoilt] == -1).all()
    without = ESTIMATOR.estimate(LineSegments.from_endpoints(np.delete(ends, spoilt, axis=0)), CAMERA)
    np.testing.assert_array_equal(points.directions, without.directions)
    np.testing.assert_array_equal(np.delete(points.labels, spoilt), without.labels)


@pytest.mark.parametrize("camera", [CAMERA, Camera.uncalibrated(640, 480)], ids=["known", "uncalibrated"])
def test_20_000_lines_cost_no_more_than_most_lines(camera):
    random = np.random.default_rng(6)
    axes = upright_axes(random)
    ends = [lines_to(random, CAMERA, axis, 100, length=(150, 250)) for axis in axes]
    lines = LineSegments.from_endpoints(np.concatenate([clutter(random, 19_700), *ends]))
    points = ESTIMATOR.estimate(lines, camera)
    assert (points.labels >= 0).sum() <= ESTIMATOR.most_lines
    if camera.focal_known:
        for axis in axes:
            assert nearest(points, axis)[1] < math.radians(0.5)
    order = np.argsort(-lines.lengths, kind="stable")[: ESTIMATOR.most_lines]
    longest = LineSegments.from_endpoints(lines.endpoints[order])
    np.testing.assert_array_equal(ESTIMATOR.estimate(longest, camera).directions, points.directions)


@pytest.mark.parametrize("camera", [CAMERA, Camera.uncalibrated(640, 480)], ids=["known", "uncalibrated"])
def test_the_same_lines_give_the_same_answer(camera):
    truth = scene(np.random.default_rng(7), CAMERA, upright_axes(np.random.default_rng(7)), [30] * 3, 0.4)
    first, again = (VanishingPointEstimator().estimate(truth.lines, camera) for _ in range(2))
    for name in ("directions", "covariance", "weight", "roles", "labels"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
    assert first.camera == again.camera


def test_neither_the_order_of_lines_nor_of_their_ends_matters_much():
    random = np.random.default_rng(8)
    truth = scene(random, CAMERA, upright_axes(random), [30] * 3, 0.4)
    first = estimate(truth)
    order = random.permutation(len(truth.lines))
    turned = truth.lines.endpoints[order][:, [2, 3, 0, 1]]
    again = ESTIMATOR.estimate(LineSegments.from_endpoints(turned), CAMERA)
    assert angle_between(first.directions, again.directions).max() < 1e-3
    assert np.mean(again.labels == first.labels[order]) > 0.97


@pytest.mark.parametrize("pitch_deg", [-30.0, 0.0, 30.0])
@pytest.mark.parametrize("roll_deg", [0.0, 10.0])
def test_roles_follow_from_how_the_camera_is_mounted(pitch_deg, roll_deg):
    camera = replace(CAMERA, pitch=math.radians(pitch_deg), roll=math.radians(roll_deg))
    yaw = math.radians(12.0)
    base = np.array([[math.cos(yaw), math.sin(yaw), 0], [0, 0, 1], [-math.sin(yaw), math.cos(yaw), 0]])
    directions = base @ camera.optical_to_base
    points = ESTIMATOR.estimate(
        scene(np.random.default_rng(9), camera, directions, [30] * 3, 0.3).lines, camera
    )
    for direction, role in zip(directions, (Role.PRIMARY, Role.VERTICAL, Role.HORIZONTAL), strict=True):
        found, away = nearest(points, direction)
        assert away < math.radians(0.5)
        assert points.roles[found] == role
    assert points.of(Role.PRIMARY) == 0 and points.of(Role.VERTICAL) == 1


def test_what_is_known_to_lie_ahead_leads():
    yaw = math.radians(44.0)
    directions = np.array([[math.sin(yaw), 0, math.cos(yaw)], [-math.cos(yaw), 0, math.sin(yaw)], [0, 1, 0]])
    lines = scene(np.random.default_rng(10), CAMERA, directions, [30] * 3, 0.2).lines
    for ahead in directions[:2]:
        points = ESTIMATOR.estimate(lines, CAMERA, ahead)
        assert angle_between(points.directions[0], ahead) < math.radians(1.0)
        assert points.roles[0] == Role.PRIMARY


def test_a_direction_to_the_side_does_not_lead():
    aside = np.array([[1.0, 0.0, 0.1]]) / math.hypot(1, 0.1)
    points = estimate(scene(np.random.default_rng(11), CAMERA, aside, [40], 0.2))
    assert points.of(Role.PRIMARY) is None
    assert points.roles[nearest(points, aside[0])[0]] == Role.HORIZONTAL


def test_weight_follows_the_number_of_lines():
    random = np.random.default_rng(12)
    axes = upright_axes(random)
    points = estimate(scene(random, CAMERA, axes, [60, 30, 15], 0.2))
    weights = [points.weight[nearest(points, axis)[0]] for axis in axes]
    assert weights == sorted(weights, reverse=True)


def test_a_distorting_camera_is_taken_as_rectified():
    bent = replace(CAMERA, distortion=(-0.3, 0.1, 0.0, 0.0, 0.0))
    random = np.random.default_rng(13)
    truth = scene(random, CAMERA, upright_axes(random), [30] * 3, 0.2)
    points = ESTIMATOR.estimate(truth.lines, bent)
    assert points.camera.is_rectified
    np.testing.assert_array_equal(points.directions, estimate(truth).directions)


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("voters", 1),
        ("candidates", 0),
        ("most_lines", 2),
        ("most", 0),
        ("orthogonality", 0.0),
        ("orthogonality", math.nan),
        ("cell", 0.0),
        ("cell", math.nan),
    ],
)
def test_settings_without_meaning_are_named(setting, value):
    with pytest.raises(ValueError, match=setting):
        VanishingPointEstimator(**{setting: value})


def test_most_is_the_most():
    random = np.random.default_rng(14)
    axes = np.concatenate([upright_axes(random), random_axes(random)])
    truth = scene(random, CAMERA, axes, [40] * 6)
    assert len(VanishingPointEstimator(most=4).estimate(truth.lines, CAMERA)) <= 4


def test_most_may_be_one():
    random = np.random.default_rng(15)
    truth = scene(random, CAMERA, upright_axes(random), [30] * 3)
    assert len(VanishingPointEstimator(most=1).estimate(truth.lines, CAMERA)) <= 1
