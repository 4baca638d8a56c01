# SPDX-License-Identifier: Apache-2.0
"""Settings of the row tracing chosen on some pictures of crop rows (CRBD) and judged on the others; see `folds`."""

from __future__ import annotations

from itertools import product

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.crbd import BLIND_MARKS, GIVEN_MARKS, SIGMAS
from bench.folds import FOLDS, ROUNDS, held_out
from bench.report import Cell, Row, Table, at_least
from bench.row_scores import crda, horizon_and_spacing
from bench.sources import CropPicture, crop_rows
from robot_vision.perception import CropRowDetector
from robot_vision.perception.crop_rows.tracing import RowTracer, TracedRows
from robot_vision.perception.crop_rows.votes import StraightRows

POWERS = (0.1, 0.2, 0.4)
TURN_COSTS = (3.0, 4.5, 6.0)
STRETCH_COSTS = (0.6, 0.9, 1.4)
Array = NDArray[np.float64]


def run(quick: bool) -> list[Table]:
    """Measure, with every fourth picture when it is to be quick.

    Raises:
        MissingSetError: the pictures are not there.
    """
    pictures = crop_rows()
    if quick:
        pictures = pictures[::4]
    cv2.setNumThreads(1)
    begun = [_begun(picture) for picture in pictures]
    tracers = [
        RowTracer(power=power, turn_cost=turn, stretch_cost=stretch)
        for power, turn, stretch in product(POWERS, TURN_COSTS, STRETCH_COSTS)
    ]
    of_all = np.array([_scores(tracer, begun, pictures) for tracer in tracers])
    goal = of_all[:, :, ::2].mean(axis=2)  # at 0.1
    judged = held_out(of_all, np.random.default_rng(0), goal).tolist()
    usual = _scores(RowTracer(), begun, pictures).mean(axis=0).tolist()
    marks = [*BLIND_MARKS, *GIVEN_MARKS]
    names = [
        f"CRDA at {sigma}, {said}"
        for said in ("nothing given", "horizon and spacing given")
        for sigma in SIGMAS
    ]
    rows = [
        Row(name, "", [Cell(judged[k], at_least(marks[k])), Cell(usual[k])], 3)
        for k, name in enumerate(names)
    ]
    title = f"CRBD, {len(tracers)} settings, {FOLDS} folds of {len(pictures)} pictures, {ROUNDS} rounds"
    return [Table(title, ["held out", "default settings"], rows)]


def _begun(picture: CropPicture) -> tuple[NDArray[np.float32], StraightRows, StraightRows]:
    """What the tracing of a picture begins with: weights, and straight rows with nothing and with both hints given."""
    detector, bgr = CropRowDetector(), picture.colour()
    height, width = bgr.shape[:2]
    weight = detector.weight.of(bgr).weight
    spectrum = detector.votes.spectrum(weight)
    horizon, spacing = horizon_and_spacing(picture.rows, height)
    given = detector.votes.search(spectrum, width, spacing, -horizon / (height - 1.0 - horizon))
    return weight, detector.votes.search(spectrum, width), given


def _scores(
    tracer: RowTracer,
    begun: list[tuple[NDArray[np.float32], StraightRows, StraightRows]],
    pictures: list[CropPicture],
) -> Array:
    """Return the scores (P, 4) of each picture: blind at each sigma, then given."""
    least = CropRowDetector().votes.least
    rows = []
    for (weight, blind, given), picture in zip(begun, pictures, strict=True):
        middle = 0.5 * weight.shape[1]
        tables = [_table(tracer.trace(weight, found, least, found is given)) for found in (blind, given)]
        rows.append([crda(table, picture.rows, middle, sigma) for table in tables for sigma in SIGMAS])
    return np.array(rows)


def _table(traced: TracedRows) -> Array:
    """Columns (H, 9) of the rows about the one that was traced."""
    return np.asarray(traced.centre[:, None] + np.arange(-4.0, 5.0) * traced.spacing[:, None])
