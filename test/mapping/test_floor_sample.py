# SPDX-License-Identifier: Apache-2.0
"""From what just before the robot the looks of the floor are learnt, and from what they are not."""

from __future__ import annotations

import numpy as np
from corridor_pictures import CAMERA
from numpy.typing import NDArray

from robot_vision.mapping import Pose
from robot_vision.mapping.appearance import FloorAppearance
from robot_vision.mapping.floor_sample import STRANGE, FloorSample
from robot_vision.mapping.ground_view import GroundView

VIEW = GroundView(CAMERA, 0.5)
FLOOR, THING = (120, 128, 128), (40, 160, 150)
START = Pose(0.0, 0.0, 0.0)


def ground(colour: tuple[int, int, int] = FLOOR) -> NDArray[np.uint8]:
    """Ground of one colour, CIE Lab."""
    rows, columns = VIEW.shape
    return np.tile(np.uint8(colour), (rows - VIEW.top, columns, 1))


def looks() -> FloorAppearance:
    """The looks of a floor that is known."""
    appearance = FloorAppearance()
    sample, strange = FloorSample().choose(ground(), appearance, VIEW, None)
    assert sample is not None and strange == ""
    appearance.learn(ground(), sample, np.full((20, 320, 3), 250, np.uint8))
    return appearance


def test_the_first_sample_is_the_ground_just_before_the_robot() -> None:
    sample, _ = FloorSample().choose(ground(), FloorAppearance(), VIEW, None)
    assert sample is not None
    rows, columns = np.nonzero(sample)
    x, y = VIEW.ground(columns.astype(float), rows + float(VIEW.top))
    assert np.abs(y).max() < 0.6 * (CAMERA.height_m or 0.0)
    assert x.max() < 2.0
    assert sample[-1, 160]


def test_what_suddenly_stands_there_is_learnt_only_after_the_robot_has_driven_over_it() -> None:
    sample, appearance = FloorSample(), looks()
    for x, learnt in ((0.0, False), (1.0, False), (1.4, False), (1.6, True)):
        chosen, strange = sample.choose(ground(THING), appearance, VIEW, Pose(x, 0.0, 0.0))
        assert strange == STRANGE
        assert (chosen is not None) == learnt
    known, strange = sample.choose(ground(), appearance, VIEW, Pose(1.7, 0.0, 0.0))
    assert known is not None and strange == ""
    again, _ = sample.choose(ground(THING), appearance, VIEW, Pose(1.8, 0.0, 0.0))
    assert again is None, "the way over it is counted anew"


def test_without_odometry_and_after_a_reset_it_is_never_believed_at_once() -> None:
    sample, appearance = FloorSample(), looks()
    assert sample.choose(ground(THING), appearance, VIEW, None)[0] is None
    sample.choose(ground(THING), appearance, VIEW, START)
    sample.reset()
    assert sample.choose(ground(THING), appearance, VIEW, Pose(5.0, 0.0, 0.0))[0] is None


def test_specks_among_floor_are_learnt_and_what_reaches_in_from_above_is_not() -> None:
    shown = ground()
    height = len(shown)
    shown[height - 8 : height - 4, 150:154] = THING
    shown[: height - 20, 170:176] = THING
    sample, _ = FloorSample().choose(shown, looks(), VIEW, START)
    assert sample is not None
    assert sample[height - 6, 152], "between floor and floor"
    assert not sample[height - 22, 173], "it may be the foot of a wall"
    assert sample[height - 10, 173]


def test_of_a_floor_half_covered_only_what_looks_like_floor_is_learnt() -> None:
    shown = ground()
    shown[:, :140] = THING
    sample, strange = FloorSample().choose(shown, looks(), VIEW, START)
    assert sample is not None and strange == ""
    assert not sample[-4, 139]
    assert sample[-4, 160]
