# SPDX-License-Identifier: Apache-2.0
"""Leaves of the crop stay where they were seen in the field, until bare ground is seen there."""

from __future__ import annotations

import numpy as np
import pytest

from robot_vision.mapping.plant_leaves import CELL_M, LeafCover
from robot_vision.mapping.pose import Pose
from robot_vision.perception.crop_rows.ground_window import GroundWindow

SIDE, CORNER = 0.006, np.array([0.7, -0.6])


def _window(leaves: bool, foreign: bool = False) -> GroundWindow:
    """Ground with a square of leaves of 0.2 m, 0.9 m ahead and 0.3 m to the left."""
    cells = np.zeros((150, 201), np.uint8)
    if leaves:
        cells[17:50, 134:167] = 1
    return GroundWindow(cells, np.ones(cells.shape, bool), (cells > 0) & foreign, CORNER, SIDE, 1.4)


@pytest.mark.parametrize("yaw", [0.0, 0.4, 2.0, -1.0])
def test_leaves_are_carried_by_what_the_robot_does(yaw: float) -> None:
    cover, begin = LeafCover(), Pose(3.0, -2.0, yaw)
    cover.see(_window(True), begin)
    middle = np.array([0.9, 0.3])
    seen = cover.places(begin)
    assert len(seen) * CELL_M**2 == pytest.approx(0.04, rel=0.15)
    assert seen.mean(axis=0) == pytest.approx(middle, abs=0.01)
    cosine, sine = np.cos(yaw), np.sin(yaw)
    end = Pose(3.0 + 1.1 * cosine, -2.0 + 1.1 * sine, yaw + 0.3)
    cover.see(_window(False), end)
    away = middle - (1.1, 0.0)
    turned = np.array([[np.cos(0.3), np.sin(0.3)], [-np.sin(0.3), np.cos(0.3)]]) @ away
    assert cover.places(end).mean(axis=0) == pytest.approx(turned, abs=0.01)
    assert len(cover.places(end)) == len(seen)


def test_bare_ground_and_weeds_are_no_cover() -> None:
    cover, here = LeafCover(), Pose(0.0, 0.0, 0.0)
    cover.see(_window(True, foreign=True), here)
    assert not len(cover.places(here))
    cover.see(_window(True), here)
    cover.see(_window(True), here)
    assert len(cover.places(here))
    cover.see(_window(False), here)
    cover.see(_window(False), here)
    assert not len(cover.places(here))


def test_far_away_and_after_a_reset_nothing_is_known() -> None:
    cover = LeafCover()
    cover.see(_window(True), Pose(0.0, 0.0, 0.0))
    cover.see(_window(False), Pose(50.0, 0.0, 0.0))
    assert not len(cover.places(Pose(50.0, 0.0, 0.0)))
    cover.see(_window(True), Pose(50.0, 0.0, 0.0))
    cover.reset()
    assert not len(cover.places(Pose(50.0, 0.0, 0.0)))
