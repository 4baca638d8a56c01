# SPDX-License-Identifier: Apache-2.0
"""Pictures at twice the pace of the camera: what is skipped, and how old what the robot steers by."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from bench.arrivals import latencies_ms, percentiles
from bench.drive import NODES, drive
from bench.latency import PICTURES, QUICK_PICTURES, answers, disturbance, dropped
from bench.report import Cell, Row, Table, at_most
from bench.stream import RATE_HZ, write_stream

OVERLOAD = 2.0  # times the pace of the camera
OLDEST = 2.0  # frames


def run(quick: bool) -> list[Table]:
    """Measure: a short drive when it is to be quick.

    Raises:
        ProcessError: a process failed.
    """
    pictures = QUICK_PICTURES if quick else PICTURES
    with tempfile.TemporaryDirectory(prefix="robot_vision-") as scratch:
        bag = Path(scratch) / "pictures.mcap"
        shown = write_stream(bag, pictures)
        once = drive(bag, pictures, Path(scratch), rate=OVERLOAD)
    rate = OVERLOAD * RATE_HZ
    ages = 1e-3 * rate * latencies_ms(once.heard.topics["steering"])
    p50, _, p99, worst = percentiles(ages)
    older = 100.0 * float(np.mean(ages > OLDEST)) if ages.size else float("nan")
    rows = [
        Row("age of the picture behind the steering, p50", "frames", [Cell(p50)], 2),
        Row("age, p99", "frames", [Cell(p99)], 2),
        Row("age, worst", "frames", [Cell(worst, at_most(OLDEST))], 2),
        Row("steering on older pictures", "%", [Cell(older)], 2),
        Row("pictures answered by vanishing_points", "", [Cell(answers("vanishing_points")(once))], 0),
        Row("pictures answered by steering", "", [Cell(answers("steering")(once))], 0),
        *[Row(f"skipped or lost by {node}", "", [Cell(dropped(node)(once))], 0) for node in NODES],
        *[Row(f"{name}, share of a core", "%", [Cell(part)]) for name, part in once.load.cores.items()],
        Row("others, share of the machine", "%", [Cell(once.load.others)]),
        Row("stolen by the host, share of the machine", "%", [Cell(once.load.stolen)]),
    ]
    title = f"Overload: {pictures} pictures 640x480 bgr8 at {rate:g} Hz"
    notes = [
        *disturbance([once]),
        f"pictures: {shown}",
        "skipped: as the nodes' diagnostics count them",
    ]
    return [Table(title, ["once"], rows, notes)]
