# SPDX-License-Identifier: Apache-2.0
"""Which chords lie on the borders or the middle of a road, how far off, and how that changes with what is believed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.perception.road.chords import Chords
from robot_vision.perception.road.curve import Alignment, Feet, RoadCurve
from robot_vision.perception.road.estimate import BENDS, OFFSET, PAINT, PITCH, ROLL, WIDTH, YAW

Array = NDArray[np.float64]

#: Borders and middle of a road, as shares of its width to the left of the middle.
_PLACES = np.array([0.5, 0.0, -0.5])
#: A chord farther than this from where a border is expected (in standard deviations) is none of it.
_GATE = 3.0
#: Share of the width to which it must be known where a chord would lie, or it is not said which border it is.
_UNSURE = 0.1
#: Length of a segment that speaks for a border with the accuracy given, px: shorter ones are often blades of grass.
_USUAL_LENGTH = 50.0
#: Distance at which a border strays twice as far from the curve, m.
_TWICE = 10.0
#: A chord of a border is as parallel to the road as this, rad, and its ends differ by this share of their variances.
_PARALLEL, _ENDS = 0.03, 0.05


@dataclass(frozen=True)
class Borders:
    """N chords beside a road, S numbers of its state.

    Attributes:
        misses: (N, 2) how far the ends lie to the left of the nearest of borders and middle, m.
        slopes: (N, 2, S) of that by the state.
        own: (N, 2) variance of the ends themselves, m^2.
        weight: (N,) how far each belongs to the road, 0 to 1.
        along: (N,) where on the road, m ahead.
    """

    misses: Array
    slopes: Array
    own: Array
    weight: Array
    along: Array


def beside(alignment: Alignment, state: Array, points: Array) -> tuple[Feet, Array, Array]:
    """Points of base_link as they lie beside the road.

    Args:
        alignment: knots of the road.
        state: (S,) what is believed.
        points: (N, 2), m.

    Returns:
        Their feet on the road's middle; (N, S) how `left` changes with offset, yaw and bends; the turn (2, 2) from
        base_link to the road.
    """
    cos, sin = np.cos(state[YAW]), np.sin(state[YAW])
    turn = np.array([[cos, -sin], [sin, cos]])
    turned = points @ turn.T
    feet = RoadCurve(alignment, state[BENDS:]).feet(turned + [0.0, state[OFFSET]])
    slopes = np.zeros((len(points), len(state)))
    slopes[:, OFFSET] = feet.normal[:, 1]
    slopes[:, YAW] = feet.normal[:, 1] * turned[:, 0] - feet.normal[:, 0] * turned[:, 1]
    slopes[:, BENDS:] = feet.bending
    return feet, slopes, turn


def match_borders(
    alignment: Alignment, state: Array, covariance: Array, chords: Chords, roughness: float
) -> Borders:
    """Hold the chords of a picture against a road.

    Args:
        alignment: knots of the road.
        state: (S,) what is believed.
        covariance: (S, S) of it.
        chords: of the picture, for the lean in `state`.
        roughness: standard deviation of a border about an even curve nearby, m.
    """
    feet, slopes, turn = beside(alignment, state, chords.points.reshape(-1, 2))
    left = feet.left.reshape(-1, 2)
    place = _PLACES[np.argmin(np.abs(left.mean(axis=1)[:, None] - _PLACES * state[WIDTH]), axis=1)]
    # A painted line has two edges; the brighter side tells which of them is seen.
    edge = np.where(chords.bright_left, -1.0, 1.0)
    misses = left - (place * state[WIDTH] + edge * state[PAINT])[:, None]
    slopes[:, WIDTH] = -np.repeat(place, 2)
    slopes[:, PAINT] = -np.repeat(edge, 2)
    leaning = chords.leaning.reshape(-1, 2, 2)
    slopes[:, ROLL : PITCH + 1] = np.einsum("ni,ij,njk->nk", feet.normal, turn, leaning)
    slopes = slopes.reshape(-1, 2, len(state))
    normals = (feet.normal @ turn).reshape(-1, 2, 2)
    placed = np.einsum("nei,nei->ne", normals, chords.placed)
    uneven = roughness * (1.0 + chords.points[..., 0] / _TWICE)
    own = (placed**2 + uneven**2) * (_USUAL_LENGTH / np.maximum(chords.lengths, 1.0))[:, None]
    expected = np.einsum("nei,ij,nej->ne", slopes, covariance, slopes)
    surprise = np.max(misses**2 / (own + expected), axis=1, initial=0.0)
    way = np.sum((chords.points[:, 1] - chords.points[:, 0]) ** 2, axis=1)
    slack = (_PARALLEL**2 + covariance[YAW, YAW]) * way + _ENDS * own.sum(axis=1)
    near = (surprise < _GATE**2) & ((misses[:, 1] - misses[:, 0]) ** 2 < _GATE**2 * slack)
    sure = np.max(expected, axis=1, initial=0.0) < (_UNSURE * state[WIDTH]) ** 2
    weight = np.where(near & sure, 1.0 / (1.0 + surprise / 2.0), 0.0)
    return Borders(misses, slopes, own, weight, feet.along.reshape(-1, 2).mean(axis=1))
