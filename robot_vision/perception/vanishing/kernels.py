# SPDX-License-Identifier: Apache-2.0
# mypy: allow-untyped-defs, allow-untyped-calls
"""The loops over all lines that a picture pays for many times, compiled: a quarter of what numpy takes for them.

Arrays of a bundle come one by one: `lines` (N, 3), `middles` (N, 2), `halves`, `sigma`, `weight` (N,), as
`Bundle` describes them. numba is slow to import: import this module only where lines are about to be used.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from robot_vision.perception.vanishing.bundle import WITHIN

#: Division by zero gives inf, as in numpy.
FAST = {"cache": True, "error_model": "numpy"}
_LARGEST_TURN = 0.1
_CONVERGED = 3e-5
#: The first rounds look twice as far for lines, so that a frame off by a cell's width finds them.
_WIDE_ROUNDS = 2


@njit(**FAST)
def reach(lines, middles, halves, i, x, y, z):
    """Lever of line i for the direction (x, y, z), infinitely short where the line contains it; see `Bundle.reach`."""
    across, down = x - z * middles[i, 0], y - z * middles[i, 1]
    lever = math.sqrt(across * across + down * down)
    return lever if lever > WITHIN * abs(z) * halves[i] else 0.0


@njit(**FAST)
def assign(lines, middles, halves, sigma, directions, tolerance, nearest, support, residual, levers):
    """For each line the direction it fits best (-1: none), its support, residual (sd) and lever for it."""
    for i in range(len(lines)):
        best = tolerance
        nearest[i] = -1
        support[i] = 0.0
        for k in range(len(directions)):
            x, y, z = directions[k, 0], directions[k, 1], directions[k, 2]
            lever = reach(lines, middles, halves, i, x, y, z)
            if lever == 0.0:
                continue
            r = (lines[i, 0] * x + lines[i, 1] * y + lines[i, 2] * z) / (lever * sigma[i])
            if abs(r) < best:
                best = abs(r)
                nearest[i] = k
                residual[i] = r
                levers[i] = lever
        if nearest[i] >= 0:
            support[i] = 1.0 - (best / tolerance) ** 2


@njit(**FAST)
def turn_frame(lines, middles, halves, sigma, weight, frame, tolerance, rounds):
    """Gauss-Newton on the rotation of an orthogonal frame (3, 3), rows turned in place; returns its support.

    Turning by a small vector w moves a direction v by w x v, and l . (w x v) = w . (v x l).
    """
    n = len(lines)
    nearest = np.empty(n, np.int64)
    support, residual, levers = np.empty(n), np.empty(n), np.empty(n)
    h = np.empty((3, 3))
    g = np.empty(3)
    j = np.empty(3)
    for turn in range(rounds):
        wide = tolerance * (2.0 if turn < _WIDE_ROUNDS else 1.0)
        assign(lines, middles, halves, sigma, frame, wide, nearest, support, residual, levers)
        h[:] = 0.0
        g[:] = 0.0
        for i in range(n):
            k = nearest[i]
            if k < 0:
                continue
            scale = 1.0 / (levers[i] * sigma[i])
            j[0] = scale * (frame[k, 1] * lines[i, 2] - frame[k, 2] * lines[i, 1])
            j[1] = scale * (frame[k, 2] * lines[i, 0] - frame[k, 0] * lines[i, 2])
            j[2] = scale * (frame[k, 0] * lines[i, 1] - frame[k, 1] * lines[i, 0])
            w = weight[i] * support[i]
            for a in range(3):
                g[a] += w * j[a] * residual[i]
                for b in range(3):
                    h[a, b] += w * j[a] * j[b]
        for a in range(3):
            h[a, a] += 1e-6
        solve3(h, g, j)
        angle = math.sqrt(j[0] ** 2 + j[1] ** 2 + j[2] ** 2)
        if angle < 1e-12:
            break
        turn_about(frame, j[0] / angle, j[1] / angle, j[2] / angle, -min(angle, _LARGEST_TURN))
        if angle < _CONVERGED and turn > _WIDE_ROUNDS:
            break
    assign(lines, middles, halves, sigma, frame, tolerance, nearest, support, residual, levers)
    return (weight * support).sum()


@njit(**FAST)
def solve3(h, g, x):
    """Solve h x = g for a symmetric positive (3, 3) by Cramer's rule."""
    c0 = h[1, 1] * h[2, 2] - h[1, 2] * h[2, 1]
    c1 = h[1, 2] * h[2, 0] - h[1, 0] * h[2, 2]
    c2 = h[1, 0] * h[2, 1] - h[1, 1] * h[2, 0]
    d = h[0, 0] * c0 + h[0, 1] * c1 + h[0, 2] * c2
    x[0] = (g[0] * c0 + g[1] * c1 + g[2] * c2) / d
    x[1] = (
        g[0] * c1
        + g[1] * (h[0, 0] * h[2, 2] - h[0, 2] * h[2, 0])
        + g[2] * (h[0, 2] * h[1, 0] - h[0, 0] * h[1, 2])
    ) / d
    x[2] = (
        g[0] * c2
        + g[1] * (h[0, 1] * h[2, 0] - h[0, 0] * h[2, 1])
        + g[2] * (h[0, 0] * h[1, 1] - h[0, 1] * h[1, 0])
    ) / d


