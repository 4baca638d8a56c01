# SPDX-License-Identifier: Apache-2.0
"""What is seen in which pixel, compiled; loaded on the first picture because numba is slow to import.

A rectangle o + s a + t b, seen along the ray d = (x, y, 1), obeys [a b o] (s', t', w') = d with s = s'/w',
t = t'/w' and w' = 1/depth. The three are linear in the pixel (u, v), so its borders s = 0, s = 1, t = 0 and
t = 1 are straight half planes s' >= 0, w' - s' >= 0, ... even where the rectangle passes behind the camera:
nothing needs clipping, and each image row meets it in one interval.

Visibility is found at 16 places in each pixel, all of different rows and columns (a Hammersley set), which
puts the edges where they belong to 1/32 px in any direction; a surface is shaded once a pixel it is seen in.

Cut-out textures are asked at every sample; holes and discs are ellipses whose crossings with a sample row are
the roots of a quadratic, so that their borders are exact.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation.packing import CUT_OUT, ROUND, Lamps, Materials, Surfaces, Surroundings
from robot_vision.simulation.painting import paint
from robot_vision.simulation.shading import BIAS, Floats, Owners, Singles, alpha_at, compiled

TOUCHING = 1e-6
"""Pixels by which neighbours overlap, so that rounding leaves no gap between walls that meet."""
FINER = 1.5
"""Mip levels by which cut-outs are finer than the pixel: its samples take part of the mean."""
FAR = 1e9
"""Column beyond all columns."""
LEVEL = 1e-10
"""Slope below which a border is level: it crosses a row so far away that dividing would leave no digits."""


@compiled
def _borders(forms: Floats, nearest: float) -> Floats:
    """Where rows of the image meet the borders of rectangles, (Q, 6, 3): a sign, and b, c of b y + c.

    Each is a half plane of slope u + rest >= 0, with rest linear in y: for sign +1 columns from b y + c on
    are inside, for -1 columns up to there, for 0 all if b y + c >= 0 and none otherwise.
    """
    borders = np.empty((forms.shape[0], 6, 3))
    plane = np.empty(3)
    for q in range(forms.shape[0]):
        for e in range(6):
            for n in range(3):
                if e < 4:
                    inner, whole = forms[q, e // 2, n], forms[q, 2, n]
                    plane[n] = inner if e % 2 == 0 else whole - inner
                else:
                    plane[n] = forms[q, 2, n] if e == 4 else -forms[q, 2, n]
            if e == 5:
                plane[2] += 1.0 / nearest
            if abs(plane[0]) <= LEVEL * (abs(plane[1]) + abs(plane[2])):
                borders[q, e, 0], borders[q, e, 1], borders[q, e, 2] = 0.0, plane[1], plane[2]
                continue
            borders[q, e, 0] = math.copysign(1.0, plane[0])
            borders[q, e, 1], borders[q, e, 2] = -plane[1] / plane[0], -plane[2] / plane[0]
    return borders


@compiled
def _span(borders: Floats, y: float, width: float) -> tuple[float, float]:
    """First and last column, not rounded, at which the image row y meets a rectangle; none if first > last."""
    low, high = -1.0, width
    for e in range(6):
        place = borders[e, 1] * y + borders[e, 2]
        if borders[e, 0] > 0:
            low = max(low, place)
        elif borders[e, 0] < 0:
            high = min(high, place)
        elif place < 0:
            high = low - 1
    return low, high


@compiled
def _inside(f: Floats, e: Floats, y: float) -> tuple[float, float, bool]:
    """Columns between which the image row y is inside an ellipse of a rectangle.

    If the third is True, those outside of which it is: the ellipse then reaches behind the camera.
    """
    p1 = e[2] * (f[0, 0] - e[0] * f[2, 0]) + e[3] * (f[1, 0] - e[1] * f[2, 0])
    r1 = e[4] * (f[0, 0] - e[0] * f[2, 0]) + e[5] * (f[1, 0] - e[1] * f[2, 0])
    w1, w0 = f[2, 0], f[2, 1] * y + f[2, 2]
    s0, t0 = f[0, 1] * y + f[0, 2] - e[0] * w0, f[1, 1] * y + f[1, 2] - e[1] * w0
    p0, r0 = e[2] * s0 + e[3] * t0, e[4] * s0 + e[5] * t0
    a = p1 * p1 + r1 * r1 - w1 * w1
    b = p1 * p0 + r1 * r0 - w1 * w0
    c = p0 * p0 + r0 * r0 - w0 * w0
    root = b * b - a * c
    if abs(a) < 1e-300 or root < 0:
        if a > 0:
            return FAR, -FAR, False
        return FAR, -FAR, True
    q = -(b + math.copysign(math.sqrt(root), b))
    x1 = q / a
    x2 = c / q if q != 0 else x1
    return min(x1, x2), max(x1, x2), a < 0


@compiled
def _draw_solid(
    f: Floats, borders: Floats, q: int, row: int, places: Floats, depth: Singles, owner: Owners
) -> None:
    """Enter a rectangle in all samples of an image row where it is the nearest so far."""
    width = depth.shape[1]
    q32, slope = np.int32(q), np.float32(f[2, 0])
    for k in range(places.shape[0]):
        y = row + places[k, 1]
        low, high = _span(borders, y, width)
        if high < low:
            continue
        start = max(int(math.ceil(low - places[k, 0] - TOUCHING)), 0)
        end = min(int(math.floor(high - places[k, 0] + TOUCHING)), width - 1)
        if end < start:
            continue
        depths, owners = depth[k, start : end + 1], owner[k, start : end + 1]
        rest = np.float32(f[2, 0] * places[k, 0] + f[2, 1] * y + f[2, 2]) + slope * np.float32(start)
        for x in range(depths.size):
            w = rest + slope * np.float32(x)
            nearer = w > depths[x]
            depths[x] = w if nearer else depths[x]
            owners[x] = q32 if nearer else owners[x]


@compiled
def _draw_round(
    f: Floats,
    borders: Floats,
    ellipses: Floats,
    q: int,
    row: int,
    places: Floats,
    depth: Singles,
    owner: Owners,
    gone: NDArray[np.uint8],
) -> None:
    """The same for a rectangle of which ellipses are missing, or of which only an ellipse is there."""
    width = depth.shape[1]
    for k in range(places.shape[0]):
        y = row + places[k, 1]
        low, high = _span(borders, y, width)
        if high < low:
            continue
        gone[:] = 0
        for e in range(ellipses.shape[0]):
            first, last, beyond = _inside(f, ellipses[e], y)
            first, last = min(max(first, -1.0), width), min(max(last, -1.0), width)
            if (ellipses[e, 6] == 0) == beyond:  # what lies between the two columns is missing
                start = max(int(math.ceil(first - places[k, 0])), 0)
                end = min(int(math.floor(last - places[k, 0])), width - 1)
                for x in range(start, end + 1):
                    gone[x] = 1
            elif beyond or ellipses[e, 6] == 0:
                low_gone = int(math.ceil(first - places[k, 0]))
                high_gone = int(math.floor(last - places[k, 0]))
                if first > last:
                    low_gone, high_gone = width, width
                for x in range(0, min(low_gone, width)):
                    gone[x] = 1
                for x in range(max(high_gone + 1, 0), width):
                    gone[x] = 1
        start = max(int(math.ceil(low - places[k, 0] - TOUCHING)), 0)
        end = min(int(math.floor(high - places[k, 0] + TOUCHING)), width - 1)
        for x in range(start, end + 1):
            w = np.float32(f[2, 0] * (x + places[k, 0]) + f[2, 1] * y + f[2, 2])
            if w > depth[k, x] and gone[x] == 0:
                depth[k, x], owner[k, x] = w, q


@compiled
def _draw_cut_out(
    f: Floats,
    borders: Floats,
    window: Floats,
    texture: int,
    materials: Materials,
    q: int,
    row: int,
    places: Floats,
    depth: Singles,
    owner: Owners,
    spans: Floats,
    starts: Singles,
) -> None:
    """The same for a rectangle whose texture says where there is material.

    Near by, the border is where alpha is 1/2. Where texels are smaller than a sample's share of the
    pixel, alpha is a mean: then that share of the samples is covered, others for each surface.
    """
    samples, width = places.shape[0], depth.shape[1]
    left, right = float(width), -1.0
    for k in range(samples):
        low, high = _span(borders, row + places[k, 1], width)
        spans[k, 0], spans[k, 1] = low - places[k, 0] - TOUCHING, high - places[k, 0] + TOUCHING
        if high >= low:
            left, right = min(left, spans[k, 0]), max(right, spans[k, 1])
    count, repeat, shift = materials.textures[texture]
    w1 = np.float32(f[2, 0])
    for k in range(samples):
        starts[k] = f[2, 0] * places[k, 0] + f[2, 1] * (row + places[k, 1]) + f[2, 2]
    for x in range(max(int(math.ceil(left)), 0), min(int(math.floor(right)), width - 1) + 1):
        hidden = True
        for k in range(samples):
            hidden &= starts[k] + w1 * np.float32(x) <= depth[k, x]
        if hidden:
            continue
        w = max(f[2, 0] * x + f[2, 1] * row + f[2, 2], 1e-9)
        across, along = window[0] / w, window[1] / w
        s, t = (f[0, 0] * x + f[0, 1] * row + f[0, 2]) / w, (f[1, 0] * x + f[1, 1] * row + f[1, 2]) / w
        xu, xv = across * (f[0, 0] - s * f[2, 0]), across * (f[0, 1] - s * f[2, 1])
        yu, yv = along * (f[1, 0] - t * f[2, 0]), along * (f[1, 1] - t * f[2, 1])
        lod = 0.5 * math.log2(max(xu * xu + xv * xv, yu * yu + yv * yv, 1e-12)) - FINER
        lod = min(max(lod, 0.0), count - 1.0)
        level = int(lod + 0.5)
        spread = min(lod, 1.0)
        scale = 1.0 / (1 << level)
        tx, ty = window[2] + s * window[0], window[3] + t * window[1]
        reach = 0.5 * max(abs(xu) + abs(xv), abs(yu) + abs(yv)) + 1.5 / scale + 1.5
        offset, rows, columns = materials.mips[texture, 0]
        if reach < rows + columns:
            i, j = int(tx + BIAS) - BIAS, int(ty + BIAS) - BIAS
            if repeat:
                i, j = i & (columns - 1), j & (rows - 1)
            i, j = min(max(i, 0), columns - 1), min(max(j, 0), rows - 1)
            clear = materials.clearances[offset - shift + j * columns + i]
        else:
            clear = np.float32(0)
        if clear <= -reach:
            continue
        whole = clear >= reach
        offset, rows, columns = materials.mips[texture, level]
        for k in range(samples):
            if x < spans[k, 0] or x > spans[k, 1]:
                continue
            inverse = starts[k] + w1 * np.float32(x)
            if inverse <= depth[k, x]:
                continue
            if whole:
                depth[k, x], owner[k, x] = inverse, q
                continue
            u, v = x + places[k, 0], row + places[k, 1]
            w = f[2, 0] * u + f[2, 1] * v + f[2, 2]
            s = (f[0, 0] * u + f[0, 1] * v + f[0, 2]) / w
            t = (f[1, 0] * u + f[1, 1] * v + f[1, 2]) / w
            share = alpha_at(
                materials.alphas,
                offset - shift,
                rows,
                columns,
                repeat,
                scale * (window[2] + s * window[0]),
                scale * (window[3] + t * window[1]),
            )
            rank = (7 * k + 5 * q) % samples
            if share > 0.5 + spread * ((rank + 0.5) / samples - 0.5):
                depth[k, x], owner[k, x] = inverse, q


@compiled
def render(
    surfaces: Surfaces,
    materials: Materials,
    lamps: Lamps,
    around: Surroundings,
    places: Floats,
    nearest: float,
    picture: Singles,
) -> None:
    """Fill `picture` (H, W, 3) with linear light; one image row at a time, so that all of it stays in cache.

    Args:
        surfaces: rectangles, any order; from near to far is fastest.
        materials: their textures and lights.
        lamps: what mirrors in them.
        around: what is behind them all.
        places: (S, 2) sample places in a pixel, from its centre.
        nearest: depth in metres below which nothing is drawn.
        picture: (H, W, 3) written.
    """
    height, width = picture.shape[0], picture.shape[1]
    samples = places.shape[0]
    depth = np.empty((samples, width), np.float32)
    owner = np.empty((samples, width), np.int32)
    gone = np.empty(width, np.uint8)
    spans = np.empty((samples, 2))
    starts = np.empty(samples, np.float32)
    bounds = surfaces.bounds
    borders = _borders(surfaces.forms, nearest)
    for row in range(height):
        depth[:] = 0.0
        owner[:] = -1
        for q in range(bounds.shape[0]):
            if row < bounds[q, 0] or row > bounds[q, 1]:
                continue
            f, kind = surfaces.forms[q], surfaces.kinds[q]
            if kind == CUT_OUT:
                _draw_cut_out(
                    f,
                    borders[q],
                    surfaces.windows[q],
                    surfaces.textures[q],
                    materials,
                    q,
                    row,
                    places,
                    depth,
                    owner,
                    spans,
                    starts,
                )
            elif kind == ROUND:
                first, some = surfaces.ellipses[q]
                shapes = materials.ellipses[first : first + some]
                _draw_round(f, borders[q], shapes, q, row, places, depth, owner, gone)
            else:
                _draw_solid(f, borders[q], q, row, places, depth, owner)
        paint(row, owner, places, surfaces, materials, lamps, around, picture[row])
