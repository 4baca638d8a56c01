# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs
"""The least that numba can be asked for."""

from __future__ import annotations

from numba import njit


@njit(cache=True)
def first_of(values):
    """The first of an array."""
    return values[0]
