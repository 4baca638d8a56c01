# SPDX-License-Identifier: Apache-2.0
"""Where to look next: round the bend, where a lost way may be, into a turn; within limits and without swinging."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from winding_road import CAMERA

from robot_vision.geometry import Camera
from robot_vision.perception.gaze import Gaze, GazePlanner
from robot_vision.perception.gaze.bearings import BEARINGS, LostWay, SeenFloor, turned
from robot_vision.perception.gaze.expected import WayBelief, expected_gain
from robot_vision.perception.lane import LaneHeading
from robot_vision.perception.road.curve import Alignment
from robot_vision.perception.road.estimate import BENDS, PITCH, WIDTH, YAW, RoadEstimate

NARROW = replace(CAMERA, fx=686.0, fy=686.0)
ALIGNMENT = Alignment()
LANE = LaneHeading(0.0, 1e-5, 0.0, 1e-4, 2.0)
RATE = 15


def road(curvature: float, yaw: float = 0.0, sigma: float = 0.004) -> RoadEstimate:
    """An arc, known nearby and less and less farther off."""
    state = np.zeros(BENDS + len(ALIGNMENT.knots))
    state[[WIDTH, YAW, PITCH]], state[BENDS:] = (5.0, yaw, CAMERA.pitch), curvature
    variance = np.full(len(state), sigma**2) * np.linspace(0.2, 2.0, len(state))
    variance[:BENDS] = [0.01, 1e-5, 0.01, 1e-5, 1e-5, 1e-6]
    nothing = np.zeros(0)
    return RoadEstimate(state, np.diag(variance), ALIGNMENT, 30.0, nothing.astype(np.intp), nothing)


def follow(planner: GazePlanner, pictures: int, camera: Camera = NARROW, **told: object) -> list[Gaze]:
    """Answers while the head obeys at once."""
    answers, pan = [], 0.0
    for k in range(pictures):
        way = {"lane": None, "road": None, "speed": 5.0, "turn_rate": 0.0, **told}
        gaze = planner.update(camera=replace(camera, pan=pan), stamp_s=k / RATE, **way)  # type: ignore[arg-type]
        assert gaze is not None
        answers.append(gaze)
        pan = gaze.pan
    return answers


def on(bend: RoadEstimate, **told: object) -> dict[str, object]:
    return {"road": bend, "lane": bend.lane, **told}


def test_on_a_straight_way_it_looks_ahead() -> None:
    for way in (on(road(0.0)), {"lane": LANE, "speed": 1.0}):
        answers = follow(GazePlanner(), 20, **way)
        assert max(abs(answer.pan) for answer in answers) < math.radians(5.0)
        assert answers[-1].reason == "ahead"


@pytest.mark.parametrize("side", [1, -1])
def test_it_looks_round_a_bend(side: int) -> None:
    last = follow(GazePlanner(), 20, **on(road(side * 0.06), turn_rate=side * 0.2))[-1]
    assert math.radians(5.0) < side * last.pan < math.radians(45.0)
    assert last.reason in ("bend", "floor", "turn")
    assert side * last.point[1] > 0.0


def test_a_wide_lens_that_sees_the_bend_stays_ahead() -> None:
    wide = replace(CAMERA, fx=330.0, fy=330.0)
    assert abs(follow(GazePlanner(), 20, wide, **on(road(0.03)))[-1].pan) < math.radians(9.0)


def test_the_point_lies_on_the_axis_of_the_lens_with_the_tilt_at_rest() -> None:
    steep = replace(CAMERA, pitch=0.2, x_m=0.4)
    for gaze in follow(GazePlanner(), 15, steep, **on(road(0.06), turn_rate=0.2)):
        looks = replace(steep, pan=gaze.pan)
        ray = looks.optical_to_base[:, 2]
        away = gaze.point - [steep.x_m, 0.0, steep.height_m]
        np.testing.assert_allclose(away / np.linalg.norm(away), ray, atol=1e-9)
        assert gaze.point[2] == pytest.approx(0.0, abs=1e-9)


def test_what_a_picture_would_tell_is_what_a_filter_makes_of_it() -> None:
    """More in view tells more, and nothing in view tells nothing."""
    way, pans = WayBelief.of_road(road(0.05)), np.radians([0.0, 15.0, 170.0])
    ahead, round_the_bend, behind = expected_gain(way, NARROW, pans, 15.0, 0.4, 5.0, 0.2).mean(axis=1)
    assert round_the_bend > ahead >= 0.0
    assert behind == pytest.approx(0.0, abs=1e-12)
    surer = replace(way, covariance=way.covariance.copy())
    surer.covariance[YAW, YAW] /= 100.0
    surer.covariance[BENDS:, BENDS:] /= 100.0
    assert expected_gain(surer, NARROW, pans, 15.0, 0.4, 5.0, 0.2)[1].mean() < round_the_bend


def test_a_lost_way_is_looked_for_where_it_was_and_then_elsewhere() -> None:
    planner = GazePlanner()
    follow(planner, 5, **on(road(-0.06), turn_rate=-0.3))
    pans, pan = [], -0.1
    for k in range(5, 95):
        gaze = planner.update(None, None, replace(NARROW, pan=pan), k / RATE, 0.0, 0.0)
        assert gaze is not None and gaze.reason == "lost"
        pan = gaze.pan
        pans.append(pan)
    assert min(pans[:10]) < -math.radians(5.0)
    assert max(pans) > math.radians(15.0)
    # What is found is looked at again
    follow(planner, 5, **on(road(0.0)))


def test_the_robots_own_turn_carries_the_belief() -> None:
    lost = LostWay()
    lost.seen(np.array([0.3]), np.array([0.05]))
    for _ in range(15):
        lost.unseen(math.pi, 0.3, 1 / RATE, 0.8 / 15)
    assert BEARINGS[np.argmax(lost.belief)] == pytest.approx(0.3 - 0.8, abs=0.05)
    assert lost.belief.sum() == pytest.approx(1.0)
    ring = np.random.default_rng(0).random(len(BEARINGS))
    np.testing.assert_allclose(turned(turned(ring, 0.7), -0.7).sum(), ring.sum())


def test_floor_seen_of_late_is_no_news() -> None:
    floor, pans = SeenFloor(), np.array([0.0, 1.0])
    floor.look(0.0, 0.4, 0.1, 0.0)
    ahead, aside = floor.news(np.array([0.1]), pans, 0.4)
    assert (ahead, aside) == (0.0, 0.0)
    assert floor.news(np.array([1.1]), pans, 0.4)[1] == 1.0
    for _ in range(30):
        floor.look(1.0, 0.4, 0.1, 0.0)
    assert floor.news(np.array([0.1]), pans, 0.4)[0] > 0.8


def test_a_robot_that_turns_on_the_spot_looks_where_it_turns_to() -> None:
    last = follow(GazePlanner(), 15, lane=LANE, speed=0.0, turn_rate=0.9)[-1]
    assert last.pan > math.radians(15.0)
    assert last.reason == "turn"


def test_it_turns_no_faster_and_no_farther_than_it_may() -> None:
    planner = GazePlanner(most_pan=0.2, rate=0.5)
    pans = [answer.pan for answer in follow(planner, 20, lane=LANE, speed=0.0, turn_rate=1.5)]
    assert max(np.abs(pans)) <= 0.2 + 1e-12
    assert np.abs(np.diff(pans)).max() <= 0.5 / RATE + 1e-12


def test_what_is_told_unsteadily_does_not_swing_the_head() -> None:
    random, planner, pans = np.random.default_rng(2), GazePlanner(), []
    for k in range(90):
        bend = road(0.05 + random.normal(0.0, 0.002), random.normal(0.0, 0.005))
        pan = pans[-1] if pans else 0.0
        gaze = planner.update(bend.lane, bend, replace(NARROW, pan=pan), k / RATE, 5.0, 0.25)
        assert gaze is not None
        pans.append(gaze.pan)
    ways = np.sign(np.diff(pans[15:]))
    assert np.count_nonzero(np.diff(ways[ways != 0.0])) <= 6


def test_the_same_words_give_the_same_looks() -> None:
    first, again = (follow(GazePlanner(), 20, **on(road(0.05), turn_rate=0.2)) for _ in range(2))
    assert [gaze.pan for gaze in first] == [gaze.pan for gaze in again]


def test_without_height_or_focal_length_it_says_nothing() -> None:
    for camera in (replace(CAMERA, height_m=None), Camera.uncalibrated(640, 480)):
        assert GazePlanner().update(LANE, None, camera, 0.0) is None


@pytest.mark.parametrize("name", ["most_pan", "rate", "ahead"])
def test_settings_without_meaning_are_refused(name: str) -> None:
    for value in (0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match=name):
            GazePlanner(**{name: value})


def test_a_leap_in_time_starts_anew() -> None:
    planner = GazePlanner()
    follow(planner, 20, **on(road(0.06), turn_rate=0.2))
    gaze = planner.update(LANE, None, CAMERA, 500.0)
    assert gaze is not None and gaze.pan == 0.0
