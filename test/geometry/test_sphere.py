# SPDX-License-Identifier: Apache-2.0
"""The sphere of directions has no favourite places, no bad corner and no sign."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_cameras import numbers

from robot_vision.geometry.sphere import (
    EqualAreaCells,
    angle_between,
    front_half,
    local_coordinates,
    normalised,
    retract,
    tangent_basis,
)

AXES = [np.array(axis, float) * sign for axis in np.eye(3) for sign in (1, -1)]
units = st.one_of(
    st.tuples(*[numbers(-1, 1)] * 3)
    .map(np.array)
    .filter(lambda v: np.linalg.norm(v) > 0.05)
    .map(lambda v: v / np.linalg.norm(v)),
    st.sampled_from(AXES),
)
cell_sizes = st.sampled_from([math.radians(degrees) for degrees in (1.0, 2.0, 3.0, 5.0, 7.3, 15.0, 45.0)])


def uniform_directions(count: int, seed: int) -> np.ndarray:
    return normalised(np.random.default_rng(seed).normal(size=(count, 3)))


@given(units)
def test_tangents_are_orthonormal_and_right_handed(direction):
    first, second = tangent_basis(direction)
    axes = np.array([first, second, direction])
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_first_tangent_is_level_in_the_picture_away_from_the_vertical():
    directions = uniform_directions(500, 1)
    directions = directions[np.abs(directions[:, 1]) < 0.9]
    assert np.abs(tangent_basis(directions)[:, 0, 1]).max() < 1e-12


def test_tangents_of_many_are_the_tangents_of_each():
    directions = uniform_directions(50, 2).reshape(5, 10, 3)
    together = tangent_basis(directions)
    assert together.shape == (5, 10, 2, 3)
    np.testing.assert_allclose(together[3, 4], tangent_basis(directions[3, 4]), atol=1e-15)


@given(units, numbers(0.0, 1.57), numbers(-math.pi, math.pi))
def test_walking_off_and_reading_the_offset_are_inverse(direction, angle, towards):
    offset = angle * np.array([math.cos(towards), math.sin(towards)])
    there = retract(direction, offset)
    assert np.linalg.norm(there) == pytest.approx(1.0, abs=1e-12)
    assert angle_between(direction, there) == pytest.approx(angle, abs=1e-9)
    np.testing.assert_allclose(local_coordinates(direction, there), offset, atol=1e-9)
    np.testing.assert_allclose(local_coordinates(direction, -there), offset, atol=1e-9)


@given(units, units)
def test_reading_the_offset_and_walking_it_leads_there(direction, other):
    there = retract(direction, local_coordinates(direction, other))
    assert angle_between(there, other) < 1e-9


@given(units)
def test_no_offset_leads_nowhere(direction):
    np.testing.assert_array_equal(retract(direction, np.zeros(2)), direction)
    np.testing.assert_allclose(local_coordinates(direction, direction), np.zeros(2), atol=1e-15)


@given(units, st.integers(0, 15), numbers(-math.pi, math.pi))
def test_angles_are_exact_however_small(direction, decimals, towards):
    angle = 10.0**-decimals
    first, second = tangent_basis(direction)
    other = math.cos(angle) * direction + math.sin(angle) * (
        math.cos(towards) * first + math.sin(towards) * second
    )
    # The other direction itself is only known to the last bit of its components.
    assert float(angle_between(direction, other)) == pytest.approx(angle, rel=1e-9, abs=4e-16)
    assert float(angle_between(direction, -other)) == pytest.approx(angle, rel=1e-9, abs=4e-16)


def test_angles_end_at_a_right_angle():
    first, second = uniform_directions(2000, 3).reshape(2, 1000, 3)
    angles = angle_between(first, second)
    assert angles.shape == (1000,)
    assert angles.min() >= 0.0 and angles.max() <= math.pi / 2
    np.testing.assert_allclose(angles, np.arccos(np.abs(np.sum(first * second, axis=1))), atol=1e-7)


def test_zero_vectors_stay_zero():
    np.testing.assert_array_equal(normalised(np.zeros((2, 3))), np.zeros((2, 3)))


def test_front_half_turns_only_what_looks_back():
    directions = uniform_directions(200, 4)
    turned = front_half(directions)
    assert turned[:, 2].min() >= 0.0
    assert np.abs(np.abs(np.sum(turned * directions, axis=1)) - 1.0).max() < 1e-12
    np.testing.assert_array_equal(turned[directions[:, 2] >= 0.0], directions[directions[:, 2] >= 0.0])


@pytest.mark.parametrize("degrees", [3.0, 5.0, 10.0])
def test_cells_are_of_equal_area(degrees):
    cells = EqualAreaCells(math.radians(degrees))
    fallen = np.bincount(
        cells.index(front_half(uniform_directions(400 * len(cells), 5))), minlength=len(cells)
    )
    assert len(fallen) == len(cells)
    # 400 a cell, give or take 20 by chance. A band has a whole number of parts, which costs a little more,
    # and most at the poles, where one part is the least.
    spread = np.sort(np.abs(fallen / 400.0 - 1.0))
    assert spread[:-2].max() < 0.25
    assert spread.max() < 0.4
    assert np.sqrt(np.mean(spread**2)) < 0.07
    area = 2 * math.pi / len(cells)
    assert area == pytest.approx(math.radians(degrees) ** 2, rel=0.05)


@given(cell_sizes, st.lists(units, min_size=1, max_size=20))
def test_every_direction_has_a_cell(size, directions):
    cells = EqualAreaCells(size)
    index = cells.index(front_half(np.array(directions)))
    assert index.min() >= 0 and index.max() < len(cells)


@given(cell_sizes, numbers(-math.pi, math.pi))
def test_directions_on_the_rim_have_a_cell(size, angle):
    cells = EqualAreaCells(size)
    rim = np.array(
        [
            [math.cos(angle), math.sin(angle), 0.0],
            [math.cos(angle), math.sin(angle), -0.0],
            [0.0, 1.0, 0.0],
            [0.0, -1.0, -0.0],
            [0.0, 1.0 + 2e-16, 0.0],
        ]
    )
    index = cells.index(rim)
    assert index.min() >= 0 and index.max() < len(cells)


@given(cell_sizes, units, units)
def test_directions_of_one_cell_are_near_each_other(size, first, second):
    cells = EqualAreaCells(size)
    pair = front_half(np.array([first, second]))
    one, other = cells.index(pair)
    if one == other:
        # Across a cell of equal sides s: its diagonal, and more where few parts make a band at the poles.
        assert float(np.arccos(np.clip(pair[0] @ pair[1], -1, 1))) < 3.3 * size


@pytest.mark.parametrize("size", [0.0, -0.1, math.pi / 3, math.nan, math.inf])
def test_cells_without_a_sensible_size_are_refused(size):
    with pytest.raises(ValueError, match="cell size"):
        EqualAreaCells(size)
