# SPDX-License-Identifier: Apache-2.0
"""Heading, offset and attitude in the recorded corridor against its truth, and whether answers repeat."""

from __future__ import annotations

import math
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.replay import LINES, PICTURES, STEERING, VANISHING, said
from bench.report import Cell, Row, Table, at_least, at_most
from bench.sources import CORRIDOR
from robot_vision.bags import HeadingScore, decode, score_heading
from robot_vision.bags.messages import stamp_ns
from robot_vision.geometry.rotation import quaternion_to_rotation, rpy_from_rotation
from robot_vision.ros.replays import replay
from robot_vision.simulation import standard_camera

QUICK_S = 5.0
REPEATED = ("heading", "steering")
_IMU = "sensor_msgs/msg/Imu"


@dataclass(frozen=True)
class AttitudeScore:
    """Roll and pitch against the truth.

    Attributes:
        compared: answers that have a truth.
        roll_rms, pitch_rms: root mean square errors, rad; nan without any.
        normalised: mean error squared over the claimed covariance; 2 degrees of freedom, divided by 2.
    """

    compared: int
    roll_rms: float
    pitch_rms: float
    normalised: float


def run(quick: bool) -> list[Table]:
    """Measure, with the first seconds of the drive when it is to be quick.

    Raises:
        ProcessError: a node failed.
    """
    camera = standard_camera()
    settings: dict[str, dict[str, Any]] = {
        LINES: {"transport": "compressed"},
        VANISHING: {"camera.height": float(camera.height_m or 0.0), "camera.pitch": float(camera.pitch)},
    }
    with tempfile.TemporaryDirectory(prefix="robot_vision-") as scratch:
        first, second = Path(scratch) / "first.mcap", Path(scratch) / "second.mcap"
        for answers in (first, second):
            duration = QUICK_S if quick else 0.0
            replay(
                CORRIDOR,
                answers,
                [LINES, VANISHING, STEERING],
                "steering",
                settings,
                duration,
                exclude=PICTURES,
            )
        score = score_heading(first)
        attitude = score_attitude(first)
        same = [said(first, topic) == said(second, topic) != [] for topic in REPEATED]
    return [_table(score, attitude, all(same))]


def score_attitude(bag: Path) -> AttitudeScore:
    """Compare the `attitude` in a bag with its `truth/attitude` by stamp."""
    answers, truths = attitudes(bag, "attitude"), attitudes(bag, "truth/attitude")
    both = sorted(answers.keys() & truths.keys())
    if not both:
        return AttitudeScore(0, math.nan, math.nan, math.nan)
    errors = np.array([answers[stamp][0] - truths[stamp][0] for stamp in both])
    information = np.array([np.linalg.inv(answers[stamp][1]) for stamp in both])
    normalised = np.einsum("ni,nij,nj->n", errors, information, errors) / 2.0
    roll, pitch = np.sqrt(np.mean(errors**2, axis=0)).tolist()
    return AttitudeScore(len(both), roll, pitch, float(normalised.mean()))


def attitudes(bag: Path, topic: str) -> dict[int, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return (roll, pitch) in rad and their covariance (2, 2) by stamp."""
    found = {}
    for cdr in said(bag, topic):
        message = decode(cdr, _IMU)
        turn = message.orientation
        rotation = quaternion_to_rotation((turn.x, turn.y, turn.z, turn.w))
        covariance = np.asarray(message.orientation_covariance, np.float64).reshape(3, 3)[:2, :2]
        found[stamp_ns(message)] = np.array(rpy_from_rotation(rotation)[:2]), covariance
    return found


def _table(score: HeadingScore, attitude: AttitudeScore, same: bool) -> Table:
    def row(name: str, unit: str, cell: Cell, digits: int = 2) -> Row:
        return Row(name, unit, [cell], digits)

    deg = math.degrees
    rows = [
        row("heading error, RMS", "deg", Cell(score.yaw_rms_deg, at_most(0.3)), 3),
        row("heading error, worst", "deg", Cell(deg(score.yaw.worst))),
        row("heading, normalised error squared (honest: 1)", "", Cell(score.yaw.normalised)),
        row("offset error, RMS", "mm", Cell(1e3 * score.offset.rms, at_most(50.0)), 1),
        row("offset error, worst", "mm", Cell(1e3 * score.offset.worst), 1),
        row("offset, normalised error squared (honest: 1)", "", Cell(score.offset.normalised)),
        row("roll error, RMS", "deg", Cell(deg(attitude.roll_rms)), 3),
        row("pitch error, RMS", "deg", Cell(deg(attitude.pitch_rms)), 3),
        row("attitude, normalised error squared (honest: 1)", "", Cell(attitude.normalised)),
        row("pictures with a heading", "%", Cell(100.0 * score.answers / score.truths), 1),
        row("pictures with an offset", "%", Cell(100.0 * score.offset.count / score.truths), 1),
        row("second replay byte for byte the same (1: yes)", "", Cell(float(same), at_least(1.0)), 0),
    ]
    title = f"Recorded corridor: {score.truths} pictures, twice in lockstep through the nodes"
    return Table(title, ["through the nodes"], rows)
