# SPDX-License-Identifier: Apache-2.0
"""What hung on leaves of the crop tells by its own height, on the way past it, whether it is one of them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from robot_vision.mapping.plant_tracks import PlantTracks, Stature
from robot_vision.mapping.pose import Pose

HEIGHT, PLACE, STATURE = 1.2, np.array([2.0, 0.3]), Stature(radius=0.2, crop=0.6)
COMMON = np.zeros((1, 2, 2))


def sight(pose: Pose, high: float) -> NDArray[np.float64]:
    """Where something so high appears on the ground, (1, 2)."""
    away = PLACE - (pose.x, pose.y)
    return away[None] * HEIGHT / (HEIGHT - high)


def begun(high: float, hanging: bool) -> PlantTracks:
    tracks, start = PlantTracks.none(), Pose(0.0, 0.0, 0.0)
    noise = 0.01**2 * np.eye(2)[None]
    area, foreign = np.array([np.pi * 0.03**2]), np.zeros(1)
    seen = sight(start, high)
    tracks.begin(1, seen, noise, COMMON, area, foreign, np.array([hanging]), start, 0.0, HEIGHT, STATURE)
    return tracks


@pytest.mark.parametrize("high", [0.01, 0.05, 0.12, 0.16])
def test_its_height_and_its_place_are_told_by_the_way_past_it(high: float) -> None:
    tracks = begun(high, True)
    for x in np.arange(0.16, 1.4, 0.16):
        pose = Pose(float(x), 0.0, 0.0)
        tracks.correct(np.array([0]), sight(pose, high), 0.01**2 * np.eye(2)[None], COMMON, pose, 0.0)
    assert HEIGHT * (1.0 - np.exp(tracks.states[0, 2])) == pytest.approx(high, abs=0.015)
    assert tracks.states[0, :2] == pytest.approx(PLACE, abs=0.02)


def test_who_hung_on_leaves_may_be_as_high_as_these_and_who_stood_alone_is_low() -> None:
    alone, hung = (HEIGHT * np.sqrt(begun(0.02, hanging).covariances[0, 2, 2]) for hanging in (False, True))
    assert alone < 0.012
    assert hung == pytest.approx(0.4 * 0.6 * 0.2, rel=0.1)


def test_large_plants_stand_as_high_as_the_crop() -> None:
    tall, unsure = STATURE.of(np.array([0.2, 0.03, 0.03]), np.array([False, False, True]))
    assert tall == pytest.approx([0.12, 0.018, 0.048])
    assert (unsure > 0.0).all()
    assert unsure[2] > unsure[1]
