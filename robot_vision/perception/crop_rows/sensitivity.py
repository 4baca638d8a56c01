# SPDX-License-Identifier: Apache-2.0
"""Three settings of how readily plants and rows are believed, for those who do not want to know of thresholds."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Sensitivity:
    """How readily plants and rows are believed.

    Attributes:
        floor: least excess green of what grows; see `VegetationMask`.
        coherence: least share of the vegetation that must stand in rows; see `RowTracker`.
        cover: least share of the ground that plants must cover; see `RowTracker`.
        sure: probability from which on a plant is called a weed, and sprayed.
    """

    floor: float
    coherence: float
    cover: float
    sure: float


PRESETS: dict[str, Sensitivity] = {
    # many weeds, moss or algae on the soil, grown crop
    "low": Sensitivity(floor=0.08, coherence=0.2, cover=0.01, sure=0.95),
    "medium": Sensitivity(floor=0.05, coherence=0.12, cover=0.004, sure=0.85),
    # just come up, pale, or a camera with dull colours
    "high": Sensitivity(floor=0.03, coherence=0.08, cover=0.001, sure=0.7),
}