@njit(**FAST)
def turn_about(frame, ux, uy, uz, angle):
    """Turn the rows of a frame about a unit axis (Rodrigues)."""
    c, s = math.cos(angle), math.sin(angle)
    for k in range(3):
        x, y, z = frame[k, 0], frame[k, 1], frame[k, 2]
        along = (ux * x + uy * y + uz * z) * (1.0 - c)
        frame[k, 0] = x * c + (uy * z - uz * y) * s + ux * along
        frame[k, 1] = y * c + (uz * x - ux * z) * s + uy * along
        frame[k, 2] = z * c + (ux * y - uy * x) * s + uz * along


@njit(**FAST)
def _tangents(d, t):
    """As `geometry.sphere.tangent_basis` has it, into t (2, 3)."""
    if abs(d[1]) > 0.9:
        size = math.hypot(d[0], d[1])
        t[0, 0], t[0, 1], t[0, 2] = -d[1] / size, d[0] / size, 0.0
    else:
        size = math.hypot(d[0], d[2])
        t[0, 0], t[0, 1], t[0, 2] = d[2] / size, 0.0, -d[0] / size
    t[1, 0] = d[1] * t[0, 2] - d[2] * t[0, 1]
    t[1, 1] = d[2] * t[0, 0] - d[0] * t[0, 2]
    t[1, 2] = d[0] * t[0, 1] - d[1] * t[0, 0]


@njit(**FAST)
def move_each(
    lines,
    middles,
    halves,
    sigma,
    weight,
    directions,
    start,
    stiffness,
    tolerance,
    rounds,
    information,
    spread,
):
    """Gauss-Newton on each direction (K, 3) by itself, in place, held to `start` by a spring (rad^-2).

    `information` (K, 2, 2) receives what the lines alone say, in the tangent planes, `spread` (K, 2) their support
    and the squared residuals summed with it.
    """
    n, count = len(lines), len(directions)
    nearest = np.empty(n, np.int64)
    support, residual, levers = np.empty(n), np.empty(n), np.empty(n)
    t = np.empty((count, 2, 3))
    g = np.empty((count, 2))
    for _ in range(rounds):
        assign(lines, middles, halves, sigma, directions, tolerance, nearest, support, residual, levers)
        information[:] = 0.0
        spread[:] = 0.0
        g[:] = 0.0
        for k in range(count):
            _tangents(directions[k], t[k])
        for i in range(n):
            k = nearest[i]
            if k < 0:
                continue
            scale = 1.0 / (levers[i] * sigma[i])
            a = scale * (lines[i, 0] * t[k, 0, 0] + lines[i, 1] * t[k, 0, 1] + lines[i, 2] * t[k, 0, 2])
            b = scale * (lines[i, 0] * t[k, 1, 0] + lines[i, 1] * t[k, 1, 1] + lines[i, 2] * t[k, 1, 2])
            w = weight[i] * support[i]
            information[k, 0, 0] += w * a * a
            information[k, 0, 1] += w * a * b
            information[k, 1, 1] += w * b * b
            g[k, 0] += w * a * residual[i]
            g[k, 1] += w * b * residual[i]
            spread[k, 0] += w
            spread[k, 1] += w * residual[i] * residual[i]
        largest = 0.0
        for k in range(count):
            information[k, 1, 0] = information[k, 0, 1]
            largest = max(largest, _step(directions[k], start[k], t[k], information[k], g[k], stiffness))
        if largest < _CONVERGED:
            break


