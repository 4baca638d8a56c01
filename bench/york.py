# SPDX-License-Identifier: Apache-2.0
"""Vanishing points of single pictures of York Urban, without tracking, against hand-drawn truth."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bench import directions as scores
from bench.peer import LuVpDetect, MissingPeerError
from bench.report import Cell, Mark, Row, Table, at_least, at_most
from bench.sources import YorkPicture, york_urban
from robot_vision.geometry import Camera
from robot_vision.perception import LineDetector, LineSegments, VanishingPointEstimator

Find = Callable[[NDArray[np.uint8]], LineSegments]

PEER = "lu-vp-detect"
FASTER_THAN_THE_PEER = 4.0
TIMES = {"trace": at_most(12.0), "focal withheld": at_most(25.0)}


@dataclass
class Scores:
    """The errors and times of one way of finding vanishing points, one entry a picture."""

    directions: list[float] = field(default_factory=list)  # deg, three a picture
    forward: list[float] = field(default_factory=list)  # deg
    horizon: list[float] = field(default_factory=list)  # of the picture's height
    rotation: list[float] = field(default_factory=list)  # deg
    focal: list[float] = field(default_factory=list)  # relative
    lines_ms: list[float] = field(default_factory=list)  # CPU, nan where it is not known apart
    whole_ms: list[float] = field(default_factory=list)  # CPU, from grey picture to vanishing points


@dataclass(frozen=True)
class Answer:
    """What one way says of one picture.

    Attributes:
        directions: (M, 3) unit vectors, M <= 3, in the optical frame of `camera`.
        camera: with the focal length found, when none was given.
        lines_ms: CPU time to its lines, nan where it is not known apart.
        whole_ms: CPU time from the grey picture to the directions.
    """

    directions: NDArray[np.float64]
    camera: Camera
    lines_ms: float
    whole_ms: float


Way = Callable[[YorkPicture], Answer]


def ours(find: Find, camera: Camera) -> Way:
    """Return our estimator behind a way of finding lines, told what `camera` tells."""
    estimator = VanishingPointEstimator()
    estimator.warm_up()

    def answer(picture: YorkPicture) -> Answer:
        gray = picture.gray()
        began = time.process_time()
        lines = find(gray)
        between = time.process_time()
        points = estimator.estimate(lines, camera)
        ended = time.process_time()
        best = scores.best_supported(points.directions, points.weight)
        return Answer(best, points.camera, 1e3 * (between - began), 1e3 * (ended - began))

    return answer


def theirs(peer: LuVpDetect, camera: Camera) -> Way:
    """Return lu-vp-detect as a way; it tells no time for its lines."""

    def answer(picture: YorkPicture) -> Answer:
        directions, spent = peer.find(picture.path)
        return Answer(directions, camera, math.nan, spent)

    return answer


def hough() -> LineDetector:
    """Return the Hough transform with the best of several settings tried on these pictures."""
    return LineDetector(method="hough", contrast=18.0, edge_contrast=6.0, min_length=20.0, max_gap=3)


def lsd() -> Find:
    """Return OpenCV's LSD as a way of finding lines."""
    detector: Any = cv2.createLineSegmentDetector()

    def find(gray: NDArray[np.uint8]) -> LineSegments:
        found = detector.detect(gray)[0]
        if found is None:
            return LineSegments.empty()
        return LineSegments.from_endpoints(np.asarray(found, np.float64).reshape(-1, 4))

    return find


def evaluate(
    pictures: Sequence[YorkPicture], true_camera: Camera, ways: Mapping[str, Way]
) -> dict[str, Scores]:
    """Find the vanishing points of each picture by itself, each way in turn, and score them.

    Args:
        pictures: with their truth.
        true_camera: the camera the truth belongs to.
        ways: by name.
    """
    said = {name: Scores() for name in ways}
    for way in ways.values():
        way(pictures[0])  # what the first picture costs more is not told
    for picture in pictures:
        # One after the other on each picture: whatever disturbs the machine disturbs all alike
        for name, way in ways.items():
            _score(said[name], way(picture), picture, true_camera)
    return said


