# SPDX-License-Identifier: Apache-2.0
"""Rows of single real pictures (CRBD), with and without horizon and spacing given, beside the textbook's recipe."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from bench.report import Cell, Mark, Row, Table, at_least, at_most
from bench.row_scores import crda, horizon_and_spacing
from bench.sources import CropPicture, crop_rows
from robot_vision.perception import CropRowDetector
from robot_vision.perception.crop_rows.tracing import RowTracer
from robot_vision.perception.vegetation import (
    Picture,
    Vegetation,
    VegetationMask,
    VegetationWeight,
    vegetation_index,
)

SIGMAS = (0.1, 0.2)
HALF_PX = 0.5
BLIND_MARKS, GIVEN_MARKS = (0.84, 0.935), (0.86, 0.94)
SMALL_MS, LARGE_MS = 12.0, 25.0


@dataclass
class Scores:
    """What one way of finding rows gives, one entry a picture."""

    blind: list[tuple[float, float]] = field(default_factory=list)
    given: list[tuple[float, float]] = field(default_factory=list)
    shifted: list[tuple[float, float]] = field(default_factory=list)  # blind, truth counted from the edge
    ms: list[float] = field(default_factory=list)  # CPU, blind


@dataclass(frozen=True)
class HardWeight(VegetationWeight):
    """A mask for a weight: each pixel grows or does not."""

    def of(self, picture: Picture) -> Vegetation:
        """Weigh plants with 1."""
        mask = VegetationMask(least_area=1).of(picture).astype(np.float32)
        return Vegetation(vegetation_index(picture), mask)


def ways() -> dict[str, CropRowDetector]:
    """Return the detector, and the same with one thing changed."""
    default = CropRowDetector(least_confidence=0.0)
    return {
        "default": default,
        "straight": replace(default, method="straight"),
        "fixed spacing": replace(default, tracer=RowTracer(stretches=1)),
        "mask": replace(default, weight=HardWeight()),
        "recipe": replace(default, method="plants"),
    }


def evaluate(pictures: Sequence[CropPicture], detector: CropRowDetector, scale: int = 1) -> Scores:
    """Find the rows of each picture by itself and score them; no answer scores 0.

    Args:
        pictures: with their truth.
        detector: that finds them.
        scale: by which pictures are enlarged before; only the time is of interest then.
    """
    detector.warm_up()
    said = Scores()
    for picture in pictures:
        bgr = picture.colour()
        height, width = bgr.shape[:2]
        if scale > 1:
            large = cv2.resize(bgr, (scale * width, scale * height), interpolation=cv2.INTER_CUBIC)
            bgr = np.asarray(large, np.uint8)
        began = time.process_time()
        blind = detector.detect(bgr)
        said.ms.append(1e3 * (time.process_time() - began))
        if scale > 1:
            continue
        given = detector.detect(bgr, *horizon_and_spacing(picture.rows, height))
        middle = 0.5 * width
        for answers, found, column in (
            (said.blind, blind, middle),
            (said.given, given, middle),
            (said.shifted, blind, middle - HALF_PX),
        ):
            scores = [0.0 if found is None else crda(found.table, picture.rows, column, s) for s in SIGMAS]
            answers.append((scores[0], scores[1]))
    return said


def run(quick: bool) -> list[Table]:
    """Measure, with every fourth picture when it is to be quick.

    Raises:
        MissingSetError: the pictures are not there.
    """
    pictures = crop_rows()
    if quick:
        pictures = pictures[::4]
    cv2.setNumThreads(1)
    found = {name: evaluate(pictures, detector) for name, detector in ways().items()}
    large = evaluate(pictures[::3], CropRowDetector(), 2)
    return [_table(found, large, len(pictures))]


def _table(found: dict[str, Scores], large: Scores, count: int) -> Table:
    def row(name: str, values: list[float], mark: Mark | None, unit: str = "", digits: int = 3) -> Row:
        """Marks hold for the default."""
        cells = [Cell(value, None if number else mark) for number, value in enumerate(values)]
        return Row(name, unit, cells, digits)

    rows = []
    for label, part, marks in (
        ("nothing given", "blind", BLIND_MARKS),
        ("horizon and spacing given", "given", GIVEN_MARKS),
        ("nothing given, edge", "shifted", (None, None)),
    ):
        for k, sigma in enumerate(SIGMAS):
            values = [float(np.mean([entry[k] for entry in getattr(said, part)])) for said in found.values()]
            mark = marks[k]
            rows.append(row(f"CRDA at {sigma}, {label}", values, None if mark is None else at_least(mark)))
    times = [float(np.median(said.ms)) for said in found.values()]
    rows.append(row("CPU median at 320x240", times, at_most(SMALL_MS), "ms", 1))
    cells = [Cell(float(np.median(large.ms)), at_most(LARGE_MS)), *[None] * (len(found) - 1)]
    rows.append(Row("CPU median at 640x480", "ms", cells))
    return Table(
        f"Crop Row Benchmark Dataset: {count} pictures 320x240, each by itself",
        list(found),
        rows,
        [
            "straight: not followed; fixed spacing: followed without stretching; mask: plants or nothing",
            "recipe: dilated plants, one vote each",
            "edge: the set's middle column, 160, is the middle of the picture, 159.5 where pixel centres are whole",
        ],
    )
