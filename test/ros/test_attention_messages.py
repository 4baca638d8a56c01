# SPDX-License-Identifier: Apache-2.0
"""Regions as messages, and how long one holds."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy", reason="there are no messages without rclpy")

from sensor_msgs.msg import RegionOfInterest

from robot_vision.perception.region import Region
from robot_vision.ros.attention import HeldRegion, region_from_message, region_to_message

REGION = Region(10, 20, 300, 200)
SECOND = 1_000_000_000


@pytest.mark.parametrize("region", [None, REGION, Region(0, 0, 1, 1)])
def test_there_and_back(region: Region | None) -> None:
    assert region_from_message(region_to_message(region)) == region


def held() -> HeldRegion:
    """One that has seen a picture and then heard a region."""
    region = HeldRegion()
    assert region.for_picture(10 * SECOND, 640, 480, 0.35) is None
    region.take(region_to_message(REGION))
    return region


def test_a_region_holds_for_its_age_from_the_picture_before_it() -> None:
    region = held()
    assert region.for_picture(10 * SECOND + SECOND // 10, 640, 480, 0.35) == REGION
    assert region.for_picture(10 * SECOND + SECOND // 3, 640, 480, 0.35) == REGION
    assert region.for_picture(10 * SECOND + SECOND // 2, 640, 480, 0.35) is None
    assert region.for_picture(10 * SECOND + SECOND // 2 + 1, 640, 480, 5.0) is None


def test_a_region_before_any_picture_after_a_gap_or_at_age_zero_is_not_obeyed() -> None:
    early = HeldRegion()
    early.take(region_to_message(REGION))
    assert early.for_picture(SECOND, 640, 480, 0.35) is None
    assert held().for_picture(12 * SECOND, 640, 480, 0.35) is None
    assert held().for_picture(10 * SECOND + 1, 640, 480, 0.0) is None


def test_pictures_of_another_size_and_a_time_that_goes_back_forget_it() -> None:
    region = held()
    assert region.for_picture(10 * SECOND + 1, 800, 600, 0.35) is None
    assert region.for_picture(10 * SECOND + 2, 800, 600, 0.35) is None
    assert held().for_picture(9 * SECOND, 640, 480, 0.35) is None
    region = held()
    region.forget()
    assert region.for_picture(10 * SECOND + 1, 640, 480, 0.35) is None


def test_a_region_outside_the_picture_is_named_once_and_forgotten() -> None:
    region = held()
    region.take(region_to_message(Region(600, 0, 100, 480)))
    with pytest.raises(ValueError, match="does not lie in a picture of 640 x 480"):
        region.for_picture(10 * SECOND + 1, 640, 480, 0.35)
    assert region.for_picture(10 * SECOND + 2, 640, 480, 0.35) is None


@pytest.mark.parametrize(("width", "height", "x"), [(0, 5, 0), (5, 0, 0), (0, 0, 7)])
def test_a_bad_message_takes_the_place_of_what_was_held(width: int, height: int, x: int) -> None:
    region = held()
    with pytest.raises(ValueError, match="whole picture is searched"):
        region.take(RegionOfInterest(x_offset=x, width=width, height=height))
    assert region.for_picture(10 * SECOND + 1, 640, 480, 0.35) is None
