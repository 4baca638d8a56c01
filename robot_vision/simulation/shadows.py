# SPDX-License-Identifier: Apache-2.0
"""Which points a distant light reaches, compiled; loaded when a world with daylight is built.

Seen along the light, with coordinates (a, b) across it and c towards it, a rectangle is a parallelogram: (s, t)
of a point are linear in (a, b), and the rectangle stands before the point if its own c there is greater.
A grid over (a, b) lists the rectangles each cell could meet.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation.packing import CUT_OUT, ROUND, Packed
from robot_vision.simulation.shading import Floats, Ints, Singles, alpha_at, compiled

GRID_CELLS = 1 << 19
"""Cells of the grid: a field of 20 m x 20 m gets cells of 3 cm."""
EDGE_ON = 1e-9
"""Share of a rectangle's area seen along the light below which it casts no shadow."""


class Casters(NamedTuple):
    """Rectangles as one light sees them."""

    axes: NDArray[np.float64]  # (3, 3): rows a, b, c of light coordinates in the world
    plans: NDArray[np.float64]  # (K, 9): s, t, c = plan (3 x 3 rows) times (a, b, 1)
    numbers: NDArray[np.int64]  # (K,): rectangle each stands for
    low: NDArray[np.float64]  # (2,): a, b of the grid's corner, metres
    cell: float  # metres
    starts: NDArray[np.int64]  # (R, C): first entry of a cell's list
    counts: NDArray[np.int64]  # (R, C)
    entries: NDArray[np.int64]  # indices into plans


class Shapes(NamedTuple):
    """Where rectangles have material, as laid out by `pack`."""

    kinds: NDArray[np.int64]
    places: NDArray[np.int64]
    ellipses: NDArray[np.float64]
    windows: NDArray[np.float64]
    quad_textures: NDArray[np.int64]
    textures: NDArray[np.int64]
    mips: NDArray[np.int64]
    alphas: NDArray[np.float32]

    @classmethod
    def of(cls, packed: Packed) -> Shapes:
        """Those of a scene."""
        made = packed.materials
        return cls(
            packed.kinds,
            packed.ellipses,
            made.ellipses,
            packed.windows,
            packed.textures,
            made.textures,
            made.mips,
            made.alphas,
        )


class Patches(NamedTuple):
    """Lattices of nodes on rectangles, laid one after another."""

    vertices: NDArray[np.float64]  # (Q, 3, 3): first, second, origin; metres
    sizes: NDArray[np.int64]  # (Q, 3): first node, rows, columns


def look_along(towards: NDArray[np.float64], packed: Packed) -> Casters:
    """Prepare a scene's rectangles for a light in the direction `towards` (3,), a unit vector."""
    helper = np.eye(3)[int(np.argmin(np.abs(towards)))]
    across = np.cross(helper, towards)
    across /= np.linalg.norm(across)
    axes = np.array([across, np.cross(towards, across), towards])
    seen = packed.vertices @ axes.T  # rows first, second, origin; columns a, b, c
    flat = seen[:, :2, :2]
    area = np.linalg.norm(np.cross(packed.vertices[:, 0], packed.vertices[:, 1]), axis=1)
    numbers = np.flatnonzero(np.abs(np.linalg.det(flat)) > EDGE_ON * area)
    seen, inverse = seen[numbers], np.linalg.inv(np.swapaxes(flat[numbers], 1, 2))
    plans = np.empty((len(numbers), 3, 3))
    plans[:, :2, :2] = inverse
    plans[:, :2, 2] = -(inverse @ seen[:, 2, :2, None])[..., 0]
    plans[:, 2] = np.einsum("ki,kij->kj", seen[:, :2, 2], plans[:, :2])
    plans[:, 2, 2] += seen[:, 2, 2]
    corners = seen[:, None, 2, :2] + np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) @ seen[:, :2, :2]
    lows, highs = corners.min(axis=1), corners.max(axis=1)
    low = lows.min(axis=0) if len(numbers) else np.zeros(2)
    extent = (highs.max(axis=0) if len(numbers) else np.ones(2)) - low
    cell = max(
        float(np.sqrt(max(extent[0] * extent[1], 1e-6) / GRID_CELLS)), float(extent.max()) / 4096, 1e-3
    )
    columns, rows = (int(side / cell) + 1 for side in extent)
    spans = np.column_stack([(lows - low) / cell, (highs - low) / cell]).astype(np.int64)
    counts = np.zeros((rows, columns), np.int64)
    _count(spans, counts)
    starts = np.concatenate([[0], np.cumsum(counts.ravel())])[:-1].reshape(counts.shape)
    entries = np.empty(int(counts.sum()), np.int64)
    _enter(spans, starts, np.zeros_like(counts), entries)
    return Casters(axes, plans.reshape(-1, 9), numbers, low, cell, starts, counts, entries)


