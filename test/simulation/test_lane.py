# SPDX-License-Identifier: Apache-2.0
"""Lanes: what they say of a robot is what circles and straight lines say."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_vision.simulation import SimulationError
from robot_vision.simulation.lane import Lane, PolyLane, StraightLane

RADIUS = 10.0


@pytest.fixture(scope="module")
def quarter() -> PolyLane:
    """A quarter of a circle to the left, from the origin along x."""
    turned = np.linspace(0.0, np.pi / 2, 25)
    return PolyLane(RADIUS * np.column_stack([np.sin(turned), 1 - np.cos(turned)]), 2.0)


def on_circle(turned: float, left: float) -> tuple[float, float]:
    return (RADIUS - left) * np.sin(turned), RADIUS - (RADIUS - left) * np.cos(turned)


def test_a_curve_is_as_long_as_its_circle(quarter: PolyLane) -> None:
    assert quarter.length == pytest.approx(RADIUS * np.pi / 2, abs=1e-4)


@pytest.mark.parametrize("turned", [0.05, 0.4, 0.7, 1.1, 1.5])
@pytest.mark.parametrize("left", [-2.0, -0.3, 0.0, 0.8])
def test_a_place_beside_a_circle_is_found(quarter: PolyLane, turned: float, left: float) -> None:
    pose = quarter.locate(*on_circle(turned, left), turned + 0.2)
    assert pose.offset == pytest.approx(left, abs=1e-3)
    assert pose.yaw == pytest.approx(0.2, abs=1e-3)
    assert pose.along == pytest.approx(RADIUS * turned, abs=2e-3)
    assert pose.curvature == pytest.approx(1 / RADIUS, rel=0.02)
    assert pose.width == 2.0


@pytest.mark.parametrize("along", [-3.0, 0.0, 4.0, 15.0, 20.0])
def test_points_of_a_lane_are_where_it_locates_them(quarter: PolyLane, along: float) -> None:
    for lane in (quarter, StraightLane(15.7, 2.0, 3.0, -1.0, 0.7)):
        x, y, yaw, _ = lane.point(along)
        pose = lane.locate(x - 0.25 * np.sin(yaw), y + 0.25 * np.cos(yaw), yaw - 0.1)
        assert (pose.offset, pose.yaw) == pytest.approx((0.25, -0.1), abs=1e-3)
        assert pose.along == pytest.approx(along, abs=2e-3)


@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3, 3), st.floats(-20, 120), st.floats(-9, 9))
def test_a_straight_lane_may_lie_anywhere(x: float, y: float, yaw: float, along: float, left: float) -> None:
    lane: Lane = StraightLane(100.0, 3.0, x, y, yaw)
    place = lane.point(along)
    pose = lane.locate(place.x - left * np.sin(yaw), place.y + left * np.cos(yaw), yaw + 0.5)
    assert (pose.offset, pose.along, pose.yaw) == pytest.approx((left, along, 0.5), abs=1e-9)


def test_a_width_that_narrows_is_told_where_it_is() -> None:
    lane = PolyLane([(0, 0), (4, 0), (6, 0), (10, 0)], [2.0, 2.0, 1.0, 1.0])
    widths = [lane.locate(x, 0.0, 0.0).width for x in (1.0, 5.0, 9.0)]
    assert widths == pytest.approx([2.0, 1.5, 1.0], abs=1e-3)


@pytest.mark.parametrize(
    ("points", "width", "words"),
    [
        ([(0, 0)], 2.0, "N >= 2"),
        ([(0, 0), (np.nan, 1)], 2.0, "finite"),
        ([(0, 0), (1, 0), (1, 0)], 2.0, "points 1 and 2 coincide"),
        ([(0, 0), (1, 0)], 0.0, "must be positive"),
    ],
)
def test_a_lane_that_is_none_is_refused(points: list[tuple[float, float]], width: float, words: str) -> None:
    with pytest.raises(SimulationError, match=words):
        PolyLane(points, width)
