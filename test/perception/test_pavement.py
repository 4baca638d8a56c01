# SPDX-License-Identifier: Apache-2.0
"""The spacings of flagstones tell the horizon: found, counted, and fused with what the lines lead to."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_vision.geometry import Camera, GroundPlane, up_from_attitude
from robot_vision.geometry.sphere import normalised, tangent_basis
from robot_vision.perception import LineSegments, Role, VanishingPoints
from robot_vision.perception.attitude import estimate_attitude
from robot_vision.perception.vanishing.pavement import PavementSpacings

HEIGHT_M, WIDTH_M, LENGTH_M, JOINT_M = 0.6, 0.4, 0.6, 0.012


def camera_at(roll: float = 0.0, pitch: float = 0.12) -> Camera:
    return Camera(460.0, 460.0, 319.5, 239.5, 640, 480, height_m=HEIGHT_M, roll=roll, pitch=pitch)


def pavement(
    camera: Camera, random: np.random.Generator, noise: float = 0.1, jitter: float = 0.0
) -> tuple[LineSegments, np.ndarray]:
    """Both edges of the joints of a path as the camera sees them, and the labels: 0 leads ahead, 1 across.

    The ends are in the order that keeps the bright stone on the left of the segment as seen in the picture.
    """
    ground = GroundPlane(camera)
    ends, labels = [], []
    for number in range(-3, 4):
        lateral = number * WIDTH_M + random.normal(0.0, jitter)
        for side in (-1, 1):
            y = lateral + side * JOINT_M / 2
            for near in (1.0, 1.6, 2.4):
                stretch = [(near, y), (near + 0.55, y)]
                ends.append(ground.to_pixels(stretch if side < 0 else stretch[::-1]).ravel())
                labels.append(0)
    for number in range(2, 9):
        ahead = number * LENGTH_M + random.normal(0.0, jitter)
        for side in (-1, 1):
            x = ahead + side * JOINT_M / 2
            for left in (-1.1, -0.5, 0.1, 0.7):
                stretch = [(x, left), (x, left + 0.4)]
                ends.append(ground.to_pixels(stretch if side < 0 else stretch[::-1]).ravel())
                labels.append(1)
    lines = np.array(ends)
    return LineSegments.from_endpoints(lines + random.normal(0.0, noise, lines.shape)), np.array(labels)


def seen(camera: Camera, labels: np.ndarray, off: float, sigma: float) -> VanishingPoints:
    """Vanishing points ahead and across, the one across too high or low by `off` rad, both as sure as `sigma`."""
    base = camera.optical_to_base
    up = up_from_attitude(camera.roll, camera.pitch)
    ahead, across = base[0], base[1]
    across = normalised(across + math.tan(off) * up)
    directions = np.array([v if v[2] >= 0 else -v for v in (ahead, across)])
    small = np.deg2rad(0.02) ** 2 * np.eye(2)
    return VanishingPoints(
        directions=directions,
        covariance=np.array([small, sigma**2 * np.eye(2)]),
        weight=np.array([20.0, 20.0]),
        roles=np.array([Role.PRIMARY, Role.HORIZONTAL], np.uint32),
        ids=np.zeros(2, np.uint32),
        labels=labels.astype(np.intp),
        camera=camera,
    )


def elevation(points: VanishingPoints, index: int) -> float:
    """How far a direction that should be level lies off the true horizon, rad."""
    up = up_from_attitude(points.camera.roll, points.camera.pitch)
    return abs(math.asin(float(up @ points.directions[index])))


@given(
    roll=st.floats(-0.1, 0.1),
    pitch=st.floats(0.0, 0.4),
    off=st.floats(-0.004, 0.004),
    seed=st.integers(0, 99),
)
@settings(max_examples=40, deadline=None)
def test_spacings_level_the_vanishing_point_across(roll, pitch, off, seed):
    camera = camera_at(roll, pitch)
    lines, labels = pavement(camera, np.random.default_rng(seed))
    points = seen(camera, labels, off, math.radians(0.25))
    fused = PavementSpacings().fuse(points, lines)
    assert np.array_equal(fused.directions[0], points.directions[0])  # sure enough already
    assert elevation(fused, 1) < max(0.5 * abs(off), math.radians(0.06))
    up = up_from_attitude(roll, pitch)
    across = tangent_basis(points.directions[1]) @ up
    before = float(across @ points.covariance[1] @ across)
    assert float(across @ fused.covariance[1] @ across) < 0.8 * before
    assert np.linalg.eigvalsh(fused.covariance[1])[0] > 0.0


def test_the_roll_follows_the_spacings():
    camera = camera_at(roll=0.03)
    lines, labels = pavement(camera, np.random.default_rng(5))
    points = seen(camera, labels, 0.006, math.radians(0.4))
    fused = PavementSpacings().fuse(points, lines)
    before, after = (abs(estimate_attitude(each, 0.035).roll - 0.03) for each in (points, fused))
    assert after < 0.3 * before


def test_errors_are_as_large_as_the_covariance_says():
    squared = []
    for seed in range(60):
        random = np.random.default_rng(seed)
        camera = camera_at(random.uniform(-0.05, 0.05), random.uniform(0.05, 0.3))
        lines, labels = pavement(camera, random, noise=0.3)
        points = seen(camera, labels, random.normal(0.0, math.radians(0.3)), math.radians(0.3))
        fused = PavementSpacings().fuse(points, lines)
        up = tangent_basis(fused.directions[1]) @ up_from_attitude(camera.roll, camera.pitch)
        squared.append(elevation(fused, 1) ** 2 / float(up @ fused.covariance[1] @ up))
    assert 0.1 < np.mean(squared) < 2.0


@pytest.mark.parametrize("roll", [-0.05, 0.0, 0.08])
def test_spacings_are_those_of_the_stones(roll):
    camera = camera_at(roll)
    lines, labels = pavement(camera, np.random.default_rng(1))
    across, along = PavementSpacings().spacings(seen(camera, labels, 0.0, 0.002), lines)
    assert across == pytest.approx(WIDTH_M / HEIGHT_M, rel=0.01)
    assert along == pytest.approx(LENGTH_M / HEIGHT_M, rel=0.01)


def test_stones_laid_anyhow_do_no_harm():
    camera = camera_at()
    for seed in range(10):
        lines, labels = pavement(camera, np.random.default_rng(seed), jitter=0.12)
        points = seen(camera, labels, 0.003, math.radians(0.25))
        fused = PavementSpacings().fuse(points, lines)
        assert elevation(fused, 1) < 1.5 * 0.003


def test_without_a_vanishing_point_across_nothing_changes():
    camera = camera_at()
    lines, labels = pavement(camera, np.random.default_rng(1))
    points = seen(camera, labels, 0.003, 0.004)
    alone = replace(points, roles=np.array([Role.PRIMARY, Role.OTHER], np.uint32))
    assert PavementSpacings().fuse(alone, lines) is alone
    none = VanishingPoints.none(camera, len(lines))
    assert PavementSpacings().fuse(none, lines) is none
    assert PavementSpacings().spacings(none, lines) == (None, None)
