# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs, allow-untyped-calls
"""A table of numbered lattice vertices for compiled kernels: it takes room for those met, not for the whole grid."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def slot_of(slots, place, x, y):
    """Where the number of a vertex stands in the table, or, where it holds 0, shall stand.

    Args:
        slots: int32 (2**k,), numbers; 0: empty. At least one must be.
        place: int32 (N, 2 or more), doubled column and row of each number's vertex.
        x: column of the vertex.
        y: its row.
    """
    last = len(slots) - 1
    # odd factors spread vertices that lie in a regular pattern, as those of mazes do
    slot = ((x * 0x9E3779B1 + y * 0x85EBCA77) >> 15) & last
    while True:
        number = slots[slot]
        if number == 0 or (place[number, 0] == 2 * x and place[number, 1] == 2 * y):
            return slot
        slot = (slot + 1) & last


@njit(cache=True)
def with_room(slots, place, count):
    """The table with room for twice as much, of `count` numbers but 0."""
    wider = np.zeros(2 * len(slots), np.int32)
    for number in range(1, count):
        wider[slot_of(wider, place, place[number, 0] >> 1, place[number, 1] >> 1)] = number
    return wider
