# SPDX-License-Identifier: Apache-2.0
"""Points of the floor seen from two places tell what odometry and horizon have wrong, each by itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from corridor_pictures import CAMERA
from numpy.typing import NDArray

from robot_vision.mapping.disagreement import FEWEST_POINTS, Disagreement, FloorMotion
from robot_vision.mapping.ground_view import GroundView

Array = NDArray[np.float64]

VIEW = GroundView(CAMERA, 0.5)
TOLD = np.array([[1.0, 0.0, 0.3], [0.0, 1.0, 0.02], [0.0, 0.0, 1.0]])
LOOSE = 0.3


def told_of(wrong: Disagreement, count: int = 120, strange: int = 0) -> Disagreement:
    """What is found wrong when so much is, by points of a floor and some that move strangely."""
    random = np.random.default_rng(5)
    here = np.column_stack([random.uniform(1.2, 5.0, count), random.uniform(-1.0, 1.0, count)])
    there = here @ wrong.righted(TOLD)[:2, :2].T + wrong.righted(TOLD)[:2, 2]
    points, seen_at = (np.column_stack(VIEW.pixels(*places.T)) for places in (here, there))
    seen_at[:strange] += (15.0, -8.0)
    camera = VIEW.camera
    leaning = replace(camera, pitch=camera.pitch + wrong.pitch, roll=camera.roll + wrong.roll)
    return FloorMotion(points, seen_at, VIEW, GroundView(leaning, VIEW.scale), TOLD).disagreement(LOOSE)


@pytest.mark.parametrize("strange", [0, 3])
@pytest.mark.parametrize(
    "wrong",
    [
        Disagreement(0.0, 0.0, 0.0, 0.2, 0.0),
        Disagreement(0.0, 0.0, 0.01, 0.0, 0.0),
        Disagreement(0.0, 0.0, 0.0, 0.0, 0.015),
        Disagreement(0.0, 0.003, 0.0, 0.0, 0.0),
        Disagreement(0.003, 0.0, 0.0, 0.0, 0.0),
        Disagreement(0.002, -0.002, -0.005, -0.1, 0.01),
    ],
)
def test_each_error_is_told_by_itself(wrong: Disagreement, strange: int) -> None:
    found = told_of(wrong, strange=strange)
    assert found[:3] == pytest.approx(wrong[:3], abs=0.0015)
    assert found.slip == pytest.approx(wrong.slip, abs=0.03)
    assert found.righted(TOLD) == pytest.approx(wrong.righted(TOLD), abs=0.008)


def test_too_few_points_tell_nothing() -> None:
    wrong = Disagreement(0.0, 0.0, 0.0, 0.2, 0.0)
    assert told_of(wrong, FEWEST_POINTS - 1) == Disagreement(0.0, 0.0, 0.0, 0.0, 0.0)
    assert told_of(wrong, FEWEST_POINTS).slip == pytest.approx(0.2, abs=0.05)
