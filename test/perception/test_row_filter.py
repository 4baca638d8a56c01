# SPDX-License-Identifier: Apache-2.0
"""The filter follows a row through what odometry and pictures tell, honestly, and does not change to the next one."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from robot_vision.perception.crop_rows.row_extent import CELL_M, RowExtent, go_on_until, row_cover
from robot_vision.perception.crop_rows.row_filter import Motion, RowFilter

SIGMA = np.diag([0.012, 0.006, 0.001]) ** 2
SURE = np.zeros((3, 3))


def driven(seed: int, steps: int = 60, turned: float = 0.0) -> np.ndarray:
    """Errors and claimed deviations (N, 4) of offset and yaw of a drive whose pictures err alike for a metre."""
    random = np.random.default_rng(seed)
    filter_, root = RowFilter(), np.linalg.cholesky(SIGMA)
    offset, yaw, curvature, common = 0.05, 0.02, 0.01, root @ random.standard_normal(3)
    told = []
    for step in range(steps):
        speed, rate, seconds = 1.5, curvature * 1.5 - 0.5 * offset - yaw, 0.1
        filter_.predict(Motion(seconds if step else 0.0, speed, rate))
        if step:
            offset += speed * seconds * np.sin(yaw)
            yaw += (rate - curvature * speed) * seconds
            keep = np.exp(-speed * seconds / 1.2)
            common = keep * common + np.sqrt(1 - keep**2) * (root @ random.standard_normal(3))
        noise = np.sqrt(0.6) * common + np.sqrt(0.4) * (root @ random.standard_normal(3))
        filter_.update(np.array([offset, yaw + turned, curvature]) + noise, SIGMA)
        state, sigma = filter_.state, np.sqrt(np.diag(filter_.covariance))
        told.append([state[0] - offset, state[1] - yaw, sigma[0], sigma[1]])
    return np.array(told)


def test_errors_shrink_and_the_covariance_says_so() -> None:
    drives = np.array([driven(seed) for seed in range(30)])
    first, last = drives[:, :5], drives[:, -5:]
    assert np.sqrt(np.mean(last[..., 0] ** 2)) < 0.9 * np.sqrt(np.mean(first[..., 0] ** 2))
    assert np.sqrt(np.mean(last[..., 1] ** 2)) < 0.8 * np.sqrt(np.mean(first[..., 1] ** 2))
    normalised = np.mean(drives[:, 10:, :2] ** 2 / drives[:, 10:, 2:] ** 2, axis=(0, 1))
    assert (normalised > 0.3).all()
    assert (normalised < 1.6).all()


def test_a_turned_camera_is_told_by_where_the_robot_goes() -> None:
    turned = RowFilter(turned=0.05)
    offset, yaw = 0.0, 0.0
    for step in range(80):
        turned.predict(Motion(0.1 * bool(step), 1.5, 0.0))
        turned.update(np.array([offset, yaw + 0.035, 0.0]), SIGMA)
    assert turned.state[3] == pytest.approx(0.035, abs=0.01)
    assert turned.state[1] == pytest.approx(0.0, abs=0.01)


def test_the_next_row_is_not_believed_and_what_goes_on_is() -> None:
    filter_ = RowFilter()
    for step in range(10):
        filter_.predict(Motion(0.1 * bool(step), 1.5, 0.0))
        assert filter_.update(np.zeros(3), SIGMA)
    assert not filter_.update(np.array([0.25, 0.0, 0.0]), SIGMA)
    assert filter_.update(np.array([0.01, 0.0, 0.0]), SIGMA)


def test_what_is_doubted_counts_less_begins_nothing_and_passes_no_wider_gate() -> None:
    assert not RowFilter().update(np.zeros(3), SIGMA, 10.0)
    believing, doubting = RowFilter(), RowFilter()
    for filter_, doubt in ((believing, 1.0), (doubting, 10.0)):
        assert filter_.update(np.zeros(3), SIGMA)
        filter_.predict(Motion(0.1, 1.5, 0.0))
        assert filter_.update(np.array([0.01, 0.0, 0.0]), SIGMA, doubt)
        filter_.predict(Motion(0.1, 1.5, 0.0))
        assert not filter_.update(np.array([0.0, 0.1, 0.0]), SIGMA, doubt)
    assert abs(doubting.state[0]) < 0.5 * abs(believing.state[0])


def test_what_is_not_seen_grows_uncertain_faster_without_odometry() -> None:
    with_it, without = RowFilter(), RowFilter()
    for filter_, motion in ((with_it, Motion(0.1, 1.5, 0.0)), (without, Motion(0.1))):
        filter_.update(np.zeros(3), SIGMA)
        before = filter_.covariance[0, 0]
        for _ in range(10):
            filter_.predict(motion)
        assert filter_.covariance[0, 0] > before
    assert without.covariance[0, 0] > with_it.covariance[0, 0]


def test_standing_still_adds_no_knowledge_twice() -> None:
    filter_ = RowFilter()
    for _ in range(50):
        filter_.predict(Motion(0.1, 0.0, 0.0))
        filter_.update(np.zeros(3), SIGMA)
    assert filter_.covariance[0, 0] > 0.4 * filter_.shared * SIGMA[0, 0]


@pytest.mark.parametrize(
    ("name", "value"), [("shared", 1.0), ("view", 0.0), ("turned", -0.1), ("gate", np.nan)]
)
def test_settings_without_meaning_are_refused(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=name):
        RowFilter(**{name: value})


def gone_along(
    extent: RowExtent, stands: list[tuple[float, float]], until: float, seed: int = 0
) -> list[tuple[float, float]]:
    """Drive along rows that stand on some stretches; returns way and way of the end said with it."""
    random = np.random.default_rng(seed)
    said = []
    for way in np.arange(0.0, until, 0.15):
        ahead = np.arange(1.0, 9.0, CELL_M) + 0.5 * CELL_M
        places = way + ahead
        cover = random.normal(0.0, 0.01, len(ahead))
        for begin, end in stands:
            cover += 0.1 * ((places > begin) & (places < end)) * random.uniform(0.3, 1.7, len(ahead))
        extent.see(float(way), ahead, cover, np.ones_like(ahead))
        end = extent.end(float(way))
        if end is not None:
            said.append((float(way), way + end))
    return said


def test_the_end_of_the_rows_is_known_from_afar_and_a_gap_is_none() -> None:
    said = gone_along(RowExtent(gap=4.0), [(0.0, 6.0), (9.0, 20.0)], 20.0)
    assert said
    assert said[0][0] < 16.5
    assert np.abs(np.array(said)[:, 1] - 20.0).max() < 0.5


def test_a_gap_longer_than_allowed_is_the_end() -> None:
    said = gone_along(RowExtent(gap=2.0), [(0.0, 6.0), (9.0, 20.0)], 6.0)
    assert said
    assert said[0][1] == pytest.approx(6.0, abs=0.5)


def test_rows_without_an_end_in_sight_have_none() -> None:
    assert gone_along(RowExtent(), [(0.0, 100.0)], 40.0) == []
    assert RowExtent().end(0.0) is None


def test_weeds_between_rows_cancel_what_stands_in_rows() -> None:
    random = np.random.default_rng(1)
    x, area = random.uniform(1.0, 2.0, 4000), np.full(4000, 1e-3)
    _, anywhere, _ = row_cover(x, random.uniform(-1.25, 1.25, 4000), area, 0.5, 1.25, (1.0, 2.0), SURE)
    rows = 0.5 * random.integers(-2, 3, 4000) + random.normal(0.0, 0.02, 4000)
    _, in_rows, _ = row_cover(x, rows, area, 0.5, 1.25, (1.0, 2.0), SURE)
    assert np.abs(anywhere).max() < 0.15 * in_rows.min()


def rows_with_a_gap(bend: float) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Way ahead and to the side, and area, of bits in five rows from 1 to 4 m and from 7 to 10 m, known to be straight.

    Weeds stand everywhere, a tenth as many.
    """
    random = np.random.default_rng(2)
    x = np.concatenate([random.uniform(1.0, 4.0, 3000), random.uniform(7.0, 10.0, 3000)])
    aside = 0.5 * random.integers(-2, 3, 6000) + random.normal(0.0, 0.02, 6000) + 0.5 * bend * x**2
    x = np.concatenate([x, random.uniform(1.0, 10.0, 600)])
    aside = np.concatenate([aside, random.uniform(-1.25, 1.25, 600)])
    return x, aside, np.full(6600, 1e-3)


