# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs, allow-untyped-calls
"""Straight lines traced along edges: walk from a strong edge point both ways while a running fit stays straight.

Each step looks at the three pixels ahead where the fitted line will pass and takes the edge point that lies closest
to the line and whose gradient points the same way. When the edge bends, ends or turns its polarity, the walk ends
and all points are fitted once more, robustly. One pass over the edge points, no parameter space: the cost follows
the number of edge points. (Related: Topal and Akinlar 2012, EDLines; Suarez et al. 2022, ELSED.)

Kernels here are compiled by numba, which infers their types; import this module only where lines are about to
be traced.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from robot_vision.perception.edges import CONTRAST, NORMAL_U, NORMAL_V, EdgeFinder, U, V
from robot_vision.perception.segments import LineSegments

#: A traced line: u1 v1 u2 v2, standard deviation of the points about the line (px), gradient (grey levels a pixel).
_LINE_COLUMNS = 6
_MOST_LINES = 6000
_BINS = 256
_STRONGEST = 64.0
_YOUNG = 6
#: Walks shorter than this share of the shortest line are not tried again from their other points.
_RETRY_SHARE = 0.6
_SUMS = 9
_S_U, _S_V, _S_UU, _S_UV, _S_VV, _S_NU, _S_NV, _S_C, _S_N = range(_SUMS)


class TraceSettings(NamedTuple):
    """What counts as a straight edge.

    Attributes:
        seed_contrast: gradient at which a walk may begin, grey levels a pixel.
        edge_contrast: gradient at which a point may join a walk, grey levels a pixel.
        min_length: shortest line kept, px.
        max_gap: steps without an edge point before the walk ends.
        turn_cosine: least cosine between a point's gradient and the normal of the running fit.
        distance: farthest a point may lie from the running fit, px.
        density: least share of steps along the line with an edge point.
    """

    seed_contrast: float
    edge_contrast: float
    min_length: float
    max_gap: int
    turn_cosine: float = 0.906
    distance: float = 1.0
    density: float = 0.7


class TraceFinder:
    """Traces lines in pictures of one size, in buffers that are allocated once.

    Args:
        shape: height and width of the pictures, px.
        blur: standard deviation of the Gaussian before the gradient, px.
        levels: contrast of seeds and of edge points, grey levels a pixel, for the first look and for each further,
            fainter one.
        enough: number of lines after which no further look is taken.
        min_length: shortest line, px.
        max_gap: longest gap bridged, px.
    """

    def __init__(
        self,
        shape: tuple[int, int],
        blur: float,
        levels: list[tuple[float, float]],
        enough: int,
        min_length: float,
        max_gap: int,
    ) -> None:
        self._edges = EdgeFinder(*shape, blur=blur)
        self._levels = [TraceSettings(seed, edge, min_length, max_gap) for seed, edge in levels]
        self._enough = enough
        self._lines = np.empty((_MOST_LINES, _LINE_COLUMNS), np.float64)
        self._members = np.empty(2 * sum(shape), np.int32)
        self._taken = np.empty(shape[0] * shape[1] // 2 + 1, np.uint8)
        self._order = np.empty(shape[0] * shape[1] // 2 + 1, np.int32)

    def find(self, gray: NDArray[np.uint8]) -> LineSegments:
        """Segments of one picture, the strongest seeds first."""
        self._edges.look(gray)
        for level in self._levels:
            index, points = self._edges.find(level.edge_contrast)
            taken, order = self._taken[: len(points)], self._order[: len(points)]
            taken[:] = 0
            _strongest_first(points, order)
            count = _trace(index, points, order, taken, self._members, self._lines, 0, level)
            if count >= self._enough:
                break
        lines = self._lines[:count]
        return LineSegments(lines[:, :4].copy(), lines[:, 5].copy(), lines[:, 4].copy())


@njit(cache=True)
def _strongest_first(points, order):
    """Counting sort of the edge points by falling contrast, in reading order among equals."""
    start = np.zeros(_BINS + 1, np.int64)
    bins = np.empty(len(points), np.uint8)
    for i in range(len(points)):
        level = min(points[i, CONTRAST] / _STRONGEST, 1.0)
        bins[i] = np.uint8(round((1.0 - level) * (_BINS - 1)))
        start[bins[i] + 1] += 1
    for b in range(_BINS):
        start[b + 1] += start[b]
    for i in range(len(points)):
        order[start[bins[i]]] = i
        start[bins[i]] += 1


@njit(cache=True, fastmath=True)
def _direction(sums):
    """Unit normal of the running fit, on the side of the mean gradient; young walks trust the gradient itself."""
    n = sums[_S_N]
    if n < _YOUNG:
        size = np.sqrt(sums[_S_NU] ** 2 + sums[_S_NV] ** 2) + 1e-12
        return sums[_S_NU] / size, sums[_S_NV] / size
    mu = sums[_S_U] / n
    mv = sums[_S_V] / n
    # Major axis of the 2x2 scatter without trigonometry, by the better conditioned of its two forms.
    spread = (sums[_S_UU] - sums[_S_VV]) / n - mu * mu + mv * mv
    mixed = 2.0 * (sums[_S_UV] / n - mu * mv)
    whole = np.sqrt(spread * spread + mixed * mixed)
    if spread >= 0.0:
        tu, tv = whole + spread, mixed
    else:
        tu, tv = mixed, whole - spread
    size = np.sqrt(tu * tu + tv * tv) + 1e-12
    nu, nv = -tv / size, tu / size
    if nu * sums[_S_NU] + nv * sums[_S_NV] < 0.0:
        nu, nv = -nu, -nv
    return nu, nv


@njit(cache=True, fastmath=True)
def _join(points, i, u0, v0, sums):
    u = points[i, U] - u0
    v = points[i, V] - v0
    sums[_S_U] += u
    sums[_S_V] += v
    sums[_S_UU] += u * u
    sums[_S_UV] += u * v
    sums[_S_VV] += v * v
    sums[_S_NU] += points[i, NORMAL_U]
    sums[_S_NV] += points[i, NORMAL_V]
    sums[_S_C] += points[i, CONTRAST]
    sums[_S_N] += 1.0


@njit(cache=True, fastmath=True)
def _walk(index, points, taken, members, count, sums, seed, sense, level):
    """Walk one way (sense +1 or -1 along the line) from the seed; returns the number of members."""
    height, width = index.shape
    u0 = np.float64(points[seed, U])
    v0 = np.float64(points[seed, V])
    # The last point taken, relative to the seed, and the pixel reached along the running axis.
    at_u, at_v = 0.0, 0.0
    column, row = int(u0 + 0.5), int(v0 + 0.5)
    gap = 0
    nu, nv = _direction(sums)
    along_row = abs(nv) >= abs(nu)
    while count < len(members):
        # Tangent with the brighter side on the left in the picture.
        tu, tv = -nv * sense, nu * sense
        if along_row != (abs(tu) >= abs(tv)):
            along_row = not along_row
            column, row = int(u0 + at_u + 0.5), int(v0 + at_v + 0.5)
        if sums[_S_N] < _YOUNG:
            base_u, base_v = at_u, at_v
        else:
            base_u, base_v = sums[_S_U] / sums[_S_N], sums[_S_V] / sums[_S_N]
        if along_row:
            column += 1 if tu > 0.0 else -1
            row = int(v0 + base_v + (column - u0 - base_u) * tv / tu + 0.5)
        else:
            row += 1 if tv > 0.0 else -1
            column = int(u0 + base_u + (row - v0 - base_v) * tu / tv + 0.5)
        if column < 1 or row < 1 or column >= width - 1 or row >= height - 1:
            break
        best = -1
        closest = level.distance + (0.5 if sums[_S_N] < _YOUNG + 2 else 0.0)
        for side in range(-1, 2):
            i = index[row + side, column] if along_row else index[row, column + side]
            if i < 0 or taken[i] or points[i, CONTRAST] < level.edge_contrast:
                continue
            if points[i, NORMAL_U] * nu + points[i, NORMAL_V] * nv < level.turn_cosine:
                continue
            away = abs((points[i, U] - u0 - base_u) * nu + (points[i, V] - v0 - base_v) * nv)
            if away < closest:
                closest = away
                best = i
        if best < 0:
            gap += 1
            if gap > level.max_gap or gap > 1 + count // 4:
                break
            continue
        gap = 0
        members[count] = best
        count += 1
        taken[best] = 1
        _join(points, best, u0, v0, sums)
        at_u = points[best, U] - u0
        at_v = points[best, V] - v0
        # The fit hardly moves once it is long: renew it ever more seldom.
        if count < 16 or count % 4 == 0:
            nu, nv = _direction(sums)
    return count


@njit(cache=True, fastmath=True)
def _fit(points, members, count, sums, seed, level, line):
    """Robust line through the members: least squares across the line with Cauchy weights; False when refused."""
    u0 = np.float64(points[seed, U])
    v0 = np.float64(points[seed, V])
    n = sums[_S_N]
    mu, mv = u0 + sums[_S_U] / n, v0 + sums[_S_V] / n
    nu, nv = _direction(sums)
    tu, tv = -nv, nu
    shift, slope = 0.0, 0.0
    scale = 0.4
    for _ in range(3):
        w0 = w1 = w2 = d0 = d1 = 0.0
        for k in range(count):
            u = points[members[k], U] - mu
            v = points[members[k], V] - mv
            t = u * tu + v * tv
            d = u * nu + v * nv
            r = (d - shift - slope * t) / scale
            w = 1.0 / (1.0 + r * r)
            w0 += w
            w1 += w * t
            w2 += w * t * t
            d0 += w * d
            d1 += w * t * d
        determinant = w0 * w2 - w1 * w1
        if determinant <= 1e-9:
            return False
        shift = (w2 * d0 - w1 * d1) / determinant
        slope = (w0 * d1 - w1 * d0) / determinant
        scale = 0.3
    first, last, square, near = 1e9, -1e9, 0.0, 0
    for k in range(count):
        u = points[members[k], U] - mu
        v = points[members[k], V] - mv
        t = u * tu + v * tv
        d = u * nu + v * nv - shift - slope * t
        if abs(d) > 1.2:
            continue
        near += 1
        square += d * d
        first = min(first, t)
        last = max(last, t)
    length = last - first
    if near < 4 or length < level.min_length or near < level.density * length * max(abs(tu), abs(tv)):
        return False
    for end, t in enumerate((first, last)):
        line[2 * end] = mu + t * tu + (shift + slope * t) * nu
        line[2 * end + 1] = mv + t * tv + (shift + slope * t) * nv
    line[4] = np.sqrt(square / near)
    line[5] = sums[_S_C] / n
    return True


@njit(cache=True, fastmath=True)
def _trace(index, points, order, taken, members, lines, found, level):
    sums = np.empty(_SUMS)
    for o in range(len(order)):
        seed = order[o]
        if points[seed, CONTRAST] < level.seed_contrast - _STRONGEST / _BINS or found == len(lines):
            break
        if taken[seed] or points[seed, CONTRAST] < level.seed_contrast:
            continue
        sums[:] = 0.0
        taken[seed] = 1
        members[0] = seed
        _join(points, seed, np.float64(points[seed, U]), np.float64(points[seed, V]), sums)
        count = _walk(index, points, taken, members, 1, sums, seed, 1.0, level)
        count = _walk(index, points, taken, members, count, sums, seed, -1.0, level)
        kept = count >= level.density * level.min_length * 0.7
        kept = kept and _fit(points, members, count, sums, seed, level, lines[found])
        if kept:
            found += 1
        elif count >= _RETRY_SHARE * level.min_length:
            # A long walk that failed began badly: its points may yet make a line from another seed.
            for k in range(1, count):
                taken[members[k]] = 0
    return found
