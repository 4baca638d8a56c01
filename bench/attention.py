# SPDX-License-Identifier: Apache-2.0
"""What looking where it matters saves of the cost of finding lines, and what it does to every score.

Each set goes once through the objects that the nodes call, picture by picture everywhere and with attention side by
side, so that whatever else the machine does meets both alike.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.azimuth import azimuth, score_azimuths, travel_azimuths
from bench.corridor import attitudes
from bench.replay import said
from bench.report import Cell, Row, Table, at_most
from bench.road import HEIGHT, PITCH, ROAD, curvature_at_start, true_curvatures
from bench.sources import CORRIDOR, MissingSetError, kitti_straight
from robot_vision.bags import BagReader, decode, make_bag
from robot_vision.bags.messages import picture, stamp_ns, yaw_of
from robot_vision.bags.trajectory import read_poses
from robot_vision.geometry import Camera
from robot_vision.perception import LineDetector, LineSegments, Role
from robot_vision.perception.attention import Attention
from robot_vision.perception.odometry import MotionHistory
from robot_vision.perception.picture import to_gray
from robot_vision.perception.region import Region
from robot_vision.perception.way import WayEstimate, WayEstimator
from robot_vision.ros.calibration import Calibration
from robot_vision.ros.parameters import CAMERA_PLACE, camera_place
from robot_vision.simulation import standard_camera

QUICK_S = 4.0
ROUNDS = 3
SAVED = 0.5  # of the CPU time at most
WITHIN = 1.02  # times the score without
_POSE = "geometry_msgs/msg/PoseWithCovarianceStamped"
_TOPICS = ["camera_info", "odom", "image", "image/compressed"]
_DETAILS = {"deg": 3, "mm": 1, "%": 2}

Scores = dict[tuple[str, str], float]
Answers = dict[int, WayEstimate]


@dataclass(frozen=True)
class _Drive:
    """A bag, the place of its camera, and how answers (by stamp) are scored: by (name, unit), less is better."""

    name: str
    bag: Path
    place: dict[str, float]
    score: Callable[[Answers], Scores]


@dataclass(frozen=True)
class _Picture:
    """A picture and what belongs to it: time (ns), speed (m/s) and turn rate (rad/s) since the one before."""

    stamp: int
    gray: NDArray[np.uint8]
    camera: Camera
    speed: float | None
    turn_rate: float | None


class _Way:
    """Lines and what they tell, everywhere or with attention, and the CPU time of the lines."""

    def __init__(self, attention: Attention | None) -> None:
        self.detector = LineDetector()
        self.detector.warm_up()
        self.estimator = WayEstimator(attention=attention)
        self.estimator.warm_up()
        self.asked: Region | None = None
        self.looks: list[float] = []
        self.answers: Answers = {}

    def search(self, gray: NDArray[np.uint8]) -> tuple[LineSegments, float]:
        """Lines, and the CPU time they took, ms."""
        began = time.process_time_ns()
        lines = self.detector.detect(gray, self.asked)
        return lines, 1e-6 * (time.process_time_ns() - began)

    def take(self, seen: _Picture, lines: LineSegments) -> None:
        """Learn from the lines, and where to look next."""
        height, width = seen.gray.shape
        self.looks.append(1.0 if self.asked is None else self.asked.share(width, height))
        answer = self.estimator.update(lines, seen.camera, 1e-9 * seen.stamp, seen.speed, seen.turn_rate)
        self.answers[seen.stamp] = answer
        self.asked = answer.attention


def run(quick: bool) -> list[Table]:
    """Measure, the first seconds of each drive when it is to be quick; what is not on this machine is left out."""
    rows: list[Row] = []
    notes = [
        f"CPU of a picture: the least of {ROUNDS} searches, everywhere and with attention in turn; share: of the sums",
        "settings were chosen on other simulated drives and on the first half of KITTI's; that a lost way ahead is",
        "a surprise at once, on all of it",
    ]
    cv2.setNumThreads(1)
    with tempfile.TemporaryDirectory(prefix="robot_vision-") as scratch:
        drives = [_corridor(), _road()]
        try:
            drives.append(_kitti(Path(scratch)))
        except MissingSetError as missing:
            notes.append(f"left out: {missing}")
        for drive in drives:
            rows += _measured(drive, QUICK_S if quick else math.inf)
    title = "Attention: the whole of every picture searched, and where it matters, picture by picture in turn"
    return [Table(title, ["everywhere", "attention"], rows, notes)]


def _measured(drive: _Drive, duration_s: float) -> list[Row]:
    ways = (_Way(None), _Way(Attention()))
    spent = []
    for number, seen in enumerate(_pictures(drive, duration_s)):
        least = [math.inf, math.inf]
        lines = [LineSegments.empty()] * 2
        for turn in range(ROUNDS):
            for way in (0, 1) if (number + turn) % 2 else (1, 0):
                lines[way], cost = ways[way].search(seen.gray)
                least[way] = min(least[way], cost)
        spent.append(least)
        for way in (0, 1):
            ways[way].take(seen, lines[way])
    costs = np.array(spent)
    whole, part = costs.mean(axis=0).tolist()
    looks = np.array(ways[1].looks)
    rows = [
        Row(f"{drive.name}: CPU of line detection, mean", "ms", [Cell(whole), Cell(part)], 2),
        Row(
            f"{drive.name}: CPU of line detection, share",
            "%",
            [Cell(100.0), Cell(100.0 * part / whole, at_most(100.0 * SAVED))],
            1,
        ),
        Row(
            f"{drive.name}: CPU share of the median picture",
            "%",
            [Cell(100.0), Cell(100.0 * float(np.median(costs[:, 1] / costs[:, 0])))],
            1,
        ),
        Row(f"{drive.name}: of the pictures looked at", "%", [Cell(100.0), Cell(100.0 * looks.mean())], 0),
        Row(f"{drive.name}: looks everywhere", "%", [Cell(100.0), Cell(100.0 * np.mean(looks == 1.0))], 0),
    ]
    before, after = drive.score(ways[0].answers), drive.score(ways[1].answers)
    for (name, unit), value in before.items():
        cells = [Cell(value), Cell(after[name, unit], at_most(WITHIN * value))]
        rows.append(Row(f"{drive.name}: {name}", unit, cells, _DETAILS[unit]))
    return rows


def _pictures(drive: _Drive, duration_s: float) -> Iterator[_Picture]:
    """Pictures of a drive, which are rectified, with the newest calibration and odometry, as the nodes hear them."""
    place: dict[str, Any] = {setting.name: setting.default for setting in CAMERA_PLACE}
    calibration, motion = Calibration(camera_place({**place, **drive.place})), MotionHistory()
    first = last = None
    for each in BagReader(drive.bag).messages(_TOPICS):
        message = decode(each.cdr, each.type_name)
        stamp = stamp_ns(message)
        if each.topic.endswith("camera_info"):
            calibration.take(message)
        elif each.topic.endswith("odom"):
            motion.add(1e-9 * stamp, message.twist.twist.linear.x, message.twist.twist.angular.z)
        else:
            first, since = stamp if first is None else first, stamp if last is None else last
            last = stamp
            if 1e-9 * (stamp - first) >= duration_s:
                return
            speed, turn_rate = motion.mean(1e-9 * since, 1e-9 * stamp)
            gray = np.ascontiguousarray(to_gray(picture(message)))
            if calibration.camera is None:
                raise ValueError(f"{drive.bag} holds no calibration before its first picture")
            yield _Picture(stamp, gray, calibration.camera, speed, turn_rate)


def _rms(errors: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(errors)))) if errors else math.nan


def _headings(bag: Path, answers: Answers) -> Scores:
    yaws, offsets = [], []
    for cdr in said(bag, "truth/heading"):
        message = decode(cdr, _POSE)
        answer = answers.get(stamp_ns(message))
        if answer is None or answer.lane is None:
            continue
        pose = message.pose.pose
        yaws.append(math.remainder(answer.lane.yaw - yaw_of(pose.orientation), math.tau))
        if answer.lane.offset_known:
            offsets.append(answer.lane.offset - pose.position.y)
    return {
        ("heading error, RMS", "deg"): math.degrees(_rms(yaws)),
        ("offset error, RMS", "mm"): 1e3 * _rms(offsets),
        ("pictures without a heading", "%"): 100.0 * (1.0 - len(yaws) / len(answers)),
    }


def _corridor() -> _Drive:
    truth = attitudes(CORRIDOR, "truth/attitude")

    def score(answers: Answers) -> Scores:
        leans = {stamp: answer.attitude for stamp, answer in answers.items()}
        seen = {stamp: lean for stamp, lean in leans.items() if lean is not None and lean.seen}
        rolls = [lean.roll - float(truth[stamp][0][0]) for stamp, lean in seen.items()]
        pitches = [lean.pitch - float(truth[stamp][0][1]) for stamp, lean in seen.items()]
        return {
            **_headings(CORRIDOR, answers),
            ("roll error, RMS", "deg"): math.degrees(_rms(rolls)),
            ("pitch error, RMS", "deg"): math.degrees(_rms(pitches)),
        }

    camera = standard_camera()
    place = {"camera.height": float(camera.height_m or 0.0), "camera.pitch": float(camera.pitch)}
    return _Drive("corridor", CORRIDOR, place, score)


def _road() -> _Drive:
    truth = true_curvatures(ROAD)

    def score(answers: Answers) -> Scores:
        paths = {stamp: answer.path for stamp, answer in answers.items()}
        bends = [curvature_at_start(path) - truth[stamp] for stamp, path in paths.items() if path is not None]
        spread = float(np.ptp(list(truth.values())))
        return {
            **_headings(ROAD, answers),
            ("curvature error, RMS, of its range", "%"): 100.0 * _rms(bends) / spread,
        }

    return _Drive("road", ROAD, {"camera.height": HEIGHT, "camera.pitch": PITCH}, score)


def _kitti(scratch: Path) -> _Drive:
    folder = kitti_straight()
    bag = scratch / "kitti.mcap"
    make_bag(folder / "image_l", bag, calibration=folder / "calib.txt", poses=folder / "poses.txt")
    truth = travel_azimuths(read_poses(folder / "poses.txt"))

    def score(answers: Answers) -> Scores:
        points = [answer.vanishing_points for answer in answers.values()]
        primaries = [each.of(Role.PRIMARY) for each in points]
        found = [
            math.nan if which is None else azimuth(each.directions[which])
            for each, which in zip(points, primaries, strict=True)
        ]
        azimuths = score_azimuths(np.array(found), truth[: len(found)])
        return {
            ("azimuth error, median", "deg"): azimuths.median,
            ("azimuth error, worst", "deg"): azimuths.worst,
            ("jitter from picture to picture", "deg"): azimuths.jitter,
            ("pictures without an answer", "%"): azimuths.missing,
        }

    return _Drive("kitti", bag, {}, score)