@njit(**FAST)
def _step(d, start, t, information, g, stiffness):
    """One step of a direction along its tangents; returns its length, rad."""
    cosine = d[0] * start[0] + d[1] * start[1] + d[2] * start[2]
    sign = 1.0 if cosine >= 0.0 else -1.0
    p = sign * (t[0, 0] * start[0] + t[0, 1] * start[1] + t[0, 2] * start[2])
    q = sign * (t[1, 0] * start[0] + t[1, 1] * start[1] + t[1, 2] * start[2])
    sine = math.hypot(p, q)
    stretch = math.atan2(sine, abs(cosine)) / sine if sine > 1e-15 else 1.0
    ga, gb = g[0] - stiffness * p * stretch, g[1] - stiffness * q * stretch
    haa, hab, hbb = information[0, 0] + stiffness, information[0, 1], information[1, 1] + stiffness
    determinant = haa * hbb - hab * hab
    a = -(ga * hbb - gb * hab) / determinant
    b = -(gb * haa - ga * hab) / determinant
    size = math.hypot(a, b)
    if size < 1e-15:
        return 0.0
    angle = min(size, 0.5 * _LARGEST_TURN)
    c, s = math.cos(angle), math.sin(angle) / size
    norm = 0.0
    for axis in range(3):
        d[axis] = c * d[axis] + s * (a * t[0, axis] + b * t[1, axis])
        norm += d[axis] * d[axis]
    for axis in range(3):
        d[axis] /= math.sqrt(norm)
    return size


@njit(**FAST)
def partner_votes(lines, middles, halves, sigma, weight, proposed, tolerance, bins, widest, angles, scores):
    """For each proposed direction (K, 3) the best angle of its orthogonal partners; see `orthogonal_frames`.

    90 degrees are cut into `bins`; votes wider than `widest` bins on either side are not cast. `angles` (K,) receives
    the angle from the first tangent in rad, `scores` (K,) the support of all lines for the frame.
    """
    width = (math.pi / 2) / bins
    t = np.empty((2, 3))
    histogram = np.empty(bins)
    for k in range(len(proposed)):
        v = proposed[k]
        _tangents(v, t)
        histogram[:] = 0.0
        own_score = 0.0
        for i in range(len(lines)):
            l0, l1, l2 = lines[i, 0], lines[i, 1], lines[i, 2]
            lever = reach(lines, middles, halves, i, v[0], v[1], v[2])
            own = 0.0
            if lever > 0.0:
                r = (l0 * v[0] + l1 * v[1] + l2 * v[2]) / (lever * sigma[i] * tolerance)
                own = max(0.0, 1.0 - r * r)
            own_score += weight[i] * own
            if own >= 0.9:
                continue
            a = l0 * t[0, 0] + l1 * t[0, 1] + l2 * t[0, 2]
            b = l0 * t[1, 0] + l1 * t[1, 1] + l2 * t[1, 2]
            slope = math.sqrt(a * a + b * b) + 1e-12
            cosine, sine = b / slope, -a / slope
            x = cosine * t[0, 0] + sine * t[1, 0]
            y = cosine * t[0, 1] + sine * t[1, 1]
            z = cosine * t[0, 2] + sine * t[1, 2]
            lever = reach(lines, middles, halves, i, x, y, z)
            half = tolerance * sigma[i] * lever / slope
            if lever == 0.0 or half >= widest * width:
                continue
            at = math.atan2(sine, cosine) / width
            half = max(half / width, 0.75)
            strength = weight[i] * (1.0 - own)
            for q in range(math.floor(at - half), math.floor(at + half) + 1):
                share = 1.0 - ((q + 0.5 - at) / half) ** 2
                if share > 0.0:
                    histogram[q % bins] += strength * share
        best = 0
        for q in range(bins):
            if histogram[q] > histogram[best]:
                best = q
        angles[k] = (best + 0.5) * width
        scores[k] = own_score + histogram[best]


@njit(**FAST)
def pair_votes(lines, weight, bands, parts, starts, total, mean):
    """All pairs of lines vote for the direction where they meet, into cells as `EqualAreaCells` has them.

    `parts` and `starts` are the number of cells and the first cell of each of the `bands`; `total` (C,) receives the
    votes and `mean` (C, 3) the directions weighted by them.
    """
    total[:] = 0.0
    mean[:] = 0.0
    for i in range(len(lines)):
        for j in range(i + 1, len(lines)):
            x = lines[i, 1] * lines[j, 2] - lines[i, 2] * lines[j, 1]
            y = lines[i, 2] * lines[j, 0] - lines[i, 0] * lines[j, 2]
            z = lines[i, 0] * lines[j, 1] - lines[i, 1] * lines[j, 0]
            size = math.sqrt(x * x + y * y + z * z)
            # Two pieces of one and the same line say nothing about where it leads.
            if size < 1e-4:
                continue
            if z < 0.0:
                size = -size
            x, y, z = x / size, y / size, z / size
            band = int((math.asin(min(max(y, -1.0), 1.0)) / math.pi + 0.5) * bands)
            band = min(max(band, 0), bands - 1)
            part = int((math.atan2(x, z) / math.pi + 0.5) * parts[band])
            cell = starts[band] + min(max(part, 0), parts[band] - 1)
            vote = math.sqrt(weight[i] * weight[j])
            total[cell] += vote
            mean[cell, 0] += vote * x
            mean[cell, 1] += vote * y
            mean[cell, 2] += vote * z
