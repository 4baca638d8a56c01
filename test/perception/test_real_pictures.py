# SPDX-License-Identifier: Apache-2.0
"""Real pictures and the recorded corridor, in one process without ROS, against the marks to reach."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

import cv2
import numpy as np
import pytest

from bench import directions as scores
from bench.azimuth import azimuth, score_azimuths, travel_azimuths
from bench.sources import (
    CORRIDOR,
    MissingSetError,
    kitti_straight,
    read_picture,
    york_urban,
)
from bench.york import Scores, evaluate, ours
from robot_vision.bags import BagReader, decode
from robot_vision.bags.messages import stamp_ns, yaw_of
from robot_vision.bags.trajectory import read_poses
from robot_vision.geometry import Camera
from robot_vision.geometry.sphere import angle_between, local_coordinates
from robot_vision.perception import (
    HeadingEstimate,
    HeadingEstimator,
    LineDetector,
    Role,
    VanishingPointEstimator,
)
from robot_vision.perception.odometry import RateHistory

Set = TypeVar("Set")


def present(find: Callable[[], Set]) -> Set:
    """The set of pictures; without it the test is skipped, by name and aloud."""
    try:
        return find()
    except MissingSetError as missing:
        pytest.skip(str(missing))


@pytest.fixture(scope="module")
def york() -> dict[str, Scores]:
    camera, pictures = present(york_urban)
    blind = Camera.uncalibrated(camera.width, camera.height)
    find = LineDetector().detect
    return evaluate(pictures, camera, {"calibrated": ours(find, camera), "withheld": ours(find, blind)})


def test_york_urban_directions(york: dict[str, Scores]) -> None:
    said = york["calibrated"]
    assert scores.area_under_recall(said.directions, 10.0) >= 92.0
    assert scores.area_under_recall(said.directions, 3.0) >= 74.0
    assert np.median(said.rotation) <= 0.7


def test_york_urban_way_ahead(york: dict[str, Scores]) -> None:
    assert scores.share_within(york["calibrated"].forward, 1.0) >= 80.0
    assert scores.share_within(york["calibrated"].forward, 5.0) == 100.0


def test_york_urban_horizon(york: dict[str, Scores]) -> None:
    assert scores.area_under_recall(york["calibrated"].horizon, scores.HORIZON_CUT) >= 96.5


def test_york_urban_without_a_focal_length(york: dict[str, Scores]) -> None:
    said = york["withheld"]
    assert scores.area_under_recall(said.horizon, scores.HORIZON_CUT) >= 96.0
    assert np.median(said.focal) <= 0.04


def test_both_halves_of_the_lines_agree_as_well_as_they_claim() -> None:
    camera, pictures = present(york_urban)
    detector, estimator = LineDetector(), VanishingPointEstimator()
    random = np.random.default_rng(0)
    distances = []
    for picture in pictures:
        lines = detector.detect(picture.gray())
        chosen = random.random(len(lines)) < 0.5
        one, other = estimator.estimate(lines[chosen], camera), estimator.estimate(lines[~chosen], camera)
        for k, direction in enumerate(one.directions):
            away = angle_between(other.directions, direction)
            if away.min(initial=math.pi) < math.radians(5.0):
                j = int(away.argmin())
                offset = local_coordinates(direction, other.directions[j])
                both = one.covariance[k] + other.covariance[j]
                distances.append(float(offset @ np.linalg.solve(both, offset)))
    assert len(distances) > 100
    # The median of a squared distance with two degrees of freedom is 1.39.
    assert 0.5 < np.median(distances) < 2.5


def kitti_answers(with_odometry: bool) -> tuple[Any, float]:
    """Scores of the azimuths, and the share of pictures whose lead has the id of the first."""
    folder = present(kitti_straight)
    poses = read_poses(folder / "poses.txt")
    paths = sorted((folder / "image_l").glob("*.png"))
    first = np.array((folder / "calib.txt").read_text().splitlines()[0].split(":")[-1].split(), float)
    projection = first.reshape(3, -1)[:, :3]
    detector, estimator, said, ids = LineDetector(), HeadingEstimator(), [], []
    for k, path in enumerate(paths):
        gray = read_picture(path, cv2.IMREAD_GRAYSCALE)
        height, width = gray.shape
        camera = Camera(projection[0, 0], projection[1, 1], projection[0, 2], projection[1, 2], width, height)
        rate = None
        if with_odometry and k:
            turn = poses[k - 1, :3, :3].T @ poses[k, :3, :3]
            rate = -math.atan2(turn[0, 2], turn[2, 2]) / 0.1
        points = estimator.update(detector.detect(gray), camera, 0.1 * k, rate).vanishing_points
        lead = points.of(Role.PRIMARY)
        said.append(math.nan if lead is None else azimuth(points.directions[lead]))
        ids.append(None if lead is None else int(points.ids[lead]))
    return score_azimuths(np.array(said), travel_azimuths(poses)), float(np.mean([i == ids[0] for i in ids]))


@pytest.mark.parametrize("with_odometry", [True, False], ids=["odometry", "alone"])
def test_kitti_straight_road(with_odometry: bool) -> None:
    score, same = kitti_answers(with_odometry)
    assert score.median <= 0.3
    assert score.worst <= 2.0
    assert score.jitter <= 0.15
    assert score.missing <= 2.0
    assert same >= 0.98


Followed = list[tuple[int, HeadingEstimate]]


@pytest.fixture(scope="module", params=[True, False], ids=["odometry", "alone"])
def corridor(request: pytest.FixtureRequest) -> tuple[Followed, dict[int, tuple[float, float]]]:
    """Answers of the recorded corridor by stamp, and the truth: yaw (rad) and offset (m)."""
    detector, estimator, rates = LineDetector(), HeadingEstimator(), RateHistory()
    camera: Camera | None = None
    truth: dict[int, tuple[float, float]] = {}
    answers: Followed = []
    before: float | None = None
    pictures: list[Any] = []
    for message in BagReader(CORRIDOR).messages():
        told = decode(message.cdr, message.type_name)
        if message.topic == "/camera_info":
            camera = Camera.from_camera_info(told, height_m=0.6, pitch=0.0873)
        elif message.topic == "/odom" and request.param:
            rates.add(1e-9 * stamp_ns(told), told.twist.twist.angular.z)
        elif message.topic == "/truth/heading":
            truth[stamp_ns(told)] = (yaw_of(told.pose.pose.orientation), told.pose.pose.position.y)
        elif message.topic == "/image/compressed":
            pictures.append(told)
        # A picture is looked at once what came with it has been heard.
        while pictures and camera is not None and stamp_ns(pictures[0]) in truth:
            picture = pictures.pop(0)
            now = 1e-9 * stamp_ns(picture)
            rate = rates.mean(now if before is None else before, now)
            before = now
            gray = np.asarray(cv2.imdecode(picture.data, cv2.IMREAD_GRAYSCALE), np.uint8)
            answers.append((stamp_ns(picture), estimator.update(detector.detect(gray), camera, now, rate)))
    return answers, truth


def test_recorded_corridor(corridor: tuple[Followed, dict[int, tuple[float, float]]]) -> None:
    answers, truth = corridor
    assert len(answers) == len(truth) == 225
    lanes = [(answer.lane, *truth[stamp]) for stamp, answer in answers if answer.lane is not None]
    assert len(lanes) >= 0.98 * len(truth)
    yaw = np.array([lane.yaw - true for lane, true, _ in lanes])
    of_yaw = np.array([lane.yaw_variance for lane, _, _ in lanes])
    assert np.degrees(np.sqrt(np.mean(yaw**2))) <= 0.3
    assert 0.2 < np.mean(yaw**2 / of_yaw) < 4.0
    placed = [(lane, true) for lane, _, true in lanes if lane.offset_known]
    assert len(placed) >= 0.9 * len(lanes)
    offset = np.array([lane.offset - true for lane, true in placed])
    of_offset = np.array([lane.offset_variance for lane, _ in placed])
    assert np.sqrt(np.mean(offset**2)) <= 0.050
    assert 0.2 < np.mean(offset**2 / of_offset) < 4.0
    leads = [int(answer.vanishing_points.ids[0]) for _, answer in answers if answer.lane is not None]
    assert len(set(leads)) == 1
