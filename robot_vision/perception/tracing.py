# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs, allow-untyped-calls
"""Straight lines traced along edges: walk from a clear edge point both ways while a running fit stays straight.

Each step looks at the three pixels ahead where the fitted line will pass and takes the edge point that lies closest
to the line and whose gradient points the same way. When the edge bends, ends or turns its polarity, the walk ends
and all points are fitted once more, robustly. One pass over the edge points in reading order, which keeps what the
processor needs near at hand; no parameter space: the cost follows the number of edge points.
(Related: Topal and Akinlar 2012, EDLines; Suarez et al. 2022, ELSED.)

Kernels here are compiled by numba, which infers their types; import this module only where lines are about to
be traced.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from robot_vision.perception.edges import CONTRAST, FAST, NORMAL_U, NORMAL_V, EdgeFinder, U, V
from robot_vision.perception.segments import LineSegments

#: A traced line: u1 v1 u2 v2, standard deviation of the points about the line (px), gradient (grey levels a pixel).
_LINE_COLUMNS = 6
_MOST_LINES = 6000
#: Walks of fewer points trust the gradient more than where the points lie.
_YOUNG = 6
#: The fit hardly moves once it is long: from this many points on it is renewed at every fourth only.
_SETTLED = 16


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


class _Sums(NamedTuple):
    """What a running fit keeps of its points: sums of their places (from the seed), gradients and contrasts."""

    n: float
    u: float
    v: float
    uu: float
    uv: float
    vv: float
    normal_u: float
    normal_v: float
    contrast: float


class TraceFinder:
    """Traces lines in pictures of one size and in parts of them, in buffers that are allocated once.

    Args:
        shape: height and width of the largest pictures, px.
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
        self._taken = np.empty(shape[0] * shape[1], np.uint8)

    def find(self, gray: NDArray[np.uint8], look: int | None = None) -> tuple[LineSegments, int]:
        """Segments of one picture, in the reading order of where they were met, and the look that showed them.

        Args:
            gray: picture, or a part of one; a view will do.
            look: the one to take; None: the first, and fainter ones while there are too few lines.
        """
        self._edges.look(gray)
        for taken_look in range(len(self._levels)) if look is None else (look,):
            level = self._levels[taken_look]
            index, points = self._edges.find(level.edge_contrast)
            taken = self._taken[: len(points)]
            taken[:] = 0
            count = _trace(index, points, taken, self._members, self._lines, level)
            if count >= self._enough:
                break
        lines = self._lines[:count]
        return LineSegments(lines[:, :4].copy(), lines[:, 5].copy(), lines[:, 4].copy()), taken_look


@njit(**FAST)
def _trace(index, points, taken, members, lines, level):
    """Walk from every point that no walk has taken yet; returns the number of lines found."""
    found = 0
    for seed in range(len(points)):
        if taken[seed] or points[seed, CONTRAST] < level.seed_contrast:
            continue
        taken[seed] = 1
        members[0] = seed
        u0, v0 = np.float64(points[seed, U]), np.float64(points[seed, V])
        sums = _joined(_Sums(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), points, seed, u0, v0)
        count, sums = _walk(index, points, taken, members, 1, sums, u0, v0, 1.0, level)
        count, sums = _walk(index, points, taken, members, count, sums, u0, v0, -1.0, level)
        # A line may run through every other pixel of a diagonal only.
        if count < 0.7 * level.density * level.min_length:
            continue
        if _fit(points, members[:count], sums, u0, v0, level, lines[found]):
            found += 1
            if found == len(lines):
                break
    return found


@njit(**FAST)
def _joined(sums, points, i, u0, v0):
    """Sums with point i besides; the seed is at (u0, v0)."""
    u, v = points[i, U] - u0, points[i, V] - v0
    return _Sums(
        sums.n + 1.0,
        sums.u + u,
        sums.v + v,
        sums.uu + u * u,
        sums.uv + u * v,
        sums.vv + v * v,
        sums.normal_u + points[i, NORMAL_U],
        sums.normal_v + points[i, NORMAL_V],
        sums.contrast + points[i, CONTRAST],
    )


