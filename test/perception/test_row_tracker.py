# SPDX-License-Identifier: Apache-2.0
"""Rows are followed from picture to picture, and where a picture shows none, nothing wrong is said."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from drawn_fields import CAMERA, Picture, Sown, drawn

from bench.sources import ROOT
from robot_vision.bags import BagReader, decode
from robot_vision.bags.messages import stamp_ns, yaw_of
from robot_vision.geometry import Camera
from robot_vision.perception.crop_rows.ground_fit import GroundFit, RowsOnGround
from robot_vision.perception.crop_rows.overlay import draw_rows
from robot_vision.perception.crop_rows.row_filter import Motion
from robot_vision.perception.crop_rows.tracker import RowEstimate, RowTracker
from robot_vision.perception.odometry import MotionHistory

FIELD = ROOT / "bags" / "field.mcap"
STEP = Motion(0.1, 1.5, 0.0)


def along(tracker: RowTracker, sown: Sown, pictures: int, seed: int = 0) -> list[RowEstimate]:
    """Drive straight on along rows, a picture every 0.15 m, each with plants of its own."""
    said = []
    for number in range(pictures):
        ahead = replace(
            sown,
            end=sown.end - 0.15 * number,
            gap=(sown.gap[0] - 0.15 * number, sown.gap[1] - 0.15 * number),
        )
        said.append(tracker.update(drawn(ahead, seed=seed + number), CAMERA, STEP if number else Motion(0.0)))
    return said


def test_rows_are_followed_and_offset_and_yaw_are_right() -> None:
    said = along(RowTracker(0.5), Sown(offset=-0.04, weeds=1.0), 6)
    lane = said[-1].lane
    assert lane is not None
    assert said[-1].seen
    assert said[-1].end is None
    assert lane.offset == pytest.approx(-0.04, abs=0.012)
    assert lane.yaw == pytest.approx(0.0, abs=math.radians(0.4))
    assert lane.curvature == pytest.approx(0.0, abs=0.003)


def test_the_row_followed_is_the_one_nearest_to_the_robot() -> None:
    (first,) = along(RowTracker(0.5), Sown(offset=0.45, missing=0.0), 1)
    assert first.lane is not None
    assert first.lane.offset == pytest.approx(-0.05, abs=0.02)


def test_the_end_of_the_rows_is_told_and_a_gap_is_driven_through() -> None:
    ends = [estimate.end for estimate in along(RowTracker(0.5), Sown(end=4.0), 4)]
    assert ends[-1] == pytest.approx(4.0 - 0.45, abs=0.5)
    tracker = RowTracker(0.5)
    through = along(tracker, Sown(gap=(2.5, 5.5)), 26)
    assert all(estimate.end is None for estimate in through)
    assert all(estimate.lane is not None for estimate in through)
    assert abs(through[-1].lane.offset) < 0.03  # type: ignore[union-attr]


def test_an_end_that_is_far_ahead_is_told_once_the_robot_is_nearer_or_to_who_asks_for_it() -> None:
    near, far = (
        [estimate.end for estimate in along(RowTracker(0.5, end_within=within), Sown(end=5.5), 15)]
        for within in (4.0, 8.0)
    )
    truth = 5.5 - 0.15 * np.arange(15)
    assert far[3] == pytest.approx(truth[3], abs=0.5)
    told = np.array([math.nan if end is None else end for end in near])
    assert np.isnan(told[truth > 4.5]).all()
    assert np.isfinite(told[-1])
    assert np.nanmax(told) <= 4.0
    assert np.nanmax(np.abs(told - truth)) < 0.5


def test_rows_that_lie_elsewhere_are_refused_at_first_and_believed_once_they_go_on_so() -> None:
    tracker = RowTracker(0.5)
    began = along(tracker, Sown(offset=-0.09), 5)[-1].lane
    later = along(tracker, Sown(offset=0.0), 16, seed=50)
    assert began is not None
    assert began.offset == pytest.approx(-0.09, abs=0.02)
    assert not later[0].seen
    assert later[0].lane is not None  # carried on, as one picture may be wrong
    assert later[0].lane.offset == pytest.approx(-0.09, abs=0.03)
    assert later[-1].seen
    assert later[-1].lane is not None
    assert later[-1].lane.offset == pytest.approx(0.0, abs=0.015)


def test_without_odometry_the_end_is_told_by_one_picture() -> None:
    tracker = RowTracker(0.5)
    for seed in range(2):
        estimate = tracker.update(drawn(Sown(end=3.5), seed=seed), CAMERA, Motion(0.1 * seed))
    assert estimate.end == pytest.approx(3.5, abs=0.5)


def flared(picture: Picture) -> Picture:
    v, u = np.indices(picture.shape[:2])
    glare = 700.0 * np.exp(-((u - 320.0) ** 2 + (v - 150.0) ** 2) / 2.0 / 200.0**2)
    return np.clip(picture + glare[..., None], 0, 255).astype(np.uint8)


def night(picture: Picture) -> Picture:
    noise = np.random.default_rng(0).normal(0.0, 2.0, picture.shape)
    return np.clip(0.04 * picture + noise, 0, 255).astype(np.uint8)


@pytest.mark.parametrize(
    ("spoilt", "words"),
    [
        (lambda _: drawn(Sown(missing=1.0)), "grows"),
        (night, "dark"),
        (flared, "overexposed"),
        (lambda picture: np.zeros_like(picture), "dark"),
    ],
)
def test_a_picture_without_rows_is_no_answer_and_says_why(spoilt, words: str) -> None:  # type: ignore[no-untyped-def]
    picture = spoilt(drawn(Sown()))
    fresh = RowTracker(0.5).update(picture, CAMERA, Motion(0.0))
    assert fresh.lane is None
    assert words in fresh.reason
    known = RowTracker(0.5)
    along(known, Sown(), 2)
    after = known.update(picture, CAMERA, STEP)
    assert not after.seen
    assert words in after.reason
    assert after.lane is None or words == "grows"


def test_open_ground_is_crossed_as_far_as_a_gap_may_be_long_and_no_farther() -> None:
    tracker = RowTracker(0.5)
    along(tracker, Sown(), 2)
    bare = drawn(Sown(missing=1.0))
    lanes = [tracker.update(bare, CAMERA, STEP).lane for _ in range(40)]
    driven = sum(lane is not None for lane in lanes) * 0.15
    assert 3.0 < driven <= tracker.extent.gap + 0.15
    assert lanes[-1] is None


@pytest.mark.parametrize("factor", [0.85, 1.15])
def test_a_wrong_spacing_is_told_not_believed(factor: float) -> None:
    said = along(RowTracker(0.5 * factor), Sown(missing=0.05), 3)
    assert all(estimate.lane is None for estimate in said)
    assert any("apart" in estimate.reason or "rows" in estimate.reason for estimate in said)


@pytest.mark.parametrize(("roll", "pitch"), [(0.035, 0.0), (0.0, 0.035), (0.0, -0.035)])
def test_a_camera_knocked_by_two_degrees_measures_on(roll: float, pitch: float) -> None:
    tracker = RowTracker(0.5)
    for seed in range(4):
        picture = drawn(Sown(offset=0.05), seed=seed, roll=roll, pitch=pitch)
        estimate = tracker.update(picture, CAMERA, Motion(0.1 * bool(seed), 1.5, 0.0))
    assert estimate.lane is not None
    assert estimate.lane.offset == pytest.approx(0.05, abs=0.02)


def test_nothing_begins_with_rows_that_single_plants_contradict_and_it_is_said(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    right = GroundFit.fit

    def astray(self: GroundFit, *args: Any) -> RowsOnGround:
        rows = right(self, *args)
        assert rows is not None
        return replace(rows, values=rows.values + np.array([0.0, 0.15, 0.0, 0.0, 0.0, 0.0]))

    picture = drawn(Sown(), seed=1)
    believed = RowTracker(0.5).update(picture, CAMERA, Motion(0.0))
    assert believed.reason == ""
    monkeypatch.setattr(GroundFit, "fit", astray)
    doubted = RowTracker(0.5).update(picture, CAMERA, Motion(0.0))
    assert "single plants say the robot heads -9 degrees off" in doubted.reason
    assert believed.lane is not None
    assert doubted.lane is None


def test_leaves_that_close_upon_each_other_are_no_open_ground() -> None:
    """Where the crop closes, rows are told by the bare ground between; a stretch without any does not part them."""
    field = drawn(Sown(offset=-0.04, radius=0.2, step=0.3))
    far, near = (int(CAMERA.pixels(point)[0, 1]) for point in ahead_of(CAMERA, (5.0, 2.6)))
    field[far:near] = drawn(Sown(radius=0.4))[far:near]
    estimate = RowTracker(0.5).update(field, CAMERA, Motion(0.0))
    assert estimate.lane is not None
    assert estimate.lane.offset == pytest.approx(-0.04, abs=0.02)
    assert math.sqrt(estimate.lane.yaw_variance) < math.radians(1.0)


def ahead_of(camera: Camera, distances: tuple[float, ...]) -> list[np.ndarray]:
    """Ground points (1, 3) straight ahead of the camera in its optical frame, m."""
    eye = np.array([camera.x_m, 0.0, camera.height_m])
    return [(np.array([[x, 0.0, 0.0]]) - eye) @ camera.optical_to_base for x in distances]


def test_scattered_weeds_are_no_rows() -> None:
    weeds = drawn(Sown(missing=0.97))
    random = np.random.default_rng(3)
    for _ in range(200):
        place = tuple(random.integers((0, 0), (640, 480)).tolist())
        cv2.circle(weeds, place, int(random.integers(3, 10)), (60, 150, 80), -1)
    estimate = RowTracker(0.5).update(weeds, CAMERA, Motion(0.0))
    assert estimate.lane is None


def test_a_camera_of_unknown_height_is_refused() -> None:
    with pytest.raises(ValueError, match=r"camera\.height"):
        RowTracker(0.5).update(drawn(Sown()), Camera(460.0, 460.0, 319.5, 239.5, 640, 480), Motion(0.0))
    for name, value in (("spacing", 0.0), ("coherence", 1.0), ("cover", -0.1)):
        with pytest.raises(ValueError, match=name):
            RowTracker(**{"spacing": 0.5, name: value})


def test_the_overlay_draws_upon_the_picture_and_says_what_is_missing() -> None:
    tracker = RowTracker(0.5)
    picture = drawn(Sown())
    estimate = tracker.update(picture, CAMERA, Motion(0.0))
    assert (draw_rows(picture.copy(), CAMERA, estimate) != picture).any(axis=2).sum() > 2000
    nothing = RowEstimate(None, "the picture is dark", False, None, None)
    assert (draw_rows(picture.copy(), CAMERA, nothing) != picture).any()


def test_the_recorded_field_is_followed_within_a_centimetre() -> None:
    errors, normalised = followed(FIELD)
    rms = np.sqrt(np.mean(errors**2, axis=0))
    assert rms[0] <= 0.010
    assert rms[1] <= math.radians(0.5)
    assert (np.mean(normalised, axis=0) < 3.0).all()
    assert (np.mean(normalised, axis=0) > 0.1).all()


def followed(bag) -> tuple[np.ndarray, np.ndarray]:  # type: ignore[no-untyped-def]
    """Errors (N, 2) of offset (m) and yaw (rad) in a recorded field, and the same squared over their variances."""
    history, tracker = MotionHistory(), RowTracker(0.5)
    truths, said, last = {}, {}, None
    for message in BagReader(bag).messages(["odom", "image/compressed", "truth/heading"]):
        content = decode(message.cdr, message.type_name)
        stamp = 1e-9 * stamp_ns(content)
        if message.topic == "/odom":
            history.add(stamp, content.twist.twist.linear.x, content.twist.twist.angular.z)
        elif message.topic == "/truth/heading":
            pose = content.pose.pose
            truths[stamp] = pose.position.y, yaw_of(pose.orientation)
        else:
            picture = cv2.imdecode(np.frombuffer(bytes(content.data), np.uint8), cv2.IMREAD_COLOR)
            motion = Motion(0.0) if last is None else Motion(stamp - last, *history.mean(last, stamp))
            last = stamp
            said[stamp] = tracker.update(np.asarray(picture), CAMERA, motion).lane
    lanes = [(lane, truths[stamp]) for stamp, lane in said.items() if lane is not None]
    assert len(lanes) > 0.95 * len(truths)
    errors = np.array([(lane.offset - truth[0], lane.yaw - truth[1]) for lane, truth in lanes])
    variances = np.array([(lane.offset_variance, lane.yaw_variance) for lane, _ in lanes])
    return errors, errors**2 / variances
