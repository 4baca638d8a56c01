# SPDX-License-Identifier: Apache-2.0
"""Roll and pitch of a body that leans by up to 3 degrees down a corridor, through the real nodes."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

from bench.corridor import AttitudeScore, score_attitude
from bench.replay import LINES, PICTURES, VANISHING
from bench.report import Cell, Row, Table, at_least, at_most
from robot_vision.ros.replays import replay
from robot_vision.simulation.record import record
from robot_vision.simulation.world import standard_camera

SEEDS, QUICK_SEEDS = range(1, 4), range(1, 2)
SECONDS, QUICK_SECONDS = 12.0, 5.0
LEAN = math.radians(3.0)


def run(quick: bool) -> list[Table]:
    """Record and replay three drives, one short one when it is to be quick.

    Raises:
        ProcessError: a node failed.
    """
    seeds, seconds = (QUICK_SEEDS, QUICK_SECONDS) if quick else (SEEDS, SECONDS)
    camera = standard_camera()
    settings: dict[str, dict[str, Any]] = {
        LINES: {"transport": "compressed"},
        VANISHING: {"camera.height": float(camera.height_m or 0.0), "camera.pitch": float(camera.pitch)},
    }
    scores, pictures = [], 0
    with tempfile.TemporaryDirectory(prefix="robot_vision-") as scratch:
        for seed in seeds:
            drive, answers = Path(scratch) / f"{seed}.mcap", Path(scratch) / f"answers{seed}.mcap"
            pictures += record("corridor", drive, seed, seconds, parameters={"shake": LEAN}).pictures
            replay(drive, answers, [LINES, VANISHING], "vanishing_points", settings, exclude=PICTURES)
            scores.append(score_attitude(answers))
    return [_table(scores, pictures)]


def _table(scores: list[AttitudeScore], pictures: int) -> Table:
    rows = [
        Row("roll error, RMS, worst drive", "deg", [_angle(max(one.roll_rms for one in scores))], 3),
        Row("pitch error, RMS, worst drive", "deg", [_angle(max(one.pitch_rms for one in scores))], 3),
        Row(
            "normalised error squared, greatest (honest: 1)",
            "",
            [Cell(max(one.normalised for one in scores))],
        ),
        Row(
            "pictures with an attitude",
            "%",
            [Cell(100.0 * sum(one.compared for one in scores) / pictures, at_least(99.0))],
            1,
        ),
    ]
    title = f"Attitude: {len(scores)} corridors, the body leans by up to {math.degrees(LEAN):g} degrees"
    return Table(title, ["through the nodes"], rows)


def _angle(radians: float) -> Cell:
    return Cell(math.degrees(radians), at_most(0.2))
