# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs, allow-untyped-calls
"""How well rows fit each band of image rows, compiled: bands are laid out in spacings once, then folded together.

What it costs does not grow with the stretches of the spacing tried, as only the folding is done for each of them.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit


@njit(cache=True, fastmath=True)
def lay_out(weight, spacing, centre, first, band, phases, laid):
    """Resamples image rows to `phases` places a spacing, the mean over each place, and sums them band by band.

    Args:
        weight: float32 (H, W).
        spacing: (H,) expected, px.
        centre: (H,) expected column of the row in the middle, px.
        first: image row from which on there is something to see.
        band: image rows a band.
        phases: places a spacing.
        laid: float32 (N, B) to be filled, N odd: place N // 2 is the row in the middle; 0 outside the picture.
    """
    height, width = weight.shape
    places, bands = laid.shape
    before = np.empty(width + 1, np.float32)
    edges = np.empty(places + 1, np.float32)
    here = np.empty(places, np.float32)
    for b in range(bands):
        here[:] = 0.0
        for v in range(max(first, b * band), min(height, b * band + band)):
            row = weight[v]
            total = np.float32(0.0)
            for u in range(width):
                before[u] = total
                total += row[u]
            before[width] = total
            # The sum up to each border between two places; pixel u reaches from u - 0.5 to u + 0.5
            step = np.float32(spacing[v] / phases)
            start = np.float32(centre[v] + 0.5 - (places // 2 + 0.5) * spacing[v] / phases)
            for i in range(places + 1):
                place = min(max(start + np.float32(i) * step, np.float32(0.0)), np.float32(width - 1e-3))
                k = np.uint32(place)
                edges[i] = before[k] + (place - np.float32(k)) * row[k]
            for i in range(places):
                here[i] += (edges[i + 1] - edges[i]) / step
        for i in range(places):
            laid[i, b] = here[i]


@njit(cache=True, fastmath=True)
def fold(laid, window, inside, rows, usual, power, stretches, smooth, scores):
    """How well rows fit each band, for each stretch of their spacing and each phase.

    All rows of a band are laid upon each other, those in the middle counting most; what comes out, as a function of
    the phase, is standardised, so that no band outvotes the others. The innermost loops run over the bands, which
    are all folded at the same places.

    Args:
        laid: float32 (N, B) of `lay_out`.
        window: float32 (N,) by which places count; its sum is 1 for each phase.
        inside: (B, 2) first and last place of each band that is in the picture.
        rows: (B,) image rows that each band is the sum of.
        usual: weight of the mean of all phases beside what a phase shows, in rows fully in view.
        power: of the standard deviation by which a band is divided.
        stretches: (E,) the spacing is spacing * (1 + stretch).
        smooth: (2 n + 1,) weights over neighbouring phases.
        scores: float32 (B, E, P) to be filled, phase P // 2 is the row as expected.
    """
    places, bands = laid.shape
    phases = scores.shape[2]
    half, side = places // 2, len(smooth) // 2
    weighed = np.empty((places, bands), np.float32)
    counted = np.empty((places, bands), np.float32)
    total = np.zeros(bands, np.float32)
    count = np.full(bands, np.float32(1e-6))
    for i in range(places):
        for b in range(bands):
            here = window[i] if inside[b, 0] <= i <= inside[b, 1] else np.float32(0.0)
            counted[i, b] = here
            weighed[i, b] = here * laid[i, b] / max(rows[b], 1)
            total[b] += weighed[i, b]
            count[b] += here
    folded = np.empty((phases, bands), np.float32)
    seen = np.empty((phases, bands), np.float32)
    scale = np.empty(bands, np.float32)
    smoothed = np.empty(bands, np.float32)
    for e in range(len(stretches)):
        stretch = 1.0 + stretches[e]
        seen[:] = usual
        folded[:] = usual * total / count
        for k in range(-(half // phases), half // phases + 1):
            for j in range(phases):
                place = half + stretch * (k * phases + j - phases // 2)
                i = int(math.floor(place))
                if not 0 <= i < places - 1:
                    continue
                far = np.float32(place - i)
                near = np.float32(1.0) - far
                value, value_after, number, number_after = (
                    weighed[i],
                    weighed[i + 1],
                    counted[i],
                    counted[i + 1],
                )
                values, numbers = folded[j], seen[j]
                for b in range(bands):
                    values[b] += near * value[b] + far * value_after[b]
                    numbers[b] += near * number[b] + far * number_after[b]
        _standardise(folded, seen, rows, power, scale)
        for j in range(phases):
            smoothed[:] = 0.0
            for i in range(2 * side + 1):
                share, values = smooth[i], folded[(j + i - side) % phases]
                for b in range(bands):
                    smoothed[b] += share * values[b]
            for b in range(bands):
                scores[b, e, j] = smoothed[b] * scale[b]


@njit(cache=True, fastmath=True)
def _standardise(folded, seen, rows, power, scale):
    """Turns sums (P, B) into means about that of all phases; `scale` (B,) is what then makes of them scores."""
    phases, bands = folded.shape
    mean = np.zeros(bands, np.float32)
    square = np.zeros(bands, np.float32)
    for j in range(phases):
        for b in range(bands):
            folded[j, b] /= seen[j, b]
            mean[b] += folded[j, b]
            square[b] += folded[j, b] * folded[j, b]
    for b in range(bands):
        mean[b] /= phases
        sd = math.sqrt(max(square[b] / phases - mean[b] * mean[b], 0.0)) + 1e-3
        scale[b] = rows[b] / sd**power
    for j in range(phases):
        for b in range(bands):
            folded[j, b] -= mean[b]
