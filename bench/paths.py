# SPDX-License-Identifier: Apache-2.0
"""Planned ways on the maps of MovingAI: how long they are, whether they can be driven, and the octile optima."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from bench.floors import MAPS, Problem, movingai
from bench.report import Cell, Row, Table, at_least, at_most
from bench.visibility import VisibilityGraph
from robot_vision.planning import connected_field, distance_field, plan_path
from robot_vision.planning.path import warm_up

PROBLEMS, QUICK_PROBLEMS = 100, 10
_PRINTED = 1e-5
"""Optima are printed with six digits."""


def run(quick: bool) -> list[Table]:
    """Plan 100 problems a map, or as many as there are; ten when it is to be quick.

    Raises:
        MissingSetError: the maps are not there.
    """
    warm_up()
    rows: dict[str, list[Cell]] = {name: [] for name in _ROWS}
    for name in MAPS:
        free, problems = movingai(name, QUICK_PROBLEMS if quick else PROBLEMS)
        for row, cell in zip(rows.values(), _measured(free, problems), strict=True):
            row.append(cell)
    table = [Row(name, unit, rows[name], digits) for name, (unit, digits) in _ROWS.items()]
    notes = [
        "drivable: no straight piece passes through a wall or between walls that touch, looked at point by point",
        "the exact optimum is found by brute force over all corners that see each other (bench/visibility.py)",
    ]
    return [Table("MovingAI: problems of the harder half of each file", list(MAPS), table, notes)]


_ROWS = {
    "problems": ("", 0),
    "way over exact optimum, mean": ("", 6),
    "way over exact optimum, worst": ("", 6),
    "ways that cannot be driven": ("", 0),
    "error of the field, worst": ("%", 6),
    "octile optima reproduced": ("%", 1),
    "octile optimum over exact, mean": ("", 3),
    "CPU for a way, median": ("ms", 1),
}


def _measured(free: NDArray[np.bool_], problems: list[Problem]) -> list[Cell]:
    ratios, octile, over, milliseconds = [], [], [], []
    errors, undrivable = [], 0
    graph = VisibilityGraph(free)
    for problem in problems:
        began = time.process_time()
        way = plan_path(free, problem.start, problem.goal)
        milliseconds.append(1e3 * (time.process_time() - began))
        exact = graph.distance(problem.start, problem.goal)
        errors.append(abs(float(distance_field(free, problem.goal)[problem.start]) / exact - 1))
        ratios.append(float(np.hypot(*np.diff(way, axis=0).T).sum()) / exact)
        undrivable += not is_drivable(free, way)
        eight = connected_field(free, problem.goal, 8, until=problem.start)[problem.start]
        octile.append(bool(abs(eight - problem.octile) <= _PRINTED * problem.octile))
        over.append(problem.octile / exact)
    return [
        Cell(len(problems)),
        Cell(float(np.mean(ratios)), at_most(1.0001)),
        Cell(max(ratios), at_most(1.001)),
        Cell(undrivable, at_most(0)),
        Cell(100 * max(errors), at_most(0.01)),
        Cell(100.0 * float(np.mean(octile)), at_least(100)),
        Cell(float(np.mean(over))),
        Cell(float(np.median(milliseconds))),
    ]


def is_drivable(free: NDArray[np.bool_], way: NDArray[np.float64]) -> bool:
    """Whether points 1/50 cell apart on a way all lie in free cells, or on their borders."""
    walls = np.pad(~free, 1, constant_values=True)
    for begin, end in zip(way, way[1:], strict=False):
        steps = int(np.ceil(50 * np.hypot(*(end - begin)))) + 1
        places = begin + np.linspace(0, 1, steps + 1)[:, None] * (end - begin) + 1.5
        blocked = np.ones(len(places), np.bool_)
        for down in (-1e-6, 1e-6):  # a point on a border is free if a cell on either side is
            for right in (-1e-6, 1e-6):
                cells = np.floor(places + (down, right)).astype(int)
                blocked &= walls[cells[:, 0], cells[:, 1]]
        if blocked.any():
            return False
    return True
