# SPDX-License-Identifier: Apache-2.0
"""What a picture says of the rows in it: the answer of the detector."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class RowPattern:
    """The crop rows of one picture.

    Attributes:
        table: (H, K) columns of the rows at each image row, left to right, px of the picture; a row keeps its place
            in the table all the way. Above the horizon rows go on as they reach it.
        offset: of the camera to the left of the row nearest to it, in `unit`.
        yaw: of the camera relative to the rows, rad, counter-clockwise positive: it looks to the left of them.
        curvature: of the rows, 1 / `unit`, to the left positive; 0 in pixels.
        spacing: between rows, in `unit`.
        covariance: (3, 3) of offset, yaw and curvature.
        confidence: 0 to 1, that these are rows.
        horizon: image row at which the rows meet, px.
        unit: `m` on the ground where the camera and either its height or the spacing are known; else `px` at the last
            image row, with a yaw that rests on a guess of the focal length.
    """

    table: Array
    offset: float
    yaw: float
    curvature: float
    spacing: float
    covariance: Array
    confidence: float
    horizon: float
    unit: str

    def columns(self, v: float) -> Array:
        """Columns (K,) of the rows at image row v, left to right, px; between image rows interpolated."""
        place = float(np.clip(v, 0.0, len(self.table) - 1.0))
        above = min(int(place), len(self.table) - 2)
        share = place - above
        return np.asarray((1.0 - share) * self.table[above] + share * self.table[above + 1])
