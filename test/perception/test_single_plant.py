# SPDX-License-Identifier: Apache-2.0
"""The quadratic of a single plant has the heading among its two roots, and plants together keep the right one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from drawn_fields import CAMERA, Sown, drawn, plants
from hypothesis import given
from hypothesis import strategies as st

from robot_vision.geometry import GroundPlane
from robot_vision.perception.crop_rows.ground_fit import Curvature, GroundFit, pieces_of
from robot_vision.perception.crop_rows.recipe import plants as centres_of
from robot_vision.perception.crop_rows.single_plant import (
    contradicting_heading,
    heading_of_plants,
    heading_roots,
)
from robot_vision.perception.vegetation import VegetationMask


@given(
    psi=st.floats(-0.15, 0.15),
    along=st.floats(1.0, 8.0),
    row_right=st.floats(-3.0, 3.0),
)
def test_one_root_is_the_heading(psi: float, along: float, row_right: float) -> None:
    right = math.cos(psi) * row_right + math.sin(psi) * along
    ahead = math.cos(psi) * along - math.sin(psi) * row_right
    roots = heading_roots(np.array([ahead]), np.array([right]), np.array([row_right]))
    # the roots are those of the quadratic for small psi: its remainder is of the third order
    assert np.nanmin(np.abs(roots - psi)) < 0.5 * abs(psi) ** 3 + 1e-9


def test_both_roots_solve_the_quadratic() -> None:
    ahead, right, row = np.array([2.0, 3.0]), np.array([0.7, -1.1]), np.array([0.5, -1.0])
    for psi in heading_roots(ahead, right, row).T:
        assert 0.5 * right * psi**2 + ahead * psi + row - right == pytest.approx(np.zeros(2), abs=1e-9)


def test_a_plant_no_heading_brings_into_its_row_has_no_root() -> None:
    assert np.isnan(heading_roots(np.array([0.1]), np.array([2.0]), np.array([8.0]))).all()
    straight = heading_roots(np.array([2.0]), np.array([0.0]), np.array([0.2]))
    assert straight[0, 0] == pytest.approx(-0.1)
    assert np.isnan(straight[0, 1])
    assert heading_of_plants(np.array([0.01]), np.array([-2.0]), np.ones(1), 9.0, 100.0) is None


@pytest.mark.parametrize("psi", [0.1, -0.06])
def test_plants_agree_on_the_right_root_and_reject_the_wrong_one(psi: float) -> None:
    places = plants(Sown(offset=0.1, yaw=psi, scatter=0.0), np.random.default_rng(0))
    seen = (places[:, 0] > 0.8) & (places[:, 0] < 5.0) & (np.abs(places[:, 1]) < 1.2)
    ahead, left = places[seen].T
    vote = heading_of_plants(ahead, left, np.ones(len(ahead)), 0.1, 0.5, guess=0.7 * psi)
    assert vote is not None
    assert vote.psi == pytest.approx(psi, abs=math.radians(0.3))
    assert vote.agreement > 0.9
    other = np.abs(vote.roots - vote.psi).max(axis=1)
    assert np.nanmin(other[np.isfinite(other)]) > 0.3


@pytest.mark.parametrize(("offset", "yaw"), [(0.05, 0.04), (-0.08, -0.05)])
def test_it_checks_the_fit_from_the_same_picture(offset: float, yaw: float) -> None:
    mask = VegetationMask().of(drawn(Sown(offset=offset, yaw=yaw), seed=2))
    start = np.array([offset, yaw, 0.0, 0.0, 0.0, 0.0])
    rows = GroundFit().fit(pieces_of(mask, CAMERA, 8), CAMERA, 0.5, start, Curvature(), (0.0, 0.03))
    assert rows is not None
    centres, areas = centres_of(mask)
    ground = GroundPlane(CAMERA).from_pixels(centres)
    near = (ground[:, 0] < 5.0) & (np.abs(ground[:, 1]) < 1.6)
    vote = heading_of_plants(
        ground[near, 0], ground[near, 1], areas[near], rows.values[0], 0.5, guess=rows.values[1]
    )
    assert vote is not None
    assert vote.psi == pytest.approx(rows.values[1], abs=math.radians(0.7))
    assert vote.psi == pytest.approx(yaw, abs=math.radians(0.7))
    assert vote.agreement > 0.6


@pytest.mark.parametrize("wrong", [0.13, -0.15])
def test_a_heading_that_is_wrong_is_contradicted_and_the_right_one_is_not(wrong: float) -> None:
    places = plants(Sown(offset=0.1, yaw=0.03, weeds=0.5), np.random.default_rng(1))
    seen = (places[:, 0] > 0.8) & (places[:, 0] < 5.0) & (np.abs(places[:, 1]) < 1.5)
    ahead, left = places[seen].T
    told = ahead, left, np.ones(len(ahead)), 0.1, 0.5
    assert contradicting_heading(*told, 0.03) is None
    other = contradicting_heading(*told, 0.03 + wrong)
    assert other == pytest.approx(0.03, abs=math.radians(0.5))
    few = ahead[:10], left[:10], np.ones(10), 0.1, 0.5
    assert contradicting_heading(*few, 0.03 + wrong) is None
