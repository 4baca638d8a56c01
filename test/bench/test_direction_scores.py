# SPDX-License-Identifier: Apache-2.0
"""The scorers of vanishing points, held to cases whose score is known by construction."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bench import directions as scores
from robot_vision.geometry import Camera

Array = NDArray[np.float64]
CAMERA = Camera(600.0, 600.0, 319.5, 239.5, 640, 480)
#: Horizontal to the right, vertical, horizontal ahead.
AXES = np.eye(3)
FRAMES = st.integers(0, 2**32 - 1).map(lambda seed: Rotation.random(random_state=seed).as_matrix())
DEGREES = st.floats(0.0, 20.0)


def looking(yaw_deg: float = 30.0, pitch_deg: float = 5.0, roll_deg: float = 2.0) -> Array:
    """The axes of a room as a camera sees them that is turned by these angles."""
    turn = Rotation.from_euler("yxz", [yaw_deg, pitch_deg, roll_deg], degrees=True).as_matrix()
    return np.asarray((turn @ AXES).T)


def turned(direction: Array, about: Array, degrees: float) -> Array:
    return np.asarray(Rotation.from_rotvec(np.radians(degrees) * about).apply(direction))


@given(FRAMES, st.permutations(range(3)), st.lists(st.sampled_from((-1.0, 1.0)), min_size=3, max_size=3))
def test_the_truth_itself_has_no_error_in_any_order_and_with_any_signs(
    frame: Array, order: list[int], signs: list[float]
) -> None:
    found = frame[order] * np.array(signs)[:, None]
    assert scores.matched_errors_deg(frame, found) == pytest.approx(0.0, abs=1e-5)
    assert scores.rotation_error_deg(frame, found) == pytest.approx(0.0, abs=1e-4)
    assert scores.area_under_recall(scores.matched_errors_deg(frame, found), 3.0) == pytest.approx(100.0)


@given(FRAMES, DEGREES)
def test_one_displaced_direction_has_just_its_displacement(frame: Array, degrees: float) -> None:
    found = frame.copy()
    found[0] = turned(frame[0], frame[1], degrees)
    assert scores.matched_errors_deg(frame, found) == pytest.approx([degrees, 0.0, 0.0], abs=1e-5)


@given(FRAMES, DEGREES, st.permutations(range(3)))
def test_a_turned_frame_is_off_by_the_angle_it_was_turned(
    frame: Array, degrees: float, order: list[int]
) -> None:
    axis = Rotation.from_matrix(frame).apply([0.6, 0.0, 0.8])
    found = np.stack([turned(direction, axis, degrees) for direction in frame])[order]
    assert scores.rotation_error_deg(frame, found) == pytest.approx(degrees, abs=1e-4)


@given(FRAMES, st.integers(0, 2))
def test_a_missing_direction_is_ninety_degrees_off(frame: Array, missing: int) -> None:
    errors = scores.matched_errors_deg(frame, np.delete(frame, missing, axis=0))
    assert sorted(errors.tolist()) == pytest.approx([0.0, 0.0, scores.MISSING_DEG], abs=1e-5)
    assert scores.area_under_recall(errors, 10.0) == pytest.approx(200.0 / 3.0)


def test_no_answer_scores_nothing_everywhere() -> None:
    none = np.zeros((0, 3))
    true = looking()
    assert scores.matched_errors_deg(true, none).tolist() == [90.0] * 3
    assert scores.area_under_recall(scores.matched_errors_deg(true, none), 10.0) == 0.0
    assert scores.forward_error_deg(true, none) == scores.MISSING_DEG
    assert scores.horizon_error(true, none, CAMERA, CAMERA) == scores.NO_HORIZON
    assert scores.rotation_error_deg(true, none) == scores.MISSING_DEG
    assert len(scores.seen_by(none, CAMERA, CAMERA)) == 0


def test_matching_is_by_the_least_total_error() -> None:
    true = np.array([[1.0, 0.0, 0.0], turned(AXES[0], AXES[1], 10.0)])
    # Nearest first would give the first of them to the second: 4 + 26 instead of 6 + 16 degrees
    found = np.array([turned(AXES[0], AXES[1], 6.0), turned(AXES[0], AXES[1], 26.0)])
    assert scores.matched_errors_deg(true, found) == pytest.approx([6.0, 16.0])


def test_further_answers_do_no_harm_to_the_matching() -> None:
    clutter = turned(AXES[0], AXES[2], 45.0)[None]
    assert scores.matched_errors_deg(AXES, np.vstack([clutter, AXES])) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("errors", "threshold", "area"),
    [
        ([0.0, 0.0], 3.0, 100.0),
        ([1.5], 3.0, 50.0),
        ([0.0, 3.0, 1.0, 90.0], 4.0, 100.0 * (1 + 0.25 + 0.75 + 0) / 4),
        ([np.nan, 0.0], 10.0, 50.0),
    ],
)
def test_the_area_under_the_recall_curve(errors: list[float], threshold: float, area: float) -> None:
    assert scores.area_under_recall(errors, threshold) == pytest.approx(area)
    # The same by its definition: recall integrated over the threshold
    steps = (np.arange(20_000) + 0.5) / 20_000 * threshold
    recall = np.mean(np.asarray(errors)[:, None] <= steps, axis=0)
    assert 100.0 * recall.mean() == pytest.approx(area, abs=0.02)


def test_the_share_within_a_limit_counts_the_limit_and_no_unknown() -> None:
    assert scores.share_within([0.5, 1.0, 1.5, np.nan], 1.0) == 50.0


def test_the_heaviest_three_count() -> None:
    weight = np.array([1.0, 5.0, 2.0, 9.0])
    directions = np.vstack([AXES, [[0.0, 0.6, 0.8]]])
    assert scores.best_supported(directions, weight).tolist() == directions[[3, 1, 2]].tolist()


def test_forward_is_the_horizontal_direction_nearest_to_the_axis() -> None:
    true = looking(yaw_deg=30.0)
    ahead = true[2]
    assert scores.forward(true) == pytest.approx(ahead)
    found = true.copy()
    found[2] = turned(ahead, true[1], 0.7)
    assert scores.forward_error_deg(true, found) == pytest.approx(0.7)
    # A camera that looks steeply down still does not take the vertical direction for the way ahead
    steep = looking(yaw_deg=10.0, pitch_deg=35.0)
    assert np.abs(scores.forward(steep) @ steep[2]) == pytest.approx(1.0)


def test_forward_is_off_by_the_other_direction_where_the_right_one_is_missing() -> None:
    true = looking(yaw_deg=30.0)
    assert scores.forward_error_deg(true, true[:2]) == pytest.approx(90.0)


def test_without_a_vertical_direction_all_are_horizontal() -> None:
    assert scores.upright(AXES[[0, 2]]) is None
    assert len(scores.horizontal(AXES[[0, 2]])) == 2
    assert scores.horizontal(AXES).tolist() == AXES[[0, 2]].tolist()


@given(st.floats(-20.0, 20.0), st.floats(-10.0, 10.0))
def test_a_true_horizon_has_no_error(pitch_deg: float, roll_deg: float) -> None:
    true = looking(30.0, pitch_deg, roll_deg)
    assert scores.horizon_error(true, true[::-1], CAMERA, CAMERA) == pytest.approx(0.0, abs=1e-9)
    # One horizontal direction is missing: the vertical one tells the horizon
    assert scores.horizon_error(true, true[:2], CAMERA, CAMERA) == pytest.approx(0.0, abs=1e-9)


def test_a_pitched_horizon_is_off_by_its_rows() -> None:
    level, pitched = looking(30.0, 0.0, 0.0), looking(30.0, 3.0, 0.0)
    rows = CAMERA.fy * np.tan(np.radians(3.0))
    assert scores.horizon_error(level, pitched, CAMERA, CAMERA) == pytest.approx(rows / CAMERA.height)


def test_a_rolled_horizon_is_worst_at_an_edge() -> None:
    level, rolled = looking(30.0, 0.0, 0.0), looking(30.0, 0.0, 4.0)
    rows = 319.5 * np.tan(np.radians(4.0))
    assert scores.horizon_error(level, rolled, CAMERA, CAMERA) == pytest.approx(rows / CAMERA.height)


@given(st.floats(0.5, 2.0))
def test_directions_of_a_wrong_focal_length_mean_the_same_points_of_the_picture(ratio: float) -> None:
    true = looking()
    wrong = Camera(ratio * CAMERA.fx, ratio * CAMERA.fy, CAMERA.cx, CAMERA.cy, CAMERA.width, CAMERA.height)
    found = scores.seen_by(true, CAMERA, wrong)
    points = (true / true[:, 2:]) @ CAMERA.matrix.T
    assert (found / found[:, 2:]) @ wrong.matrix.T == pytest.approx(points)
    assert scores.matched_errors_deg(true, scores.seen_by(found, wrong, CAMERA)) == pytest.approx(0, abs=1e-5)


def test_two_orthogonal_directions_make_a_frame() -> None:
    true = looking()
    assert scores.rotation_error_deg(true, true[:2]) == pytest.approx(0.0, abs=1e-4)
    assert scores.rotation_error_deg(true, true[:1]) == scores.MISSING_DEG
