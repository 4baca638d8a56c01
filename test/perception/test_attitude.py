# SPDX-License-Identifier: Apache-2.0
"""Roll and pitch at picture rate, of bodies that sway faster than a track of the vertical follows."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from corridor_lines import CAMERA, Corridor, seen_lines

from robot_vision.geometry.sphere import retract
from robot_vision.perception import HeadingEstimator, Role
from robot_vision.perception.attitude import estimate_attitude

STEP = 1 / 15


def test_a_body_that_sways_by_three_degrees_is_followed():
    """At picture rate, with rolls so fast that a vertical vanishing point jumps from one picture to the next."""
    random, estimator = np.random.default_rng(5), HeadingEstimator()
    errors, surprises = [], []
    for k in range(60):
        roll = math.radians(3.0) * math.sin(2.0 * np.pi * 2.2 * k * STEP)
        pitch = math.radians(3.0) * math.sin(2.0 * np.pi * 1.3 * k * STEP)
        true = replace(CAMERA, roll=roll, pitch=CAMERA.pitch + pitch)
        lines = seen_lines(Corridor(doors=2.0), 0.1, 0.0, random, true, along=0.05 * k)
        attitude = estimator.update(lines, CAMERA, k * STEP).attitude
        assert attitude is not None and attitude.seen
        error = np.array([attitude.roll - true.roll, attitude.pitch - true.pitch])
        errors.append(error)
        surprises.append(error @ np.linalg.solve(attitude.covariance, error) / 2.0)
    assert np.degrees(np.sqrt(np.mean(np.square(errors), axis=0))).max() < 0.2
    assert np.mean(surprises) < 3.0


def test_a_vertical_that_is_unseen_gives_way_to_the_one_in_the_picture():
    random, estimator = np.random.default_rng(0), HeadingEstimator()
    for k in range(5):
        seen = estimator.update(seen_lines(Corridor(), 0.0, 0.0, random), CAMERA, k * STEP).vanishing_points
    place = seen.of(Role.VERTICAL)
    assert place is not None
    old = retract(seen.directions[place], np.array([0.05, 0.0]))
    both = replace(
        seen,
        directions=np.concatenate([old[None], seen.directions]),
        covariance=np.concatenate([seen.covariance[place : place + 1], seen.covariance]),
        weight=np.concatenate([[0.0], seen.weight]),
        roles=np.concatenate([[np.uint32(Role.VERTICAL)], seen.roles]),
        ids=np.concatenate([[np.uint32(77)], seen.ids]),
        labels=seen.labels + 1,
    )
    np.testing.assert_allclose(
        estimate_attitude(both, 0.035).up, estimate_attitude(seen, 0.035).up, atol=1e-12
    )
