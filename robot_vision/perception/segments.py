# SPDX-License-Identifier: Apache-2.0
"""Straight line segments as they travel from the detector to everything that reads them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
#: A line of which nothing else is known is placed this well, px.
USUAL_SIGMA = 0.3


@dataclass(frozen=True)
class LineSegments:
    """N straight segments of one rectified picture.

    Attributes:
        endpoints: (N, 4) float64, `u1 v1 u2 v2` in pixels of the rectified picture, pixel centres at integers.
            Seen from the first end towards the second, the brighter side lies on the left in the picture.
        strength: (N,) float64, mean gradient across the line in grey levels a pixel.
        sigma: (N,) float64, standard deviation of the edge points about the line in pixels.

    Raises:
        ValueError: for arrays of other shapes, naming the array and its shape.
    """

    endpoints: Array
    strength: Array
    sigma: Array

    def __post_init__(self) -> None:
        endpoints = np.ascontiguousarray(self.endpoints, dtype=np.float64)
        if endpoints.ndim != 2 or endpoints.shape[1] != 4:
            shape = " x ".join(map(str, np.shape(self.endpoints))) or "a single number"
            raise ValueError(f"endpoints must be N x 4 (u1 v1 u2 v2 of each segment), not {shape}")
        count = len(endpoints)
        object.__setattr__(self, "endpoints", endpoints)
        for name in ("strength", "sigma"):
            values = np.ascontiguousarray(getattr(self, name), dtype=np.float64)
            if values.ndim != 1:
                raise ValueError(f"{name} must be one row of numbers, not of {values.ndim} dimensions")
            if len(values) != count:
                raise ValueError(f"{name} has {len(values)} values for {count} segments")
            object.__setattr__(self, name, values)

    @classmethod
    def empty(cls) -> LineSegments:
        """No segments: an ordinary answer."""
        return cls(np.zeros((0, 4)), np.zeros(0), np.zeros(0))

    @classmethod
    def from_endpoints(
        cls, endpoints: Array, strength: float = 10.0, sigma: float = USUAL_SIGMA
    ) -> LineSegments:
        """Segments known by their ends alone (N, 4), with the same strength and sigma for all."""
        count = len(endpoints)
        return cls(endpoints, np.full(count, strength), np.full(count, sigma))

    def __len__(self) -> int:
        return len(self.endpoints)

    def __getitem__(self, chosen: NDArray[np.intp] | NDArray[np.bool_] | slice) -> LineSegments:
        return LineSegments(self.endpoints[chosen], self.strength[chosen], self.sigma[chosen])

    @property
    def lengths(self) -> Array:
        """(N,) lengths in pixels."""
        return np.hypot(
            self.endpoints[:, 2] - self.endpoints[:, 0], self.endpoints[:, 3] - self.endpoints[:, 1]
        )

    @property
    def midpoints(self) -> Array:
        """(N, 2) midpoints in pixels."""
        return 0.5 * (self.endpoints[:, :2] + self.endpoints[:, 2:])
