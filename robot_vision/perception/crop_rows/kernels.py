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
#: Rows whose image rows, were they all in step, had not this share of the best votes are not looked at.
_HOPELESS = 0.5


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
def standardise_rows(weight, window, centred, power):
    """Each row without its mean, divided by width and by sd^power, its middle pixel at column 0 (circular).

    Pixels count by `window` (W,).
    """
    height, width = weight.shape
    length = centred.shape[1]
    half = width // 2
    share = window.sum()
    for v in range(height):
        total = np.float32(0.0)
        for u in range(width):
            total += window[u] * weight[v, u]
        mean = total / share
        square = np.float32(0.0)
        for u in range(width):
            value = window[u] * (weight[v, u] - mean)
            square += value * value
        scale = np.float32(1.0 / ((math.sqrt(square / width) + 1e-3) ** power * width))
        for u in range(width - half):
            centred[v, u] = scale * window[u + half] * (weight[v, u + half] - mean)
        for u in range(half):
            centred[v, length - half + u] = scale * window[u] * (weight[v, u] - mean)


@njit(cache=True, fastmath=True)
def pool(spectrum, bottom, ratio, least, step, most, harmonic, rates, real, imaginary, density):
    """Gathers the spectrum of each image row at the frequency of the crop rows there.

    The spacing runs linearly from `bottom` at the last image row to `bottom * ratio` at the first. Successive image
    rows whose densities (1 / spacing) differ by less than `step` are summed, at most `most` of them.

    `spectrum` holds packed rows of cv2.dft, (H, L); `harmonic` is 1 for the fundamental; `rates` (H,) is scratch;
    `real` and `imaginary` (H,) are filled, and `density` (H,) with the mean rows a pixel of each pool.

    Returns:
        Number of pools filled.
    """
    height, length = spectrum.shape
    slope = bottom * (1.0 - ratio) / (height - 1.0)
    seen = height
    if bottom * ratio < least:
        seen = max(0, min(height, int((bottom - least) / slope) + 1))
    for i in range(seen):
        rates[i] = np.float32(1.0) / (np.float32(bottom) - np.float32(slope) * np.float32(i))
    pools, count = 0, 0
    first = total = re = im = np.float32(0.0)
    for i in range(seen):
        rate = rates[i]
        if count > 0 and (rate - first > step or count >= most):
            density[pools], real[pools], imaginary[pools] = total / count, re, im
            pools += 1
            count = 0
        if count == 0:
            first = rate
            total = re = im = np.float32(0.0)
        count += 1
        total += rate
        bin_ = np.uint32(harmonic * rate * np.float32(length) + np.float32(0.5))
        if bin_ < length // 2:
            re += spectrum[height - 1 - i, 2 * bin_ - 1]
            im += spectrum[height - 1 - i, 2 * bin_]
    if count > 0:
        density[pools], real[pools], imaginary[pools] = total / count, re, im
        pools += 1
    return pools


@njit(cache=True, fastmath=True)
def turn_pools(
    real, imaginary, density, pools, harmonic, column, step, bend, bends, sum_real, sum_imaginary, turn
):
    """Sums all pools turned to where rows through each vanishing column would bring them.

    The phase of a row at density s is  t + column (s - s_bottom) + bend (x^2 - x),  x = 0 at the bottom and 1 at the
    top: a straight row's phase is linear in its density.

    `harmonic` is 1 for the fundamental. `column` and `bend` are those in the middle of what is tried: the columns, px
    from the middle of the picture, lie `step` apart, and the rows by which curved rows sway differ from `bend` by
    `bends` (A,), which are as many to either side: A is odd, bends[A - 1 - a] = -bends[a]. `sum_real` and
    `sum_imaginary` (A, B) are filled, B odd; `turn` (2, B) is scratch.
    """
    tried, columns = sum_real.shape
    middle, half = tried // 2, columns // 2
    sum_real[:] = 0.0
    sum_imaginary[:] = 0.0
    span = density[pools - 1] - density[0] + 1e-9
    for g in range(pools):
        along = density[g] - density[0]
        x = along / span
        sway = x * x - x
        angle = _TURN * harmonic * along * step
        step_re, step_im = np.float32(math.cos(angle)), np.float32(math.sin(angle))
        re, im = np.float32(1.0), np.float32(0.0)
        for b in range(half + 1):
            turn[0, half + b], turn[1, half + b] = re, im
            turn[0, half - b], turn[1, half - b] = re, -im
            re, im = re * step_re - im * step_im, re * step_im + im * step_re
        re, im = real[g], imaginary[g]
        if column != 0.0 or bend != 0.0:
            angle = _TURN * harmonic * (along * column + bend * sway)
            c, s = np.float32(math.cos(angle)), np.float32(math.sin(angle))
            re, im = re * c - im * s, re * s + im * c
        for a in range(middle, tried):
            angle = _TURN * harmonic * bends[a] * sway
            c, s = np.float32(math.cos(angle)), np.float32(math.sin(angle))
            _add(re * c - im * s, re * s + im * c, turn, sum_real[a], sum_imaginary[a])
            if a > middle:
                other = tried - 1 - a
                _add(re * c + im * s, im * c - re * s, turn, sum_real[other], sum_imaginary[other])


