# SPDX-License-Identifier: Apache-2.0
"""Calibration from recorded drives against their truth, and what the spacings of flagstones add to the lines."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from bench.corridor import attitudes
from bench.report import Cell, Row, Table, at_most
from bench.sources import CORRIDOR, MissingSetError, york_urban
from robot_vision.calibrate.drive import Drive, read_drive
from robot_vision.geometry import Camera
from robot_vision.perception import HeadingEstimator, LineDetector
from robot_vision.perception.calibration import CameraCalibration, CameraCalibrator, KnownLengths
from robot_vision.perception.vanishing.pavement import PavementSpacings
from robot_vision.simulation import standard_camera

PATH = CORRIDOR.with_name("path.mcap")
QUICK = 45


def run(quick: bool) -> list[Table]:
    """Measure, with few pictures when it is to be quick."""
    most = QUICK if quick else 600
    drives = {
        "corridor": (_drive(CORRIDOR, most), KnownLengths(corridor_width=2.0)),
        "path": (_drive(PATH, most), KnownLengths(stone_width=0.4)),
    }
    found = {
        name: CameraCalibrator().calibrate(
            drive.lines, Camera.uncalibrated(drive.camera.width, drive.camera.height), drive.stamps_s, lengths
        )
        for name, (drive, lengths) in drives.items()
    }
    tables = [_calibrations(found)]
    try:
        tables.append(_town())
    except MissingSetError as missing:
        tables[0] = Table(tables[0].title, tables[0].columns, tables[0].rows, [f"no town: {missing}"])
    return [*tables, _flagstones(drives["path"][0])]


def _drive(bag: Path, most: int) -> Drive:
    return read_drive(bag, None, most, lambda done, total: None)


def _calibrations(found: dict[str, CameraCalibration]) -> Table:
    truth = standard_camera()
    height = float(truth.height_m or math.nan)

    def value(number: float | None) -> float:
        return math.nan if number is None else number

    calibrations = list(found.values())
    rows = [
        Row(
            "focal length error",
            "%",
            [
                Cell(100 * abs(value(each.focal.value) / truth.fx - 1.0), at_most(1.0))
                for each in calibrations
            ],
            2,
        ),
        Row(
            "focal length, claimed sd",
            "%",
            [Cell(100 * each.focal.sigma / truth.fx) for each in calibrations],
            2,
        ),
        Row(
            "roll error",
            "deg",
            [
                Cell(math.degrees(abs(value(each.roll.value) - truth.roll)), at_most(0.1))
                for each in calibrations
            ],
            3,
        ),
        Row(
            "pitch error",
            "deg",
            [
                Cell(math.degrees(abs(value(each.pitch.value) - truth.pitch)), at_most(0.1))
                for each in calibrations
            ],
            3,
        ),
        Row(
            "height error",
            "%",
            [Cell(100 * abs(value(each.height.value) / height - 1.0), at_most(1.0)) for each in calibrations],
            2,
        ),
    ]
    return Table("Camera calibrated from its own drive, no focal length given", list(found), rows)


def _town() -> Table:
    camera, pictures = york_urban()
    detector = LineDetector()
    lines = [detector.detect(picture.gray()) for picture in pictures]
    found = CameraCalibrator().calibrate(lines, Camera.uncalibrated(camera.width, camera.height))
    alone = np.abs(found.focal.own / camera.fx - 1.0)
    together = math.nan if found.focal.value is None else abs(found.focal.value / camera.fx - 1.0)
    rows = [
        Row(
            "focal length error, each picture by itself, median",
            "%",
            [Cell(100 * float(np.nanmedian(alone)), at_most(5.0))],
        ),
        Row("focal length error, all together", "%", [Cell(100 * together)]),
        Row("pictures that tell of it", "", [Cell(float(found.focal.told_by))], 0),
    ]
    return Table(f"York Urban: focal length from {len(pictures)} pictures, nothing given", ["town"], rows)


def _flagstones(drive: Drive) -> Table:
    ways = {"lines alone": PavementSpacings(least_joints=10**6), "with spacings": PavementSpacings()}
    ground = {name: _leans(drive, way, ground_only=True) for name, way in ways.items()}
    whole = {name: _leans(drive, way, ground_only=False) for name, way in ways.items()}
    rows = [
        Row(f"{what} error, RMS{where}", "deg", [Cell(math.degrees(score[name][axis])) for name in ways], 3)
        for where, score in (("", whole), (", only the pavement in view", ground))
        for axis, what in enumerate(("roll", "pitch"))
    ]
    return Table("Flagstones: attitude on the recorded path", list(ways), rows)


def _leans(drive: Drive, pavement: PavementSpacings, ground_only: bool) -> tuple[float, float]:
    """RMS errors of roll and pitch, rad, of a drive followed with its true camera.

    `ground_only` leaves out all lines that reach above the ground.
    """
    truth = {1e-9 * stamp: lean for stamp, (lean, _) in attitudes(drive.bag, "truth/attitude").items()}
    stamps = np.array(sorted(truth))
    camera = standard_camera()
    horizon = camera.cy - camera.fy * math.tan(camera.pitch)
    estimator = HeadingEstimator(pavement=pavement)
    errors = []
    for lines, stamp in zip(drive.lines, drive.stamps_s, strict=True):
        shown = lines
        if ground_only:
            shown = lines[np.minimum(lines.endpoints[:, 1], lines.endpoints[:, 3]) > horizon + 15.0]
        attitude = estimator.update(shown, camera, stamp).attitude
        if attitude is not None and attitude.seen:
            lean = truth[float(stamps[int(np.argmin(np.abs(stamps - stamp)))])]
            errors.append((attitude.roll - lean[0], attitude.pitch - lean[1]))
    roll, pitch = np.sqrt(np.mean(np.square(errors), axis=0)).tolist()
    return roll, pitch
