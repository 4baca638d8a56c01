# SPDX-License-Identifier: Apache-2.0
"""Rows end where their last stems stand, give or take half of what leaves reach beyond them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from robot_vision.perception.crop_rows.row_extent import CELL_M, RowExtent

AHEAD = CELL_M * (np.arange(1, 37) + 0.5)


def leaves(end: float, reach: float, dense: float = 0.2) -> NDArray[np.float64]:
    """Cover of the stretches AHEAD by a crop of evenly spread stems up to `end`, whose leaves reach so far, m."""
    fine = (np.arange(len(AHEAD) * 50) + 0.5) * CELL_M / 50 + AHEAD[0] - 0.5 * CELL_M
    cover = dense * np.clip((end + reach - fine) / (2.0 * reach), 0.0, 1.0)
    return np.asarray(cover.reshape(len(AHEAD), 50).mean(axis=1))


def seen(cover: NDArray[np.float64]) -> RowExtent:
    extent = RowExtent()
    for _ in range(3):  # pictures, as one alone tells no end
        extent.see(0.0, AHEAD, cover, np.ones(len(AHEAD)))
    return extent


@pytest.mark.parametrize("end", [3.5, 3.6, 3.7])
@pytest.mark.parametrize("reach", [0.05, 0.2, 0.35])
def test_leaves_shift_the_end_by_no_more_than_half_of_their_reach(end: float, reach: float) -> None:
    assert seen(leaves(end, reach)).end(0.0) == pytest.approx(end, abs=0.17)


def test_small_plants_at_the_end_of_rows_are_still_rows() -> None:
    cover = leaves(4.0, 0.05)
    cover[AHEAD > 3.0] *= 0.25
    assert seen(cover).end(0.0) == pytest.approx(4.0, abs=0.5)


def test_last_plants_that_are_faint_from_afar_are_told_from_nearby() -> None:
    extent = RowExtent()
    for way in 0.15 * np.arange(48):
        there = AHEAD + way
        faint = (there > 7.5) & (AHEAD > 2.0)
        extent.see(way, AHEAD, np.where(there < 8.5, np.where(faint, 0.06, 0.2), 0.0), np.ones(len(AHEAD)))
    told = extent.end(way)
    assert told is not None
    assert way + told == pytest.approx(8.5, abs=0.26)


def test_a_last_metre_that_grows_denser_is_not_longer_than_its_leaves_reach() -> None:
    cover = leaves(3.5, 0.05)
    cover[(AHEAD > 2.5) & (AHEAD < 3.5)] *= 3.0
    assert seen(cover).end(0.0) == pytest.approx(3.5, abs=0.3)


def test_leaves_that_close_end_beyond_the_stems_by_their_reach() -> None:
    closed = seen(np.where(AHEAD < 3.75, 0.2, 0.0))
    assert closed.end(0.0) == pytest.approx(3.75, abs=0.01)
    assert closed.end(0.0, reach=0.25) == pytest.approx(3.5, abs=0.01)


def test_a_gap_of_three_metres_is_no_end() -> None:
    cover = np.where((AHEAD > 3.0) & (AHEAD < 6.0), 0.0, 0.2)
    assert seen(cover).end(0.0) is None
    cover[AHEAD > 3.0] = 0.0
    assert seen(cover).end(0.0) == pytest.approx(3.0, abs=0.01)


def test_a_gap_between_thin_rows_and_dense_ones_is_no_end() -> None:
    cover = np.where(AHEAD < 3.0, 0.09, np.where(AHEAD < 6.0, 0.0, 0.3))
    assert seen(cover).end(4.5) is None
