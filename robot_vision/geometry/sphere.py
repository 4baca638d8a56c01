# SPDX-License-Identifier: Apache-2.0
"""Directions live on the Gaussian sphere: its tangent planes and a division of it into cells of equal area.

A vanishing point is a direction without sign, so it is kept on the front half of the unit sphere around the
centre of projection (z >= 0, optical frame: x right, y down, z forward), where a point outside the picture or at
infinity is a point like any other (Barnard 1983; Magee and Aggarwal 1984).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Beyond this slope (the sine of the elevation) the horizontal tangent is taken from the optical z axis.
_STEEP = 0.9


def normalised(vectors: Array) -> Array:
    """Unit vectors along the last axis; a zero vector stays zero."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(lengths > 0.0, lengths, 1.0))


def front_half(directions: Array) -> Array:
    """The same lines through the centre, each turned to the front half of the sphere (z >= 0), shape (..., 3)."""
    return np.asarray(np.where(directions[..., 2:3] < 0.0, -directions, directions))


def tangent_basis(directions: Array) -> Array:
    """Two orthonormal tangents at each unit direction: (..., 3) -> (..., 2, 3).

    The first tangent is horizontal in the picture wherever that exists (perpendicular to the optical y axis), the
    second completes a right-handed set with the direction: t1 x t2 = direction.
    """
    directions = np.asarray(directions, dtype=np.float64)
    if directions.ndim == 1:
        return np.array(_tangents(*directions.tolist()))
    x, y, z = directions[..., 0], directions[..., 1], directions[..., 2]
    steep = np.abs(y) > _STEEP
    first = np.stack([np.where(steep, -y, z), np.where(steep, x, 0.0), np.where(steep, 0.0, -x)], axis=-1)
    first = normalised(first)
    return np.stack([first, cross(directions, first)], axis=-2)


def _tangents(x: float, y: float, z: float) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """`tangent_basis` of one direction: filters call it thousands of times a second."""
    if abs(y) > _STEEP:
        size = math.hypot(x, y)
        a, b = -y / size, x / size
        return (a, b, 0.0), (-z * b, z * a, x * b - y * a)
    size = math.hypot(x, z)
    a, c = z / size, -x / size
    return (a, 0.0, c), (y * c, z * a - x * c, -y * a)


def cross(first: Array, second: Array) -> Array:
    """Cross product along the last axis: numpy's own spends most of its time on generality."""
    x1, y1, z1 = first[..., 0], first[..., 1], first[..., 2]
    x2, y2, z2 = second[..., 0], second[..., 1], second[..., 2]
    return np.stack([y1 * z2 - z1 * y2, z1 * x2 - x1 * z2, x1 * y2 - y1 * x2], axis=-1)


def retract(direction: Array, offset: Array) -> Array:
    """Walk from a unit direction along a tangent offset (2,) in radians, on the great circle. Shape (3,)."""
    angle = math.hypot(offset[0], offset[1])
    if angle < 1e-15:
        return np.array(direction, dtype=np.float64)
    away = np.asarray(offset, dtype=np.float64) @ tangent_basis(direction)
    there = math.cos(angle) * direction + (math.sin(angle) / angle) * away
    return np.asarray(there / math.sqrt(float(there @ there)))


def local_coordinates(direction: Array, other: Array) -> Array:
    """Inverse of `retract` for directions without sign: tangent offset (2,) in radians from one to the other."""
    cosine = float(direction @ other)
    tangential = tangent_basis(direction) @ (other if cosine >= 0.0 else -other)
    sine = math.hypot(tangential[0], tangential[1])
    return np.asarray(tangential * (math.atan2(sine, abs(cosine)) / sine if sine > 1e-15 else 1.0))


def angle_between(first: Array, second: Array) -> Array:
    """Angle in [0, pi/2] between directions without sign, along the last axis, exact near zero too."""
    sine = np.linalg.norm(cross(first, second), axis=-1)
    cosine = np.abs(np.sum(first * second, axis=-1))
    return np.asarray(np.arctan2(sine, cosine))


@dataclass(frozen=True)
class EqualAreaCells:
    """The front half of the sphere cut into cells of nearly equal area, about `size` radians across.

    Bands of equal elevation, each cut into as many equal parts as its length allows: a vote weighs the same
    wherever it falls, so the sphere has no favourite places.

    Attributes:
        size: height of a band and nominal width of a cell, rad.
    """

    size: float
    _starts: NDArray[np.intp] = field(init=False, repr=False, compare=False)
    _parts: NDArray[np.intp] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not 0.0 < self.size <= np.pi / 4:
            raise ValueError(f"cell size must lie in (0, pi/4] rad, not {self.size}")
        bands = int(np.ceil(np.pi / self.size))
        edges = np.linspace(-1.0, 1.0, bands + 1) * (np.pi / 2)
        lengths = np.pi * (np.sin(edges[1:]) - np.sin(edges[:-1])) / self.size
        parts = np.maximum(1, np.rint(lengths / self.size)).astype(np.intp)
        object.__setattr__(self, "_parts", parts)
        object.__setattr__(self, "_starts", np.concatenate([[0], np.cumsum(parts)]).astype(np.intp))

    def __len__(self) -> int:
        return int(self._starts[-1])

    @property
    def layout(self) -> tuple[int, NDArray[np.intp], NDArray[np.intp]]:
        """Number of bands, cells in each band (B,), and first cell of each band (B + 1,)."""
        return len(self._parts), self._parts, self._starts

    def index(self, directions: Array) -> NDArray[np.intp]:
        """Cell of each unit direction with z >= 0: (N, 3) -> (N,)."""
        bands = len(self._parts)
        elevation = np.arcsin(np.clip(directions[:, 1], -1.0, 1.0))
        band = np.clip(((elevation / np.pi + 0.5) * bands).astype(np.intp), 0, bands - 1)
        azimuth = np.arctan2(directions[:, 0], directions[:, 2]) / np.pi + 0.5
        parts = self._parts[band]
        part = np.clip((azimuth * parts).astype(np.intp), 0, parts - 1)
        return np.asarray(self._starts[band] + part)
