# SPDX-License-Identifier: Apache-2.0
"""Why a weed that could have been sprayed was not: what the map and the planner said of it shortly before the boom."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping.plants import PlantKind, Plants
from robot_vision.planning.sprayer import Spray

UNKNOWN, UNSURE, SPARED, BESIDE = (
    "not in the map",
    "not called a weed",
    "spared near the crop",
    "jet beside it",
)
CAUSES = UNKNOWN, UNSURE, SPARED, BESIDE


def cause_of_miss(place: NDArray[np.float64], near: float, plants: Plants, spray: Spray) -> str:
    """Say which of `CAUSES` it was.

    Args:
        place: (2,) of the weed in base_link, m.
        near: distance up to which a plant of the map is this weed, m.
        plants: of the map at that time.
        spray: planned at that time.
    """
    if not len(plants):
        return UNKNOWN
    away = np.linalg.norm(plants.places - place, axis=1)
    nearest = int(away.argmin())
    if away[nearest] >= near:
        return UNKNOWN
    if plants.kinds[nearest] != PlantKind.WEED:
        return UNSURE
    return BESIDE if plants.ids[nearest] in spray.weeds.ids else SPARED
