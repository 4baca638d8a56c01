# SPDX-License-Identifier: Apache-2.0
"""Scores plans of the floor against its truth: each picture, and the map that all of them make."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from bench.floor_truth import FLOOR, FloorTruth
from robot_vision.mapping import PlanView
from robot_vision.mapping.boundary import Boundary
from robot_vision.simulation import floor_plan
from robot_vision.simulation.world import World

Array = NDArray[np.float64]

REACH_M, NEAREST_M = 6.0, 1.0
_CLOSE_M = 0.15
"""Cells this near to anything real are not counted as falsely taken: they may be its edge."""
_TOLERANCE = 0.15
_COLUMNS = 8
"""An object that fewer columns show is too small a part of the picture to be judged."""
_AROUND_M = 0.3
_CELLS = 4


@dataclass
class PictureScores:
    """Collects what single pictures are worth.

    Attributes:
        iou: of visible floor up to 6 m, in pixels.
        shadow: share of visible floor in shadow that is called something else.
        found: by kind of object, whether the end of the floor is right in half of its columns.
        distance: relative errors of the distance of found objects.
    """

    iou: list[float] = field(default_factory=list)
    shadow: list[float] = field(default_factory=list)
    found: dict[str, list[bool]] = field(default_factory=lambda: defaultdict(list))
    distance: list[float] = field(default_factory=list)

    def add(self, world: World, truth: FloorTruth, boundary: Boundary) -> None:
        """Score one picture."""
        label, distance = truth.label, truth.distance
        rows = np.arange(len(label))[:, None]
        told = rows > boundary.rows[None, :]
        near, floor = distance < REACH_M, label == FLOOR
        self.iou.append(float((told & floor & near).sum() / ((told | floor) & near).sum()))
        dark = truth.shadow & near
        if dark.sum() > 100:
            self.shadow.append(float((dark & ~told).sum() / dark.sum()))
        other = label != FLOOR
        base = np.where(other.any(axis=0), len(label) - 1 - np.argmax(other[::-1], axis=0), 0)
        columns = np.arange(label.shape[1])
        what, away = label[base, columns], distance[base, columns]
        believed = np.hypot(boundary.x, boundary.y)
        for number, item in enumerate(world.objects):
            mine = (what == number + 1) & (away > NEAREST_M) & (away < REACH_M)
            if item.kind != "object" or item.height < 0.2 or mine.sum() < _COLUMNS:
                continue
            right = np.abs(believed[mine] / away[mine] - 1.0) < _TOLERANCE
            kind = "disguised" if item.name.startswith("disguised") else "distinct"
            self.found[kind].append(bool(right.mean() >= 0.5))
            if right.mean() >= 0.5:
                self.distance.append(abs(float(np.median(believed[mine]) / np.median(away[mine])) - 1.0))


@dataclass(frozen=True)
class MapScores:
    """What a map is worth.

    Attributes:
        iou: of free floor, among cells that are known.
        false_of_free: share of free cells, more than 15 cm from anything real, that are called taken.
        false_of_taken: share of the cells called taken that are such.
        shadow, shadow_away: share of the cells in shadow called taken: of all, and of those 15 cm off anything real.
        found: by kind of object, whether the map has it.
    """

    iou: float
    false_of_free: float
    false_of_taken: float
    shadow: float
    shadow_away: float
    found: dict[str, list[bool]]


def score_map(world: World, grid: PlanView, told: Array, true: Array) -> MapScores:
    """Score a map against the plan of its world.

    Args:
        world: that was driven through.
        grid: the map, in odom.
        told: (N, 2) places of the robot by odometry; the map lies in them as best they fit the truth.
        true: (N, 2) true places.
    """
    turn, shift = _fit(told, true)
    rows, columns = np.mgrid[0 : grid.cells.shape[0], 0 : grid.cells.shape[1]]
    x = grid.origin[0] + (columns + 0.5) * grid.resolution
    y = grid.origin[1] + (rows + 0.5) * grid.resolution
    places = np.stack([x, y], axis=-1) @ turn.T + shift
    plan = floor_plan.occupancy(world)
    really = _looked_up(plan.cells, plan, places, -1)
    free, taken = grid.cells == 0, grid.cells == 100
    known, floor = free | taken, really == floor_plan.FREE
    room = distance_transform_edt(np.pad(plan.cells, 20, constant_values=-1) == floor_plan.FREE)[
        20:-20, 20:-20
    ]
    away = floor & (_looked_up(room * plan.resolution, plan, places, 0.0) > _CLOSE_M)
    dark = np.zeros(floor.shape, bool)
    if world.shadows:
        dark = (_looked_up(floor_plan.shadows(world).cells, plan, places, -1) == floor_plan.OCCUPIED) & known
    found: dict[str, list[bool]] = defaultdict(list)
    for item in world.objects:
        middle = item.footprint.mean(axis=0)
        about = np.hypot(*np.moveaxis(places - middle, -1, 0)) < _AROUND_M
        passed = np.hypot(*(true - middle).T).min() < 3.0
        if item.kind == "object" and item.height >= 0.2 and passed and (known & about).any():
            kind = "disguised" if item.name.startswith("disguised") else "distinct"
            found[kind].append(bool((taken & about).sum() >= _CELLS))
    return MapScores(
        iou=_share(free & floor, free | (floor & known)),
        false_of_free=_share(taken & away, away & known),
        false_of_taken=_share(taken & away, taken),
        shadow=_share(taken & dark, dark),
        shadow_away=_share(taken & dark & away, dark & away),
        found=found,
    )


def _share(part: NDArray[np.bool_], whole: NDArray[np.bool_]) -> float:
    return float(part.sum() / whole.sum()) if whole.any() else float("nan")


def _fit(told: Array, true: Array) -> tuple[Array, Array]:
    """Rotation (2, 2) and shift (2,) that bring one row of places upon the other (Kabsch 1976)."""
    a, b = told - told.mean(axis=0), true - true.mean(axis=0)
    moment = a.T @ b
    angle = np.arctan2(moment[0, 1] - moment[1, 0], moment[0, 0] + moment[1, 1])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return turn, true.mean(axis=0) - turn @ told.mean(axis=0)


def _looked_up(values: NDArray[Any], plan: floor_plan.Plan, places: Array, outside: float) -> Array:
    """Values of a plan's cells (R, C) at places (..., 2)."""
    cells = np.floor((places - plan.origin) / plan.resolution).astype(int)
    inside = (cells >= 0).all(axis=-1) & (cells < np.array(values.shape)[::-1]).all(axis=-1)
    found = np.full(inside.shape, outside, np.float64)
    found[inside] = values[cells[inside][:, 1], cells[inside][:, 0]]
    return found


def joined(parts: Sequence[dict[str, list[bool]]], kind: str) -> float:
    """Share of an object's appearances that were found, nan without any."""
    all_of = [value for part in parts for value in part.get(kind, [])]
    return float(np.mean(all_of)) if all_of else float("nan")
