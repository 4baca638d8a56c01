# SPDX-License-Identifier: Apache-2.0
"""Vanishing points of single pictures of York Urban, without tracking, against hand-drawn truth."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bench import directions as scores
from bench.report import Cell, Mark, Row, Table, at_least
from bench.sources import YorkPicture, york_urban
from robot_vision.geometry import Camera
from robot_vision.perception import LineDetector, LineSegments, VanishingPointEstimator

Find = Callable[[NDArray[np.uint8]], LineSegments]


@dataclass
class Scores:
    """The errors and times of one way of finding vanishing points, one entry a picture."""

    directions: list[float] = field(default_factory=list)  # deg, three a picture
    forward: list[float] = field(default_factory=list)  # deg
    horizon: list[float] = field(default_factory=list)  # of the picture's height
    rotation: list[float] = field(default_factory=list)  # deg
    focal: list[float] = field(default_factory=list)  # relative
    lines_ms: list[float] = field(default_factory=list)  # CPU
    vanishing_ms: list[float] = field(default_factory=list)  # CPU


def lsd() -> Find:
    """Return OpenCV's LSD as a way of finding lines."""
    detector: Any = cv2.createLineSegmentDetector()

    def find(gray: NDArray[np.uint8]) -> LineSegments:
        found = detector.detect(gray)[0]
        if found is None:
            return LineSegments.empty()
        return LineSegments.from_endpoints(np.asarray(found, np.float64).reshape(-1, 4))

    return find


def evaluate(pictures: Sequence[YorkPicture], true_camera: Camera, camera: Camera, find: Find) -> Scores:
    """Find the vanishing points of each picture by itself and score them.

    Args:
        pictures: with their truth.
        true_camera: the camera the truth belongs to.
        camera: what the estimator is told of it.
        find: gives the lines of a grey picture.
    """
    estimator = VanishingPointEstimator()
    estimator.estimate(find(pictures[0].gray()), camera)  # what the first picture costs more is not told
    said = Scores()
    for picture in pictures:
        gray = picture.gray()
        began = time.process_time()
        lines = find(gray)
        between = time.process_time()
        points = estimator.estimate(lines, camera)
        ended = time.process_time()
        said.lines_ms.append(1e3 * (between - began))
        said.vanishing_ms.append(1e3 * (ended - between))
        given = scores.best_supported(points.directions, points.weight)
        found = scores.seen_by(given, points.camera, true_camera)
        said.directions += scores.matched_errors_deg(picture.directions, found).tolist()
        said.forward.append(scores.forward_error_deg(picture.directions, found))
        said.horizon.append(scores.horizon_error(picture.directions, given, true_camera, points.camera))
        said.rotation.append(scores.rotation_error_deg(picture.orthogonal, given))
        said.focal.append(abs(points.camera.fx / true_camera.fx - 1.0))
    return said


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
    trace, hough = LineDetector(), LineDetector(method="hough")
    trace.warm_up()
    ways = {
        "trace": evaluate(pictures, camera, camera, trace.detect),
        "focal withheld": evaluate(pictures, camera, blind, trace.detect),
        "hough": evaluate(pictures, camera, camera, hough.detect),
        "OpenCV LSD": evaluate(pictures, camera, camera, lsd()),
    }
    return [_table(ways, len(pictures))]


def _table(ways: dict[str, Scores], count: int) -> Table:
    def row(
        name: str, unit: str, value: Callable[[Scores], float], mark: Mark | None = None, digits: int = 1
    ) -> Row:
        """Marks hold for the first way, the default one with the true camera."""
        cells = [Cell(value(said), None if number else mark) for number, said in enumerate(ways.values())]
        return Row(name, unit, cells, digits)

    focal = [None if name != "focal withheld" else Cell(_percent(said.focal)) for name, said in ways.items()]
    rows = [
        row("AA@3", "%", lambda said: scores.area_under_recall(said.directions, 3.0), at_least(70.0)),
        row("AA@5", "%", lambda said: scores.area_under_recall(said.directions, 5.0)),
        row("AA@10", "%", lambda said: scores.area_under_recall(said.directions, 10.0), at_least(90.0)),
        row("forward within 1 deg", "%", lambda said: scores.share_within(said.forward, 1.0), at_least(75.0)),
        row("forward within 5 deg", "%", lambda said: scores.share_within(said.forward, 5.0)),
        row(
            "horizon AUC",
            "%",
            lambda said: scores.area_under_recall(said.horizon, scores.HORIZON_CUT),
            at_least(94.0),
        ),
        row("rotation error, median", "deg", lambda said: float(np.median(said.rotation)), digits=2),
        Row("focal length error, median", "%", focal),
        row("lines, CPU median", "ms", lambda said: float(np.median(said.lines_ms))),
        row("vanishing points, CPU median", "ms", lambda said: float(np.median(said.vanishing_ms))),
    ]
    return Table(
        f"York Urban: {count} pictures 640x480, each by itself",
        list(ways),
        rows,
        ["the three best-supported vanishing points count; a missing one is 90 deg off"],
    )


def _percent(ratios: list[float]) -> float:
    return 100.0 * float(np.median(ratios))
