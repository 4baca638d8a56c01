# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs, allow-untyped-calls
"""An active contour across a picture, solved by dynamic programming; compiled, and numba is slow to import."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def contour(cost, bend, broken):
    """State of each column of the contour along which costs and bends together are least.

    Amini, Weymouth and Jain 1990, one step a column.

    Args:
        cost: (W, S) float64 of each state of each column.
        bend: (S, S) float32, what it costs to come to a state (row) from one of the column before.
        broken: (W - 1,) whether nothing holds a column and the next one together.

    Returns:
        (W,) int64.
    """
    columns, states = cost.shape
    came = np.zeros((columns, states), np.int64)
    best = cost[0].astype(np.float32)
    for k in range(1, columns):
        sums = np.empty(states, np.float32)
        for state in range(states):
            least, origin = np.float32(np.inf), 0
            for before in range(states):
                step = best[before] if broken[k - 1] else best[before] + bend[state, before]
                if step < least:
                    least, origin = step, before
            came[k, state] = origin
            sums[state] = cost[k, state] + least
        best = sums
    chosen = np.zeros(columns, np.int64)
    chosen[-1] = best.argmin()
    for k in range(columns - 1, 0, -1):
        chosen[k - 1] = came[k, chosen[k]]
    return chosen
