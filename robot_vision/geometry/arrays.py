# SPDX-License-Identifier: Apache-2.0
"""Lists of points are checked once, at the door of the room, so that no formula behind it has to."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray: TypeAlias = NDArray[np.float64]


def as_rows(values: ArrayLike, columns: int, name: str) -> FloatArray:
    """Give `values` as float64 (N, columns), a row that is not all finite as NaN: "no answer" in this room.

    Raises:
        ValueError: naming `name` and the shape that came instead.
    """
    rows = np.asarray(values, dtype=np.float64)
    if rows.size == 0:
        return np.empty((0, columns))
    if rows.ndim != 2 or rows.shape[1] != columns:
        raise ValueError(f"{name} must have shape (N, {columns}), got {rows.shape}")
    if not np.isfinite(rows).all():
        rows = rows.copy()
        rows[~np.isfinite(rows).all(axis=1)] = np.nan
    return rows
