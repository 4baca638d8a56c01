# SPDX-License-Identifier: Apache-2.0
"""How fast the distance function spreads, how much memory it takes and how it grows, beside scikit-fmm (order 2).

scikit-fmm comes with `pip install 'robot_vision[bench]'`; without it the columns of the peer stay empty.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.floors import FLOORS, middle_cell
from bench.report import Cell, Row, Table, at_least, at_most
from bench.sources import ROOT
from robot_vision.planning import cost_field, distance_field
from robot_vision.planning.path import warm_up

SIZES, QUICK_SIZES = (500, 1000, 2000, 4000), (250, 500)
FASTER = {"maze": 3.0, "rooms": 8.0}
NEAR_CELLS, NEAR_GOALS = 40, 15
ERRORS_SIZE, FAR_CELLS = 500, 10
PEER = "skfmm"
Field = Callable[[NDArray[np.bool_], tuple[int, int]], Any]


def spread_by_peer(free: NDArray[np.bool_], goal: tuple[int, int]) -> Any:
    """The same field by scikit-fmm, order 2."""
    import skfmm

    front = np.ones(free.shape)
    front[goal] = 0.0
    return skfmm.distance(np.ma.MaskedArray(front, ~free), order=2)


def run(quick: bool) -> list[Table]:
    """Measure four sizes, two small ones when it is to be quick."""
    warm_up()
    sizes = QUICK_SIZES if quick else SIZES
    return [_errors(), *(_table(kind, sizes) for kind in FLOORS)]


def _errors() -> Table:
    """Fast marching against the exact field, where all cells cost the same."""
    marching, peers = [], []
    for floor in FLOORS.values():
        free = floor(ERRORS_SIZE)
        goal = middle_cell(free)
        exact = distance_field(free, goal)
        far = np.isfinite(exact) & (exact > FAR_CELLS)
        found = [cost_field(np.where(free, 1.0, np.inf), goal)]
        if find_spec(PEER) is not None:
            # scikit-fmm's front lies half a cell around the goal's centre
            found.append(np.asarray(spread_by_peer(free, goal).filled(np.inf)) + 0.5)
        errors = [100.0 * np.abs(field[far] / exact[far] - 1.0) for field in found]
        marching.append(errors[0])
        peers.append(errors[1] if len(errors) > 1 else np.array([math.nan]))
    rows = [
        Row("cost_field, worst", "%", [Cell(float(e.max()), at_most(0.5)) for e in marching], 3),
        Row("cost_field, mean", "%", [Cell(float(e.mean())) for e in marching], 5),
        Row("scikit-fmm order 2, worst", "%", [Cell(float(e.max())) for e in peers], 3),
        Row("scikit-fmm order 2, mean", "%", [Cell(float(e.mean())) for e in peers], 3),
    ]
    title = f"Fast marching over even floors of {ERRORS_SIZE}², more than {FAR_CELLS} cells from the goal"
    notes = ["against distance_field, which is held to brute force (tests, and the benchmark paths)"]
    return Table(title, list(FLOORS), rows, notes)


def _table(kind: str, sizes: tuple[int, ...]) -> Table:
    has_peer = find_spec(PEER) is not None
    ours, peers, near, memory = [], [], [], []
    for size in sizes:
        free = FLOORS[kind](size)
        goal = middle_cell(free)
        ours.append(_least_seconds(distance_field, free, goal))
        peers.append(_least_seconds(spread_by_peer, free, goal) if has_peer else math.nan)
        near.append(ours[-1] / _near_seconds(free, goal))
        memory.append((_peak_mb("ours", kind, size), _peak_mb(PEER, kind, size) if has_peer else math.nan))
    faster, less = at_least(FASTER[kind]) if has_peer else None, at_most(50.0) if has_peer else None
    per_cell = [1e9 * seconds / size**2 for seconds, size in zip(ours, sizes, strict=True)]
    rows = [
        Row("whole field, CPU", "ms", [Cell(1e3 * value) for value in ours]),
        Row("the same a cell", "ns", [Cell(value) for value in per_cell]),
        Row("scikit-fmm order 2, CPU", "ms", [Cell(1e3 * value) for value in peers]),
        Row("times as fast", "", [Cell(b / a, faster) for a, b in zip(ours, peers, strict=True)]),
        Row(
            "`until` a near robot, times as fast, median", "", [Cell(value, at_least(10.0)) for value in near]
        ),
        Row("peak memory", "MB", [Cell(a) for a, _ in memory]),
        Row("share of scikit-fmm's", "%", [Cell(100 * a / b, less) for a, b in memory], 0),
    ]
    notes = [
        f"near: within {NEAR_CELLS} cells; memory: what a process of its own needs beyond the grid itself",
    ]
    return Table(f"Distance functions of {kind}, goal in the middle", [f"{s}²" for s in sizes], rows, notes)


def _least_seconds(spread: Field, free: NDArray[np.bool_], goal: tuple[int, int]) -> float:
    """CPU seconds, the least of some runs."""
    least = math.inf
    runs = min(10, 8_000_000 // free.size)
    for _ in range(max(runs, 1 if spread is spread_by_peer else 2)):
        began = time.process_time()
        spread(free, goal)
        least = min(least, time.process_time() - began)
    return least


def _near_seconds(free: NDArray[np.bool_], goal: tuple[int, int]) -> float:
    """CPU seconds until robots near the goal are reached, in the median."""
    away = np.argwhere(free) - goal
    near = np.argwhere(free)[(np.hypot(away[:, 0], away[:, 1]) <= NEAR_CELLS) & away.any(axis=1)]
    reached = distance_field(free, goal)
    chosen = np.random.default_rng(0).permutation(near)
    robots = [tuple(cell) for cell in chosen if np.isfinite(reached[tuple(cell)])][:NEAR_GOALS]
    times = []
    for robot in robots:
        began = time.process_time()
        distance_field(free, goal, until=robot)
        times.append(time.process_time() - began)
    return float(np.median(times))


def _peak_mb(who: str, kind: str, size: int) -> float:
    """Peak memory of one field beyond that of the process with the grid in it, by a process of its own, MB."""
    told = subprocess.run(
        [sys.executable, "-m", "bench.fields", who, kind, str(size)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    return float(json.loads(told.stdout)["mb"])


def _measure_memory(who: str, kind: str, size: int) -> float:
    """Peak of the resident memory while a field spreads, beyond what is resident before, MB (Linux)."""
    spread: Field = distance_field if who == "ours" else spread_by_peer
    small = FLOORS[kind](64)
    spread(small, middle_cell(small))
    free = FLOORS[kind](size)
    goal = (1, 1)  # looking for another one would take memory itself
    Path("/proc/self/clear_refs").write_text("5")  # the peak so far is forgotten
    before = _status_kb("VmRSS")
    spread(free, goal)
    return (_status_kb("VmHWM") - before) / 1024


def _status_kb(name: str) -> int:
    lines = Path("/proc/self/status").read_text(encoding="utf-8").splitlines()
    (line,) = (line for line in lines if line.startswith(f"{name}:"))
    return int(line.split()[1])


if __name__ == "__main__":
    print(json.dumps({"mb": _measure_memory(sys.argv[1], sys.argv[2], int(sys.argv[3]))}))
