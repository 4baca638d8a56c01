# SPDX-License-Identifier: Apache-2.0
"""Nozzles open for weeds, in time, never over the crop, never blindly."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_vision.mapping.plants import PlantKind, Plants
from robot_vision.planning.sprayer import Fate, SprayPlanner

CROP, WEED, UNSURE = PlantKind


def plants(*table: tuple[float, float, float, PlantKind]) -> Plants:
    """Plants by x, y and radius (m) and kind; numbered from 1."""
    count = len(table)
    places = np.array([(x, y) for x, y, _, _ in table]).reshape(-1, 2)
    return Plants(
        np.arange(1, count + 1, dtype=np.uint32),
        places,
        np.zeros(count),
        np.pi * np.array([radius for _, _, radius, _ in table]) ** 2,
        np.full(count, 5),
        np.zeros((count, 2, 2)),
        np.full(count, 0.5),
        np.array([kind for _, _, _, kind in table], np.uint8),
        places,
    )


def test_a_weed_between_the_rows_is_sprayed_when_it_is_under_its_nozzle() -> None:
    planner = SprayPlanner(lanes=10, width=0.1, boom_x=-0.4, latency=0.2)
    spray = planner.plan(plants((0.6, 0.25, 0.02, WEED), (0.6, 0.0, 0.05, CROP)), 2.0)
    assert spray.weeds.ids.tolist() == [1]
    assert spray.lanes.tolist() == [7]
    assert planner.middles[7] == pytest.approx(0.25)
    assert spray.times == pytest.approx([(0.6 + 0.4) / 2.0 - 0.2])
    assert spray.reason == ""


def test_a_weed_on_the_border_of_two_lanes_gets_both() -> None:
    spray = SprayPlanner(lanes=10, width=0.1).plan(plants((0.6, 0.2, 0.02, WEED)), 1.0)
    assert spray.lanes.tolist() == [6, 7]


@pytest.mark.parametrize("neighbour", [CROP, UNSURE])
def test_a_weed_whose_middle_is_too_near_the_crop_is_spared(neighbour: PlantKind) -> None:
    planner = SprayPlanner(lanes=10, width=0.1, safety=0.03, margin=0.01)
    for gap, sprayed in ((0.02, False), (0.04, True)):
        near = plants((0.6, 0.25, 0.02, WEED), (0.6 + 0.01 + gap + 0.05, 0.25, 0.05, neighbour))
        assert (len(planner.plan(near, 1.0)) == 1) == sprayed


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_jet_is_shortened_where_all_of_it_would_come_too_near_the_crop(side: float) -> None:
    planner = SprayPlanner(lanes=10, width=0.1, safety=0.03, margin=0.01, boom_x=0.0, latency=0.0)
    near = plants((0.6, 0.25, 0.02, WEED), (0.6 + side * (0.02 + 0.03 + 0.05), 0.25, 0.05, CROP))
    spray = planner.plan(near, 2.0)
    half = float(spray.weeds.radii[0]) + planner.margin
    middle = float(spray.times[0]) * 2.0
    # 30 mm on the open side, and 20 mm towards the crop, whose leaves begin 50 mm from the weed
    assert sorted((side * (middle - half - 0.6), side * (middle + half - 0.6))) == pytest.approx(
        [-0.03, 0.02]
    )
    assert near.areas[0] == pytest.approx(np.pi * 0.02**2)


def test_who_does_not_know_well_where_a_weed_is_opens_the_next_nozzle_too() -> None:
    planner = SprayPlanner(lanes=10, width=0.1)
    for sigma, lanes in ((0.0, [7]), (0.03, [6, 7])):
        weed = plants((0.6, 0.22, 0.01, WEED))
        weed.covariance[:] = sigma**2 * np.eye(2)
        assert planner.plan(weed, 1.0).lanes.tolist() == lanes


def test_who_does_not_know_well_where_the_crop_is_keeps_farther_off() -> None:
    planner = SprayPlanner(lanes=10, width=0.1, safety=0.03, margin=0.01)
    for sigma, count in ((0.0, 1), (0.06, 0)):
        near = plants((0.6, 0.25, 0.01, WEED), (0.6, 0.25 - 0.05 - 0.05 - 0.04, 0.05, CROP))
        near.covariance[1] = sigma**2 * np.eye(2)
        assert len(planner.plan(near, 1.0)) == count


@given(
    st.lists(
        st.tuples(
            st.floats(-0.3, 2.0),
            st.floats(-0.6, 0.6),
            st.floats(0.005, 0.2),
            st.sampled_from(list(PlantKind)),
        ),
        max_size=12,
    )
)
def test_no_jet_reaches_what_may_be_crop(table: list[tuple[float, float, float, PlantKind]]) -> None:
    planner = SprayPlanner(safety=0.02, margin=0.01)
    known = plants(*table)
    spray = planner.plan(known, 1.0)
    assert (spray.weeds.kinds == WEED).all()
    guarded = known.take(known.kinds != WEED)
    for place, radius, lane in zip(spray.weeds.places, spray.weeds.radii, spray.lanes, strict=True):
        low = place[0] - radius - 0.01, planner.middles[lane] - 0.5 * planner.width
        high = place[0] + radius + 0.01, planner.middles[lane] + 0.5 * planner.width
        nearest = np.clip(guarded.places, low, high)
        away = np.linalg.norm(guarded.places - nearest, axis=1) - guarded.radii
        assert (away > 0.02 - 1e-9).all()


@pytest.mark.parametrize(
    ("speed", "blind", "words"),
    [(None, "", "odometry"), (0.0, "", "still"), (-0.5, "", "still"), (1.0, "no row is known", "no row")],
)
def test_nothing_is_sprayed_blindly(speed: float | None, blind: str, words: str) -> None:
    spray = SprayPlanner().plan(plants((0.5, 0.2, 0.02, WEED)), speed, blind)
    assert len(spray) == 0
    assert words in spray.reason


def test_a_weed_that_the_jet_can_no_longer_reach_is_not_sprayed() -> None:
    planner = SprayPlanner(boom_x=-0.3, latency=0.1)
    assert len(planner.plan(plants((-0.25, 0.02, 0.02, WEED)), 1.0)) == 0
    assert len(planner.plan(plants((-0.18, 0.02, 0.02, WEED)), 1.0)) == 1


def test_what_became_of_the_plants_is_counted_once() -> None:
    planner = SprayPlanner(boom_x=-0.3, latency=0.0)
    table = (
        (0.0, 0.2, 0.02, WEED),
        (0.0, -0.2, 0.05, CROP),
        (0.06, -0.2, 0.02, WEED),
        (0.0, 0.4, 0.02, UNSURE),
    )
    for back in (0.0, 0.2, 0.4, 0.6):
        planner.plan(plants(*((x - back, y, radius, kind) for x, y, radius, kind in table)), 2.0)
    assert planner.counts.tolist() == [1, 1, 1, 1]
    assert planner.counts[Fate.SPARED] == 1


@pytest.mark.parametrize("wrong", [{"lanes": 0}, {"width": 0.0}, {"latency": -1.0}, {"safety": math.nan}])
def test_settings_without_meaning_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        SprayPlanner(**wrong)  # type: ignore[arg-type]


def test_jets_keep_off_leaves_that_were_seen_but_for_those_of_the_weed() -> None:
    planner = SprayPlanner(lanes=10, width=0.1, safety=0.02, margin=0.01)
    weed = plants((0.6, 0.25, 0.02, WEED))
    own = np.array([[0.6, 0.25], [0.61, 0.26]])
    for gap, sprayed in ((0.01, False), (0.08, True)):
        leaves = np.append(own, [[0.6, 0.3 + gap]], axis=0)
        assert (len(planner.plan(weed, 1.0, leaves=leaves)) == 1) == sprayed
    whole, part = (
        planner.plan(weed, 1.0, leaves=seen).weeds for seen in (own, np.append(own, [[0.65, 0.25]], axis=0))
    )
    assert whole.radii == pytest.approx([0.02])
    assert part.radii[0] < 0.02
    assert part.places[0, 0] < 0.6


def test_where_leaves_were_looked_at_less_is_kept_from_a_plant_of_unsure_place() -> None:
    planner = SprayPlanner(lanes=10, width=0.1, safety=0.03, margin=0.01)
    near = plants((0.6, 0.25, 0.01, WEED), (0.6, 0.25 - 0.05 - 0.05 - 0.04, 0.05, CROP))
    near.covariance[1] = 0.06**2 * np.eye(2)
    for leaves, count in ((None, 0), ([1.6, 0.4], 0), ([0.6, 0.11], 1), ([0.6, 0.19], 0)):
        seen = None if leaves is None else np.array([leaves])
        assert len(planner.plan(near, 1.0, leaves=seen)) == count
