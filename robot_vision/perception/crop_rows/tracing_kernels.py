# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs, allow-untyped-calls
"""Crop rows followed from the top of the picture to the bottom: compiled scores of bands, and the best path."""

from __future__ import annotations

import math

import numpy as np
from numba import njit


@njit(cache=True, fastmath=True)
def score_bands(weight, spacing, centre, first, band, stretches, reach, power, smooth, scores):
    """How well the central rows fit each band of image rows, for each stretch of their spacing and each phase.

    Every pixel within `reach` spacings of the centre is folded into its phase about the nearest expected row; phases
    are standardised image row by image row, so that no single one outvotes the others.

    Args:
        weight: float32 (H, W).
        spacing: (H,) expected, px.
        centre: (H,) expected column of the row nearest the middle, px.
        first: image row from which on there is something to see.
        band: image rows a band.
        stretches: (E,) the spacing is spacing * (1 + stretch).
        reach: in spacings.
        power: of the standard deviation by which an image row is divided.
        smooth: (2 n + 1,) weights over neighbouring phases.
        scores: float32 (B, E, P) to be filled.
    """
    height, width = weight.shape
    bands, _, phases = scores.shape
    half = len(smooth) // 2
    total = np.empty(phases + 1, np.float32)
    count = np.empty(phases + 1, np.float32)
    summed = np.empty(phases, np.float32)
    ring = np.empty(phases + 2 * half, np.float32)
    for b in range(bands):
        for e in range(len(stretches)):
            summed[:] = 0.0
            for v in range(max(first, b * band), min(height, b * band + band)):
                total[:] = 0.0
                count[:] = 0.0
                d = spacing[v] * (1.0 + stretches[e])
                left = max(0, int(centre[v] - reach * d))
                right = min(width, int(centre[v] + reach * d) + 1)
                phase = (left - centre[v]) / d + 0.5
                place = np.float32((phase - math.floor(phase)) * phases)
                step = np.float32(phases / d)
                for u in range(left, right):
                    if place >= phases:
                        place -= phases
                    j = int(place)
                    share = place - j
                    w = weight[v, u]
                    total[j] += (1 - share) * w
                    total[j + 1] += share * w
                    count[j] += 1 - share
                    count[j + 1] += share
                    place += step
                total[0] += total[phases]
                count[0] += count[phases]
                sum_w = np.float32(0.0)
                sum_n = np.float32(1e-3)
                for j in range(phases):
                    sum_w += total[j]
                    sum_n += count[j]
                usual = np.float32(0.5) * sum_w / sum_n
                mean = np.float32(0.0)
                square = np.float32(0.0)
                for j in range(phases):
                    w = (total[j] + usual) / (count[j] + np.float32(0.5))
                    total[j] = w
                    mean += w
                    square += w * w
                mean /= phases
                sd = math.sqrt(max(square / phases - mean * mean, 0.0)) + 1e-3
                scale = np.float32(1.0 / sd**power)
                for j in range(phases):
                    summed[j] += scale * (total[j] - mean)
            for j in range(phases):
                ring[j + half] = summed[j]
            for j in range(half):
                ring[j] = summed[phases - half + j]
                ring[phases + half + j] = summed[j]
            for j in range(phases):
                s = np.float32(0.0)
                for i in range(2 * half + 1):
                    s += smooth[i] * ring[j + i]
                scores[b, e, j] = s


