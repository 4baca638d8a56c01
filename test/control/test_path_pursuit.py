# SPDX-License-Identifier: Apache-2.0
"""Pure pursuit follows a way closely, stops at its end, and never asks for more than the limits."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from robot_vision.control import PathPursuit
from robot_vision.planning.navigator import distance_to_line

STEP = 0.05
BENDS = np.array([(0, 0), (3, 0), (3, 2), (1, 3), (1, 5)], np.float64)


def driven(
    law: PathPursuit,
    way: NDArray[np.float64],
    pose: tuple[float, float, float],
    seconds: float,
    seen: float = np.inf,
) -> NDArray[np.float64]:
    """Poses and commands (N, 5) of a robot that does at once what it is told."""
    x, y, yaw = pose
    rows = []
    for number in range(int(seconds / STEP)):
        told = law.update(way, (x, y, yaw), number * STEP, seen)
        rows.append((x, y, yaw, told.speed, told.turn_rate))
        x, y = x + told.speed * STEP * np.cos(yaw), y + told.speed * STEP * np.sin(yaw)
        yaw += told.turn_rate * STEP
    return np.array(rows)


@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (0.1, 0.15, 0.5), (0.0, 0.0, 3.0), (-0.2, -0.1, -2.0)])
def test_it_follows_bends_and_stops_at_the_end(pose: tuple[float, float, float]) -> None:
    law = PathPursuit(latency=0.01)
    track = driven(law, BENDS, pose, 60.0)
    assert np.hypot(*(track[-1, :2] - BENDS[-1])) < 0.05
    assert tuple(track[-1, 3:]) == pytest.approx((0.0, 0.0), abs=0.02)
    later = track[60:]
    assert max(distance_to_line(BENDS, (x, y)) for x, y in later[:, :2]) < 0.2


def test_commands_stay_within_the_limits() -> None:
    law = PathPursuit(speed=0.8, most_turn_rate=1.5, most_acceleration=0.6, most_turn_acceleration=4.0)
    track = driven(law, BENDS, (0.0, 0.3, 2.5), 60.0)
    speed, turn = track[:, 3], track[:, 4]
    assert speed.min() >= 0.0
    assert speed.max() <= 0.8 + 1e-9
    assert np.abs(turn).max() <= 1.5 + 1e-9
    # at its end the way may be over at once
    moving = np.hypot(*(track[:, :2] - BENDS[-1]).T)[:-1] > 0.1
    assert np.abs(np.diff(speed)[moving]).max() <= 0.6 * STEP + 1e-9
    assert np.abs(np.diff(turn)[moving]).max() <= 4.0 * STEP + 1e-9


def test_it_does_not_drive_where_nobody_has_looked() -> None:
    track = driven(PathPursuit(latency=0.01), BENDS, (0.0, 0.0, 0.0), 40.0, seen=2.0)
    assert track[-1, 3] == 0.0
    assert 1.8 < track[-1, 0] <= 2.02


def test_without_a_way_or_a_place_it_stands() -> None:
    law = PathPursuit()
    assert law.update(np.zeros((0, 2)), (0, 0, 0), 0.0).speed == 0.0
    told = law.update(BENDS, (0.0, float("nan"), 0.0), 0.1)
    assert (told.speed, told.turn_rate) == (0.0, 0.0)
    assert told.reason == "the robot's place is no number"


@pytest.mark.parametrize("name", ["speed", "lookahead", "most_turn_rate", "latency"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
def test_settings_that_make_no_sense_are_named(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{name} must be a positive number"):
        PathPursuit(**{name: value})
