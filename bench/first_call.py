# SPDX-License-Identifier: Apache-2.0
"""What the first distance field of a process costs: right after installing, and with the compiled kernels kept.

Beside it a kernel of one line, kept likewise: what numba takes to load itself, whatever it is asked for.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from tempfile import TemporaryDirectory

import numpy as np

from bench.report import Cell, Row, Table, at_most
from bench.sources import ROOT

PROCESSES, QUICK_PROCESSES = 5, 2
ASKED = {"distance_field": "field", "a kernel of one line": "least"}


def run(quick: bool) -> list[Table]:
    """Measure fresh processes, one after the other, with a cache of their own."""
    first, later, imports = [], [], []
    with TemporaryDirectory() as cache:
        for asked in ASKED.values():
            first.append(_fresh(asked, cache)["call"])
        told = [
            [_fresh(asked, cache) for asked in ASKED.values()]
            for _ in range(QUICK_PROCESSES if quick else PROCESSES)
        ]
    for column in range(len(ASKED)):
        later.append(float(np.median([row[column]["call"] for row in told])))
        imports.append(float(np.median([row[column]["import"] for row in told])))
    rows = [
        Row("first call after installing", "s", [Cell(first[0], at_most(30.0)), Cell(first[1])], 2),
        Row("first call of later processes", "s", [Cell(later[0], at_most(0.5)), Cell(later[1])], 3),
        Row("import of robot_vision.planning", "s", [Cell(imports[0], at_most(0.5)), None], 3),
    ]
    notes = [f"CPU; later processes: median of {len(told)}; numba is imported by the call"]
    return [Table("First call of a process", list(ASKED), rows, notes)]


def _fresh(asked: str, cache: str) -> dict[str, float]:
    told = subprocess.run(
        [sys.executable, "-m", "bench.first_call", asked],
        cwd=ROOT,
        env={**os.environ, "NUMBA_CACHE_DIR": cache, "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    found: dict[str, float] = json.loads(told.stdout)
    return found


def _field() -> dict[str, float]:
    began = time.process_time()
    from robot_vision.planning import distance_field

    imported = time.process_time()
    distance_field(np.ones((50, 50), np.bool_), (1, 1))
    return {"import": imported - began, "call": time.process_time() - imported}


def _least() -> dict[str, float]:
    began = time.process_time()
    from bench.least_kernel import first_of

    first_of(np.zeros(1))
    return {"import": 0.0, "call": time.process_time() - began}


if __name__ == "__main__":
    print(json.dumps(_field() if sys.argv[1] == "field" else _least()))
