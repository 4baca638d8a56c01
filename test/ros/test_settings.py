# SPDX-License-Identifier: Apache-2.0
"""A setting accepts what its type and range allow, and refuses the rest in words that name it."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.parameter import Parameter

from robot_vision.ros.parameters import CAMERA_PLACE, ParameterError, Setting, camera_place, changed

SPEED = Setting("speed", 0.5, "m/s", 0.1, 2.0)
COUNT = Setting("count", 3, "lines", 1, 10)
METHOD = Setting("method", "trace", "how", choices=("trace", "hough"))
ON = Setting("on", True, "whether")
NAMES = Setting("names", [""], "of topics")
ALL = (SPEED, COUNT, METHOD, ON, NAMES)


@given(st.floats(allow_nan=True, allow_infinity=True))
def test_a_number_is_accepted_exactly_within_its_range(value: float) -> None:
    if 0.1 <= value <= 2.0:
        SPEED.check(value)
    else:
        with pytest.raises(ParameterError, match="speed must"):
            SPEED.check(value)


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        (SPEED, 1),
        (SPEED, "1.0"),
        (SPEED, True),
        (COUNT, 2.0),
        (COUNT, True),
        (COUNT, 11),
        (METHOD, "guess"),
        (METHOD, 1),
        (ON, 1),
        (ON, "true"),
        (NAMES, "image"),
        (NAMES, 3),
        (NAMES, None),
    ],
)
def test_a_wrong_type_or_choice_is_refused_by_name_and_value(setting: Setting, value: Any) -> None:
    with pytest.raises(ParameterError, match=rf"{setting.name} must .*{value}"):
        setting.check(value)


def test_every_default_is_acceptable_and_every_descriptor_tells_the_range() -> None:
    for setting in (*ALL, *CAMERA_PLACE):
        setting.check(setting.default)
        descriptor = setting.descriptor
        assert descriptor.description == setting.description
        ranges = [*descriptor.floating_point_range, *descriptor.integer_range]
        assert len(ranges) == (setting.low is not None)
        for limits in ranges:
            assert (limits.from_value, limits.to_value) == (setting.low, setting.high)
    assert "hough" in METHOD.descriptor.additional_constraints
    assert Setting("bag", "", "which", live=False).descriptor.read_only


def test_a_change_touches_only_what_it_names_and_ignores_what_is_not_ours() -> None:
    before = {setting.name: setting.default for setting in ALL}
    after = changed(ALL, before, [Parameter("speed", value=1.5), Parameter("use_sim_time", value=True)])
    assert after == {**before, "speed": 1.5}
    assert before["speed"] == 0.5
    with pytest.raises(ParameterError, match="count"):
        changed(ALL, before, [Parameter("speed", value=1.5), Parameter("count", value=0)])


def test_a_camera_height_of_zero_means_that_it_is_not_known() -> None:
    values = {setting.name: setting.default for setting in CAMERA_PLACE}
    assert camera_place(values)["height_m"] is None
    assert camera_place({**values, "camera.height": 1.2, "camera.pitch": 0.1}) == {
        "height_m": 1.2,
        "pitch": 0.1,
        "roll": 0.0,
        "x_m": 0.0,
    }
    assert math.isfinite(values["camera.x"])
