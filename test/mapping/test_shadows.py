# SPDX-License-Identifier: Apache-2.0
"""Shadows are floor, and no part of what stands is one, though it be as dark."""

from __future__ import annotations

import numpy as np
import pytest
from corridor_pictures import CAMERA
from numpy.typing import NDArray

from robot_vision.mapping.ground_view import GroundView
from robot_vision.mapping.plane_motion import Parallax
from robot_vision.mapping.shadows import ShadowFinder

VIEW = GroundView(CAMERA, 0.5)
SHAPE = VIEW.shape[0] - VIEW.top, VIEW.shape[1]
LIT, DIM = 180, 110
#: Dark, side by side and touching: a post that stands and the shadow it casts to the right, rows and columns.
POST, SHADOW = np.s_[20:60, 60:80], np.s_[52:60, 80:130]
Grid = NDArray[np.float64]


def found(dark: list[tuple[slice, slice]], raised: Grid, telling: Grid, like_floor: float = -1.0) -> Grid:
    """Which pixels are called shadow where patches are dark and all else is lit floor."""
    picture, score = np.full((*SHAPE, 3), LIT, np.uint8), np.full(SHAPE, 2.0, np.float32)
    finder, nothing = ShadowFinder(), np.zeros(SHAPE)
    finder.learn(picture, np.ones(SHAPE, bool))
    for part in dark:
        picture[part], score[part] = DIM, like_floor
    empty = np.zeros((0, 2))
    parallax = Parallax(raised, nothing, telling, 0.3, 0.0, 0.0, 0.01, empty, empty, np.zeros(0))
    return finder.find(finder.dim(picture), score, VIEW, parallax)


def test_a_shadow_is_told_from_the_post_that_casts_it() -> None:
    raised, telling = np.zeros(SHAPE), np.full(SHAPE, 0.5)
    raised[POST], raised[SHADOW] = 0.8, -0.4
    shadow = found([POST, SHADOW], raised, telling)
    assert shadow[SHADOW].mean() > 0.9
    assert not shadow[POST].any()


def test_a_plain_part_of_what_stands_is_no_shadow() -> None:
    raised, telling = np.zeros(SHAPE), np.zeros(SHAPE)
    front, top = np.s_[40:60, 60:100], np.s_[20:40, 60:100]
    raised[front], telling[front] = 0.8, 0.5
    assert not found([front, top], raised, telling).any()


def test_floor_that_shadow_makes_doubtful_is_floor() -> None:
    shadow = found([SHADOW], np.zeros(SHAPE), np.zeros(SHAPE), like_floor=0.1)
    assert shadow[SHADOW].all()


@pytest.mark.parametrize(
    ("rim", "below", "is_shadow"),
    [(-0.3, -0.3, True), (-0.1, -0.1, False), (0.0, -0.45, False), (-0.45, 0.02, False)],
)
def test_a_strip_beside_what_stands_is_shadow_when_it_surely_lies(
    rim: float, below: float, is_shadow: bool
) -> None:
    """As the shadow of a kerb, which runs on along it for longer than things on the floor are deep.

    What stands rises with its height: skirtings lie at their feet only.
    """
    raised, telling = np.zeros(SHAPE), np.full(SHAPE, 0.5)
    strip = np.s_[10:60, 80:84]
    raised[POST], raised[strip], raised[10:12, 80:84] = 0.8, below, rim
    shadow = found([POST, strip], raised, telling)
    assert shadow[strip].any() == is_shadow