def _score(said: Scores, answer: Answer, picture: YorkPicture, true_camera: Camera) -> None:
    given, camera = answer.directions, answer.camera
    found = scores.seen_by(given, camera, true_camera)
    said.directions += scores.matched_errors_deg(picture.directions, found).tolist()
    said.forward.append(scores.forward_error_deg(picture.directions, found))
    said.horizon.append(scores.horizon_error(picture.directions, given, true_camera, camera))
    said.rotation.append(scores.rotation_error_deg(picture.orthogonal, given))
    said.focal.append(abs(camera.fx / true_camera.fx - 1.0))
    said.lines_ms.append(answer.lines_ms)
    said.whole_ms.append(answer.whole_ms)


def run(quick: bool) -> list[Table]:
    """Measure, with every fourth picture when it is to be quick.

    Raises:
        MissingSetError: the pictures are not there.
    """
    camera, pictures = york_urban()
    if quick:
        pictures = pictures[::4]
    cv2.setNumThreads(1)
    blind = Camera.uncalibrated(camera.width, camera.height)
    trace = LineDetector()
    trace.warm_up()
    ways = {
        "trace": ours(trace.detect, camera),
        "focal withheld": ours(trace.detect, blind),
        "hough": ours(hough().detect, camera),
        "OpenCV LSD": ours(lsd(), camera),
    }
    notes = ["the three best-supported vanishing points count; a missing one is 90 deg off"]
    try:
        with LuVpDetect(camera) as peer:
            said = evaluate(pictures, camera, {**ways, PEER: theirs(peer, camera)})
    except MissingPeerError as missing:
        notes.append(f"lu-vp-detect could not be installed, so nothing is measured beside it: {missing}")
        said = evaluate(pictures, camera, ways)
    return [_table(said, len(pictures), notes)]


Marks = Mapping[str, Mark]


def _table(ways: Mapping[str, Scores], count: int, notes: Sequence[str]) -> Table:
    def row(
        name: str, unit: str, value: Callable[[Scores], float], marks: Marks | None = None, digits: int = 1
    ) -> Row:
        cells = [Cell(value(said), (marks or {}).get(way)) for way, said in ways.items()]
        return Row(name, unit, cells, digits)

    def reached(threshold: float) -> Callable[[Scores], float]:
        return lambda said: scores.area_under_recall(said.directions, threshold)

    def ahead_within(limit: float) -> Callable[[Scores], float]:
        return lambda said: scores.share_within(said.forward, limit)

    def horizon(said: Scores) -> float:
        return scores.area_under_recall(said.horizon, scores.HORIZON_CUT)

    focal = [
        Cell(_percent(said.focal), at_most(4.0)) if way == "focal withheld" else None
        for way, said in ways.items()
    ]
    rows = [
        row("AA@3", "%", reached(3.0), {"trace": at_least(74.0)}),
        row("AA@5", "%", reached(5.0)),
        row("AA@10", "%", reached(10.0), {"trace": at_least(92.0)}),
        row("forward within 1 deg", "%", ahead_within(1.0), {"trace": at_least(80.0)}),
        row("forward within 5 deg", "%", ahead_within(5.0), {"trace": at_least(100.0)}),
        row("horizon AUC", "%", horizon, {"trace": at_least(96.5), "focal withheld": at_least(96.0)}),
        row("rotation error, median", "deg", lambda said: _median(said.rotation), {"trace": at_most(0.7)}, 2),
        Row("focal length error, median", "%", focal),
        row("lines, CPU median", "ms", lambda said: _median(said.lines_ms)),
        row("picture to vanishing points, CPU median", "ms", lambda said: _median(said.whole_ms), TIMES),
    ]
    if PEER in ways:
        usual = _median(ways[PEER].whole_ms)
        faster = {"trace": at_least(FASTER_THAN_THE_PEER)}
        rows.append(
            row("times as fast as lu-vp-detect", "", lambda said: usual / _median(said.whole_ms), faster)
        )
    return Table(f"York Urban: {count} pictures 640x480, each by itself", list(ways), rows, notes)


def _median(values: list[float]) -> float:
    return float(np.median(values))


def _percent(ratios: list[float]) -> float:
    return 100.0 * _median(ratios)
