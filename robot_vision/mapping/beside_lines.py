# SPDX-License-Identifier: Apache-2.0
"""Looks at the strips of ground to the left and to the right of lines, section by section."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping.ground_view import GroundView

Array = NDArray[np.float64]

SECTIONS = 8
_SAMPLES, _ACROSS = 3, 5
RIM = (0.02, 0.07)
"""Strip beside a line that a shadow's edge has in shadow, m: a shadow need not be wider."""


class Beside:
    """Strips of ground beside lines of the working picture.

    Args:
        ends: (N, 4) of the lines, working pixels.
        view: of the ground in the working picture.
        vanishing: (2,) where they lead, working pixels.
        strip: distance from the line of the strips, from and to, m across the way.
        sections: of each line.

    Steep lines are left along the rows of the picture, flat ones along its columns, so that what lies beside them is
    in the picture as far as may be.
    """

    def __init__(
        self,
        ends: Array,
        view: GroundView,
        vanishing: Array,
        strip: tuple[float, float],
        sections: int = SECTIONS,
    ) -> None:
        part = ((np.arange(sections * _SAMPLES) + 0.5) / (sections * _SAMPLES))[:, None]
        u = (ends[:, 0] + part * (ends[:, 2] - ends[:, 0])).T[..., None] - vanishing[0]
        v = (ends[:, 1] + part * (ends[:, 3] - ends[:, 1])).T[..., None] - vanishing[1]
        # On the ground a line to the vanishing point lies at u / v camera heights to the right (20.3).
        v = np.maximum(v, 1.0)
        shift = np.array([-1.0, 1.0])[:, None, None, None] * np.linspace(*strip, _ACROSS)
        there = u / v + shift / (view.camera.height_m or 1.0)
        down = vanishing[1] - view.top
        columns = np.rint(there * v + vanishing[0])
        rows = np.broadcast_to(np.rint(v + down), there.shape).copy()
        flat = (np.abs(u) > v) & (there * u > 0.0)
        if flat.any():
            level = np.broadcast_to(u, there.shape)[flat]
            columns[flat] = np.rint(level + vanishing[0])
            rows[flat] = np.rint(level / there[flat] + down)
        height, width = view.shape[0] - view.top, view.shape[1]
        inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
        self._sections = sections
        self._places = np.where(inside, rows * width + columns, 0.0).astype(np.intp)
        self._inside = inside
        self._count = self._by_section(inside)

    def means(self, values: NDArray[Any]) -> Array:
        """Mean (2, N, sections) of values (H - view.top, W) left and right of each section; nan outside the picture."""
        total = self._by_section(np.where(self._inside, values.ravel().take(self._places), 0.0))
        enough = self._count >= _SAMPLES * _ACROSS // 2
        return np.where(enough, total / np.maximum(self._count, 1), np.nan)

    def _by_section(self, values: NDArray[Any]) -> Array:
        shape = (*values.shape[:2], self._sections, _SAMPLES * _ACROSS)
        return np.asarray(values.reshape(shape).sum(axis=-1), np.float64)
