# SPDX-License-Identifier: Apache-2.0
"""Roads that bend: their curve, the search that finds one, the filter that follows it, and what is given up."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from line_scenes import clutter
from winding_road import CAMERA, PAINT_M, WIDTH_M, Bends, seen_road

from robot_vision.geometry import Camera, GroundPlane
from robot_vision.perception import LineSegments, Role
from robot_vision.perception.road.chords import ChordReader
from robot_vision.perception.road.curve import Alignment, RoadCurve
from robot_vision.perception.road.estimate import PAINT, PITCH, ROLL, RoadEstimate
from robot_vision.perception.road.search import find_road
from robot_vision.perception.road.sequence import SEQUENCE_IDS, attitude_on, vanishing_sequence
from robot_vision.perception.road.tracker import RoadTracker

RATE = 15
ALIGNMENT = Alignment()
curvatures = st.lists(
    st.floats(-0.025, 0.025), min_size=len(ALIGNMENT.knots), max_size=len(ALIGNMENT.knots)
).map(np.array)


@given(curvatures, st.floats(0.0, 30.0), st.floats(-6.0, 6.0))
@settings(max_examples=60)
def test_a_point_beside_a_curve_has_its_foot_there(bends: np.ndarray, along: float, left: float) -> None:
    curve = RoadCurve(ALIGNMENT, bends)
    heading = curve.heading([along])
    normal = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    feet = curve.feet(curve.points([along]) + left * normal)
    assert feet.left[0] == pytest.approx(left, abs=0.02)
    assert feet.along[0] == pytest.approx(along, abs=0.15)


@given(curvatures, st.floats(1.0, 30.0), st.floats(-3.0, 3.0), st.integers(0, len(ALIGNMENT.knots) - 1))
@settings(max_examples=60)
def test_slopes_tell_how_a_point_moves_when_the_road_bends_more(
    bends: np.ndarray, along: float, left: float, knot: int
) -> None:
    curve = RoadCurve(ALIGNMENT, bends)
    point = curve.points([along]) + [[0.0, left]]
    step = 1e-4
    more, less = bends.copy(), bends.copy()
    more[knot] += step
    less[knot] -= step
    moved = RoadCurve(ALIGNMENT, more).feet(point).left - RoadCurve(ALIGNMENT, less).feet(point).left
    slope = curve.feet(point).bending[0, knot]
    assert slope == pytest.approx(float(moved[0]) / (2.0 * step), rel=0.05, abs=1.0)


def test_an_arc_is_a_circle() -> None:
    curve = RoadCurve(ALIGNMENT, np.full(len(ALIGNMENT.knots), 0.02))
    points = curve.points(np.arange(0.0, 36.0, 2.0))
    np.testing.assert_allclose(np.hypot(points[:, 0], points[:, 1] - 50.0), 50.0, atol=5e-3)


def test_chords_are_the_ground_under_the_segments() -> None:
    lines = seen_road(Bends(), 20.0, 0.5, 0.05, np.random.default_rng(1), noise=0.0, others=0)
    camera = replace(CAMERA, roll=0.01, pitch=0.07)
    chords = ChordReader(lines, camera, 200.0).read(camera.roll, camera.pitch)
    ends = lines.endpoints[chords.index].reshape(-1, 2)
    np.testing.assert_allclose(chords.points.reshape(-1, 2), GroundPlane(camera).from_pixels(ends), atol=1e-6)


def test_a_search_finds_the_road_and_seldom_one_of_its_lanes() -> None:
    """In one picture: where a border is out of sight, the nearest lane may pass for the road."""
    right = 0
    for seed in range(20):
        random = np.random.default_rng(seed)
        offset, yaw = random.uniform(-1.5, 1.5), random.uniform(-0.1, 0.1)
        lines = seen_road(Bends(), random.uniform(5.0, 100.0), offset, yaw, random)
        found = find_road(ChordReader(lines, CAMERA, 20.0).read(0.0, CAMERA.pitch), 1.0, 12.0, 15.0)
        assert found is not None
        right += abs(found.width - WIDTH_M) < 0.5 and abs(found.offset - offset) < 0.4
    assert right >= 18


@dataclass
class Drive:
    """Along a road at an even speed, weaving, the body leaning."""

    bends: Bends
    speed: float = 6.0
    seed: int = 0
    odometry: bool = True
    camera: Camera = CAMERA

    def answers(self, tracker: RoadTracker, pictures: int) -> list[tuple[RoadEstimate | None, np.ndarray]]:
        """The answer to each picture, and what is true: offset, yaw, curvature, roll, pitch."""
        random = np.random.default_rng(self.seed)
        found, before = [], None
        for picture in range(pictures):
            time = picture / RATE
            along = 5.0 + self.speed * time
            offset = 0.8 * math.sin(0.1 * along) - 0.5
            yaw = math.atan(0.08 * math.cos(0.1 * along))
            roll, lean = 0.01 * math.sin(3.0 * time), 0.015 * math.sin(5.0 * time)
            seen_by = replace(self.camera, roll=roll, pitch=self.camera.pitch + lean)
            lines = seen_road(self.bends, along, offset, yaw, random, seen_by)
            course = self.bends.sharpest * self.bends.wavelength / (2.0 * np.pi)
            heading = course * (1.0 - math.cos(2.0 * np.pi * along / self.bends.wavelength)) + yaw
            turn_rate = None if before is None else (heading - before) * RATE
            before = heading
            told = (self.speed, turn_rate) if self.odometry else (None, None)
            answer = tracker.update(lines, self.camera, time, *told)
            found.append((answer, np.array([offset, yaw, self.bends.curvature(along), roll, seen_by.pitch])))
        return found


def errors_of(answers: list[tuple[RoadEstimate | None, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """(N, 5) errors and (N, 5) what they should be (standard deviations) of the answers there are."""
    errors, sigmas = [], []
    for answer, truth in answers:
        if answer is None:
            continue
        said = [answer.offset, answer.yaw, answer.curvature, answer.state[ROLL], answer.state[PITCH]]
        errors.append(np.array(said) - truth)
        own = np.sqrt(np.diag(answer.covariance))
        sigmas.append(own[[0, 1, PAINT + 1, ROLL, PITCH]])
    return np.array(errors), np.array(sigmas)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_winding_road_is_followed(seed: int) -> None:
    answers = Drive(Bends(), seed=seed).answers(RoadTracker(), 90)
    assert sum(answer is None for answer, _ in answers) <= 4
    errors, sigmas = errors_of(answers[20:])
    rms = np.sqrt(np.mean(errors**2, axis=0))
    assert rms[0] < 0.05
    assert math.degrees(rms[1]) < 0.5
    assert rms[2] < 0.1 * 2.0 * 0.02
    assert math.degrees(rms[3]) < 0.5
    assert math.degrees(rms[4]) < 0.2
    assert np.all(np.mean((errors / sigmas) ** 2, axis=0) < 3.0)


def test_without_odometry_it_is_followed_all_the_same() -> None:
    answers = Drive(Bends(), seed=3, odometry=False).answers(RoadTracker(), 90)
    assert sum(answer is None for answer, _ in answers) <= 8
    errors, _ = errors_of(answers[20:])
    assert math.degrees(np.sqrt(np.mean(errors[:, 1] ** 2))) < 3.0
    assert np.sqrt(np.mean(errors[:, 0] ** 2)) < 0.2


def test_the_same_pictures_give_the_same_road() -> None:
    first, again = (Drive(Bends(), seed=4).answers(RoadTracker(), 20) for _ in range(2))
    assert first[-1][0] is not None and again[-1][0] is not None
    np.testing.assert_array_equal(first[-1][0].state, again[-1][0].state)


def followed(pictures: int = 30) -> RoadEstimate:
    answer = Drive(Bends(), seed=5).answers(RoadTracker(), pictures)[-1][0]
    assert answer is not None
    return answer


def test_the_path_begins_beside_the_robot_and_leads_along_the_road() -> None:
    road = followed()
    path = road.path(np.arange(0.0, 20.0, 0.5))
    assert path[0] == pytest.approx([math.sin(road.yaw) * -road.offset, -math.cos(road.yaw) * road.offset])
    bearing, _ = road.bearings([10.0])
    step = path[21] - path[19]
    assert math.atan2(step[1], step[0]) == pytest.approx(float(bearing[0]), abs=1e-3)


def test_the_sequence_moves_along_the_vanishing_line() -> None:
    road = followed()
    points = vanishing_sequence(road, CAMERA, 500)
    assert len(points) >= 2
    assert points.roles[0] == Role.PRIMARY
    assert tuple(points.ids) == SEQUENCE_IDS[: len(points)]
    leaning = replace(CAMERA, roll=float(road.state[ROLL]), pitch=float(road.state[PITCH]))
    a, b, c = GroundPlane(leaning).horizon
    u, v = points.pixels.T
    np.testing.assert_allclose(a * u + b * v + c, 0.0, atol=1e-6)
    azimuth = np.arctan2(*(points.directions @ leaning.optical_to_base.T).T[[1, 0]])
    np.testing.assert_allclose(azimuth, road.bearings([5.0, 15.0, 30.0][: len(points)])[0], atol=1e-9)
    # The covariance of a direction: how it scatters when the road is what its own covariance allows.
    random = np.random.default_rng(0)
    drawn = random.multivariate_normal(road.state, road.covariance, 3000)
    moved = [
        vanishing_sequence(replace(road, state=state), CAMERA, 500).directions[0] for state in drawn[:800]
    ]
    spread = np.sqrt(np.trace(np.cov(np.array(moved).T)))
    assert spread == pytest.approx(np.sqrt(np.trace(points.covariance[0])), rel=0.15)
    assert attitude_on(road, CAMERA).pitch == road.state[PITCH]


def test_what_is_no_road_is_none() -> None:
    tracker = RoadTracker()
    random = np.random.default_rng(7)
    for picture in range(20):
        lines = LineSegments.from_endpoints(clutter(random, 60))
        assert tracker.update(lines, CAMERA, picture / RATE) is None
    assert tracker.update(LineSegments.empty(), CAMERA, 2.0) is None


def test_a_road_out_of_sight_is_not_said_and_found_again() -> None:
    tracker = RoadTracker()
    drive = Drive(Bends(), seed=8)
    assert drive.answers(tracker, 20)[-1][0] is not None
    for picture in range(20, 40):
        assert tracker.update(LineSegments.empty(), CAMERA, picture / RATE) is None
    again = [answer for answer, _ in drive.answers(tracker, 20)]  # whose stamps begin anew
    assert again[-1] is not None


@pytest.mark.parametrize("camera", [replace(CAMERA, height_m=None), Camera.uncalibrated(640, 480)])
def test_a_camera_that_cannot_measure_is_refused(camera: Camera) -> None:
    with pytest.raises(ValueError, match="height"):
        RoadTracker().update(LineSegments.empty(), camera, 0.0)


@pytest.mark.parametrize(
    "setting", [{"narrowest": 0.0}, {"lean": math.nan}, {"confirmations": 0}, {"patience": -1.0}]
)
def test_settings_without_meaning_are_refused(setting: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(setting))):
        RoadTracker(**setting)  # type: ignore[arg-type]


def test_paint_is_as_wide_as_it_is() -> None:
    assert followed().state[PAINT] == pytest.approx(PAINT_M / 2.0, abs=0.01)