@compiled
def _count(spans: Ints, counts: Ints) -> None:
    """Add up how many boxes (first column, first row, last column, last row) touch each cell."""
    for n in range(spans.shape[0]):
        for row in range(spans[n, 1], spans[n, 3] + 1):
            for column in range(spans[n, 0], spans[n, 2] + 1):
                counts[row, column] += 1


@compiled
def _enter(spans: Ints, starts: Ints, filled: Ints, entries: Ints) -> None:
    """Write the boxes that touch each cell into the cell's list."""
    for n in range(spans.shape[0]):
        for row in range(spans[n, 1], spans[n, 3] + 1):
            for column in range(spans[n, 0], spans[n, 2] + 1):
                entries[starts[row, column] + filled[row, column]] = n
                filled[row, column] += 1


@compiled
def _reached(
    a: float,
    b: float,
    c: float,
    plans: Floats,
    numbers: Ints,
    low: Floats,
    cell: float,
    starts: Ints,
    counts: Ints,
    entries: Ints,
    kinds: Ints,
    ellipse_places: Ints,
    ellipses: Floats,
    windows: Floats,
    quad_textures: Ints,
    textures: Ints,
    mips: Ints,
    alphas: Singles,
) -> bool:
    """Whether light reaches the point (a, b, c)."""
    column, row = int(math.floor((a - low[0]) / cell)), int(math.floor((b - low[1]) / cell))
    if column < 0 or row < 0 or column >= counts.shape[1] or row >= counts.shape[0]:
        return True
    start = starts[row, column]
    for n in range(start, start + counts[row, column]):
        k = entries[n]
        if plans[k, 6] * a + plans[k, 7] * b + plans[k, 8] <= c:
            continue
        s = plans[k, 0] * a + plans[k, 1] * b + plans[k, 2]
        t = plans[k, 3] * a + plans[k, 4] * b + plans[k, 5]
        if s < 0 or s > 1 or t < 0 or t > 1:
            continue
        q = numbers[k]
        if kinds[q] == CUT_OUT:
            texture = quad_textures[q]
            share = alpha_at(
                alphas,
                mips[texture, 0, 0] - textures[texture, 2],
                mips[texture, 0, 1],
                mips[texture, 0, 2],
                textures[texture, 1],
                windows[q, 2] + s * windows[q, 0],
                windows[q, 3] + t * windows[q, 1],
            )
            if share > 0.5:
                return False
        elif kinds[q] == ROUND:
            there = True
            for e in range(ellipse_places[q, 0], ellipse_places[q, 0] + ellipse_places[q, 1]):
                ds, dt = s - ellipses[e, 0], t - ellipses[e, 1]
                x, y = ellipses[e, 2] * ds + ellipses[e, 3] * dt, ellipses[e, 4] * ds + ellipses[e, 5] * dt
                there &= (x * x + y * y > 1) == (ellipses[e, 6] == 1)
            if there:
                return False
        else:
            return False
    return True


@compiled
def reach(
    patches: Patches, casters: Casters, shapes: Shapes, subsamples: int, lift: float, share: Singles
) -> None:
    """Write to each node which share (N,) of the light reaches the patch of surface around it."""
    axes, plans, numbers, low, cell = casters.axes, casters.plans, casters.numbers, casters.low, casters.cell
    starts, counts, entries = casters.starts, casters.counts, casters.entries
    kinds, places, ellipses = shapes.kinds, shapes.places, shapes.ellipses
    windows, quad_textures = shapes.windows, shapes.quad_textures
    textures, mips, alphas = shapes.textures, shapes.mips, shapes.alphas
    seen = np.empty((3, 3))
    for q in range(patches.vertices.shape[0]):
        for i in range(3):
            for j in range(3):
                seen[i, j] = 0.0
                for n in range(3):
                    seen[i, j] += patches.vertices[q, i, n] * axes[j, n]
        first, rows, columns = patches.sizes[q]
        for row in range(rows):
            for column in range(columns):
                lit = 0
                for n in range(subsamples * subsamples):
                    shift_t = ((n // subsamples + 0.5) / subsamples - 0.5) / max(rows - 1, 1)
                    shift_s = ((n % subsamples + 0.5) / subsamples - 0.5) / max(columns - 1, 1)
                    s = min(max(column / max(columns - 1, 1) + shift_s, 0.0), 1.0)
                    t = min(max(row / max(rows - 1, 1) + shift_t, 0.0), 1.0)
                    lit += _reached(
                        seen[2, 0] + s * seen[0, 0] + t * seen[1, 0],
                        seen[2, 1] + s * seen[0, 1] + t * seen[1, 1],
                        seen[2, 2] + s * seen[0, 2] + t * seen[1, 2] + lift,
                        plans,
                        numbers,
                        low,
                        cell,
                        starts,
                        counts,
                        entries,
                        kinds,
                        places,
                        ellipses,
                        windows,
                        quad_textures,
                        textures,
                        mips,
                        alphas,
                    )
                share[first + row * columns + column] = lit / (subsamples * subsamples)
