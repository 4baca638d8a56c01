# SPDX-License-Identifier: Apache-2.0
"""Faces of walls on a square grid in a plan of the floor: where floor ends along a line of the grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping.plan_view import FREE, OCCUPIED, PlanView
from robot_vision.mapping.pose import Pose

Array = NDArray[np.float64]

_STRAIGHT = 0.25
"""Way across per way along from which ends of the floor lie on no face."""
_APART = 0.6
"""Cells between every fourth bearing's ends from which they lie on no common face."""
_TOGETHER = 0.08
"""Cells from their median within which ends of the floor tell of the same faces."""
_LEAST = 5
"""Bearings that must tell of a face."""
_UNSURE = 0.45
"""Cells by which a face may lie off a line of the grid: beyond it could as well be that of the next one."""


@dataclass(frozen=True)
class Face:
    """Where floor ends before walls across an axis, on one side of the robot.

    Attributes:
        axis: 0 for walls that run north and south, 1 for the others.
        side: of the robot: 1 up the axis, -1 down it.
        nearer: m by which floor ends nearer to the robot than at the walls' faces, were it where it is believed.
    """

    axis: int
    side: int
    nearer: float


def faces(plan: PlanView, pose: Pose, eye: float, reach: float, cell: float, wall: float) -> list[Face]:
    """Faces of walls in a plan, at most one for each axis and side.

    Args:
        plan: in base_link.
        pose: of base_link in the maze, as believed.
        eye: of the camera ahead of base_link, m.
        reach: farthest face looked for, m.
        cell: side of the grid's cells, m.
        wall: thickness of the walls, m.
    """
    cos, sin = np.cos(pose.yaw), np.sin(pose.yaw)
    ends = floor_ends(plan, eye, reach) @ np.array([[cos, sin], [-sin, cos]])
    found = []
    for axis in (0, 1):
        step = np.full_like(ends, np.nan)
        step[2:-2] = ends[4:] - ends[:-4]
        along = np.abs(step[:, 1 - axis])
        with np.errstate(invalid="ignore"):
            across = (np.abs(step[:, axis]) < _STRAIGHT * along) & (along < _APART * cell)
        for side in (-1, 1):
            places = ends[across & (ends[:, axis] * side > 0.0), axis]
            lines = (places + side * wall / 2 + pose[axis]) / cell
            nearer = _agreed(side * (np.round(lines) - lines))
            if nearer is not None:
                found.append(Face(axis, side, nearer * cell))
    return found


def _agreed(nearer: Array) -> float | None:
    """What most of the bearings (K,) tell, cells; None where they do not agree."""
    if len(nearer) < _LEAST:
        return None
    middle = float(np.median(nearer))
    same = np.abs(nearer - middle) < _TOGETHER
    if same.sum() < _LEAST or same.mean() < 0.5 or abs(middle) > _UNSURE:
        return None
    return float(nearer[same].mean())


def floor_ends(plan: PlanView, eye: float, reach: float, rays: int = 91) -> Array:
    """Where the floor ends in a plan, bearing by bearing from right to left; (rays, 2) m in base_link, nan where not.

    Args:
        plan: in base_link.
        eye: of the camera ahead of base_link, m.
        reach: farthest end looked for, m.
        rays: bearings from -45 to 45 degrees.
    """
    bearings = np.linspace(-np.pi / 4, np.pi / 4, rays)[:, None]
    ranges = np.arange(0.0, reach, plan.resolution / 4)
    x, y = eye + ranges * np.cos(bearings), ranges * np.sin(bearings)
    column = np.floor((x - plan.origin[0]) / plan.resolution).astype(np.int64)
    row = np.floor((y - plan.origin[1]) / plan.resolution).astype(np.int64)
    rows, columns = plan.cells.shape
    inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    cells = np.where(inside, plan.cells[np.where(inside, row, 0), np.where(inside, column, 0)], -1)
    taken, free = cells >= OCCUPIED, cells == FREE
    first = np.argmax(taken, axis=1)
    numbers = np.arange(len(ranges))
    last = np.max(np.where(free & (numbers < first[:, None]), numbers, -1), axis=1)
    # floor that was seen up to what ends it: else the end may be nearer than the picture's lower edge
    good = taken.any(axis=1) & (last >= 0) & (ranges[first] - ranges[last] < 2.5 * plan.resolution)
    end = np.where(good, (ranges[first] + ranges[last]) / 2, np.nan)[:, None]
    return np.concatenate([eye + end * np.cos(bearings), end * np.sin(bearings)], axis=1)
