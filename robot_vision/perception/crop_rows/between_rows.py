# SPDX-License-Identifier: Apache-2.0
"""The bare ground between the rows: where the crop nearly closes it is the rarer, and tells more than the plants."""

from __future__ import annotations

import numpy as np

from robot_vision.geometry import Camera
from robot_vision.perception.crop_rows.ground_fit import Pieces, ground_places

#: Length of a stretch of way (m), the farthest one, and the share of it that must be grown over to be of use.
_STRETCH_M, _FARTHEST_M, _GROWN = 0.5, 40.0, 0.4


def between_plants(bare: Pieces, plants: Pieces, camera: Camera) -> Pieces:
    """The bits of bare ground in stretches of the way where plants stand: not those of gaps and the headland."""
    upright = np.zeros(6)
    ahead = [
        np.clip(ground_places(bits.rays, camera, upright)[0], 0.0, _FARTHEST_M) for bits in (bare, plants)
    ]
    stretch = [(x / _STRETCH_M).astype(np.int64) for x in ahead]
    count = int(_FARTHEST_M / _STRETCH_M) + 1
    open_area, grown = (
        np.bincount(place, bits.weight, count) for place, bits in zip(stretch, (bare, plants), strict=True)
    )
    kept = (grown > _GROWN * (open_area + grown))[stretch[0]]
    return Pieces(bare.rays[kept], bare.weight[kept], bare.aside)
