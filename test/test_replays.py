# SPDX-License-Identifier: Apache-2.0
"""Whole drives through the real nodes in lockstep, each node a process: good enough, and the same every time."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from robot_vision.bags import BagReader, decode, make_bag, score_heading
from robot_vision.bags.messages import stamp_ns
from robot_vision.ros.messages import points_from_cloud
from robot_vision.ros.replays import replay

ROOT = Path(__file__).resolve().parents[1]
CORRIDOR = ROOT / "bags" / "corridor.mcap"
FIELD = ROOT / "bags" / "field.mcap"
DATA = Path(os.environ.get("ROBOT_VISION_DATA", ROOT.parent / "shared" / "data"))
PICTURES = ("lines/overlay", "rows/overlay", "image", "image/compressed")
TWIST = "geometry_msgs/msg/TwistStamped"
CHAIN = ("line_detector", "vp_estimator", "corridor_steering")


def said(bag: Path, topic: str) -> list[bytes]:
    return [message.cdr for message in BagReader(bag).messages([topic])]


def test_the_corridor_is_steered_well_and_the_same_way_twice(tmp_path: Path) -> None:
    settings = {
        "line_detector": {"transport": "compressed"},
        "vp_estimator": {"camera.height": 0.6, "camera.pitch": 0.0873},
    }
    first, again = tmp_path / "first.mcap", tmp_path / "again.mcap"
    for answers, seconds in ((first, 0.0), (again, 5.0)):
        replay(CORRIDOR, answers, CHAIN, "steering", settings, seconds, exclude=PICTURES)
    for topic in ("heading", "steering"):
        assert len(said(first, topic)) == 225
        # when the replay's clock has gone, the robot is told to stand: the last steering may be that
        repeated = said(again, topic)[:70]
        assert repeated == said(first, topic)[:70]
        assert len(repeated) == 70
    score = score_heading(first)
    assert score.missing == 0
    assert score.yaw_rms_deg <= 0.3
    assert score.offset.rms <= 0.05
    assert 0.2 < score.yaw.normalised < 3.0
    assert 0.1 < score.offset.normalised < 3.0


def test_with_attention_the_corridor_is_seen_as_well_and_the_same_way_twice(tmp_path: Path) -> None:
    settings = {
        "line_detector": {"transport": "compressed"},
        "vp_estimator": {"camera.height": 0.6, "camera.pitch": 0.0873, "attention.enabled": True},
    }
    first, again = tmp_path / "first.mcap", tmp_path / "again.mcap"
    for answers, seconds in ((first, 4.0), (again, 2.0)):
        replay(CORRIDOR, answers, CHAIN[:2], "vanishing_points", settings, seconds, exclude=PICTURES)
    for topic in ("attention", "lines", "heading"):
        assert said(first, topic)[:25] == said(again, topic)[:25] != []
    regions = [decode(cdr, "sensor_msgs/msg/RegionOfInterest") for cdr in said(first, "attention")]
    assert len(regions) == len(said(first, "lines")) >= 60
    assert sum(region.width > 0 for region in regions) > 50
    assert score_heading(first).yaw_rms_deg <= 0.1


@pytest.fixture(scope="module")
def field_answers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = {"transport": "compressed", "camera.height": 1.4, "camera.pitch": 0.6109, "row.spacing": 0.5}
    answers = tmp_path_factory.mktemp("field") / "rows.mcap"
    replay(FIELD, answers, ["crop_row_steering"], "steering", {"crop_row_steering": place}, exclude=PICTURES)
    return answers


def test_the_field_is_followed_within_a_centimetre(field_answers: Path) -> None:
    answers = field_answers
    # the last one may be answered twice: when the replay's clock has gone, the robot is told to stand
    stamps = {stamp_ns(decode(cdr, TWIST)) for cdr in said(answers, "steering")}
    assert len(stamps) == 100
    score = score_heading(answers)
    assert score.missing <= 5
    assert score.yaw_rms_deg <= 0.5
    assert score.offset.rms <= 0.010
    assert 0.1 < score.yaw.normalised < 3.0
    assert 0.1 < score.offset.normalised < 3.0


def clouds(bag: Path, topic: str) -> dict[int, np.ndarray]:
    """Points by the stamp of their picture."""
    decoded = (decode(cdr, "sensor_msgs/msg/PointCloud2") for cdr in said(bag, topic))
    return {stamp_ns(cloud): points_from_cloud(cloud, ("x", "y", "id", "kind")) for cloud in decoded}


def test_the_plants_of_the_field_keep_their_numbers_and_weeds_alone_are_sprayed(field_answers: Path) -> None:
    told, truth = clouds(field_answers, "plants"), clouds(field_answers, "truth/plants")
    jets = clouds(field_answers, "spray")
    assert set(told) == set(jets) == set(truth)
    numbers: dict[int, list[int]] = {}
    kinds: list[tuple[int, int]] = []
    sprayed_crop = sprayed = 0
    for stamp in sorted(told)[10:]:
        near = truth[stamp][(truth[stamp]["x"] < 2.0) & (np.abs(truth[stamp]["y"]) < 0.5)]
        here, plants = (np.column_stack([cloud["x"], cloud["y"]]) for cloud in (near, told[stamp]))
        away = np.linalg.norm(here[:, None] - plants[None], axis=2)
        reach = np.maximum(0.04, np.sqrt(near["area"] / np.pi))
        away[away > reach[:, None]] = 1e3
        for n, k in zip(*linear_sum_assignment(away), strict=True):
            if away[n, k] < 1e3:
                numbers.setdefault(int(near["id"][n]), []).append(int(told[stamp]["id"][k]))
                kinds.append((int(near["kind"][n]), int(told[stamp]["kind"][k])))
                planned = told[stamp]["id"][k] in jets[stamp]["id"]
                sprayed += int(planned)
                sprayed_crop += int(planned and near["kind"][n] == 0)
    long = [ids for ids in numbers.values() if len(ids) >= 5]
    assert len(long) > 60
    assert np.mean([len(set(ids)) == 1 for ids in long]) >= 0.95
    assert np.mean([said_kind != 1 for true_kind, said_kind in kinds if true_kind == 0]) >= 0.98
    assert np.mean([said_kind == 1 for true_kind, said_kind in kinds if true_kind == 1]) >= 0.9
    assert sprayed > 100
    assert sprayed_crop <= 0.02 * sprayed


def test_a_real_road_is_known_to_a_third_of_a_degree(tmp_path: Path) -> None:
    source = DATA / "kitti_straight"
    if not source.is_dir():
        pytest.skip(
            f"the pictures of kitti_straight are not at {source}; ROBOT_VISION_DATA names their place"
        )
    bag, answers = tmp_path / "road.mcap", tmp_path / "answers.mcap"
    make_bag(
        source / "image_l",
        bag,
        calibration=str(source / "calib.txt"),
        poses=source / "poses.txt",
        rate_hz=10.0,
        transport="png",
    )
    nodes = CHAIN[:2]
    replay(
        bag,
        answers,
        nodes,
        "vanishing_points",
        {"line_detector": {"transport": "compressed"}},
        exclude=PICTURES,
    )
    directions = [primary(cdr) for cdr in said(answers, "vanishing_points")]
    assert len(directions) == 51
    assert sum(direction is None for direction in directions) <= 1
    azimuth = np.degrees([np.nan if d is None else np.arctan2(d[0], d[2]) for d in directions])
    error = azimuth[:46] - travel(source / "poses.txt")
    assert np.nanmedian(np.abs(error)) <= 0.3
    assert np.nanmax(np.abs(error)) <= 2.0
    assert np.nanstd(np.diff(azimuth)) <= 0.3


def primary(cdr: bytes) -> np.ndarray | None:
    from robot_vision.bags import decode
    from robot_vision.bags.clouds import points

    cloud = points(decode(cdr, "sensor_msgs/msg/PointCloud2"))
    first = [place for place in range(len(cloud["role"])) if cloud["role"][place] == 1]
    return np.array([cloud[axis][first[0]] for axis in "xyz"], float) if first else None


def travel(poses: Path) -> np.ndarray:
    """Azimuth of the way from picture i to picture i + 5 in the frame of camera i, degrees."""
    matrices = np.loadtxt(poses).reshape(-1, 3, 4)
    ways = [m[:, :3].T @ (n[:, 3] - m[:, 3]) for m, n in zip(matrices[:46], matrices[5:], strict=True)]
    return np.degrees([np.arctan2(way[0], way[2]) for way in ways])
