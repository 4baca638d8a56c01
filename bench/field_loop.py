# SPDX-License-Identifier: Apache-2.0
"""Tracker and steering drive along crop rows at 1.6 m/s over rough ground, to the headland, through gaps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.report import Cell, Mark, Row, Table, at_most
from bench.row_drives import RATE, Told, closed
from robot_vision.simulation.live import LiveSettings

SPEED = 1.6
SEEDS, QUICK_SEEDS = range(1, 6), range(1, 2)
LIVE = LiveSettings(rate=RATE, roughness=0.01, lean=math.radians(1.0), offset=0.08, yaw=0.04)
LENGTH_M, GAP_M = 14.0, 3.0
FIELDS: dict[str, dict[str, Any]] = {
    "seedlings": {"set": "seedlings"},
    "cabbages": {"set": "cabbages"},
    "bend 0.02": {"set": "cabbages", "curvature": 0.02, "rows": 19},
    "gap of 3 m": {"set": "cabbages", "gap": GAP_M, "gap_at": 6.0},
    "canopy": {"set": "canopy"},
}
RMS_MM, END_M = 15.0, 0.5
SHORT_M = 1.0
"""A drive that stops so long before the end of the rows has not gone through."""


def run(quick: bool, seeds: Sequence[int] | None = None) -> list[Table]:
    """Drive with five seeds in each field, with one when it is to be quick, or with those that are named."""
    seeds = seeds or (QUICK_SEEDS if quick else SEEDS)
    drives = {
        name: [closed({"length": LENGTH_M, **settings}, seed, SPEED, LIVE, True) for seed in seeds]
        for name, settings in FIELDS.items()
    }
    return [_table(drives, len(seeds))]


def end_error(told: Told) -> float:
    """Farthest the end of the rows was said from where it is, m; nan when it was never said."""
    ends = np.array(told.ends)
    return float(np.nanmax(np.abs(ends - LENGTH_M))) if np.isfinite(ends).any() else math.nan


def told_from(told: Told) -> float:
    """How far before the end of the rows one was first told, m; nan when it never was."""
    known = np.flatnonzero(np.isfinite(told.ends))
    return LENGTH_M - told.along[known[0]] if len(known) else math.nan


def _kept(drive: Told) -> NDArray[np.float64]:
    """Offsets after settling, m; infinite for a drive that came to an end before."""
    offsets = drive.kept()
    return offsets if len(offsets) else np.array([np.inf])


def _table(drives: dict[str, list[Told]], count: int) -> Table:
    def row(name: str, unit: str, value: Any, mark: Mark | None = None, digits: int = 1) -> Row:
        cells = [Cell(float(value(told)), mark) for told in drives.values()]
        return Row(name, unit, cells, digits)

    kept = {name: np.concatenate([_kept(drive) for drive in told]) for name, told in drives.items()}
    rms = [Cell(1e3 * float(np.sqrt(np.mean(values**2))), at_most(RMS_MM)) for values in kept.values()]
    rows = [
        Row("offset after 3 m, RMS", "mm", rms),
        Row(
            "offset after 3 m, RMS of the worst drive",
            "mm",
            [
                Cell(1e3 * max(float(np.sqrt(np.mean(_kept(d) ** 2))) for d in told))
                for told in drives.values()
            ],
        ),
        Row("offset, greatest", "mm", [Cell(1e3 * float(np.abs(values).max())) for values in kept.values()]),
        row(
            "drives that changed row",
            "",
            lambda told: sum(not np.abs(_kept(drive)).max() <= 0.25 for drive in told),
            at_most(0.0),
            0,
        ),
        row(
            "drives that did not stop at the headland",
            "",
            lambda told: sum(not d.stopped for d in told),
            at_most(0),
            0,
        ),
        row(
            "drives that stopped on the way",
            "",
            lambda told: sum(d.stopped and d.along[-1] < LENGTH_M - SHORT_M for d in told),
            at_most(0),
            0,
        ),
        row(
            "end of the rows, first told before it, median",
            "m",
            lambda told: np.nanmedian([*map(told_from, told)]),
        ),
        row(
            "end of the rows, median error", "m", lambda told: np.nanmedian([*map(end_error, told)]), digits=2
        ),
        row(
            "end of the rows, greatest error",
            "m",
            lambda told: np.nanmax([*map(end_error, told)]),
            at_most(END_M),
            2,
        ),
    ]
    return Table(
        f"Crop rows, closed loop: {count} drives of {LENGTH_M:g} m at {SPEED:g} m/s, in one process",
        list(drives),
        rows,
        ["each starts 8 cm and 2 deg off; rough ground, up to 1 deg of sway besides"],
    )
