# SPDX-License-Identifier: Apache-2.0
"""Heading, place in the lane and attitude are recovered from the lines of a corridor, and nothing is made up."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from corridor_lines import CAMERA, Corridor, seen_lines, without_height
from hypothesis import given, settings
from hypothesis import strategies as st
from line_scenes import clutter, lines_to
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.perception import HeadingEstimate, HeadingEstimator, LineSegments, Role
from robot_vision.perception.lane import LaneFilter

STEP = 1 / 15
#: Enough of them show the way where a wall is missing.
LAMPS = (-0.6, -0.3, 0.3, 0.6)


def follow(
    estimator: HeadingEstimator,
    corridor: Corridor,
    offset: float,
    yaw: float,
    pictures: int = 12,
    seed: int = 0,
    true: Camera = CAMERA,
    told: Camera = CAMERA,
    first: int = 0,
    others: int = 15,
) -> list[HeadingEstimate]:
    """Answers while the robot rolls slowly down the corridor."""
    random = np.random.default_rng(seed)
    return [
        estimator.update(
            seen_lines(corridor, offset, yaw, random, true, along=0.05 * k, others=others), told, k * STEP
        )
        for k in range(first, first + pictures)
    ]


@settings(max_examples=25, derandomize=True)
@given(
    st.floats(-0.3, 0.3),
    st.floats(-0.2, 0.2),
    st.sampled_from([1.6, 2.0, 3.0]),
    st.floats(0.07, 0.12),
    st.sampled_from([None, 0.35, -0.3]),
    st.integers(0, 2**32 - 1),
)
def test_yaw_offset_and_width_are_recovered(share, yaw, width, skirting, joint, seed):
    corridor = Corridor(width=width, skirting=skirting, joint=joint)
    offset = share * width / 2
    answer = follow(HeadingEstimator(), corridor, offset, yaw, seed=seed)[-1]
    lane = answer.lane
    assert lane is not None and answer.reason == ""
    assert abs(math.degrees(lane.yaw - yaw)) < 0.3
    # Once in a while a skirting is taken for the foot: never more than its height makes of the distance.
    assert abs(lane.offset - offset) < 0.12 * width / 2
    assert abs(lane.width - width) < 0.12 * width


def test_how_well_and_how_surely():
    yaws, offsets, of_yaw, of_offset = [], [], [], []
    for seed in range(30):
        random = np.random.default_rng(1000 + seed)
        offset, yaw = random.uniform(-0.3, 0.3), random.uniform(-0.2, 0.2)
        lane = follow(HeadingEstimator(), Corridor(), offset, yaw, 8, seed)[-1].lane
        assert lane is not None and lane.offset_known
        yaws.append(lane.yaw - yaw)
        offsets.append(lane.offset - offset)
        of_yaw.append(yaws[-1] ** 2 / lane.yaw_variance)
        of_offset.append(offsets[-1] ** 2 / lane.offset_variance)
    assert np.sqrt(np.mean(np.square(yaws))) < math.radians(0.1)
    assert np.median(np.abs(offsets)) < 0.005
    # Drawn lines are straighter than real ones, so both are rather too careful here.
    assert 0.05 < np.mean(of_yaw) < 2.0
    assert 0.05 < np.median(of_offset) < 2.0


def test_signs():
    right_of_lane = follow(HeadingEstimator(), Corridor(), -0.25, 0.1)[-1].lane
    left_of_lane = follow(HeadingEstimator(), Corridor(), 0.25, -0.1)[-1].lane
    assert right_of_lane is not None and left_of_lane is not None
    assert right_of_lane.offset < 0 < left_of_lane.offset
    assert left_of_lane.yaw < 0 < right_of_lane.yaw


@pytest.mark.parametrize("camera_x", [-0.3, 0.4])
def test_the_offset_is_that_of_the_robot_not_of_its_camera(camera_x):
    camera = replace(CAMERA, x_m=camera_x)
    lane = follow(HeadingEstimator(), Corridor(), 0.1, 0.2, true=camera, told=camera)[-1].lane
    assert lane is not None
    assert lane.offset == pytest.approx(0.1, abs=0.02)


@pytest.mark.parametrize(("roll_deg", "pitch_deg"), [(0.0, 0.0), (1.0, 0.0), (0.0, -1.0), (-1.5, 1.5)])
def test_attitude_is_recovered(roll_deg, pitch_deg):
    true = replace(
        CAMERA, roll=CAMERA.roll + math.radians(roll_deg), pitch=CAMERA.pitch + math.radians(pitch_deg)
    )
    answer = follow(HeadingEstimator(), Corridor(), 0.1, 0.1, true=true)[-1]
    attitude = answer.attitude
    assert attitude is not None and attitude.seen
    error = np.array([attitude.roll - true.roll, attitude.pitch - true.pitch])
    assert np.degrees(np.abs(error)).max() < 0.25
    assert error @ np.linalg.solve(attitude.covariance, error) < 12.0
    # The offset does not suffer from the lean.
    assert answer.lane is not None
    assert answer.lane.offset == pytest.approx(0.1, abs=0.02)


def test_attitude_covariance_shrinks_with_what_is_seen():
    estimator = HeadingEstimator()
    answer = follow(estimator, Corridor(), 0.0, 0.0)[-1]
    assert answer.attitude is not None
    assert np.sqrt(np.diag(answer.attitude.covariance)).max() < 0.5 * estimator.lean


def test_without_the_height_of_the_camera_there_is_yaw_alone():
    answer = follow(HeadingEstimator(), Corridor(), 0.2, 0.1, told=without_height(CAMERA))[-1]
    assert answer.lane is not None
    assert math.degrees(abs(answer.lane.yaw - 0.1)) < 0.3
    assert not answer.lane.offset_known and math.isinf(answer.lane.offset_variance)
    assert "height of the camera" in answer.reason


def test_without_walls_there_is_yaw_alone():
    # Lines of a ceiling: they lead ahead but say nothing of the floor.
    random = np.random.default_rng(3)
    ends = lines_to(random, CAMERA, CAMERA.optical_to_base.T @ np.array([1.0, 0.0, 0.0]), 200)
    above = ends[ends[:, [1, 3]].max(axis=1) < 190]
    answer = HeadingEstimator().update(LineSegments.from_endpoints(above), CAMERA, 0.0)
    assert answer.lane is not None and not answer.lane.offset_known
    assert "between floor and walls" in answer.reason


def test_a_wall_unseen_for_a_while_is_remembered_and_then_given_up():
    estimator, corridor = HeadingEstimator(), Corridor(joint=None, lamps=LAMPS)
    known = follow(estimator, corridor, 0.15, 0.05)
    assert known[-1].lane is not None
    before = known[-1].lane.offset_variance
    one_wall = replace(corridor, walls=(1,))
    held = follow(estimator, one_wall, 0.15, 0.05, pictures=30, seed=1, first=12, others=0)
    patience = estimator.lane_filter.patience
    for k, answer in enumerate(held):
        assert answer.lane is not None
        seconds = (k + 1) * STEP
        if seconds < patience - STEP:
            assert answer.lane.offset == pytest.approx(0.15, abs=0.05)
            assert answer.lane.offset_known
        elif seconds > patience + STEP:
            assert not answer.lane.offset_known
            assert "between floor and walls" in answer.reason
    middle = held[5].lane
    assert middle is not None and middle.offset_variance > before
    again = follow(estimator, corridor, 0.15, 0.05, seed=2, first=42)[-1].lane
    assert again is not None and again.offset == pytest.approx(0.15, abs=0.03)


@pytest.mark.parametrize("seed", [1, 2, 4])
def test_clutter_is_no_wall(seed):
    estimator = HeadingEstimator()
    corridor = Corridor(joint=None, lamps=LAMPS)
    follow(estimator, corridor, 0.15, 0.05)
    one_wall = replace(corridor, walls=(1,))
    answers = follow(estimator, one_wall, 0.15, 0.05, pictures=40, seed=seed, first=12)
    for answer in answers:
        assert answer.lane is not None
        if answer.lane.offset_known:
            assert (answer.lane.offset - 0.15) ** 2 < 25 * answer.lane.offset_variance
    assert not any(answer.lane.offset_known for answer in answers[25:] if answer.lane is not None)


@pytest.mark.parametrize("offset", [0.48, -0.48])
def test_the_uprights_of_a_box_in_the_way_hide_no_wall(offset):
    boxed = Corridor(boxes=((3.0, 0.0, 0.5, 1.2),))
    answers = follow(HeadingEstimator(), boxed, offset, 0.0)
    lane = answers[-1].lane
    assert lane is not None and lane.offset_known
    assert lane.offset == pytest.approx(offset, abs=0.03)
    assert lane.width == pytest.approx(2.0, abs=0.06)


def test_a_box_before_a_wall_that_is_not_seen_is_no_wall():
    boxed = Corridor(boxes=((3.0, 0.0, 0.5, 1.2),), walls=(1,), lamps=LAMPS)
    answers = follow(HeadingEstimator(), boxed, 0.48, 0.0, pictures=30)
    assert not any(answer.lane.offset_known for answer in answers if answer.lane is not None)


def on_the_floor(left: float, first: float, last: float, offset: float, yaw: float) -> NDArray[np.float64]:
    """Ends (4,) px of a line along the corridor, `left` of its middle, from `first` to `last` m ahead."""
    points = np.array([[first, left - offset, 0.0], [last, left - offset, 0.0]])
    turn = np.array(
        [[math.cos(yaw), math.sin(yaw), 0.0], [-math.sin(yaw), math.cos(yaw), 0.0], [0.0, 0.0, 1.0]]
    )
    body = points @ turn.T - [CAMERA.x_m, 0.0, CAMERA.height_m]
    return CAMERA.pixels(body @ CAMERA.optical_to_base).reshape(4)


@pytest.mark.parametrize("tracked", [0, 8])
@pytest.mark.parametrize("before", [0.93, 0.95, 1.06])
def test_a_chance_line_beside_a_wall_does_not_mislead(tracked, before):
    estimator, offset, yaw = HeadingEstimator(), 0.1, 0.05
    if tracked:
        follow(estimator, Corridor(joint=None), offset, yaw, tracked)
    side = offset + before * (-1.0 - offset)
    chance = on_the_floor(side, 2.0, 3.4, offset, yaw)
    assert 50 < np.hypot(*(chance[2:] - chance[:2])) < 130
    usual = seen_lines(Corridor(joint=None), offset, yaw, np.random.default_rng(3), along=0.05 * tracked)
    lines = LineSegments.from_endpoints(np.vstack([usual.endpoints, chance]))
    lane = estimator.update(lines, CAMERA, tracked * STEP).lane
    assert lane is not None
    if tracked:
        assert lane.offset == pytest.approx(offset, abs=0.015)
    if lane.offset_known:
        assert (lane.offset - offset) ** 2 < 16 * lane.offset_variance


def test_feet_seen_in_part_must_be_confirmed():
    estimator, offset, yaw = HeadingEstimator(), 0.1, 0.0
    parts = np.array([on_the_floor(side, 1.9, 4.0, offset, yaw) for side in (1.0, -1.0)])
    ahead = CAMERA.optical_to_base.T @ np.array([1.0, 0.0, 0.0])
    ends = lines_to(np.random.default_rng(3), CAMERA, ahead, 200)
    above = ends[ends[:, [1, 3]].max(axis=1) < 190]
    lines = LineSegments.from_endpoints(np.vstack([above, parts]))
    lanes = [estimator.update(lines, CAMERA, k * STEP).lane for k in range(4)]
    assert [lane is not None and lane.offset_known for lane in lanes] == [False, False, True, True]
    last = lanes[-1]
    assert last is not None and last.offset == pytest.approx(offset, abs=0.01)
    # Half seen is half sure.
    assert math.sqrt(last.offset_variance) > 0.01


@pytest.mark.parametrize(
    ("setting", "values"),
    [
        *[
            (name, [0.0, -1.0, math.nan, math.inf])
            for name in ("narrowest", "widest", "drift", "width_drift", "cluster", "foot_sigma", "full_cover")
        ],
        ("narrowest", [12.0, 13.0]),
        *[(name, [-0.1, 1.0, math.nan]) for name in ("least_share", "least_cover", "most_before")],
        *[(name, [-0.1, math.nan, math.inf]) for name in ("tallest_skirting", "patience")],
        *[(name, [0, -1]) for name in ("confirmations", "contradictions")],
    ],
)
def test_settings_of_the_lane_without_meaning_are_named(setting, values):
    for value in values:
        with pytest.raises(ValueError, match=f"^{setting} must be"):
            replace(LaneFilter(), **{setting: value})


@pytest.mark.parametrize("lean", [0.0, -0.1, math.nan, math.inf])
def test_a_lean_without_meaning_is_refused(lean):
    with pytest.raises(ValueError, match="^lean must be a positive number"):
        HeadingEstimator(lean=lean)


def test_reasons_are_in_plain_words():
    estimator = HeadingEstimator()
    nothing = estimator.update(LineSegments.empty(), CAMERA, 0.0)
    assert nothing.lane is None and nothing.attitude is None
    assert nothing.reason == "no vanishing point: only 0 lines"
    aside = CAMERA.optical_to_base.T @ np.array([0.1, 1.0, 0.0])
    lines = LineSegments.from_endpoints(
        lines_to(np.random.default_rng(0), CAMERA, aside / np.hypot(1, 0.1), 40)
    )
    answer = HeadingEstimator().update(lines, CAMERA, 0.0)
    assert answer.lane is None
    assert answer.reason == "no vanishing point lies in the direction of motion"


def test_what_is_not_seen_is_not_steered_by_though_it_is_remembered_for_a_while():
    estimator = HeadingEstimator()
    follow(estimator, Corridor(), 0.1, 0.1)
    blind = [estimator.update(LineSegments.empty(), CAMERA, (12 + k) * STEP) for k in range(15)]
    assert all(answer.lane is None for answer in blind)
    assert "not seen" in blind[0].reason
    assert blind[0].vanishing_points.of(Role.PRIMARY) == 0
    assert blind[4].vanishing_points.sigma[0] > blind[0].vanishing_points.sigma[0]
    assert len(blind[-1].vanishing_points) == 0 and "no vanishing point" in blind[-1].reason


def test_a_picture_of_clutter_does_not_turn_the_robot():
    estimator = HeadingEstimator()
    follow(estimator, Corridor(), 0.1, 0.1)
    for k in range(4):
        lines = LineSegments.from_endpoints(clutter(np.random.default_rng(k), 80))
        answer = estimator.update(lines, CAMERA, (12 + k) * STEP)
        assert answer.lane is None or math.degrees(abs(answer.lane.yaw - 0.1)) < 2.0
    again = seen_lines(Corridor(), 0.1, 0.1, np.random.default_rng(9))
    answer = estimator.update(again, CAMERA, 16 * STEP)
    assert answer.lane is not None and math.degrees(abs(answer.lane.yaw - 0.1)) < 0.5


@pytest.mark.parametrize("told", [True, False])
def test_yaw_follows_a_robot_that_turns(told):
    estimator, random, errors = HeadingEstimator(), np.random.default_rng(5), []
    for k in range(60):
        yaw = 0.2 * math.sin(1.5 * k * STEP)
        rate = 0.3 * math.cos(1.5 * (k - 0.5) * STEP) if told else None
        lines = seen_lines(Corridor(), 0.1, yaw, random, along=0.03 * k)
        answer = estimator.update(lines, CAMERA, k * STEP, rate)
        assert answer.lane is not None
        assert answer.vanishing_points.ids[0] == 1
        errors.append(answer.lane.yaw - yaw)
    assert np.degrees(np.abs(errors)).max() < 0.5
    assert math.degrees(float(np.sqrt(np.mean(np.square(errors))))) < 0.15


def test_a_clock_that_goes_back_starts_afresh():
    estimator = HeadingEstimator()
    before = follow(estimator, Corridor(), 0.1, 0.1)[-1]
    after = follow(estimator, Corridor(), -0.3, -0.1, pictures=1)[0]
    assert after.vanishing_points.ids.min() > before.vanishing_points.ids.max()
    assert after.lane is not None
    assert after.lane.yaw == pytest.approx(-0.1, abs=0.01)
    assert after.lane.offset == pytest.approx(-0.3, abs=0.03)


def test_reset_forgets_the_lane():
    estimator = HeadingEstimator()
    follow(estimator, Corridor(), 0.1, 0.1)
    estimator.reset()
    assert estimator.update(LineSegments.empty(), CAMERA, 12 * STEP).lane is None


def test_the_same_lines_give_the_same_answer():
    first, again = (follow(HeadingEstimator(), Corridor(), 0.1, 0.1)[-1] for _ in range(2))
    assert first.lane == again.lane
    np.testing.assert_array_equal(first.vanishing_points.directions, again.vanishing_points.directions)


def test_the_primary_leads_the_list_and_the_vertical_is_up():
    points = follow(HeadingEstimator(), Corridor(), 0.0, 0.1)[-1].vanishing_points
    assert points.roles[0] == Role.PRIMARY
    vertical = points.of(Role.VERTICAL)
    assert vertical is not None
    assert abs(points.directions[vertical] @ CAMERA.optical_to_base[2]) > math.cos(math.radians(1.0))


def test_with_an_unknown_focal_length_the_yaw_is_less_sure():
    squared = []
    for seed in range(20):
        random = np.random.default_rng(seed)
        focal = 640 * random.uniform(0.6, 1.8)
        camera = Camera(focal, focal, 319.5, 239.5, 640, 480)
        yaw = random.choice([-1, 1]) * random.uniform(0.1, 0.25)
        ahead = np.array([math.sin(yaw), 0.0, math.cos(yaw)])
        lines = LineSegments.from_endpoints(lines_to(random, camera, ahead, 40))
        lane = HeadingEstimator().update(lines, Camera.uncalibrated(640, 480), 0.0).lane
        if lane is not None:
            squared.append((lane.yaw - yaw) ** 2 / lane.yaw_variance)
    assert np.median(squared) < 4.0


def test_with_an_unknown_focal_length_yaw_lean_and_offset_do_not_claim_too_much():
    of_yaw, of_lean, of_offset = [], [], []
    for seed in range(15):
        random = np.random.default_rng(seed)
        focal, pitch = 640 * random.uniform(0.6, 1.3), math.radians(random.uniform(-2, 8))
        # The camera sits far ahead of the robot's middle: a yaw that is off moves the robot sideways.
        true = Camera(focal, focal, 319.5, 239.5, 640, 480, height_m=0.6, pitch=pitch, x_m=1.0)
        told = replace(Camera.uncalibrated(640, 480), height_m=0.6, pitch=pitch, x_m=1.0)
        yaw, offset = random.uniform(-0.25, 0.25), random.uniform(-0.3, 0.3)
        answers = follow(HeadingEstimator(), Corridor(), offset, yaw, 6, seed, true, told)
        answer = next(answer for answer in reversed(answers) if answer.lane is not None)
        lane, attitude = answer.lane, answer.attitude
        assert lane is not None and attitude is not None
        of_yaw.append((lane.yaw - yaw) ** 2 / lane.yaw_variance)
        error = np.array([attitude.roll, attitude.pitch - pitch])
        of_lean.append(error @ np.linalg.solve(attitude.covariance, error) / 2.0)
        if lane.offset_known:
            of_offset.append((lane.offset - offset) ** 2 / lane.offset_variance)
    assert np.mean(of_yaw) < 2.0
    assert np.mean(of_lean) < 2.0
    assert len(of_offset) > 10
    assert np.mean(of_offset) < 2.0


def test_a_way_straight_ahead_of_a_level_camera_needs_no_focal_length():
    level = replace(CAMERA, pitch=0.0)
    sigmas = []
    for yaw in (0.0, 0.3):
        random = np.random.default_rng(1)
        ahead = np.array([math.sin(yaw), 0.0, math.cos(yaw)])
        lines = LineSegments.from_endpoints(lines_to(random, level, ahead, 40))
        lane = HeadingEstimator().update(lines, Camera.uncalibrated(640, 480), 0.0).lane
        assert lane is not None
        sigmas.append(math.degrees(math.sqrt(lane.yaw_variance)))
    assert sigmas[0] < 0.5 and sigmas[1] > 1.0
