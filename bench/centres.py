# SPDX-License-Identifier: Apache-2.0
"""True centres of holes on rendered plates of any slant, beside the centres of the ellipses seen."""

from __future__ import annotations

import time

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.report import Cell, Row, Table, at_least, at_most
from robot_vision.perception import CentreFinder, Centres
from robot_vision.simulation.plate_view import PlateView, plate_view

FIRST_SEED, PLATES, FEW = 1000, 40, 8
SHIFTED = 0.5
"""px: from this shift on, the correction is what counts."""
COLUMNS = ("ellipse", "plane given", "plane by circles")


def run(quick: bool) -> list[Table]:
    """Measure on pictures with the blur, noise and grey levels of a cheap camera."""
    cv2.setNumThreads(1)
    finder = CentreFinder()
    errors: dict[str, list[NDArray[np.float64]]] = {name: [] for name in COLUMNS}
    tilts, spent, holes, seen = [], [], 0, 0
    views = [plate_view(FIRST_SEED + number) for number in range(FEW if quick else PLATES)]
    finder.find(views[0].gray, views[0].camera)
    for view in views:
        given = finder.find(view.gray, view.camera, view.normal)
        began = time.process_time_ns()
        told = finder.find(view.gray, view.camera)
        spent.append(1e-6 * (time.process_time_ns() - began))
        holes, seen = holes + len(view.centres), seen + len(given.found)
        plain = np.array([each.seen.ellipse.centre for each in given.found])
        for name, places in zip(COLUMNS, (plain, _centres(given), _centres(told)), strict=True):
            errors[name].append(_errors(view, places))
        if told.plane is not None:
            tilts.append(np.degrees(np.arccos(min(1.0, float(told.plane.normal @ view.normal)))))
    joined = {name: np.concatenate(each) for name, each in errors.items()}
    shifted = joined["ellipse"] >= SHIFTED
    mark = at_most(0.03)

    def row(name: str, unit: str, ellipse: float | None, given: Cell | None, told: Cell | None) -> Row:
        return Row(name, unit, [None if ellipse is None else Cell(ellipse), given, told], 3)

    plain, given_errors, told_errors = (joined[name] for name in COLUMNS)
    rows = [
        row(
            f"error, RMS, where the ellipse is {SHIFTED} px off or more",
            "px",
            _rms(plain[shifted]),
            Cell(_rms(given_errors[shifted]), mark),
            Cell(_rms(told_errors[shifted]), mark),
        ),
        row(
            "error, RMS, all",
            "px",
            _rms(plain),
            Cell(_rms(given_errors), mark),
            Cell(_rms(told_errors), mark),
        ),
        row(
            "error, worst",
            "px",
            float(plain.max()),
            Cell(float(given_errors.max())),
            Cell(float(told_errors.max())),
        ),
        row("holes found", "%", None, Cell(100.0 * seen / holes, at_least(98.0)), None),
        row("error of the plane, median", "deg", None, None, Cell(float(np.median(tilts)))),
        row("CPU a picture, median", "ms", None, None, Cell(float(np.median(spent)))),
    ]
    title = f"Centres: {holes} holes on {len(views)} rendered plates, {int(shifted.sum())} of them shifted"
    return [Table(title, COLUMNS, rows)]


def _centres(found: Centres) -> NDArray[np.float64]:
    return np.array([each.centre for each in found.found])


def _errors(view: PlateView, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Error of each hole that was found at all, px: one missed is counted elsewhere."""
    apart = view.errors(places)
    return apart[apart < 5.0]


def _rms(errors: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))
