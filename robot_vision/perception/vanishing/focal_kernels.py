# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs, allow-untyped-calls
"""The loop of the search for a focal length that is run for every frame tried, compiled.

Arrays of a bundle come one by one, as in `kernels`. numba is slow to import: import this module only where lines are
about to be used.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from robot_vision.perception.vanishing.kernels import FAST, assign, solve3, turn_about

_LARGEST_TURN = 0.1
_LARGEST_STRETCH = 0.15
_CONVERGED = 3e-5
_WIDE_ROUNDS = 2


@njit(**FAST)
def at_ratio(lines, middles, halves, ratio, new_lines, new_middles, new_halves):
    """As `Bundle.at_focal_ratio` has it, into arrays given."""
    for i in range(len(lines)):
        new_lines[i, 0], new_lines[i, 1] = lines[i, 0], lines[i, 1]
        new_lines[i, 2] = lines[i, 2] / ratio
        new_middles[i, 0], new_middles[i, 1] = middles[i, 0] / ratio, middles[i, 1] / ratio
        new_halves[i] = halves[i] / ratio


@njit(**FAST)
def _gather(lines, sigma, weight, frame, nearest, residual, levers, h, pull, mixed):
    """Normal equations: of the rotation into `h` and `pull`, mixed terms into `mixed`, of the stretch returned."""
    j = np.empty(3)
    own = own_pull = 0.0
    for i in range(len(lines)):
        k = nearest[i]
        if k < 0:
            continue
        scale = 1.0 / (levers[i] * sigma[i])
        j[0] = scale * (frame[k, 1] * lines[i, 2] - frame[k, 2] * lines[i, 1])
        j[1] = scale * (frame[k, 2] * lines[i, 0] - frame[k, 0] * lines[i, 2])
        j[2] = scale * (frame[k, 0] * lines[i, 1] - frame[k, 1] * lines[i, 0])
        stretch = -scale * lines[i, 2] * frame[k, 2]
        for a in range(3):
            pull[a] += weight[i] * j[a] * residual[i]
            mixed[a] += weight[i] * j[a] * stretch
            for b in range(3):
                h[a, b] += weight[i] * j[a] * j[b]
        own += weight[i] * stretch * stretch
        own_pull += weight[i] * stretch * residual[i]
    for a in range(3):
        h[a, a] += 1e-6
    return own, own_pull


@njit(**FAST)
def turn_frame_and_stretch(lines, middles, halves, sigma, weight, frame, ratio, stiffness, tolerance, rounds):
    """Gauss-Newton on the rotation of an orthogonal frame (3, 3), in place, and on the logarithm of the focal length.

    Turning by a small vector w moves a direction v by w x v, and l . (w x v) = w . (v x l); of the line
    (a, b, c / ratio) only the last part moves with the focal length.

    `ratio` is that of the focal length to the one assumed, to begin with; `stiffness` of the spring that holds its
    logarithm to 0.

    Returns the ratio found, the information on its logarithm with the rotation left free, the support of all lines.
    """
    n = len(lines)
    scaled, centres, reaches = np.empty((n, 3)), np.empty((n, 2)), np.empty(n)
    nearest = np.empty(n, np.int64)
    support, residual, levers = np.empty(n), np.empty(n), np.empty(n)
    h, pull, mixed = np.empty((3, 3)), np.empty(3), np.empty(3)
    by_pull, by_mixed, j = np.empty(3), np.empty(3), np.empty(3)
    information = stiffness
    arrived = False
    for step in range(rounds + 1):
        at_ratio(lines, middles, halves, ratio, scaled, centres, reaches)
        wide = tolerance * (2.0 if step < _WIDE_ROUNDS else 1.0)
        assign(scaled, centres, reaches, sigma, frame, wide, nearest, support, residual, levers)
        h[:], pull[:], mixed[:] = 0.0, 0.0, 0.0
        own, own_pull = _gather(
            scaled, sigma, weight * support, frame, nearest, residual, levers, h, pull, mixed
        )
        own += stiffness
        own_pull += stiffness * math.log(ratio)
        # Block elimination of the rotation: what it cannot explain tells of the focal length.
        solve3(h, pull, by_pull)
        solve3(h, mixed, by_mixed)
        information = max(own - (mixed * by_mixed).sum(), stiffness)
        if arrived or step == rounds:
            break
        stretch = -(own_pull - (mixed * by_pull).sum()) / information
        stretch = min(max(stretch, -_LARGEST_STRETCH), _LARGEST_STRETCH)
        for a in range(3):
            j[a] = -by_pull[a] - stretch * by_mixed[a]
        angle = math.sqrt(j[0] ** 2 + j[1] ** 2 + j[2] ** 2)
        if angle > 1e-12:
            turn_about(frame, j[0] / angle, j[1] / angle, j[2] / angle, min(angle, _LARGEST_TURN))
        ratio *= math.exp(stretch)
        arrived = step > _WIDE_ROUNDS and angle < _CONVERGED and abs(stretch) < _CONVERGED
    return ratio, information, (weight * support).sum()
