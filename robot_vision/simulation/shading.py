# SPDX-License-Identifier: Apache-2.0
"""What colour a surface shows in a pixel: textures, light and mirrored lamps, compiled for the renderer."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Singles = NDArray[np.float32]
Owners = NDArray[np.int32]

Function = TypeVar("Function", bound=Callable[..., Any])

MAX_PROBES = 12
"""Texture samples along the long side of a slanted pixel footprint; beyond that the mip level coarsens."""
BLENDING = 0.4
"""Part of the way from one mip level to the next over which both are mixed."""
BIAS = 1 << 20
"""Added before cutting off decimals, so that it rounds down below zero as well."""


def compiled(function: Function) -> Function:
    """Compile with numba into its caller, keep the result on disk, and divide as numpy does, unchecked.

    numba looks at the caller's file only: who changes a function here must touch the files that call it.
    """
    compiled: Function = njit(cache=True, error_model="numpy", forceinline=True)(function)
    return compiled


@compiled
def _sample(
    texels: Singles, offset: int, rows: int, columns: int, repeat: int, x: float, y: float
) -> tuple[float, float, float]:
    """Bilinear texture value at (x, y) in texels of one level, texel centres at halves."""
    x -= 0.5
    y -= 0.5
    if not repeat:
        x = min(max(x, 0.0), columns - 1.0)
        y = min(max(y, 0.0), rows - 1.0)
    i, j = int(x + BIAS) - BIAS, int(y + BIAS) - BIAS
    a, b = np.float32(x - i), np.float32(y - j)
    if repeat:
        i0, i1, j0, j1 = i & (columns - 1), (i + 1) & (columns - 1), j & (rows - 1), (j + 1) & (rows - 1)
    else:
        i0, i1, j0, j1 = i, min(i + 1, columns - 1), j, min(j + 1, rows - 1)
    upper, lower = offset + j0 * columns, offset + j1 * columns
    p00, p01 = np.uint64(upper + i0), np.uint64(upper + i1)
    p10, p11 = np.uint64(lower + i0), np.uint64(lower + i1)
    one = np.float32(1)
    w00, w01, w10, w11 = (one - a) * (one - b), a * (one - b), (one - a) * b, a * b
    return (
        w00 * texels[p00, 0] + w01 * texels[p01, 0] + w10 * texels[p10, 0] + w11 * texels[p11, 0],
        w00 * texels[p00, 1] + w01 * texels[p01, 1] + w10 * texels[p10, 1] + w11 * texels[p11, 1],
        w00 * texels[p00, 2] + w01 * texels[p01, 2] + w10 * texels[p10, 2] + w11 * texels[p11, 2],
    )


@compiled
def _filtered(
    texels: Singles,
    mips: Ints,
    texture: int,
    count: int,
    repeat: int,
    x: float,
    y: float,
    xu: float,
    xv: float,
    yu: float,
    yv: float,
) -> tuple[float, float, float]:
    """Texture mean over the footprint of one pixel, given the derivatives of the texel by the pixel.

    The footprint's axes are the singular values of the 2x2 derivative; samples of the mip level of the
    short axis are strung along the long one.
    """
    p, q, r = xu * xu + xv * xv, xu * yu + xv * yv, yu * yu + yv * yv
    mean, half = (p + r) / 2, math.sqrt((p - r) * (p - r) / 4 + q * q)
    long = math.sqrt(mean + half)
    short = max(math.sqrt(max(mean - half, 0.0)), long / MAX_PROBES, 1.0)
    probes = min(max(int(math.ceil(0.75 * long / short - 0.25)), 1), MAX_PROBES)
    ax = ay = 0.0
    if probes > 1:
        if p >= r:
            ax, ay = half + (p - r) / 2, q
        else:
            ax, ay = q, half + (r - p) / 2
        norm = math.sqrt(ax * ax + ay * ay)
        if norm > 0:
            ax, ay = ax * (long / norm), ay * (long / norm)
    lod = min(math.log2(short), count - 1.0)
    level = int(lod)
    blend = min(max((lod - level - 0.5) / BLENDING + 0.5, 0.0), 1.0)
    if level == 0 and blend == 0 and probes == 1:
        return _sample(texels, mips[texture, 0, 0], mips[texture, 0, 1], mips[texture, 0, 2], repeat, x, y)
    blue = green = red = np.float32(0)
    for step in range(2):
        weight = np.float32((1 - blend if step == 0 else blend) / probes)
        if weight == 0:
            continue
        at = level + step
        scale = 1.0 / (1 << at)
        offset, rows, columns = mips[texture, at, 0], mips[texture, at, 1], mips[texture, at, 2]
        dx, dy = ax * (scale / probes), ay * (scale / probes)
        px, py = x * scale - (probes - 1) / 2 * dx, y * scale - (probes - 1) / 2 * dy
        for probe in range(probes):
            b, g, r_ = _sample(texels, offset, rows, columns, repeat, px + probe * dx, py + probe * dy)
            blue += weight * b
            green += weight * g
            red += weight * r_
    return float(blue), float(green), float(red)


@compiled
def alpha_at(alphas: Singles, offset: int, rows: int, columns: int, repeat: int, x: float, y: float) -> float:
    """Bilinear share of material at (x, y) in texels of one level, texel centres at halves."""
    x -= 0.5
    y -= 0.5
    if not repeat:
        x = min(max(x, 0.0), columns - 1.0)
        y = min(max(y, 0.0), rows - 1.0)
    i, j = int(x + BIAS) - BIAS, int(y + BIAS) - BIAS
    a, b = x - i, y - j
    if repeat:
        i0, i1, j0, j1 = i & (columns - 1), (i + 1) & (columns - 1), j & (rows - 1), (j + 1) & (rows - 1)
    else:
        i0, i1, j0, j1 = i, min(i + 1, columns - 1), j, min(j + 1, rows - 1)
    upper, lower = offset + j0 * columns, offset + j1 * columns
    top = (1 - a) * alphas[upper + i0] + a * alphas[upper + i1]
    low = (1 - a) * alphas[lower + i0] + a * alphas[lower + i1]
    return float((1 - b) * top + b * low)


@compiled
def _soft(x: float, width: float) -> float:
    """Smooth step from 0 at x = -width to 1 at x = +width."""
    f = min(max(0.5 + 0.5 * x / width, 0.0), 1.0)
    return f * f * (3 - 2 * f)


@compiled
def mirrored(
    u: float,
    v: float,
    mirrors: Floats,
    mirror: int,
    lamp_colours: Floats,
    lamp_sizes: Floats,
    roughness: float,
) -> tuple[float, float, float]:
    """Light of the lamps behind a mirroring plane, their borders softened with distance."""
    blue = green = red = 0.0
    for lamp in range(mirrors.shape[1]):
        w = mirrors[mirror, lamp, 2, 0] * u + mirrors[mirror, lamp, 2, 1] * v + mirrors[mirror, lamp, 2, 2]
        if w <= 1e-3:
            continue
        s = (
            mirrors[mirror, lamp, 0, 0] * u + mirrors[mirror, lamp, 0, 1] * v + mirrors[mirror, lamp, 0, 2]
        ) / w
        t = (
            mirrors[mirror, lamp, 1, 0] * u + mirrors[mirror, lamp, 1, 1] * v + mirrors[mirror, lamp, 1, 2]
        ) / w
        ws = roughness / (w * lamp_sizes[lamp, 0])
        wt = roughness / (w * lamp_sizes[lamp, 1])
        if s < -ws or s > 1 + ws or t < -wt or t > 1 + wt:
            continue
        seen = _soft(s, ws) * _soft(1 - s, ws) * _soft(t, wt) * _soft(1 - t, wt)
        blue += seen * lamp_colours[lamp, 0]
        green += seen * lamp_colours[lamp, 1]
        red += seen * lamp_colours[lamp, 2]
    return blue, green, red


@compiled
def shade(
    u: float,
    v: float,
    q: int,
    forms: Floats,
    windows: Floats,
    quad_textures: Ints,
    textures: Ints,
    mips: Ints,
    texels: Singles,
    quad_lights: Ints,
    lights: Singles,
) -> tuple[float, float, float]:
    """Light that leaves a rectangle towards the camera through the pixel (u, v)."""
    depth = 1.0 / (forms[q, 2, 0] * u + forms[q, 2, 1] * v + forms[q, 2, 2])
    s = (forms[q, 0, 0] * u + forms[q, 0, 1] * v + forms[q, 0, 2]) * depth
    t = (forms[q, 1, 0] * u + forms[q, 1, 1] * v + forms[q, 1, 2]) * depth
    texture = quad_textures[q]
    count, repeat = textures[texture, 0], textures[texture, 1]
    if count == 1 and mips[texture, 0, 1] == 1 and mips[texture, 0, 2] == 1:
        at = mips[texture, 0, 0]
        blue, green, red = float(texels[at, 0]), float(texels[at, 1]), float(texels[at, 2])
    else:
        across, along = depth * windows[q, 0], depth * windows[q, 1]
        blue, green, red = _filtered(
            texels,
            mips,
            texture,
            count,
            repeat,
            windows[q, 2] + s * windows[q, 0],
            windows[q, 3] + t * windows[q, 1],
            across * (forms[q, 0, 0] - s * forms[q, 2, 0]),
            across * (forms[q, 0, 1] - s * forms[q, 2, 1]),
            along * (forms[q, 1, 0] - t * forms[q, 2, 0]),
            along * (forms[q, 1, 1] - t * forms[q, 2, 1]),
        )
    b, g, r = _sample(
        lights,
        quad_lights[q, 0],
        quad_lights[q, 1],
        quad_lights[q, 2],
        0,
        s * (quad_lights[q, 2] - 1) + 0.5,
        t * (quad_lights[q, 1] - 1) + 0.5,
    )
    return blue * b, green * g, red * r