@njit(cache=True, fastmath=True)
def _add(re, im, turn, sum_real, sum_imaginary):
    """Adds a complex number times each of `turn` (2, B) to sums (B,)."""
    for b in range(len(sum_real)):
        sum_real[b] += re * turn[0, b] - im * turn[1, b]
        sum_imaginary[b] += re * turn[1, b] + im * turn[0, b]


@njit(cache=True, fastmath=True)
def search(spectrum, hypotheses, least, pooling, most, step, columns, bends, column_cost, bend_cost):
    """Votes an image row (N,), less the costs, of the best rows for each (spacing at the bottom, ratio top / bottom).

    They are straight or bent, and told by the fundamental alone; -1e9 where there could not be half as many votes as
    the best ones have. `hypotheses` is (N, 2); `columns`, an odd number,
    and `bends` as for `turn_pools`, about none.
    """
    height = spectrum.shape[0]
    rates, real, imaginary, density = np.empty((4, height), np.float32)
    sum_real = np.empty((len(bends), columns), np.float32)
    sum_imaginary = np.empty((len(bends), columns), np.float32)
    turn = np.empty((2, columns), np.float32)
    found = np.full(len(hypotheses), -1e9)
    best = 0.0
    # Backwards: wide rows, which win more often, come last
    for n in range(len(hypotheses) - 1, -1, -1):
        bottom, ratio = hypotheses[n]
        pools = pool(spectrum, bottom, ratio, least, pooling, most, 1, rates, real, imaginary, density)
        if pools < 2:
            continue
        bound = 0.0
        for g in range(pools):
            bound += math.sqrt(real[g] ** 2 + imaginary[g] ** 2)
        if bound / height < _HOPELESS * best:
            continue
        turn_pools(real, imaginary, density, pools, 1, 0.0, step, 0.0, bends, sum_real, sum_imaginary, turn)
        for a in range(len(bends)):
            for b in range(columns):
                votes = math.sqrt(sum_real[a, b] ** 2 + sum_imaginary[a, b] ** 2) / height
                votes -= bend_cost * abs(bends[a]) + column_cost * abs((b - columns // 2) * step)
                found[n] = max(found[n], votes)
        best = max(best, found[n])
    return found


@njit(cache=True, fastmath=True)
def settle(
    spectrum,
    bottom,
    ratio,
    least,
    pooling,
    most,
    gains,
    column,
    step,
    columns,
    bend,
    bends,
    column_cost,
    bend_cost,
):
    """Best vanishing column, bend and offset for one spacing and ratio, by as many harmonics as there are gains.

    `column`, `step`, `columns`, `bend` and `bends` say what is tried, as for `turn_pools`.

    Returns:
        Votes an image row less the costs, vanishing column (px), bend, offset (rows).
    """
    height = spectrum.shape[0]
    harmonics = len(gains)
    offsets = 32
    rates, real, imaginary, density = np.empty((4, height), np.float32)
    sums_real = np.empty((harmonics, len(bends), columns), np.float32)
    sums_imaginary = np.empty((harmonics, len(bends), columns), np.float32)
    turn = np.empty((2, columns), np.float32)
    for m in range(harmonics):
        pools = pool(spectrum, bottom, ratio, least, pooling, most, m + 1, rates, real, imaginary, density)
        if pools < 2:
            return -1e9, 0.0, 0.0, 0.0
        turn_pools(
            real,
            imaginary,
            density,
            pools,
            m + 1,
            column,
            step,
            bend,
            bends,
            sums_real[m],
            sums_imaginary[m],
            turn,
        )
    turns = np.empty((offsets, harmonics, 2), np.float32)
    for t in range(offsets):
        for m in range(harmonics):
            angle = _TURN * (m + 1) * t / offsets
            turns[t, m, 0] = gains[m] * math.cos(angle)
            turns[t, m, 1] = gains[m] * math.sin(angle)
    best, best_column, best_bend, best_offset = -1e9, 0.0, 0.0, 0.0
    for a in range(len(bends)):
        here_bend = bend + bends[a]
        for b in range(columns):
            here = column + (b - columns // 2) * step
            cost = bend_cost * abs(here_bend) + column_cost * abs(here)
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
                    best, best_column, best_bend, best_offset = votes, here, here_bend, t / offsets
    return best, best_column, best_bend, best_offset
