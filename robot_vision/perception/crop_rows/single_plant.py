# SPDX-License-Identifier: Apache-2.0
"""What one plant tells of the heading: a quadratic with two answers, of which the other plants keep one.

(20.11)-(20.15) with roll = pitch = 0: a plant at (X, Z) in the field, Z along the rows and X to their right, is seen
from a vehicle that stands at t_x to the right of its row and heads psi to the left of it:

    X' = cos(psi) (X - t_x) + sin(psi) Z,    Z' = cos(psi) Z - sin(psi) (X - t_x),    x = f X' / Z'.

Along the row the plant could stand anywhere; its image row tells how far ahead it is: Z' = H f / y (20.2). So
X' = x Z' / f is known as well, and the field gives X - t_x = cos(psi) X' - sin(psi) Z'. With small psi, cos(psi) =
1 - psi^2 / 2 and sin(psi) = psi, that is a quadratic in psi for each t_x:

    X' psi^2 / 2 + Z' psi + (X - t_x - X') = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Headings beyond this are not small, rad.
_MOST = 0.35
#: Headings asked beside one that is checked, rad; only where fewer of the plants bear that one out.
_ASKED = np.delete(np.linspace(-0.25, 0.25, 11), 5)
_BORNE_OUT = 0.75
#: Bits of plants that are asked, the largest ones; fewer than the least say nothing.
_MOST_BITS, _LEAST_BITS = 100, 25
#: By how much more plants must agree on another heading, and how far off it must be (rad), to contradict one. Of
#: drawn fields with as many weeds as plants and 2 degrees of lean, 2 of 86 good fits are contradicted and 54 of 94
#: bad ones.
_MORE, _OFF = 0.05, float(np.deg2rad(2.0))


@dataclass(frozen=True)
class HeadingVote:
    """What single plants say of the heading for a given place between the rows.

    Attributes:
        psi: heading to the left of the rows on which the plants agree best, rad.
        agreement: share of the plants, by weight, that have a root within `tolerance` of it.
        roots: (N, 2) both answers of each plant, rad; nan where there is none.
    """

    psi: float
    agreement: float
    roots: Array


def heading_roots(ahead: Array, right: Array, row_right: Array) -> Array:
    """Both answers psi (N, 2), rad, the smaller one first, to the quadratic of each plant; nan where there is none.

    Args:
        ahead: (N,) Z' of plants as the vehicle sees them, m.
        right: (N,) X' likewise, m.
        row_right: (N,) X - t_x: how far to the right of the vehicle the row of each plant runs, m.
    """
    a, b, c = 0.5 * right, ahead, row_right - right
    square = b * b - 4.0 * a * c
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        # In this form the small root does not suffer where a is near 0 and the other one far away
        q = -0.5 * (b + np.copysign(np.sqrt(square), b))
        roots = np.column_stack([c / q, q / a])
    return np.asarray(np.where(np.isfinite(roots), roots, np.nan))


def heading_of_plants(
    ahead: Array,
    left: Array,
    weight: Array,
    offset: float,
    spacing: float,
    guess: float = 0.0,
    tolerance: float = float(np.deg2rad(1.5)),
) -> HeadingVote | None:
    """The heading on which single plants agree, for a known offset; independent of any Hough transform.

    Every plant is taken to stand in the row that is nearest for the guess, its two roots vote, and the root with the
    most weight within the tolerance wins: the wrong root of each plant lies elsewhere for every other plant.

    Args:
        ahead: (N,) of plants ahead of the vehicle, m.
        left: (N,) of plants to the left of the vehicle, m.
        weight: (N,) of each, such as its area.
        offset: of the vehicle to the left of a row, m.
        spacing: between rows, m.
        guess: heading to the left of the rows that tells which row a plant stands in, rad.
        tolerance: within which roots agree, rad.

    Returns:
        None when no plant has a root that is small.
    """
    turned = offset + np.sin(guess) * ahead + np.cos(guess) * left
    row = spacing * np.round(turned / spacing)
    roots = heading_roots(ahead, -left, offset - row)
    usable = np.isfinite(roots) & (np.abs(roots) < _MOST)
    if not usable.any():
        return None
    candidates = roots[usable]
    weights = np.broadcast_to(weight[:, None], roots.shape)[usable]
    near = np.abs(candidates[:, None] - candidates[None, :]) < tolerance
    support = near @ weights
    winner = near[int(support.argmax())]
    psi = float(np.average(candidates[winner], weights=weights[winner]))
    return HeadingVote(psi, float(support.max() / weight.sum()), roots)


def contradicting_heading(
    ahead: Array, left: Array, weight: Array, offset: float, spacing: float, yaw: float
) -> float | None:
    """Another heading that single plants like better than one that is to be checked, rad; None if they like that one.

    Which row a plant stands in is not taken from the heading that is checked alone: a wrong one would find rows to
    bear it out. So other headings are asked as well.

    Args:
        ahead: (N,) of plants ahead of the vehicle, m; None is returned when there are too few of them to ask.
        left: (N,) of plants to the left of the vehicle, m.
        weight: (N,) of each, such as its area.
        offset: of the vehicle to the left of a row, m.
        spacing: between rows, m.
        yaw: heading to the left of the rows that is to be checked, rad.
    """
    if len(weight) < _LEAST_BITS:
        return None
    largest = np.argsort(-weight, kind="stable")[:_MOST_BITS]
    plants = ahead[largest], left[largest], weight[largest], offset, spacing
    own = heading_of_plants(*plants, yaw)
    agreement = own.agreement if own is not None and abs(own.psi - yaw) < _OFF else 0.0
    if agreement > _BORNE_OUT:
        return None
    asked = [heading_of_plants(*plants, float(guess)) for guess in yaw + _ASKED]
    others = [vote for vote in (own, *asked) if vote is not None and abs(vote.psi - yaw) > _OFF]
    best = max(others, key=lambda vote: vote.agreement, default=None)
    return best.psi if best is not None and best.agreement > agreement + _MORE else None