def test_rows_far_ahead_are_rows_though_they_lie_beside_where_they_should() -> None:
    bits = rows_with_a_gap(0.005)  # at 8 m 0.16 m aside: there the wave of straight rows has its trough
    ahead, sure, _ = row_cover(*bits, 0.5, 1.25, (1.0, 10.0), SURE)
    _, unsure, _ = row_cover(*bits, 0.5, 1.25, (1.0, 10.0), np.diag([1e-5, 1e-5, 1e-5]))
    near, gap, far = ahead < 3.5, (ahead > 4.5) & (ahead < 6.5), ahead > 7.5
    assert sure[far].max() < 0.3 * sure[near].min()
    assert unsure[far].min() > 0.6 * unsure[near].mean()
    assert np.abs(unsure[gap]).max() < 0.2 * unsure[near].mean()


def test_rows_go_on_until_open_ground_wherever_they_lie() -> None:
    within, half = (1.0, 10.0), 1.25
    assert go_on_until(*rows_with_a_gap(0.005), 0.5, half, within) == pytest.approx(4.0, abs=0.5)
    x, aside, area = rows_with_a_gap(0.0)
    with_a_gap_of_a_metre = np.where(x < 5.0, x, x - 2.0)
    assert go_on_until(with_a_gap_of_a_metre, aside, area, 0.5, half, (1.0, 8.0)) == 8.0
    assert go_on_until(x + 1.5, aside, area, 0.5, half, (1.0, 6.0)) == pytest.approx(
        5.5, abs=0.5
    )  # begins late
    assert go_on_until(x[:0], aside[:0], area[:0], 0.5, half, within) == within[1]


def test_an_end_is_not_told_by_one_picture() -> None:
    extent, ahead = RowExtent(gap=4.0), np.arange(1.0, 9.0, CELL_M) + 0.5 * CELL_M
    for _ in range(2):
        assert extent.end(0.0) is None
        extent.see(0.0, ahead, np.where(ahead < 4.0, 0.1, 0.0), np.ones_like(ahead))
    extent.see(0.0, ahead, np.where(ahead < 4.0, 0.1, 0.0), np.ones_like(ahead))
    assert extent.end(0.0) == pytest.approx(4.0, abs=0.5)


def test_settings_of_the_extent_are_checked() -> None:
    for name, value in (("gap", 0.1), ("sparse", 1.0)):
        with pytest.raises(ValueError, match=name):
            RowExtent(**{name: value})
