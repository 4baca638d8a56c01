# SPDX-License-Identifier: Apache-2.0
"""Two plants side by side are told by the waist between them, and one plant is never cut."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.perception.crop_rows.ground_window import GroundWindow, Lean
from robot_vision.perception.crop_rows.plant_blobs import PlantSegmenter
from robot_vision.perception.crop_rows.plant_twins import twins

LEAST, MOST = 30.0, 4000.0


def rosette(middle: tuple[float, float], radius: float, leaves: int) -> NDArray[np.bool_]:
    """A star of leaves in a window of 80 by 80 cells."""
    down, aside = np.mgrid[:80, :80]
    away = np.hypot(down - middle[0], aside - middle[1])
    turn = np.arctan2(down - middle[0], aside - middle[1])
    return np.asarray(away < radius * (0.7 + 0.3 * np.cos(leaves * turn)))


def parts(*masks: NDArray[np.bool_]) -> tuple[list[int], NDArray[np.float64]]:
    """What is cut of blobs, the first of which has label 1."""
    labels = np.zeros((80, 80), np.intp)
    for number, mask in enumerate(masks, 1):
        labels[mask] = number
    row, column = np.nonzero(labels)
    which, middles = twins(row, column, labels[row, column], len(masks) + 1, LEAST, MOST)
    return which.tolist(), middles


@pytest.mark.parametrize("turn", np.linspace(0.0, np.pi, 7))
def test_two_rosettes_that_touch_are_two(turn: float) -> None:
    step = 11.0 * np.array([np.sin(turn), np.cos(turn)])
    first, second = (40.0 - step[0], 40.0 - step[1]), (40.0 + step[0], 40.0 + step[1])
    which, middles = parts(rosette(first, 12.0, 6) | rosette(second, 12.0, 5))
    assert which == [1]
    true = np.array([first, second])
    away = np.linalg.norm(middles[0][:, None] - true[None], axis=2)
    assert away.min(axis=0).max() < 2.0


@pytest.mark.parametrize("leaves", [3, 4, 5, 6, 7])
def test_one_rosette_is_one(leaves: int) -> None:
    assert parts(rosette((40.0, 40.0), 20.0, leaves))[0] == []


@pytest.mark.parametrize("ratio", [1.0, 1.6, 2.5, 4.0])
def test_an_ellipse_is_one_however_long(ratio: float) -> None:
    down, aside = np.mgrid[:80, :80] - 40.0
    assert parts((down / ratio) ** 2 + aside**2 < 81.0)[0] == []


def test_blobs_too_small_or_too_large_are_left_alone() -> None:
    small = rosette((10.0, 10.0), 3.0, 5) | rosette((10.0, 15.0), 3.0, 5)
    assert small.sum() < 2 * LEAST
    assert parts(small)[0] == []
    large = rosette((40.0, 18.0), 20.0, 5) | rosette((40.0, 58.0), 20.0, 5)
    row, column = np.nonzero(large)
    assert len(twins(row, column, np.ones(len(row), np.intp), 2, LEAST, large.sum() - 1.0)[0]) == 0
    assert len(twins(row, column, np.ones(len(row), np.intp), 2, LEAST, MOST)[0]) == 1


def test_nothing_grows() -> None:
    none = np.zeros(0, np.intp)
    which, middles = twins(none, none, none, 1, LEAST, MOST)
    assert len(which) == 0
    assert middles.shape == (0, 2, 2)


def test_small_plants_that_are_known_stay_apart_where_they_grow_together() -> None:
    cells = np.zeros((120, 200), np.uint8)
    cells[:, :150] = 1  # the crop closes
    down, aside = np.mgrid[:120, :200]
    cells[((down - 60) / 11) ** 2 + ((aside - 175) / 5) ** 2 < 1] = 1
    corner, side = np.array([0.7, -0.6]), 0.006
    window = GroundWindow(cells, np.ones(cells.shape, bool), np.zeros(cells.shape, bool), corner, side, 1.2)
    camera = Camera(460.0, 460.0, 319.5, 239.5, 640, 480, height_m=1.4)
    both = corner + side * np.array([[53, 175], [67, 175]])
    for known, expected in (
        (both, 2),
        (both[:1], 1),
        (np.zeros((0, 2)), 1),
        (both.mean(axis=0) + [[0, 0], [0.005, 0]], 1),
    ):
        blobs = PlantSegmenter().cut(window, camera, Lean(), 0.1, np.zeros((0, 2)), known)
        left = blobs.slopes[:, 1] * window.fall
        assert (left > corner[1] + side * 160).sum() == expected


@pytest.mark.parametrize(("closes", "expected"), [(True, 2), (False, 1)])
def test_small_plants_are_cut_at_their_waist_where_the_crop_closes(closes: bool, expected: int) -> None:
    cells = np.zeros((120, 200), np.uint8)
    if closes:
        cells[:, :150] = 1
    twin = rosette((50.0, 40.0), 8.0, 5) | rosette((66.0, 40.0), 8.0, 5)
    cells[: len(twin), 140 : 140 + twin.shape[1]][twin[:, : cells.shape[1] - 140]] = 1
    cells[:, 150:160] = 0
    corner, side = np.array([0.7, -0.6]), 0.006
    window = GroundWindow(cells, np.ones(cells.shape, bool), np.zeros(cells.shape, bool), corner, side, 1.2)
    assert window.closes == closes
    camera = Camera(460.0, 460.0, 319.5, 239.5, 640, 480, height_m=1.4)
    none = np.zeros((0, 2))
    blobs = PlantSegmenter().cut(window, camera, Lean(), 0.12, none, none)
    left = blobs.slopes[:, 1] * window.fall
    assert (left > corner[1] + side * 160).sum() == expected