@njit(cache=True, fastmath=True)
def accumulate(scores, turn_cost, drift_cost, stretch_cost, totals):
    """Best total score of a path from the first band to each state (stretch, drift, phase) of each band.

    A path's phase moves by its drift from band to band; drift and stretch change by at most one step a band.

    Args:
        scores: float32 (B, E, P).
        turn_cost: (B,) of a change of the drift.
        drift_cost: (B,) times drift^2.
        stretch_cost: of a change of the stretch.
        totals: float32 (B, E, D, P) to be filled; D odd, its middle is no drift.
    """
    bands, stretches, phases = scores.shape
    drifts = totals.shape[2]
    turned = np.empty((stretches, drifts, phases), np.float32)
    for e in range(stretches):
        for q in range(drifts):
            for j in range(phases):
                totals[0, e, q, j] = scores[0, e, j]
    for b in range(1, bands):
        before = totals[b - 1]
        turn = np.float32(turn_cost[b])
        for e in range(stretches):
            for q in range(drifts):
                lower, upper = max(q - 1, 0), min(q + 1, drifts - 1)
                for j in range(phases):
                    turned[e, q, j] = max(
                        before[e, q, j], max(before[e, lower, j], before[e, upper, j]) - turn
                    )
        for e in range(stretches):
            lower, upper = max(e - 1, 0), min(e + 1, stretches - 1)
            for q in range(drifts):
                drift = q - drifts // 2
                cost = np.float32(drift_cost[b] * drift * drift)
                shift = drift % phases
                # phase j comes from phase j - drift: two runs without a wrap in the inner loop
                for j in range(shift, phases):
                    k = j - shift
                    side = max(turned[lower, q, k], turned[upper, q, k]) - stretch_cost
                    totals[b, e, q, j] = max(turned[e, q, k], side) + scores[b, e, j] - cost
                for j in range(shift):
                    k = j - shift + phases
                    side = max(turned[lower, q, k], turned[upper, q, k]) - stretch_cost
                    totals[b, e, q, j] = max(turned[e, q, k], side) + scores[b, e, j] - cost


@njit(cache=True, fastmath=True)
def recall(totals, turn_cost, stretch_cost, path):
    """The path behind the best total: (B, 2) of stretch index and phase index, the phase running on past its ends.

    No pointers are kept on the way there: each state on the path is asked again where it came from.

    Returns:
        The best total.
    """
    bands, stretches, drifts, phases = totals.shape
    best = np.float32(-1e30)
    e, q, j = 0, 0, 0
    for ee in range(stretches):
        for qq in range(drifts):
            for jj in range(phases):
                if totals[bands - 1, ee, qq, jj] > best:
                    best = totals[bands - 1, ee, qq, jj]
                    e, q, j = ee, qq, jj
    for b in range(bands - 1, -1, -1):
        path[b, 0], path[b, 1] = e, j
        if b == 0:
            break
        j -= q - drifts // 2
        k = j % phases
        most = np.float32(-1e30)
        came_e, came_q = e, q
        for ee in range(max(e - 1, 0), min(e + 1, stretches - 1) + 1):
            for qq in range(max(q - 1, 0), min(q + 1, drifts - 1) + 1):
                value = totals[b - 1, ee, qq, k]
                if qq != q:
                    value -= turn_cost[b]
                if ee != e:
                    value -= stretch_cost
                if value > most:
                    most = value
                    came_e, came_q = ee, qq
        e, q = came_e, came_q
    return best


@njit(cache=True, fastmath=True)
def best_through(totals, back, scores, by_phase, by_stretch):
    """Best total score of a path through each phase (B, P) and each stretch (B, E) of each band, to be filled.

    `totals` (B, E, D, P) come from above, `back` from below, its bands and drifts the other way round.
    """
    bands, stretches, drifts, phases = totals.shape
    here = np.empty(phases, np.float32)
    for b in range(bands):
        for j in range(phases):
            by_phase[b, j] = -1e30
        for e in range(stretches):
            for j in range(phases):
                here[j] = -1e30
            for q in range(drifts):
                for j in range(phases):
                    here[j] = max(here[j], totals[b, e, q, j] + back[bands - 1 - b, e, drifts - 1 - q, j])
            most = np.float32(-1e30)
            for j in range(phases):
                here[j] -= scores[b, e, j]
                by_phase[b, j] = max(by_phase[b, j], here[j])
                most = max(most, here[j])
            by_stretch[b, e] = most
