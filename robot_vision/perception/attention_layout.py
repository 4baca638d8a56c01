# SPDX-License-Identifier: Apache-2.0
"""Lays out the region that holds most of what tells, at a given cost: from the bottom of the picture upwards."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.geometry.sphere import normalised
from robot_vision.perception.region import Region
from robot_vision.perception.segments import LineSegments
from robot_vision.perception.vanishing import Role, VanishingPoints

Array = NDArray[np.float64]

#: How far above the vanishing line a region may reach, rad.
_TOPS = np.radians([0.0, 1.0, 2.0, 4.0, 6.0, 9.0, 12.0])
#: Room above that a region will be given besides, about, rad; beside it gets a column.
_ROOM = 0.02
#: The vanishing point has so much of the region on each side of it, rad.
_BESIDE = 0.1
_COLUMNS = 32
#: Points along a line by which it is told what part of it lies in a region.
_STATIONS = 8
#: What leads ahead on the floor, uprights, and all that leads ahead: what they tell, relative to each other.
_VALUES = np.array([1.0, 0.3, 0.1])
#: Of regions that hold about the same the cheaper one: value of the cost saved.
_THRIFT = 0.02
#: What a look costs: the part that any look does, that which follows the pixels, that which follows the length of the
#: lines there. Measured on simulated roads and corridors and on the first half of a real road.
_FIXED, _PIXELS, _LENGTH = 0.04, 0.78, 0.18
#: A whole look that found fewer lines than this was followed by a second, fainter one; a region is spared one of both.
_FEW, _SPARED = 120, 1.6
#: Least share of what leads ahead on the floor that a region must hold.
_LEAST = 0.3
#: Least support of the primary vanishing point that a region must promise: fewer lines may confirm it no longer.
_LEAST_SUPPORT = 4.0
_BEGIN, _END = (
    np.array(pairs)
    for pairs in zip(*((i, j) for i in range(_COLUMNS) for j in range(i + 1, _COLUMNS + 1)), strict=True)
)


@dataclass(frozen=True)
class Layout:
    """A region relative to the primary vanishing point.

    Attributes:
        left, right: borders from the vanishing point, px; None: the border of the picture.
        above: height above the vanishing line, rad.
        support: of the primary and the vertical vanishing point that the region promises.
        lines: number of lines that it promises.
    """

    left: float | None
    right: float | None
    above: float
    support: tuple[float, float]
    lines: float

    def region(
        self, points: VanishingPoints, primary: int, up: Array, room: tuple[float, float]
    ) -> Region | None:
        """The region where the vanishing point is, with room beside and above it (rad); None: it holds nothing."""
        camera = points.camera
        column = float(points.pixels[primary][0])
        beside, above = room[0] * camera.fx, room[1] * camera.fy
        left = 0.0 if self.left is None else np.clip(column + self.left - beside, 0.0, camera.width)
        right = (
            camera.width if self.right is None else np.clip(column + self.right + beside, 0.0, camera.width)
        )
        rows = vanishing_rows(points, primary, up, np.array([left, right]))
        if rows is None:
            return None
        top = np.clip(rows.min() - self.above * camera.fy - above, 0.0, camera.height)
        first, last, upper = int(left), int(np.ceil(right)), int(top)
        if last <= first or upper >= camera.height:
            return None
        return Region(first, upper, last - first, camera.height - upper)


def lay_out(
    lines: LineSegments, points: VanishingPoints, primary: int, up: Array, budget: float
) -> Layout | None:
    """The best layout by a look at the whole picture; None where none holds enough at that cost.

    Args:
        lines: of the whole picture, with `points.labels` for each.
        points: vanishing points.
        primary: index of the primary one, which lies in the picture.
        up: (3,) the vertical in the optical frame.
        budget: greatest cost, as a share of that of the whole picture.
    """
    camera = points.camera
    column, row = points.pixels[primary]
    scale, beside = camera.width / _COLUMNS, _BESIDE * camera.fx
    share = (np.arange(_STATIONS) + 0.5) / _STATIONS
    u = lines.endpoints[:, :1] + share * (lines.endpoints[:, 2:3] - lines.endpoints[:, :1])
    v = lines.endpoints[:, 1:2] + share * (lines.endpoints[:, 3:4] - lines.endpoints[:, 1:2])
    rows = vanishing_rows(points, primary, up, u)
    if rows is None:
        return None
    roles = np.append(points.roles, np.uint32(0))[points.labels]
    member = points.labels >= 0
    upright = member & (roles == Role.VERTICAL)
    # On a road that bends the points farther ahead lead ahead, too.
    ahead = member & ((roles == Role.PRIMARY) | (roles == Role.OTHER))
    kinds = np.stack([ahead, upright, ahead, np.ones(len(lines), bool)])
    above = (rows - v) / camera.fy
    cell = np.clip((u * (_COLUMNS / camera.width)).astype(int), 0, _COLUMNS - 1)
    piece = lines.lengths / _STATIONS
    held = np.zeros((4, len(_TOPS), _COLUMNS + 1))
    for k, top in enumerate(_TOPS):
        for kind in range(4):
            inside = kinds[kind][:, None] & (above <= (0.0 if kind == 0 else top))
            counted = np.bincount(cell[inside], np.broadcast_to(piece[:, None], u.shape)[inside], _COLUMNS)
            held[kind, k, 1:] = np.cumsum(counted)
    whole = kinds @ lines.lengths
    whole[0] = held[0, 0, -1]
    if whole[0] <= 0.0:
        return None
    shares = (held[:, :, _END] - held[:, :, _BEGIN]) / np.maximum(whole, 1e-9)[:, None, None]
    # It will be kept with some room: what that costs is counted.
    high = np.clip(row - (_TOPS + _ROOM) * camera.fy, 0.0, camera.height)
    begins, ends = np.maximum(_BEGIN - 1, 0), np.minimum(_END + 1, _COLUMNS)
    area = (1.0 - high / camera.height)[:, None] * ((ends - begins) / _COLUMNS)
    length = (held[3][:, ends] - held[3][:, begins]) / max(float(whole[3]), 1e-9)
    cost = _FIXED + _PIXELS * area + _LENGTH * length
    if len(lines) < _FEW:
        cost = cost / _SPARED
    value = np.tensordot(_VALUES, shares[:3], 1) - _THRIFT * cost
    around = _evenly_around(column / scale, beside / scale, held[0, 0])
    enough = (shares[0] >= _LEAST) & (shares[2] * points.weight[primary] >= _LEAST_SUPPORT)
    value = np.where((cost <= budget) & enough & around, value, -np.inf)
    k, pair = divmod(int(np.argmax(value)), value.shape[1])
    if not np.isfinite(value[k, pair]):
        return None
    begin, end = int(_BEGIN[pair]), int(_END[pair])
    vertical = points.of(Role.VERTICAL)
    return Layout(
        None if begin == 0 else begin * scale - float(column),
        None if end == _COLUMNS else end * scale - float(column),
        float(_TOPS[k]),
        (
            float(shares[2, k, pair] * points.weight[primary]),
            0.0 if vertical is None else float(shares[1, k, pair] * points.weight[vertical]),
        ),
        float(shares[3, k, pair]) * len(lines),
    )


def _evenly_around(column: float, beside: float, floor: Array) -> NDArray[np.bool_]:
    """Which spans of columns reach as far to both sides of a column, or on one to the last line on the floor.

    Args:
        column: where the vanishing point is.
        beside: least reach to each side, unless the picture ends before.
        floor: (_COLUMNS + 1,) what leads ahead on the floor before each column.
    """
    first = int(np.searchsorted(floor, 0.0, side="right")) - 1
    last = int(np.searchsorted(floor, floor[-1]))
    to_left, to_right = column - _BEGIN, _END - column
    even = np.abs(to_left - to_right) <= 1.0
    even |= (to_left < to_right) & (_BEGIN == first) | (to_right < to_left) & (_END == last)
    wide = (_BEGIN <= max(0.0, column - beside)) & (_END >= min(_COLUMNS, column + beside))
    return even & wide


def vanishing_rows(points: VanishingPoints, primary: int, up: Array, columns: Array) -> Array | None:
    """Rows of the vanishing line through the primary point at some columns; None where the floor is not below it."""
    camera: Camera = points.camera
    ahead = points.directions[primary]
    level = normalised(up - float(up @ ahead) * ahead)
    if not level[1] <= -0.5:
        return None
    across = (columns - camera.cx) / camera.fx
    return np.asarray(camera.cy - camera.fy * (level[0] * across + level[2]) / level[1])
