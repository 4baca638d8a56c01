# SPDX-License-Identifier: Apache-2.0
"""What finding lines costs and how well they lie, beside OpenCV's LSD in the same run on the same pictures.

Three families are compared: edges traced along a running fit (`trace`), a Hough transform with refit (`hough`), and
regions of one gradient direction (LSD).
"""

from __future__ import annotations

import time

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.report import Cell, Row, Table, at_most
from bench.sources import CORRIDOR, MissingSetError, YorkPicture, york_urban
from bench.york import Find, hough, lsd
from robot_vision.bags import BagReader, decode
from robot_vision.bags.messages import picture
from robot_vision.geometry import Camera
from robot_vision.perception import LineDetector, LineSegments
from robot_vision.perception.vanishing.bundle import Bundle

ROUNDS = 4
PERCENTILES = (50, 95, 99)
LSD_SHARE = 0.4  # of LSD's time
LEAST_LENGTH = 15.0  # px; shorter lines say nothing
LEADS_WITHIN_DEG = 1.0
YORK = "York Urban"


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
        "hough": hough().detect,
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
    ratios = {name: float(np.median(spent[name])) / usual for name in ways}
    marks = {"trace": at_most(LSD_SHARE)}
    rows += [
        Row("p50 as a ratio to LSD", "", [Cell(ratio, marks.get(name)) for name, ratio in ratios.items()], 2),
        Row("lines a picture, median", "", [Cell(float(np.median(counts[name]))) for name in ways], 0),
    ]
    title = f"Lines: {len(pictures)} pictures of {source}, {ROUNDS} times each, one thread"
    tables = [Table(title, list(ways), rows)]
    if source == YORK:
        tables.append(_placement(ways, quick))
    return tables


def _placement(ways: dict[str, Find], quick: bool) -> Table:
    """How many lines lead to a true vanishing point, and how exactly."""
    camera, pictures = york_urban()
    found = {
        name: [misses_deg(way(each.gray()), each, camera) for each in pictures[:: 4 if quick else 1]]
        for name, way in ways.items()
    }
    led = {name: [misses[misses <= LEADS_WITHIN_DEG] for misses in each] for name, each in found.items()}

    def share(name: str) -> float:
        return 100.0 * sum(map(len, led[name])) / sum(map(len, found[name]))

    rows = [
        Row("lead there, a picture", "", [Cell(float(np.median([len(m) for m in led[n]]))) for n in ways], 0),
        Row("share of all that do", "%", [Cell(share(name)) for name in ways]),
        Row("miss it by, median", "deg", [Cell(float(np.median(np.concatenate(led[n])))) for n in ways], 2),
    ]
    return Table(
        f"Lines of at least {LEAST_LENGTH:g} px that lead to a true vanishing point within {LEADS_WITHIN_DEG:g} deg",
        list(ways),
        rows,
    )


def misses_deg(lines: LineSegments, picture: YorkPicture, camera: Camera) -> NDArray[np.float64]:
    """Return by how much each line misses the true vanishing point it misses least, degrees."""
    bundle = Bundle.of(lines[lines.lengths >= LEAST_LENGTH], camera, len(lines))
    off = np.abs(bundle.residuals(picture.directions)) * bundle.sigma
    return np.asarray(np.degrees(np.arcsin(np.minimum(off, 1.0)).min(axis=0)))


def _pictures() -> tuple[list[NDArray[np.uint8]], str]:
    try:
        return [each.gray() for each in york_urban()[1]], YORK
    except MissingSetError:
        messages = list(BagReader(CORRIDOR).messages(["image/compressed"]))[::4]
        decoded = [picture(decode(each.cdr, each.type_name)) for each in messages]
        grays = [np.asarray(cv2.cvtColor(each, cv2.COLOR_BGR2GRAY), np.uint8) for each in decoded]
        return grays, "the corridor"
