# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs, allow-untyped-calls
"""The loops of the crop rows over all pixels, hypotheses and states, compiled.

numba is slow to import: import this module only where a picture is about to be looked at.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

_TURN = 2.0 * math.pi


@njit(cache=True, fastmath=True)
def excess_green(picture, dark):
    """(2 g - b - r) / (b + g + r + dark), float32 (H, W), of a BGR picture uint8 (H, W, 3)."""
    height, width = picture.shape[:2]
    index = np.empty((height, width), np.float32)
    for v in range(height):
        for u in range(width):
            b = np.float32(picture[v, u, 0])
            g = np.float32(picture[v, u, 1])
            r = np.float32(picture[v, u, 2])
            index[v, u] = (g + g - b - r) / (b + g + r + dark)
    return index


@njit(cache=True, fastmath=True)
def standardise_rows(weight, centred, power):
    """Each row without its mean, divided by width and by sd^power, its middle pixel at column 0 (circular)."""
    height, width = weight.shape
    length = centred.shape[1]
    half = width // 2
    for v in range(height):
        total = np.float32(0.0)
        square = np.float32(0.0)
        for u in range(width):
            total += weight[v, u]
            square += weight[v, u] * weight[v, u]
        mean = total / width
        sd = math.sqrt(max(square / width - mean * mean, 0.0)) + 1e-3
        scale = np.float32(1.0 / (sd**power * width))
        for u in range(width - half):
            centred[v, u] = (weight[v, u + half] - mean) * scale
        for u in range(half):
            centred[v, length - half + u] = (weight[v, u] - mean) * scale


@njit(cache=True, fastmath=True)
def pool(spectrum, bottom, ratio, least, step, most, harmonics, real, imaginary, density):
    """Gathers the spectrum of each image row at the frequency of the crop rows there.

    The spacing runs linearly from `bottom` at the last image row to `bottom * ratio` at the first. Successive image
    rows whose densities (1 / spacing) differ by less than `step` are summed, at most `most` of them.

    `spectrum` holds packed rows of cv2.dft, (H, L); `real` and `imaginary` (G, harmonics) are filled, and `density`
    (G,) with the mean rows a pixel of each pool.

    Returns:
        Number of pools filled.
    """
    height, length = spectrum.shape
    pools = 0
    count = 0
    first = 0.0
    total = 0.0
    slope = bottom * (1.0 - ratio) / (height - 1.0)
    for v in range(height - 1, -1, -1):
        spacing = bottom - slope * (height - 1 - v)
        if spacing < least:
            break
        rate = 1.0 / spacing
        if pools == 0 or rate - first > step or count >= most:
            if pools > 0:
                density[pools - 1] = total / count
            if pools == len(density):
                return pools
            pools += 1
            first = rate
            count = 0
            total = 0.0
            for m in range(harmonics):
                real[pools - 1, m] = 0.0
                imaginary[pools - 1, m] = 0.0
        count += 1
        total += rate
        for m in range(harmonics):
            bin_ = int((m + 1) * rate * length + 0.5)
            if bin_ < length // 2:
                real[pools - 1, m] += spectrum[v, 2 * bin_ - 1]
                imaginary[pools - 1, m] += spectrum[v, 2 * bin_]
    if pools > 0:
        density[pools - 1] = total / count
    return pools


@njit(cache=True, fastmath=True)
def turn_pools(real, imaginary, density, pools, harmonic, first, step, bends, sum_real, sum_imaginary):
    """Sums all pools turned to where rows through each vanishing column would bring them.

    The phase of a row at density s is  t + column (s - s_bottom) + bend (x^2 - x),  x = 0 at the bottom and 1 at the
    top: a straight row's phase is linear in its density.

    `harmonic` is 0 for the fundamental; `first` and `step` give the vanishing columns, px from the middle of the
    picture, `bends` (A,) the rows by which curved rows sway; `sum_real` and `sum_imaginary` (A, B) are filled.
    """
    columns = sum_real.shape[1]
    sum_real[:] = 0.0
    sum_imaginary[:] = 0.0
    span = density[pools - 1] - density[0] + 1e-9
    m = harmonic + 1
    turned_real = np.empty(columns, np.float32)
    turned_imaginary = np.empty(columns, np.float32)
    for g in range(pools):
        along = density[g] - density[0]
        x = along / span
        sway = x * x - x
        angle = _TURN * m * along * first
        re, im = math.cos(angle), math.sin(angle)
        angle = _TURN * m * along * step
        step_re, step_im = math.cos(angle), math.sin(angle)
        for b in range(columns):
            turned_real[b] = re
            turned_imaginary[b] = im
            re, im = re * step_re - im * step_im, re * step_im + im * step_re
        for a in range(len(bends)):
            angle = _TURN * m * bends[a] * sway
            c, s = np.float32(math.cos(angle)), np.float32(math.sin(angle))
            fr = real[g, harmonic] * c - imaginary[g, harmonic] * s
            fi = real[g, harmonic] * s + imaginary[g, harmonic] * c
            for b in range(columns):
                sum_real[a, b] += fr * turned_real[b] - fi * turned_imaginary[b]
                sum_imaginary[a, b] += fr * turned_imaginary[b] + fi * turned_real[b]


@njit(cache=True, fastmath=True)
def search(
    spectrum, hypotheses, least, pooling, most, first, step, columns, bends, column_cost, bend_cost, found
):
    """Best straight or bent rows for each (spacing at the bottom, ratio top / bottom), by the fundamental alone.

    `hypotheses` is (N, 2); `found` (N, 3) is filled with votes an image row less the costs, vanishing column, bend.
    """
    height = spectrum.shape[0]
    real = np.empty((height, 1), np.float32)
    imaginary = np.empty((height, 1), np.float32)
    density = np.empty(height)
    sum_real = np.empty((len(bends), columns), np.float32)
    sum_imaginary = np.empty((len(bends), columns), np.float32)
    for n in range(len(hypotheses)):
        pools = pool(
            spectrum, hypotheses[n, 0], hypotheses[n, 1], least, pooling, most, 1, real, imaginary, density
        )
        found[n, 0] = -1e9
        if pools < 2:
            continue
        turn_pools(real, imaginary, density, pools, 0, first, step, bends, sum_real, sum_imaginary)
        for a in range(len(bends)):
            for b in range(columns):
                votes = math.sqrt(sum_real[a, b] ** 2 + sum_imaginary[a, b] ** 2) / height
                votes -= bend_cost * abs(bends[a]) + column_cost * abs(first + b * step)
                if votes > found[n, 0]:
                    found[n, 0] = votes
                    found[n, 1] = first + b * step
                    found[n, 2] = bends[a]


@njit(cache=True, fastmath=True)
def settle(
    spectrum, bottom, ratio, least, pooling, most, gains, first, step, columns, bends, column_cost, bend_cost
):
    """Best vanishing column, bend and offset for one spacing and ratio, by as many harmonics as there are gains.

    Returns:
        Votes an image row less the costs, vanishing column (px), bend, offset (rows).
    """
    height = spectrum.shape[0]
    harmonics = len(gains)
    offsets = 32
    real = np.empty((height, harmonics), np.float32)
    imaginary = np.empty((height, harmonics), np.float32)
    density = np.empty(height)
    pools = pool(spectrum, bottom, ratio, least, pooling, most, harmonics, real, imaginary, density)
    if pools < 2:
        return -1e9, 0.0, 0.0, 0.0
    sums_real = np.empty((harmonics, len(bends), columns), np.float32)
    sums_imaginary = np.empty((harmonics, len(bends), columns), np.float32)
    for m in range(harmonics):
        turn_pools(real, imaginary, density, pools, m, first, step, bends, sums_real[m], sums_imaginary[m])
    turns = np.empty((offsets, harmonics, 2), np.float32)
    for t in range(offsets):
        for m in range(harmonics):
            angle = _TURN * (m + 1) * t / offsets
            turns[t, m, 0] = gains[m] * math.cos(angle)
            turns[t, m, 1] = gains[m] * math.sin(angle)
    best, best_column, best_bend, best_offset = -1e9, 0.0, 0.0, 0.0
    for a in range(len(bends)):
        for b in range(columns):
            cost = bend_cost * abs(bends[a]) + column_cost * abs(first + b * step)
            bound = 0.0
            for m in range(harmonics):
                bound += gains[m] * math.sqrt(sums_real[m, a, b] ** 2 + sums_imaginary[m, a, b] ** 2)
            if bound / height - cost <= best:
                continue
            for t in range(offsets):
                votes = 0.0
                for m in range(harmonics):
                    votes += sums_real[m, a, b] * turns[t, m, 0] - sums_imaginary[m, a, b] * turns[t, m, 1]
                votes = votes / height - cost
                if votes > best:
                    best, best_column, best_bend, best_offset = votes, first + b * step, bends[a], t / offsets
    return best, best_column, best_bend, best_offset