@njit(**FAST)
def _normal(sums):
    """Unit normal of the running fit, on the side of the mean gradient; young walks trust the gradient itself."""
    if sums.n < _YOUNG:
        size = np.sqrt(sums.normal_u**2 + sums.normal_v**2) + 1e-12
        return sums.normal_u / size, sums.normal_v / size
    # Major axis of the 2x2 scatter without trigonometry, by the better conditioned of its two forms.
    spread = (sums.uu - sums.vv) * sums.n - sums.u * sums.u + sums.v * sums.v
    mixed = 2.0 * (sums.uv * sums.n - sums.u * sums.v)
    whole = np.sqrt(spread * spread + mixed * mixed)
    if spread >= 0.0:
        tu, tv = whole + spread, mixed
    else:
        tu, tv = mixed, whole - spread
    size = np.sqrt(tu * tu + tv * tv) + 1e-12
    nu, nv = -tv / size, tu / size
    if nu * sums.normal_u + nv * sums.normal_v < 0.0:
        nu, nv = -nu, -nv
    return nu, nv


@njit(**FAST)
def _walk(index, points, taken, members, count, sums, u0, v0, sense, level):
    """Walk one way (sense +1 or -1 along the line) from the seed at (u0, v0); returns member count and sums.

    Between renewals of the fit each step depends on the picture only through the last column or row, so the
    processor runs ahead.
    """
    height, width = index.shape
    nu, nv = _normal(sums)
    base_u, base_v = u0 + sums.u / sums.n, v0 + sums.v / sums.n
    if count < _YOUNG:
        base_u, base_v = u0, v0
    column, row = int(u0 + 0.5), int(v0 + 0.5)
    along_row, ahead, slope = _course(nu, nv, sense)
    offset = base_u * nu + base_v * nv
    gap = 0
    while count < len(members):
        if along_row:
            column += ahead
            row = int(base_v + (column - base_u) * slope + 0.5)
        else:
            row += ahead
            column = int(base_u + (row - base_v) * slope + 0.5)
        if column < 1 or row < 1 or column >= width - 1 or row >= height - 1:
            break
        best = -1
        closest = level.distance + (0.5 if count < _YOUNG + 2 else 0.0)
        for side in range(-1, 2):
            i = index[row + side, column] if along_row else index[row, column + side]
            if i < 0 or taken[i]:
                continue
            if points[i, NORMAL_U] * nu + points[i, NORMAL_V] * nv < level.turn_cosine:
                continue
            away = abs(points[i, U] * nu + points[i, V] * nv - offset)
            if away < closest:
                closest = away
                best = i
        if best < 0:
            gap += 1
            if gap > level.max_gap or gap > count // 4:
                break
            continue
        gap = 0
        members[count] = best
        count += 1
        taken[best] = 1
        at_u, at_v = np.float64(points[best, U]), np.float64(points[best, V])
        sums = _joined(sums, points, best, u0, v0)
        if count < _SETTLED or count % 4 == 0:
            nu, nv = _normal(sums)
            base_u, base_v = at_u, at_v
            if count >= _YOUNG:
                base_u, base_v = u0 + sums.u / sums.n, v0 + sums.v / sums.n
            offset = base_u * nu + base_v * nv
            if along_row != (abs(nv) >= abs(nu)):
                column, row = int(at_u + 0.5), int(at_v + 0.5)
            along_row, ahead, slope = _course(nu, nv, sense)
    return count, sums


@njit(**FAST)
def _course(nu, nv, sense):
    """Whether the way across normal (nu, nv) steps along rows, by +1 or -1 a step, and its slope across them.

    Walked in the positive sense it has the brighter side on the left in the picture.
    """
    if abs(nv) >= abs(nu):
        return True, (1 if -nv * sense > 0.0 else -1), -nu / nv
    return False, (1 if nu * sense > 0.0 else -1), -nv / nu


@njit(**FAST)
def _fit(points, members, sums, u0, v0, level, line):
    """Robust line through the members: least squares across the line with Cauchy weights; False when refused."""
    n = sums.n
    mu, mv = u0 + sums.u / n, v0 + sums.v / n
    nu, nv = _normal(sums)
    tu, tv = -nv, nu
    shift, slope = 0.0, 0.0
    scale = 0.4
    for _ in range(3):
        w0 = w1 = w2 = d0 = d1 = 0.0
        for i in members:
            u, v = points[i, U] - mu, points[i, V] - mv
            t, d = u * tu + v * tv, u * nu + v * nv
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
    for i in members:
        u, v = points[i, U] - mu, points[i, V] - mv
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
    line[5] = sums.contrast / n
    return True
