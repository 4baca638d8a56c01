# SPDX-License-Identifier: Apache-2.0
"""The crop rows of simulated fields: offset and yaw of drives as they are recorded, for each of the three crops."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bench.report import Cell, Row, Table, at_most
from bench.row_drives import Told, recorded

SETS = ("seedlings", "cabbages", "canopy")
SEEDS, QUICK_SEEDS = (1, 2, 3), (1,)
SECONDS = 8.0
OFFSET_MM, YAW_DEG = 10.0, 0.5


def run(quick: bool, seeds: Sequence[int] | None = None) -> list[Table]:
    """Measure three drives of each crop, one when it is to be quick."""
    seeds = seeds or (QUICK_SEEDS if quick else SEEDS)
    drives = {crop: [recorded({"set": crop}, seed, SECONDS) for seed in seeds] for crop in SETS}
    return [_table(drives, len(seeds))]


def _table(drives: dict[str, list[Told]], count: int) -> Table:
    rms = {crop: np.array([drive.rms() for drive in told]) for crop, told in drives.items()}
    honest = {crop: np.mean([drive.normalised() for drive in told], axis=0) for crop, told in drives.items()}
    unsaid = {
        crop: sum(np.isnan(drive.errors).any(axis=1).sum() for drive in told) for crop, told in drives.items()
    }

    def pooled(crop: str, part: int) -> float:
        return float(np.sqrt(np.mean(rms[crop][:, part] ** 2)))

    rows = [
        Row("offset, RMS", "mm", [Cell(1e3 * pooled(crop, 0), at_most(OFFSET_MM)) for crop in SETS]),
        Row(
            "offset, RMS of the worst drive",
            "mm",
            [Cell(1e3 * float(rms[crop][:, 0].max())) for crop in SETS],
        ),
        Row("yaw, RMS", "deg", [Cell(math.degrees(pooled(crop, 1)), at_most(YAW_DEG)) for crop in SETS], 2),
        Row("offset, squared error / variance", "", [Cell(float(honest[crop][0])) for crop in SETS], 2),
        Row("yaw, squared error / variance", "", [Cell(float(honest[crop][1])) for crop in SETS], 2),
        Row("pictures without an answer", "", [Cell(float(unsaid[crop])) for crop in SETS], 0),
    ]
    return Table(
        f"Crop rows: {count} drives of {SECONDS:g} s for each crop, 640x480 at 10 Hz, in one process",
        list(SETS),
        rows,
        ["20 % of the plants missing, as many weeds as plants were sown, up to 2 deg of roll and pitch"],
    )
