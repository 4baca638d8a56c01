# SPDX-License-Identifier: Apache-2.0
"""When a picture that stays the same says that the camera hangs, and when only that the robot stands."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot_vision.mapping import Pose
from robot_vision.mapping.freeze import FreezeDetector

HERE = Pose(1.0, 2.0, math.pi - 0.01)
PICTURE = np.arange(12, dtype=np.uint8).reshape(3, 4)


@pytest.mark.parametrize(
    ("pose", "hangs"),
    [
        (HERE, False),
        (Pose(1.02, 2.02, HERE.yaw), False),
        (Pose(1.02, 2.03, HERE.yaw), True),
        (Pose(1.0, 2.0, -math.pi), False),  # turned by 0.01 rad over the seam
        (Pose(1.0, 2.0, -math.pi + 0.02), True),
    ],
)
def test_the_same_picture_from_another_place_is_that_of_a_camera_that_hangs(pose: Pose, hangs: bool) -> None:
    detector = FreezeDetector(way=0.03, turn=0.02)
    assert not detector.update(PICTURE, HERE)
    assert detector.update(PICTURE.copy(), pose) is hangs


def test_it_is_held_against_the_place_where_it_was_first_seen() -> None:
    detector = FreezeDetector(way=0.03, turn=0.02)
    told = [detector.update(PICTURE, Pose(0.01 * step, 0.0, 0.0)) for step in range(5)]
    assert told == [False, False, False, True, True]


def test_another_picture_and_a_reset_begin_anew() -> None:
    detector = FreezeDetector(way=0.03, turn=0.02)
    detector.update(PICTURE, HERE)
    away = Pose(5.0, 2.0, 0.0)
    for other in (PICTURE + 1, PICTURE[:2], PICTURE):
        assert not detector.update(other, away)
    assert detector.update(PICTURE, HERE)
    detector.reset()
    assert not detector.update(PICTURE, away)
