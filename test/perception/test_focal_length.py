# SPDX-License-Identifier: Apache-2.0
"""A focal length nobody gave is found where right angles show it, and doubted where they do not."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from line_scenes import CROOKED, clutter, nearest, scene, upright_axes
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.perception import LineSegments, VanishingPointEstimator
from robot_vision.perception.vanishing.focal import PRIOR_SIGMA

UNKNOWN = Camera.uncalibrated(640, 480)


@dataclass(frozen=True)
class Answers:
    """Errors of the logarithm of the focal length, their sigmas, and the worst error of a direction (rad)."""

    error: NDArray[np.float64]
    sigma: NDArray[np.float64]
    away: NDArray[np.float64]


def answers(many: int, finite: bool = True, scenes: int = 40) -> Answers:
    found = []
    for seed in range(scenes):
        random = np.random.default_rng(seed)
        focal = 640 * random.uniform(0.65, 1.8)
        camera = Camera(focal, focal, 319.5, 239.5, 640, 480)
        axes = upright_axes(random, 0.3)
        # Only vanishing points at a finite distance tell of the focal length.
        while finite and np.abs(axes[:, 2]).min() < 0.1:
            axes = upright_axes(random, 0.3)
        truth = scene(random, camera, axes[:many], [35] * many, 0.2, crooked=CROOKED)
        points = VanishingPointEstimator().estimate(truth.lines, UNKNOWN)
        away = max(nearest(points, direction)[1] for direction in truth.directions)
        found.append((math.log(points.camera.fx / focal), points.focal_sigma, away))
    return Answers(*np.array(found).T)


@pytest.fixture(scope="module")
def three() -> Answers:
    return answers(3)


def test_three_orthogonal_directions_tell_the_focal_length(three):
    assert np.median(np.abs(three.error)) < 0.03
    assert np.mean(np.abs(three.error) < 0.15) > 0.9
    assert np.median(three.away) < math.radians(1.0)


def test_its_sigma_is_honest(three):
    sure = three.sigma < 0.3
    assert sure.mean() > 0.8
    # Sigma is for real towns, where errors are shared: larger than independent errors would make it.
    assert 0.02 < np.mean((three.error / three.sigma) ** 2) < 2.0


def test_the_camera_of_the_answer_is_the_one_found():
    truth = scene(
        np.random.default_rng(1),
        Camera(800.0, 800.0, 319.5, 239.5, 640, 480),
        upright_axes(np.random.default_rng(3), 0.3),
        [40] * 3,
        0.1,
    )
    points = VanishingPointEstimator().estimate(truth.lines, UNKNOWN)
    assert points.camera.fx == points.camera.fy
    assert (points.camera.cx, points.camera.cy) == (UNKNOWN.cx, UNKNOWN.cy)
    for direction, pixel in zip(points.directions, points.pixels, strict=True):
        if np.isfinite(pixel).all():
            assert points.camera.rays(pixel[None])[0] @ direction == pytest.approx(1.0, abs=1e-9)


def test_one_direction_says_nothing_of_the_focal_length():
    one = answers(1)
    assert np.median(one.sigma) > 0.7 * PRIOR_SIGMA
    assert np.mean((one.error / one.sigma) ** 2) < 4.0


def test_two_directions_do_not_claim_too_much():
    two = answers(2, finite=False, scenes=60)
    assert np.mean((two.error / two.sigma) ** 2) < 4.0


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_too_few_lines_leave_the_guess(count):
    lines = LineSegments.from_endpoints(clutter(np.random.default_rng(0), count))
    points = VanishingPointEstimator().estimate(lines, UNKNOWN)
    assert points.focal_sigma == pytest.approx(PRIOR_SIGMA, rel=0.2)
    assert points.camera.fx == pytest.approx(UNKNOWN.fx, rel=0.5)
    assert not points.camera.focal_known


def test_a_focal_length_that_is_given_is_kept():
    camera = Camera(700.0, 700.0, 319.5, 239.5, 640, 480)
    truth = scene(np.random.default_rng(2), camera, upright_axes(np.random.default_rng(2)), [30] * 3)
    points = VanishingPointEstimator().estimate(truth.lines, camera)
    assert points.camera == camera
    assert points.focal_sigma == 0.0
