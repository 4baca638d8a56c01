# SPDX-License-Identifier: Apache-2.0
"""A missed weed is booked under what the map and the planner said of it; seeds are read as they are written."""

from __future__ import annotations

import argparse

import numpy as np
import pytest

from bench.__main__ import seeds_of
from bench.spray_misses import BESIDE, SPARED, UNKNOWN, UNSURE, cause_of_miss
from robot_vision.mapping.plants import PlantKind, Plants
from robot_vision.planning.sprayer import SprayPlanner

WEED = np.array([0.5, 0.0])


def told(*kinds: PlantKind) -> Plants:
    """Plants on the weed's place and then 30 mm farther to the left each."""
    count = len(kinds)
    places = WEED + np.column_stack([np.zeros(count), 0.03 * np.arange(count)])
    return Plants(
        np.arange(count, dtype=np.uint32),
        places,
        np.zeros(count),
        np.full(count, 1e-3),
        np.full(count, 5),
        np.zeros((count, 2, 2)),
        np.zeros(count),
        np.array(kinds, np.uint8),
        places,
    )


@pytest.mark.parametrize(
    ("plants", "cause"),
    [
        (Plants.none(), UNKNOWN),
        (told(PlantKind.UNSURE), UNSURE),
        (told(PlantKind.WEED, PlantKind.CROP), SPARED),
        (told(PlantKind.WEED), BESIDE),
    ],
)
def test_a_miss_has_one_cause(plants: Plants, cause: str) -> None:
    spray = SprayPlanner().plan(plants, 1.0)
    assert cause_of_miss(WEED, 0.02, plants, spray) == cause
    assert cause_of_miss(WEED - (0.0, 0.5), 0.02, plants, spray) == UNKNOWN


def test_seeds_are_single_ones_and_ranges() -> None:
    assert seeds_of("3,5-7,6") == (3, 5, 6, 7)
    for wrong in ("", "x", "3-", "7-5"):
        with pytest.raises(argparse.ArgumentTypeError, match="seed"):
            seeds_of(wrong)
