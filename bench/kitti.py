# SPDX-License-Identifier: Apache-2.0
"""The way ahead on a real straight road: pictures made into a bag and replayed through the real nodes."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np

from bench.azimuth import azimuth, score_azimuths, travel_azimuths
from bench.replay import LINES, PICTURES, VANISHING, said
from bench.report import Cell, Row, Table, at_most
from bench.sources import kitti_straight
from robot_vision.bags import decode, make_bag
from robot_vision.bags.clouds import points
from robot_vision.bags.make import DEFAULT_RATE_HZ, START_NS
from robot_vision.bags.messages import stamp_ns
from robot_vision.bags.trajectory import read_poses
from robot_vision.perception import Role
from robot_vision.ros.replays import replay

CLOUD = "sensor_msgs/msg/PointCloud2"


def run(quick: bool) -> list[Table]:
    """Measure; there is nothing to leave out when it is to be quick.

    Raises:
        MissingSetError: the pictures are not there.
        ProcessError: a node failed.
    """
    folder = kitti_straight()
    poses = read_poses(folder / "poses.txt")
    with tempfile.TemporaryDirectory(prefix="robot_vision-") as scratch:
        bag, answers = Path(scratch) / "road.mcap", Path(scratch) / "answers.mcap"
        made = make_bag(folder / "image_l", bag, calibration=folder / "calib.txt", poses=folder / "poses.txt")
        replay(bag, answers, [LINES, VANISHING], "vanishing_points", {}, exclude=PICTURES)
        seen = primary_azimuths(answers, made.pictures)
    score = score_azimuths(seen, travel_azimuths(poses))
    rows = [
        Row("error, median", "deg", [Cell(score.median, at_most(0.2))], 3),
        Row("error, worst", "deg", [Cell(score.worst, at_most(2.0))], 2),
        Row("jitter from picture to picture", "deg", [Cell(score.jitter, at_most(0.15))], 3),
        Row("jitter of the travel itself", "deg", [Cell(score.true_jitter)], 3),
        Row("pictures without an answer", "%", [Cell(score.missing, at_most(2.0))]),
    ]
    title = f"KITTI, straight road: {made.pictures} pictures through the nodes, {score.compared} with truth"
    return [Table(title, ["primary"], rows)]


def primary_azimuths(answers: Path, pictures: int) -> np.ndarray:
    """Return the azimuth (rad, to the right) of the primary vanishing point of each picture, nan without.

    Args:
        answers: the bag with `vanishing_points`.
        pictures: in the bag that `make_bag` made.
    """
    found = np.full(pictures, math.nan)
    for cdr in said(answers, "vanishing_points"):
        message = decode(cdr, CLOUD)
        cloud = points(message)
        first = cloud[cloud["role"] == Role.PRIMARY][:1]
        if len(first):
            number = round((stamp_ns(message) - START_NS) * DEFAULT_RATE_HZ / 1e9)
            found[number] = azimuth([float(first[axis][0]) for axis in "xyz"])
    return found
