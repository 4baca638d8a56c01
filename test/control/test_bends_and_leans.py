# SPDX-License-Identifier: Apache-2.0
"""Steering along paths that bend, beside the centre line, and with a body that leans."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_vision.control import CorridorSteering
from robot_vision.perception import LaneHeading
from robot_vision.perception.attitude import Lean, lean_from

STEP = 1 / 15
SURE = math.radians(0.3) ** 2


def bend(curvature: float, length: float = 20.0) -> np.ndarray:
    """Points of a circle that leads on from the robot, to the left for a positive curvature."""
    turned = curvature * np.arange(0.0, length, 0.5)
    return np.stack([np.sin(turned), 1.0 - np.cos(turned)], axis=1) / curvature


def test_along_an_even_bend_the_robot_drives_its_circle():
    law = CorridorSteering(speed=2.0, most_acceleration=5.0, most_turn_acceleration=50.0)
    for picture in range(60):
        said = law.update(LaneHeading(0.0, SURE, 0.0, SURE), picture * STEP, None, bend(0.05))
    assert said.turn_rate / said.speed == pytest.approx(0.05, rel=0.02)


def test_no_bend_is_taken_faster_than_it_allows_and_none_too_late():
    law = CorridorSteering(speed=8.0, most_side_acceleration=1.5, most_acceleration=1.0)
    lane = LaneHeading(0.0, SURE, 0.0, SURE)
    for picture in range(300):
        straight = law.update(
            lane, picture * STEP, None, np.stack([np.arange(0.0, 30.0), np.zeros(30)], axis=1)
        )
    assert straight.speed == pytest.approx(8.0, rel=0.1)
    for picture in range(300, 600):
        bent = law.update(lane, picture * STEP, None, bend(0.1))
    assert bent.speed**2 * 0.1 <= 1.5 * 1.05


def test_what_is_kept_beside_the_centre_line_is_kept_on_straights_and_on_paths():
    lane = LaneHeading(0.0, SURE, -1.4, SURE)
    law = CorridorSteering(keep=-1.4)
    along = np.arange(0.0, 10.0, 0.5)
    for path in (None, np.stack([along, np.full(len(along), 1.4)], axis=1)):
        law.reset()
        for picture in range(10):
            said = law.update(lane, picture * STEP, None, path)
        assert abs(said.turn_rate) < 1e-6
        assert said.speed > 0.1


def test_a_path_that_is_none_is_not_followed():
    law, plain = CorridorSteering(), CorridorSteering()
    lane = LaneHeading(0.1, SURE, 0.2, SURE)
    for path in (np.zeros((1, 2)), np.full((5, 2), math.nan)):
        assert law.update(lane, 0.0, None, path) == plain.update(lane, 0.0)


def test_a_place_to_keep_that_is_no_number_is_refused():
    with pytest.raises(ValueError, match="keep"):
        CorridorSteering(keep=math.nan)


def test_a_body_that_leans_slows_and_stands_before_it_tips_over():
    lane = LaneHeading(0.0, SURE, 0.0, SURE)
    speeds = []
    for angle in np.radians([0.0, 5.0, 10.0, 15.0, 25.0]):
        law = CorridorSteering(speed=0.6, most_acceleration=20.0)
        said = law.update(lane, 0.0, lean=Lean(float(angle), "left"))
        speeds.append(said.speed)
        assert bool(said.reason) == (angle > law.lean_slow)
    assert speeds[0] == speeds[1] > speeds[2] > speeds[3] > speeds[4] == 0.0
    assert "to the left" in said.reason
    assert CorridorSteering().update(lane, 0.0, lean=Lean(math.nan, "left")).speed == 0.0
    with pytest.raises(ValueError, match="lean_slow"):
        CorridorSteering(lean_slow=0.5, lean_stop=0.4)


def test_a_lean_is_what_is_left_of_the_attitude_beside_the_mounting():
    assert lean_from(0.0, 0.1, 0.0, 0.1).angle == pytest.approx(0.0, abs=1e-7)
    assert lean_from(0.1, 0.1, 0.0, 0.1) == Lean(pytest.approx(0.1, rel=0.01), "right")
    assert lean_from(0.0, -0.2, 0.0, 0.1) == Lean(pytest.approx(0.3), "back")
