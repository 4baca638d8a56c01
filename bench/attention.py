# SPDX-License-Identifier: Apache-2.0
"""What looking where it matters saves of the cost of finding lines, and what it does to every score.

Each set is replayed twice in lockstep through the real nodes, with `attention` and without. The regions that were said
are then searched again in the pictures of the set, beside the whole pictures, to measure CPU time.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.azimuth import score_azimuths, travel_azimuths
from bench.corridor import score_attitude
from bench.kitti import primary_azimuths
from bench.replay import LINES, PICTURES, VANISHING, said
from bench.report import Cell, Row, Table, at_most
from bench.road import HEIGHT, PITCH, ROAD, curvatures
from bench.sources import CORRIDOR, MissingSetError, kitti_straight
from robot_vision.bags import BagReader, decode, make_bag, score_heading
from robot_vision.bags.messages import picture
from robot_vision.bags.trajectory import read_poses
from robot_vision.perception import LineDetector
from robot_vision.perception.picture import to_gray
from robot_vision.perception.region import Region
from robot_vision.ros.replays import replay
from robot_vision.simulation import standard_camera

QUICK_S = 4.0
ROUNDS = 3
SAVED = 0.5  # of the CPU time at most
WITHIN = 1.02  # times the score without
_REGION = "sensor_msgs/msg/RegionOfInterest"
_DETAILS = {"deg": 3, "mm": 1, "%": 2}

Scores = dict[tuple[str, str], float]


@dataclass(frozen=True)
class _Drive:
    """A bag, the settings of the estimator, and how answers are scored: by (name, unit), less is better."""

    name: str
    bag: Path
    transport: str
    settings: dict[str, Any]
    score: Callable[[Path], Scores]


def run(quick: bool) -> list[Table]:
    """Measure, the first seconds of each drive when it is to be quick; what is not on this machine is left out.

    Raises:
        ProcessError: a node failed.
    """
    rows: list[Row] = []
    notes: list[str] = []
    with tempfile.TemporaryDirectory(prefix="robot_vision-") as scratch:
        drives = [_corridor(), _road()]
        try:
            drives.append(_kitti(Path(scratch)))
        except MissingSetError as missing:
            notes.append(f"left out: {missing}")
        for drive in drives:
            rows += _measured(drive, Path(scratch), QUICK_S if quick else 0.0)
    title = (
        "Attention: the whole of every picture searched, and where it matters, in lockstep through the nodes"
    )
    return [Table(title, ["everywhere", "attention"], rows, notes)]


def _measured(drive: _Drive, scratch: Path, duration_s: float) -> list[Row]:
    answers = {on: scratch / f"{drive.name}-{on}.mcap" for on in (False, True)}
    for on, path in answers.items():
        settings = {
            LINES: {"transport": drive.transport},
            VANISHING: {**drive.settings, "attention.enabled": on},
        }
        replay(
            drive.bag,
            path,
            [LINES, VANISHING],
            "vanishing_points",
            settings,
            duration_s,
            exclude=("lines/overlay",),
        )
    grays = _pictures(answers[True])
    regions = _regions(answers[True], len(grays))
    whole, part = _cost(grays, regions)
    height, width = grays[0].shape
    looked = float(np.mean([1.0 if each is None else each.share(width, height) for each in regions]))
    everywhere = float(np.mean([each is None for each in regions]))
    rows = [
        Row(
            f"{drive.name}: CPU of line detection, mean",
            "ms",
            [Cell(whole), Cell(part, at_most(SAVED * whole))],
            2,
        ),
        Row(f"{drive.name}: of the pictures looked at", "%", [Cell(100.0), Cell(100.0 * looked)], 0),
        Row(f"{drive.name}: looks everywhere", "%", [Cell(100.0), Cell(100.0 * everywhere)], 0),
    ]
    before, after = drive.score(answers[False]), drive.score(answers[True])
    for (name, unit), value in before.items():
        cells = [Cell(value), Cell(after[name, unit], at_most(WITHIN * value))]
        rows.append(Row(f"{drive.name}: {name}", unit, cells, _DETAILS[unit]))
    return rows


def _pictures(bag: Path) -> list[NDArray[np.uint8]]:
    messages = BagReader(bag).messages([topic for topic in PICTURES if topic != "lines/overlay"])
    return [np.ascontiguousarray(to_gray(picture(decode(each.cdr, each.type_name)))) for each in messages]


def _regions(bag: Path, pictures: int) -> list[Region | None]:
    """Where each picture was searched: as the answer to the picture before it said.

    Raises:
        ValueError: not every picture was answered by a region.
    """
    told = [decode(cdr, _REGION) for cdr in said(bag, "attention")]
    if len(told) != pictures:
        raise ValueError(f"{len(told)} regions were said for {pictures} pictures")
    found = [Region(r.x_offset, r.y_offset, r.width, r.height) if r.width else None for r in told]
    return [None, *found[:-1]]


def _cost(grays: list[NDArray[np.uint8]], regions: list[Region | None]) -> tuple[float, float]:
    """Mean CPU time (ms) of lines in whole pictures and in the regions; of each picture the least of a few rounds."""
    cv2.setNumThreads(1)
    spent = np.full((2, ROUNDS, len(grays)), math.nan)
    for turn in range(ROUNDS):
        for way in range(2):
            detector = LineDetector()
            detector.warm_up()
            detector.detect(grays[0])
            for number, (gray, region) in enumerate(zip(grays, regions, strict=True)):
                began = time.process_time_ns()
                detector.detect(gray, region if way else None)
                spent[way, turn, number] = 1e-6 * (time.process_time_ns() - began)
    whole, part = spent.min(axis=1).mean(axis=1).tolist()
    return whole, part


def _headings(bag: Path) -> Scores:
    heading = score_heading(bag)
    return {
        ("heading error, RMS", "deg"): heading.yaw_rms_deg,
        ("offset error, RMS", "mm"): 1e3 * heading.offset.rms,
        ("pictures without a heading", "%"): 100.0 * (1.0 - heading.answers / heading.truths),
    }


def _corridor() -> _Drive:
    def score(bag: Path) -> Scores:
        attitude = score_attitude(bag)
        return {
            **_headings(bag),
            ("roll error, RMS", "deg"): math.degrees(attitude.roll_rms),
            ("pitch error, RMS", "deg"): math.degrees(attitude.pitch_rms),
        }

    camera = standard_camera()
    settings = {"camera.height": float(camera.height_m or 0.0), "camera.pitch": float(camera.pitch)}
    return _Drive("corridor", CORRIDOR, "compressed", settings, score)


def _road() -> _Drive:
    def score(bag: Path) -> Scores:
        bends = curvatures(bag)
        rms = float(np.sqrt(np.mean((bends[:, 0] - bends[:, 1]) ** 2)))
        return {
            **_headings(bag),
            ("curvature error, RMS, of its range", "%"): 100.0 * rms / float(np.ptp(bends[:, 1])),
        }

    return _Drive("road", ROAD, "compressed", {"camera.height": HEIGHT, "camera.pitch": PITCH}, score)


def _kitti(scratch: Path) -> _Drive:
    folder = kitti_straight()
    bag = scratch / "kitti.mcap"
    made = make_bag(folder / "image_l", bag, calibration=folder / "calib.txt", poses=folder / "poses.txt")
    truth = travel_azimuths(read_poses(folder / "poses.txt"))

    def score(answers: Path) -> Scores:
        azimuths = score_azimuths(primary_azimuths(answers, made.pictures), truth)
        return {
            ("azimuth error, median", "deg"): azimuths.median,
            ("azimuth error, worst", "deg"): azimuths.worst,
            ("jitter from picture to picture", "deg"): azimuths.jitter,
            ("pictures without an answer", "%"): azimuths.missing,
        }

    return _Drive("kitti", bag, "raw", {}, score)
