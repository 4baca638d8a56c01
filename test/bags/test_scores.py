# SPDX-License-Identifier: Apache-2.0
"""Known errors come out as they went in."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from robot_vision.bags import BagError, BagWriter, messages, score_heading

POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"


def write(path: Path, topic: str, rows: list[tuple[int, float, float | None, float, float]]) -> Path:
    with BagWriter(path) as bag:
        bag.add_topic(topic, POSE)
        for stamp, *values in rows:
            bag.write(topic, POSE, stamp + 3, messages.lane_heading(stamp, "corridor", *values))
    return path


def test_errors_and_honesty_are_measured_by_stamp(tmp_path: Path) -> None:
    truth = write(tmp_path / "t", "/truth/heading", [(i, 0.1 * i, 0.5, 0.0, 0.0) for i in range(4)])
    output = write(
        tmp_path / "o",
        "/heading",
        [
            (1, 0.13, 0.6, 0.0009, 0.01),
            (2, 0.16, None, 0.0004, 0.0),
            (3, 0.3, 0.3, 0.0001, 0.01),
            (9, 0, 0, 1, 1),
        ],
    )
    score = score_heading(output, truth)
    assert (score.truths, score.answers, score.missing, score.strays) == (4, 3, 1, 1)
    assert score.yaw.rms == pytest.approx(math.sqrt((0.03**2 + 0.04**2) / 3))
    assert score.yaw_rms_deg == pytest.approx(math.degrees(score.yaw.rms))
    assert score.yaw.worst == pytest.approx(0.04)
    assert score.yaw.normalised == pytest.approx((1 + 4 + 0) / 3)
    assert (score.offset.count, score.offset.unknown) == (2, 1)
    assert score.offset.rms == pytest.approx(math.sqrt((0.1**2 + 0.2**2) / 2))
    assert score.offset.normalised == pytest.approx((1 + 4) / 2)
    assert [frame.stamp_ns for frame in score.frames] == [1, 2, 3]
    assert score.frames[1].offset.error is None


def test_answers_and_truth_may_stand_in_one_bag(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "a") as bag:
        for topic in ("heading", "/truth/heading"):
            bag.write(topic, POSE, 1, messages.lane_heading(1, "row", 0.2, 0.1, 0.1, 0.1))
    score = score_heading(tmp_path / "a")
    assert score.yaw.rms == pytest.approx(0, abs=1e-12) and score.answers == 1


def test_yaw_goes_round(tmp_path: Path) -> None:
    truth = write(tmp_path / "t", "/truth/heading", [(1, math.pi - 0.01, 0.0, 0.0, 0.0)])
    output = write(tmp_path / "o", "/heading", [(1, -math.pi + 0.01, 0.0, 0.1, 0.1)])
    assert score_heading(output, truth).yaw.rms == pytest.approx(0.02)


def test_honest_answers_score_one(tmp_path: Path) -> None:
    random = np.random.default_rng(4)
    errors = random.normal(0, (0.01, 0.05), (2000, 2))
    truth = write(tmp_path / "t", "/truth/heading", [(i, 0.0, 0.0, 0.0, 0.0) for i in range(2000)])
    output = write(tmp_path / "o", "/heading", [(i, y, o, 1e-4, 25e-4) for i, (y, o) in enumerate(errors)])
    score = score_heading(output, truth)
    # the mean of 2000 chi-square values of one degree of freedom: 1 with sigma sqrt(2 / 2000)
    assert abs(score.yaw.normalised - 1) < 4 * math.sqrt(2 / 2000)
    assert abs(score.offset.normalised - 1) < 4 * math.sqrt(2 / 2000)


def test_no_answer_at_all_is_a_score_too(tmp_path: Path) -> None:
    truth = write(tmp_path / "t", "/truth/heading", [(1, 0.0, 0.0, 0.0, 0.0)])
    score = score_heading(write(tmp_path / "o", "/heading", []), truth)
    assert score.missing == 1 and math.isnan(score.yaw.rms) and math.isnan(score.offset.normalised)


def test_missing_topics_are_named(tmp_path: Path) -> None:
    output = write(tmp_path / "o", "/heading", [(1, 0.0, 0.0, 0.0, 0.0)])
    with pytest.raises(BagError, match="has no topic /truth/heading; it has /heading"):
        score_heading(output)
    empty = write(tmp_path / "e", "/truth/heading", [])
    with pytest.raises(BagError, match="no message on /truth/heading"):
        score_heading(output, empty)
    with BagWriter(tmp_path / "w") as bag:
        bag.write("/heading", "sensor_msgs/msg/Imu", 1, messages.imu(1, "f", (0, 0, 0, 1)))
    with pytest.raises(BagError, match="holds sensor_msgs/msg/Imu"):
        score_heading(tmp_path / "w")
