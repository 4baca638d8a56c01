# SPDX-License-Identifier: Apache-2.0
"""Pictures that a filter refuses get the word when they agree for long, and only about the filter's own row."""

from __future__ import annotations

import numpy as np
import pytest

from robot_vision.perception.crop_rows.row_dispute import RowDispute
from robot_vision.perception.crop_rows.row_filter import Motion, RowFilter

SIGMA = np.diag([0.012, 0.006, 0.001]) ** 2
SPACING = 0.5
#: So sure of itself and so wrong is a filter that began with a picture whose far rows were taken for their neighbours.
WRONG = np.array([-0.05, 0.04, -0.02])


def taken_over_after(true: np.ndarray, speed: float, pictures: int, held_every: int = 0) -> float | None:
    """Way, m, after which a filter that began wrong gives way to pictures of the true rows; None: it does not.

    In one of so many pictures, `held_every`, the search that begins where the filter is finds rows there.
    """
    random, step = np.random.default_rng(0), Motion(0.1, speed, 0.0)
    row_filter, dispute = RowFilter(), RowDispute()
    row_filter.update(WRONG, SIGMA)
    for number in range(pictures):
        row_filter.predict(step)
        dispute.predict(step)
        measured = true + random.multivariate_normal(np.zeros(3), 0.2 * SIGMA)
        if row_filter.update(measured, SIGMA):
            dispute.settle()
            continue
        held = held_every and number % held_every == 0
        if held:
            assert row_filter.update(row_filter.expected(), SIGMA)
            dispute.trust()
        better = dispute.hear(row_filter, measured, SIGMA, 1.0, SPACING, bool(held))
        if better is not None:
            assert better.expected()[:2] == pytest.approx(true[:2], abs=0.02)
            return (number + 1) * 0.1 * speed
    return None


def test_a_filter_that_began_wrong_gives_way_to_pictures_that_agree() -> None:
    way = taken_over_after(np.array([0.03, 0.0, 0.02]), speed=1.6, pictures=40)
    assert way is not None
    assert way < 2.5


def test_a_filter_that_at_times_finds_what_it_looks_for_gives_way_too() -> None:
    true = np.array([0.03, 0.0, 0.02])
    assert taken_over_after(true, speed=1.6, pictures=40, held_every=3) is not None
    assert taken_over_after(true, speed=1.6, pictures=40, held_every=1) is None


@pytest.mark.parametrize(("speed", "least"), [(1.6, 1.5), (0.0, 1.0)])
def test_a_filter_has_credit_for_the_pictures_it_has_believed_on_its_way(speed: float, least: float) -> None:
    row_filter, dispute, before, step = (
        RowFilter(),
        RowDispute(),
        Motion(0.1, speed, 0.0),
        Motion(0.1, 1.6, 0.0),
    )
    row_filter.update(WRONG, SIGMA)
    for _ in range(20):
        dispute.predict(before)
        dispute.trust()
    ways = [0.0]
    for number in range(30):
        row_filter.predict(step)
        dispute.predict(step)
        measured = np.array([0.03, 0.0, 0.02])
        if dispute.hear(row_filter, measured, SIGMA, 1.0, SPACING, False) is not None:
            ways.append(0.16 * number)
            break
    assert least < ways[-1] < least + 2.0


def test_a_dispute_is_over_once_the_picture_by_itself_agrees_with_the_filter() -> None:
    row_filter, dispute, step = RowFilter(), RowDispute(), Motion(0.1, 1.6, 0.0)
    row_filter.update(WRONG, SIGMA)
    for measured, believed in ((WRONG + [0.1, 0.1, 0.0], False), (WRONG, True)):
        row_filter.predict(step)
        dispute.predict(step)
        dispute.hear(row_filter, measured, SIGMA, 1.0, SPACING, believed)
        assert dispute.goes_on != believed


@pytest.mark.parametrize("motion", [Motion(0.1, 16.0, 0.0), Motion(0.1, -16.0, 0.0), Motion(0.1)])
def test_a_stretch_that_no_picture_shows_and_a_way_that_nobody_knows_end_a_dispute(motion: Motion) -> None:
    row_filter, dispute = RowFilter(), RowDispute()
    row_filter.update(WRONG, SIGMA)
    dispute.hear(row_filter, WRONG + [0.1, 0.1, 0.0], SIGMA, 1.0, SPACING, False)
    assert dispute.goes_on
    dispute.predict(motion)
    assert not dispute.goes_on


def test_backwards_it_is_decided_as_forwards() -> None:
    true = np.array([-0.2, 0.0, 0.02])
    assert taken_over_after(true, speed=-1.6, pictures=40) is not None


def test_who_is_believed_where_the_refused_do_not_go_on_has_settled_the_dispute() -> None:
    row_filter, dispute, step = RowFilter(), RowDispute(), Motion(0.1, 1.6, 0.0)
    row_filter.update(WRONG, SIGMA)
    assert not dispute.goes_on
    for measured, believed, goes_on in (([0.08, 0.1, 0.0], False, True), (WRONG, True, False)):
        row_filter.predict(step)
        dispute.predict(step)
        heard = dispute.hear(row_filter, np.array(measured), SIGMA, 1.0, SPACING, believed)
        assert heard is None
        assert dispute.goes_on == goes_on


def test_the_next_row_never_takes_over() -> None:
    assert taken_over_after(np.array([-0.25, 0.0, 0.02]), speed=1.6, pictures=40) is None


def test_the_same_plants_seen_again_and_again_prove_nothing() -> None:
    assert taken_over_after(np.array([0.03, 0.0, 0.02]), speed=0.0, pictures=60) is None


def test_pictures_that_contradict_each_other_prove_nothing() -> None:
    row_filter, dispute, step = RowFilter(), RowDispute(), Motion(0.1, 1.6, 0.0)
    row_filter.update(WRONG, SIGMA)
    for number in range(40):
        row_filter.predict(step)
        dispute.predict(step)
        measured = np.array([0.08, 0.1 if number % 2 else -0.1, 0.0])
        assert not row_filter.update(measured, SIGMA)
        assert dispute.hear(row_filter, measured, SIGMA, 1.0, SPACING, False) is None


def test_two_pictures_with_a_gap_between_prove_nothing() -> None:
    row_filter, dispute = RowFilter(), RowDispute()
    row_filter.update(WRONG, SIGMA)
    measured = np.array([0.06, 0.0, 0.02])
    for seconds in (0.1, 1.5):
        step = Motion(seconds, 1.6, 0.0)
        row_filter.predict(step)
        dispute.predict(step)
        assert dispute.hear(row_filter, measured, SIGMA, 1.0, SPACING, False) is None


@pytest.mark.parametrize("name", ["agreed", "pictures", "aside"])
def test_settings_without_meaning_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match=name):
        RowDispute(**{name: 0})
