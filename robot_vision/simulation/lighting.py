# SPDX-License-Identifier: Apache-2.0
"""How light falls on surfaces: shading is half of what makes walls and floor look like what they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_ALONG_LAMP = (-0.4, 0.0, 0.4)
"""Metres from a lamp's middle to the points that stand for its length."""


@dataclass(frozen=True, eq=False)
class RoomLight:
    """Light in a long room along x, between y = -width / 2 and width / 2, from z = 0 to height.

    Direct light of the lamps by Lambert's law at both ends, without shadows; the light that all walls send to
    and fro is the same everywhere but weaker in corners; daylight falls in at the far end.

    Attributes:
        lamps: (N,) middle of each lamp along x, metres; they hang below the middle of the ceiling.
        width: metres.
        height: metres.
        length: x of the window, metres.
    """

    lamps: NDArray[np.float64]
    width: float
    height: float
    length: float

    def __call__(self, points: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Light (N, 3) on points (N, 3) of a surface with a unit normal (3,), linear blue, green, red."""
        direct = np.zeros(len(points))
        for place in self.lamps:
            for shift in _ALONG_LAMP:
                towards = np.array([place + shift, 0.0, self.height - 0.05]) - points
                distance2 = np.maximum((towards**2).sum(axis=1), 0.04)
                leaving = np.maximum(towards[:, 2], 0.0) / np.sqrt(distance2)
                arriving = np.maximum(towards @ normal, 0.0) / np.sqrt(distance2)
                direct += 0.55 * leaving * arriving / distance2
        gaps = np.column_stack(
            [
                self.width / 2 - points[:, 1],
                self.width / 2 + points[:, 1],
                points[:, 2],
                self.height - points[:, 2],
            ]
        )
        nearest_corner = np.sort(np.abs(gaps), axis=1)[:, 1]
        ambient = 0.36 * (1 - 0.35 * np.exp(-nearest_corner / 0.15))
        window = 0.25 * np.exp(-(self.length - points[:, 0]) / 1.5) * (normal[0] > -0.5)
        warm, cold = np.array([0.97, 1.0, 1.03]), np.array([1.1, 1.0, 0.92])
        return np.asarray((direct + ambient)[:, None] * warm + window[:, None] * cold)
