# SPDX-License-Identifier: Apache-2.0
"""Kerbs of the floor's own stone, drawn on a plane of stones each of a tint of its own."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.mapping.ground_view import GroundView
from robot_vision.mapping.kerbs import KerbFinder
from robot_vision.mapping.plane_motion import Parallax
from robot_vision.mapping.pose import Pose

VIEW = GroundView(Camera(460.0, 460.0, 319.5, 239.5, 640, 480, height_m=0.6, pitch=math.radians(8.0)), 0.5)
AHEAD = VIEW.camera.optical_to_base.T @ np.array([1.0, 0.0, 0.0])
FOOT, BACK = 1.2, 1.65
"""Where a kerb on the left begins, and where the floor behind it ends in the picture, m."""
STONE = 0.6
Picture = tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.uint8]]


def ground() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rows, columns = VIEW.shape
    grid = np.meshgrid(np.arange(columns, dtype=float), np.arange(VIEW.top, rows, dtype=float))
    return VIEW.ground(*grid)


def picture(kerb: float, seed: int = 0, hidden: float = 0.0) -> Picture:
    """Score, dimness and colours of a floor of stones of random tint with a kerb that differs by `kerb` from them.

    The nearest `hidden` metres of the left side are hidden by a thing on the floor.
    """
    random = np.random.default_rng(seed)
    x, y = ground()
    stones = random.normal(0.0, 1.0, (80, 80))
    number = [np.clip(np.floor(part / STONE).astype(int) + 40, 0, 79) for part in (x, y)]
    lab = np.full((*x.shape, 3), 128.0)
    lab[..., 2] += 8.0 + stones[number[0], number[1]] + random.normal(0.0, 1.0, x.shape)
    strip = (y > FOOT) & (y < BACK)
    lab[strip, 2] += kerb
    score = np.where((y < BACK) & (y > -1.6), 2.0, -3.0)
    score[(y > 0.8) & (x < hidden)] = -3.0
    return score.astype(np.float32), np.zeros(x.shape, bool), np.clip(lab, 0, 255).astype(np.uint8)


def line(y: float, near: float, far: float) -> NDArray[np.float64]:
    """A line (1, 4) along the way at y (m to the left), working pixels."""
    u, v = VIEW.pixels(np.array([near, far]), np.array([y, y]))
    return np.array([[u[0], v[0], u[1], v[1]]])


def lines(*places: float) -> NDArray[np.float64]:
    return np.concatenate([line(y, 2.5, 3.5) for y in places])


def test_a_kerb_is_followed_from_a_piece_of_its_foot_to_the_edge_of_the_picture_and_to_where_it_ends() -> (
    None
):
    borders = KerbFinder().find(lines(FOOT, 0.6, 0.0, -0.6), AHEAD, *picture(-4.0), VIEW, None)
    x, y = VIEW.ground(borders.ends[:, 0::2], borders.ends[:, 1::2])
    assert np.abs(y - FOOT).max() < 0.02
    assert (borders.away == -1.0).all()
    assert x.min() < 2.3
    assert x.max() > 6.0


@pytest.mark.parametrize("seed", range(12))
def test_joints_between_stones_of_different_tints_are_no_kerbs(seed: int) -> None:
    places = (FOOT, 0.6, 0.0, -0.6, -1.2)
    borders = KerbFinder().find(lines(*places), AHEAD, *picture(0.0, seed), VIEW, None)
    assert len(borders.ends) == 0


def test_floor_that_goes_on_behind_a_strip_of_another_tint_has_no_kerb() -> None:
    score, dim, lab = picture(-4.0)
    score[:] = 2.0
    assert len(KerbFinder().find(lines(FOOT), AHEAD, score, dim, lab, VIEW, None).ends) == 0


def test_a_kerb_in_shadow_cannot_be_told_from_the_shadow() -> None:
    score, _, lab = picture(-4.0)
    dim = np.ones(score.shape, bool)
    assert len(KerbFinder().find(lines(FOOT), AHEAD, score, dim, lab, VIEW, None).ends) == 0


def moved(kerb: float) -> Parallax:
    """What motion tells of that floor: it shows half of what floor should, the strip the share `kerb` of that."""
    x, y = ground()
    telling = np.ones(x.shape, np.float32)
    strip = (y > FOOT) & (y < BACK)
    raised = np.where(strip, np.float32(-0.5 * kerb), np.float32(-0.5))
    none = np.zeros((0, 2))
    return Parallax(raised, telling * 0.0, telling, 0.3, 0.0, 0.0, 0.01, none, none, np.zeros(0))


@pytest.mark.parametrize(("shows", "found"), [(0.3, True), (1.0, False)])
def test_the_outermost_row_of_stones_lies_as_low_as_the_floor_and_is_no_kerb(
    shows: float, found: bool
) -> None:
    borders = KerbFinder().find(lines(FOOT), AHEAD, *picture(-4.0), VIEW, None, moved(shows))
    assert bool(len(borders.ends)) == found


def test_motion_that_tells_nothing_of_a_strip_leaves_it_a_kerb() -> None:
    blank = moved(1.0)
    blank = replace(blank, raised=blank.raised * 0.1, telling=blank.telling * 0.1)
    assert len(KerbFinder().find(lines(FOOT), AHEAD, *picture(-4.0), VIEW, None, blank).ends)


def test_a_known_kerb_is_found_behind_a_thing_that_hides_most_of_it() -> None:
    """From the place the robot has moved to, and without any line seen there."""
    hidden = picture(-4.0, hidden=4.3)
    finder, fresh = KerbFinder(), KerbFinder()
    assert len(finder.find(lines(FOOT), AHEAD, *picture(-4.0), VIEW, Pose(0.0, 0.3, 0.0)).ends)
    assert len(fresh.find(lines(FOOT), AHEAD, *hidden, VIEW, Pose(0.0, 0.0, 0.0)).ends) == 0
    # The robot goes 0.3 m to the right, so that the kerb should be farther off than this picture shows it.
    moved = finder.find(np.zeros((0, 4)), AHEAD, *hidden, VIEW, Pose(0.5, 0.0, 0.0))
    assert len(moved.ends) == 0
    finder.reset()
    finder.find(lines(FOOT), AHEAD, *picture(-4.0), VIEW, Pose(0.0, 0.0, 0.0))
    assert len(finder.find(np.zeros((0, 4)), AHEAD, *hidden, VIEW, Pose(0.5, 0.0, 0.0)).ends)


def test_a_kerb_moves_across_the_picture_as_the_robot_moves_across_the_way() -> None:
    finder = KerbFinder()
    turn = math.radians(30.0)
    start = Pose(0.2 * math.sin(turn), -0.2 * math.cos(turn), turn)
    finder.find(lines(FOOT), AHEAD, *picture(-4.0), VIEW, start)
    # From there 0.2 m to the left: the kerb is nearer by that much.
    borders = finder.find(np.zeros((0, 4)), AHEAD, *shifted(picture(-4.0), 0.2), VIEW, Pose(0.0, 0.0, turn))
    _, y = VIEW.ground(borders.ends[:, 0::2], borders.ends[:, 1::2])
    assert y.mean() == pytest.approx(FOOT - 0.2, abs=0.03)


def shifted(what: Picture, by: float) -> Picture:
    """The picture from `by` metres farther left."""
    x, y = ground()
    u, v = VIEW.pixels(x, y + by)
    rows, columns = what[0].shape
    row = np.clip(np.round(v - VIEW.top), 0, rows - 1).astype(int)
    column = np.clip(np.round(u), 0, columns - 1).astype(int)
    score, dim, lab = what
    return score[row, column], dim[row, column], lab[row, column]
