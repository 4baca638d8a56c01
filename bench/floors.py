# SPDX-License-Identifier: Apache-2.0
"""Grids to plan on: mazes and rooms grown from a seed at any size, and the maps and problems of MovingAI."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench.sources import data_set

MAPS = ("16room_000", "arena", "brc202d", "maze512-8-0")
_HEADER_LINES = 4


def maze_floor(size: int, seed: int = 0, corridor: int = 7, loops: float = 0.1) -> NDArray[np.bool_]:
    """A maze of corridors with walls one cell thick, bool (size, size), free where True."""
    random = np.random.default_rng(seed)
    pitch = corridor + 1
    count = size // pitch
    free = np.zeros((size, size), np.bool_)

    def carve(a: tuple[int, int], b: tuple[int, int]) -> None:
        (row, column), (r, c) = min(a, b), max(a, b)
        free[row * pitch + 1 : (r + 1) * pitch, column * pitch + 1 : (c + 1) * pitch] = True

    seen = np.zeros((count, count), np.bool_)
    seen[0, 0] = True
    trail = [(0, 0)]
    carve((0, 0), (0, 0))
    while trail:
        row, column = trail[-1]
        around = [(row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)]
        fresh = [place for place in around if min(place) >= 0 and max(place) < count and not seen[place]]
        if not fresh:
            trail.pop()
            continue
        there = fresh[int(random.integers(len(fresh)))]
        seen[there] = True
        carve((row, column), there)
        trail.append(there)
    for _ in range(int(loops * count * count)):
        row, column = (int(part) for part in random.integers(0, count - 1, 2))
        carve((row, column), (row, column + 1) if random.random() < 0.5 else (row + 1, column))
    return free


def rooms_floor(size: int, seed: int = 0, room: int = 32, door: int = 3) -> NDArray[np.bool_]:
    """Square rooms with doors to most of their neighbours, bool (size, size), free where True."""
    random = np.random.default_rng(seed)
    free = np.ones((size, size), np.bool_)
    free[::room] = free[:, ::room] = False
    for row in range(0, size, room):
        for column in range(0, size, room):
            for upright in (False, True):
                at = int(random.integers(2, room - door - 2))
                if random.random() > 0.85 or not (row if upright else column):
                    continue
                if upright:
                    free[row, column + at : column + at + door] = True
                else:
                    free[row + at : row + at + door, column] = True
    return free


FLOORS = {"maze": maze_floor, "rooms": rooms_floor}


def middle_cell(free: NDArray[np.bool_]) -> tuple[int, int]:
    """A free cell near the middle of the list of free cells."""
    row, column = np.argwhere(free)[free.sum() // 2]
    return int(row), int(column)


@dataclass(frozen=True)
class Problem:
    """From where to where (row, column), and the length over eight neighbours that never cuts a corner."""

    start: tuple[int, int]
    goal: tuple[int, int]
    octile: float


def movingai(name: str, most: int, seed: int = 1) -> tuple[NDArray[np.bool_], list[Problem]]:
    """A map of MovingAI, free where True, and problems of the harder half of its file, drawn with a fixed seed.

    Raises:
        MissingSetError: it is not there.
    """
    folder = data_set("movingai", f"{name}.map")
    lines = (folder / f"{name}.map").read_text(encoding="utf-8").splitlines()
    height = int(lines[1].split()[1])
    letters = np.array([list(line) for line in lines[_HEADER_LINES : _HEADER_LINES + height]])
    rows = (folder / f"{name}.map.scen").read_text(encoding="utf-8").splitlines()[1:]
    problems = []
    for row in rows:
        if row.strip():
            parts = row.split()
            c0, r0, c1, r1 = (int(part) for part in parts[4:8])
            problems.append(Problem((r0, c0), (r1, c1), float(parts[8])))
    hard = sorted(problems, key=lambda problem: problem.octile)[len(problems) // 2 :]
    chosen = np.random.default_rng(seed).permutation(len(hard))[:most]
    return np.isin(letters, [".", "G", "S"]), [hard[number] for number in chosen]
