# SPDX-License-Identifier: Apache-2.0
"""What finding lines costs, as a ratio to OpenCV's LSD in the same run on the same pictures."""

from __future__ import annotations

import time

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.report import Cell, Row, Table
from bench.sources import CORRIDOR, MissingSetError, york_urban
from bench.york import Find, lsd
from robot_vision.bags import BagReader, decode
from robot_vision.bags.messages import picture
from robot_vision.perception import LineDetector

ROUNDS = 4
PERCENTILES = (50, 95, 99)


def run(quick: bool) -> list[Table]:
    """Measure on the pictures of York Urban, or of the corridor where these are missing."""
    pictures, source = _pictures()
    if quick:
        pictures = pictures[::4]
    cv2.setNumThreads(1)
    trace = LineDetector()
    trace.warm_up()
    ways: dict[str, Find] = {
        "trace": trace.detect,
        "hough": LineDetector(method="hough").detect,
        "OpenCV LSD": lsd(),
    }
    spent = {name: np.zeros((ROUNDS, len(pictures))) for name in ways}
    counts = {name: np.zeros(len(pictures)) for name in ways}
    for way in ways.values():
        way(pictures[0])
    for turn in range(ROUNDS):
        for number, gray in enumerate(pictures):
            # One after the other on each picture: whatever disturbs the machine disturbs all alike
            for name, way in ways.items():
                began = time.process_time_ns()
                counts[name][number] = len(way(gray))
                spent[name][turn, number] = 1e-6 * (time.process_time_ns() - began)
    rows = [
        Row(f"CPU p{part}", "ms", [Cell(float(np.percentile(spent[name], part))) for name in ways], 2)
        for part in PERCENTILES
    ]
    usual = float(np.median(spent["OpenCV LSD"]))
    rows += [
        Row("p50 as a ratio to LSD", "", [Cell(float(np.median(spent[name])) / usual) for name in ways], 2),
        Row("lines a picture, median", "", [Cell(float(np.median(counts[name]))) for name in ways], 0),
    ]
    title = f"Lines: {len(pictures)} pictures of {source}, {ROUNDS} times each, one thread"
    return [Table(title, list(ways), rows)]


def _pictures() -> tuple[list[NDArray[np.uint8]], str]:
    try:
        return [each.gray() for each in york_urban()[1]], "York Urban"
    except MissingSetError:
        messages = list(BagReader(CORRIDOR).messages(["image/compressed"]))[::4]
        decoded = [picture(decode(each.cdr, each.type_name)) for each in messages]
        grays = [np.asarray(cv2.cvtColor(each, cv2.COLOR_BGR2GRAY), np.uint8) for each in decoded]
        return grays, "the corridor"
