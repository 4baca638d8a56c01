# SPDX-License-Identifier: Apache-2.0
"""A small plant that hangs on the leaves of a closed crop by a neck is cut off; lobes and jags of leaves are not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.perception.crop_rows.ground_window import GroundWindow, Lean
from robot_vision.perception.crop_rows.plant_blobs import PlantSegmenter
from robot_vision.perception.crop_rows.plant_cells import PlantCells
from robot_vision.perception.crop_rows.plant_necks import cut_necks

RADIUS, SIDE, LEAST = 32.0, 0.006, 8.0
Cells = NDArray[np.uint8]


def leaves() -> Cells:
    """A row of the crop that closes, along the left of the window."""
    grown = np.zeros((180, 200), np.uint8)
    grown[:, :80] = 1
    return grown


def hung(grown: Cells, row: int, radius: int, neck: int, away: int = 6) -> Cells:
    """A round plant so far from the leaves, and a neck so wide between."""
    middle = 80 + away + radius
    cv2.circle(grown, (middle, row), radius, 1, -1)
    grown[row - neck // 2 : row - neck // 2 + neck, 78:middle] = 1
    return grown


def cut(grown: Cells) -> tuple[PlantCells, NDArray[np.bool_]]:
    cells = PlantCells.of(grown, grown)
    return cells, cut_necks(grown, cells, RADIUS, SIDE, LEAST)


@pytest.mark.parametrize(("radius", "neck"), [(4, 2), (6, 4), (8, 4), (9, 7)])
def test_a_weed_that_touches_the_leaves_gets_its_own_label(radius: int, neck: int) -> None:
    grown = hung(leaves(), 100, radius, neck)
    cells, hangs = cut(grown)
    assert cells.count == 3
    own = cells.labels == 2
    assert own[100, 86 + radius]
    assert not own[:, :80].any()
    assert np.count_nonzero(own) > 0.7 * np.pi * radius**2
    assert np.count_nonzero(hangs) == np.count_nonzero(own)


def test_several_are_told_apart() -> None:
    grown = hung(hung(hung(leaves(), 40, 4, 2), 80, 8, 5), 130, 6, 3)
    cells, _ = cut(grown)
    assert cells.count == 5
    assert len({int(cells.labels[row, 80 + 6 + radius]) for row, radius in ((40, 4), (80, 8), (130, 6))}) == 3


def test_lobes_and_jags_of_leaves_stay_with_them() -> None:
    grown = leaves()
    cv2.circle(grown, (80, 60), 12, 1, -1)
    cv2.fillPoly(grown, [np.array([[78, 110], [100, 118], [78, 126]])], 1)
    cv2.line(grown, (78, 150), (100, 150), 1, 2)
    cells, hangs = cut(grown)
    assert cells.count == 2
    assert not hangs.any()


def test_plants_as_large_as_the_crop_are_left_to_its_bodies() -> None:
    assert cut(hung(leaves(), 100, 9, 3))[0].count == 3
    assert cut(hung(leaves(), 100, 24, 3))[0].count == 2


@pytest.mark.parametrize("away", [0, 2, 4])
def test_hardly_anything_of_the_leaves_goes_with_it(away: int) -> None:
    cells, hangs = cut(hung(leaves(), 100, 9, 7, away))
    assert hangs.any()
    assert np.count_nonzero(cells.labels[:, :80] > 1) < 0.15 * np.pi * 9**2


def test_a_row_of_weeds_with_no_leaves_behind_hangs_on_none() -> None:
    grown = np.zeros((180, 200), np.uint8)
    for row in range(20, 160, 17):
        cv2.circle(grown, (100, row), 7, 1, -1)
        grown[row : row + 12, 99:101] = 1
    cells, hangs = cut(grown)
    assert cells.count > 2
    assert not hangs.any()


def test_far_off_and_at_the_rim_of_what_is_looked_at_nothing_is_cut() -> None:
    tall = np.concatenate([leaves(), leaves()])
    near, far, rim = (hung(tall.copy(), row, 7, 3) for row in (100, 280, 214))
    assert [cut(grown)[0].count for grown in (near, far, rim)] == [3, 2, 2]


def test_weeds_that_touch_no_leaves_are_left_alone() -> None:
    grown = np.zeros((180, 200), np.uint8)
    grown[100, 100:130] = 1
    cv2.circle(grown, (100, 100), 7, 1, -1)
    cv2.circle(grown, (130, 100), 7, 1, -1)
    assert cut(grown)[0].count == 2


def test_nothing_grows() -> None:
    cells, hangs = cut(np.zeros((180, 200), np.uint8))
    assert cells.count == 1
    assert len(hangs) == 0


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 179), st.integers(60, 199), st.integers(2, 20)), max_size=12))
def test_what_grows_is_neither_more_nor_less_afterwards(discs: list[tuple[int, int, int]]) -> None:
    grown = leaves()
    for row, column, radius in discs:
        cv2.circle(grown, (column, row), radius, 1, -1)
    before = PlantCells.of(grown, grown)
    cells, hangs = cut(grown)
    assert ((cells.labels > 0) == (grown > 0)).all()
    assert (cells.labels[cells.labels < before.count] == before.labels[cells.labels < before.count]).all()
    assert (cells.label[hangs] >= before.count).all()
    assert set(np.unique(cells.labels).tolist()) <= set(range(cells.count))


@pytest.mark.parametrize("closes", [True, False])
def test_blobs_say_what_hung_on_leaves_where_the_crop_closes(closes: bool) -> None:
    grown = hung(leaves(), 100, 7, 3)
    grown[:, 150:] = closes
    seen = np.ones(grown.shape, np.bool_)
    window = GroundWindow(grown, seen, np.zeros_like(seen), np.array([0.7, -0.6]), SIDE, 1.2)
    assert window.closes == closes
    camera = Camera(460.0, 460.0, 319.5, 239.5, 640, 480, height_m=1.4)
    blobs = PlantSegmenter().cut(window, camera, Lean(), RADIUS * SIDE, np.zeros((0, 2)), np.zeros((0, 2)))
    assert blobs.hanging.sum() == closes
    if closes:
        place = blobs.slopes[blobs.hanging][0] * window.fall
        assert place == pytest.approx(window.corner + SIDE * np.array([100, 93]), abs=0.02)


def test_a_weed_known_on_its_neck_hides_no_plant_of_the_crop_beside_it() -> None:
    radius, rows = 25, 30 + 40 * np.arange(5)
    grown = np.zeros((220, 300), np.uint8)
    for row in rows.tolist():
        cv2.circle(grown, (60, row), radius, 1, -1)
    grown[:, 130:] = 1  # the crop closes
    cv2.circle(grown, (93, 110), 5, 1, -1)
    grown[109:111, 83:93] = 1
    seen = np.ones(grown.shape, np.bool_)
    window = GroundWindow(grown, seen, np.zeros_like(seen), np.array([0.7, -0.9]), SIDE, 1.2)
    camera = Camera(460.0, 460.0, 319.5, 239.5, 640, 480, height_m=1.4)

    def nearest(known: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance of the blob nearest to each plant, cells."""
        blobs = PlantSegmenter().cut(window, camera, Lean(), radius * SIDE, known, known)
        places = (blobs.slopes * window.fall - window.corner) / SIDE
        plants = np.column_stack([rows, np.full(5, 60)])
        return np.asarray(np.linalg.norm(places[:, None] - plants[None], axis=2).min(axis=0))

    unknown, known = nearest(np.zeros((0, 2))), nearest(window.corner + SIDE * np.array([[110.0, 93.0]]))
    assert known == pytest.approx(unknown, abs=1.0)
