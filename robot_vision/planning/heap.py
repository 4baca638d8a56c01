# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs, allow-untyped-calls
"""A binary heap of (key, number) in two arrays, for compiled kernels; numba is slow to import."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def push(keys, items, count, key, item):
    """Put an item into the first `count` places; there must be room for one more."""
    place = count
    while place > 0:
        parent = (place - 1) >> 1
        if keys[parent] <= key:
            break
        keys[place] = keys[parent]
        items[place] = items[parent]
        place = parent
    keys[place] = key
    items[place] = item


@njit(cache=True)
def drop_first(keys, items, count):
    """Take out the least of `count` items, which is the first; `count - 1` are left."""
    last = count - 1
    key, item = keys[last], items[last]
    place = 0
    while True:
        child = 2 * place + 1
        if child >= last:
            break
        if child + 1 < last and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        keys[place] = keys[child]
        items[place] = items[child]
        place = child
    keys[place] = key
    items[place] = item


@njit(cache=True)
def doubled(array):
    """The same with room for as much again along the first axis, zeros there."""
    wider = np.zeros((2 * array.shape[0], *array.shape[1:]), array.dtype)
    wider[: array.shape[0]] = array
    return wider
