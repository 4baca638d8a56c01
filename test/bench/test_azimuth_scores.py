# SPDX-License-Identifier: Apache-2.0
"""The score of the way ahead, held to drives whose direction is known by construction."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bench.azimuth import azimuth, score_azimuths, travel_azimuths

Array = NDArray[np.float64]


def straight_drive(yaw_deg: float, count: int = 20) -> Array:
    """A camera turned to the right by `yaw_deg` that moves straight along z of the world."""
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, :3] = Rotation.from_euler("y", yaw_deg, degrees=True).as_matrix()
    poses[:, 2, 3] = np.arange(count)
    return poses


@given(st.floats(-60.0, 60.0))
def test_a_camera_turned_to_the_right_sees_its_way_to_the_left(yaw_deg: float) -> None:
    ways = travel_azimuths(straight_drive(yaw_deg), steps=5)
    assert len(ways) == 15
    assert np.degrees(ways) == pytest.approx(-yaw_deg)


def test_the_way_is_that_of_the_coming_pictures() -> None:
    poses = straight_drive(0.0, 8)
    poses[4:, 0, 3] = np.arange(1, 5)  # from picture 3 on it goes to the right as fast as ahead
    assert np.degrees(travel_azimuths(poses, steps=1)).tolist() == pytest.approx([0, 0, 0, 45, 45, 45, 45])


def test_a_direction_to_the_right_has_a_positive_azimuth() -> None:
    assert math.degrees(azimuth([1.0, 0.3, 1.0])) == pytest.approx(45.0)
    assert azimuth([0.0, -0.5, 2.0]) == 0.0


def test_perfect_answers() -> None:
    truth = np.radians(np.linspace(-3.0, 3.0, 12))
    score = score_azimuths(np.r_[truth, 0.05, 0.05], truth)
    assert (score.median, score.worst, score.missing, score.compared) == (0.0, 0.0, 0.0, 12)


def test_a_constant_error_is_no_jitter() -> None:
    score = score_azimuths(np.radians(np.full(10, 0.4)), np.zeros(8))
    assert (score.median, score.worst) == (pytest.approx(0.4), pytest.approx(0.4))
    assert score.jitter == pytest.approx(0.0, abs=1e-12)


def test_jitter_is_the_deviation_of_the_differences() -> None:
    score = score_azimuths(np.radians([0.0, 1.0, 0.0, 1.0, 0.0]), np.zeros(5))
    assert score.jitter == pytest.approx(1.0)  # differences 1, -1, 1, -1
    assert score.true_jitter == 0.0


def test_missing_answers_are_counted_and_compared_with_nothing() -> None:
    answers = np.radians([0.5, math.nan, 0.1, math.nan])
    score = score_azimuths(answers, np.zeros(3))
    assert (score.missing, score.compared) == (50.0, 2)
    assert score.worst == pytest.approx(0.5)
    none = score_azimuths(np.full(4, math.nan), np.zeros(3))
    assert (none.missing, none.compared) == (100.0, 0)
    assert math.isnan(none.median) and math.isnan(none.worst) and math.isnan(none.jitter)
