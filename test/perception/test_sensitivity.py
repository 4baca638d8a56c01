# SPDX-License-Identifier: Apache-2.0
"""Each preset believes plants, rows and weeds more readily than the one before."""

from __future__ import annotations

import numpy as np
import pytest

from robot_vision.perception.crop_rows.sensitivity import PRESETS, Sensitivity
from robot_vision.perception.vegetation import LeafMask, VegetationMask

SOIL = (100, 110, 120)


def pale_plants(excess: float) -> np.ndarray:
    """Soil with plants whose excess green is as told, BGR."""
    picture = np.full((60, 80, 3), SOIL, np.uint8)
    # 2 g - b - r = excess (sum + 30) at the sum of the soil
    green = round((excess * (sum(SOIL) + 30) + sum(SOIL)) / 3)
    rest = (sum(SOIL) - green) // 2
    for u in (10, 40, 65):
        picture[25:35, u : u + 10] = rest, green, rest
    return picture


def test_there_are_three_from_the_most_doubtful_to_the_readiest() -> None:
    assert list(PRESETS) == ["low", "medium", "high"]
    for name in Sensitivity.__dataclass_fields__:
        low, medium, high = (getattr(preset, name) for preset in PRESETS.values())
        assert low > medium > high > 0.0, name


@pytest.mark.parametrize(("excess", "seen_by"), [(0.2, 3), (0.065, 2), (0.04, 1), (0.015, 0)])
def test_the_paler_the_plants_the_fewer_presets_see_them(excess: float, seen_by: int) -> None:
    picture = pale_plants(excess)
    for mask in (VegetationMask, LeafMask):
        found = [mask(floor=preset.floor).of(picture)[28:32, 12:18].all() for preset in PRESETS.values()]
        assert found == [False] * (3 - seen_by) + [True] * seen_by
