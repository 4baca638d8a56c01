# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs, allow-untyped-calls
"""The loop over all cells in which something grows, compiled: which plant each belongs to.

numba is slow to import: import this module only where a picture is about to be looked at.
"""

from __future__ import annotations

from numba import njit


@njit(cache=True)
def share_among_seeds(label, row, column, first, seeds, names):
    """Give each cell of a blob to the nearest of the blob's seeds; blobs without seeds stay as they are.

    Args:
        label: intp (N,) blob of each cell, changed in place.
        row: intp (N,) of the cells.
        column: intp (N,) of the cells.
        first: intp (B + 1,) where the seeds of each blob begin.
        seeds: intp (M, 2) row and column, blob by blob.
        names: intp (M,) new label of each seed.
    """
    for n in range(len(label)):
        blob = label[n]
        best, least = -1, 1 << 60
        for k in range(first[blob], first[blob + 1]):
            down, aside = row[n] - seeds[k, 0], column[n] - seeds[k, 1]
            away = down * down + aside * aside
            if away < least:
                best, least = k, away
        if best >= 0:
            label[n] = names[best]
