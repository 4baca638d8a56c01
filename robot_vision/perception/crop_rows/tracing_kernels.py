# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs, allow-untyped-calls
"""Crop rows followed from the top of the picture to the bottom: the best path, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, fastmath=True)
def accumulate(scores, turn_cost, stretch_cost, totals):
    """Best total score of a path from the first band to each state (stretch, drift, phase) of each band.

    A path's phase moves by its drift from band to band; drift and stretch change by at most one step a band.

    Args:
        scores: float32 (B, E, P).
        turn_cost: (B,) of a change of the drift.
        stretch_cost: of a change of the stretch.
        totals: float32 (B, E, D, P) to be filled; D odd, its middle is no drift.
    """
    bands, stretches, phases = scores.shape
    drifts = totals.shape[2]
    turned = np.empty((stretches, drifts, phases), np.float32)
    for e in range(stretches):
        for q in range(drifts):
            totals[0, e, q] = scores[0, e]
    for b in range(1, bands):
        turn = np.float32(turn_cost[b])
        for e in range(stretches):
            before = totals[b - 1, e]
            for q in range(drifts):
                same, lower, upper = before[q], before[max(q - 1, 0)], before[min(q + 1, drifts - 1)]
                best = turned[e, q]
                for j in range(phases):
                    best[j] = max(same[j], max(lower[j], upper[j]) - turn)
        for e in range(stretches):
            lower, upper = turned[max(e - 1, 0)], turned[min(e + 1, stretches - 1)]
            for q in range(drifts):
                shift = (q - drifts // 2) % phases
                # phase j comes from phase j - drift: two runs without a wrap, which the compiler makes vectors of
                for begin, end, source in ((shift, phases, 0), (0, shift, phases - shift)):
                    stop = source + end - begin
                    same, less, more = turned[e, q, source:stop], lower[q, source:stop], upper[q, source:stop]
                    gain, best = scores[b, e, begin:end], totals[b, e, q, begin:end]
                    for j in range(end - begin):
                        best[j] = max(same[j], max(less[j], more[j]) - stretch_cost) + gain[j]


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
        of_phase = by_phase[b]
        of_phase[:] = np.float32(-1e30)
        for e in range(stretches):
            down, up = totals[b, e], back[bands - 1 - b, e]
            here[:] = np.float32(-1e30)
            for q in range(drifts):
                above, below = down[q], up[drifts - 1 - q]
                for j in range(phases):
                    here[j] = max(here[j], above[j] + below[j])
            twice = scores[b, e]
            for j in range(phases):
                here[j] -= twice[j]
                of_phase[j] = max(of_phase[j], here[j])
            by_stretch[b, e] = here.max()
