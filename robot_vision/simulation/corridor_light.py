# SPDX-License-Identifier: Apache-2.0
"""Light in a corridor that turns: what shines in one leg is hidden from most of the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation.corridor_parts import DOOR_RECESS

ALONG_LAMP = (-0.4, 0.0, 0.4)
"""Metres from a lamp's middle to the points that stand for its length."""


@dataclass(frozen=True, eq=False)
class TurnedLight:
    """Light in a corridor of two legs, as `RoomLight` has it for one; lamps do not shine around the corner.

    Attributes:
        lamps: (N, 2) middle of each lamp, metres.
        directions: (N, 2) unit vector along each.
        outline: (K, 2) of the floor, counter-clockwise, metres.
        corner: (2,) of the two walls that meet where the corridor turns, metres.
        inwards: (2, 2) rows: unit vectors from that corner into the building, along both walls.
        height: of the ceiling, metres.
        window: (2,) middle of the window, metres.
        leaving: (2,) unit vector in which the second leg leads to the window.
    """

    lamps: NDArray[np.float64]
    directions: NDArray[np.float64]
    outline: NDArray[np.float64]
    corner: NDArray[np.float64]
    inwards: NDArray[np.float64]
    height: float
    window: NDArray[np.float64]
    leaving: NDArray[np.float64]

    def __call__(self, points: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Light (N, 3) on points (N, 3) of a surface with a unit normal (3,), linear blue, green, red."""
        pieces = np.array_split(points, max(len(points) // 4096, 1))
        direct = np.concatenate([self._direct(piece, normal) for piece in pieces])
        ambient = 0.36 * (1 - 0.35 * np.exp(-self._second_gap(points) / 0.15))
        beyond = (points[:, :2] - self.window) @ self.leaving
        facing = normal[:2] @ self.leaving > -0.5
        window = 0.25 * np.exp(np.minimum(beyond, 0.0) / 1.5) * facing
        warm, cold = np.array([0.97, 1.0, 1.03]), np.array([1.1, 1.0, 0.92])
        return np.asarray((direct + ambient)[:, None] * warm + window[:, None] * cold)

    def _direct(self, points: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
        """Light (N,) straight from the lamps, by Lambert's law at both ends."""
        shifts = np.array(ALONG_LAMP)[:, None, None] * self.directions
        places = (self.lamps + shifts).reshape(-1, 2)
        sources = np.column_stack([places, np.full(len(places), self.height - 0.05)])
        towards = sources - points[:, None]
        distance2 = np.maximum((towards**2).sum(axis=2), 0.04)
        leaving = np.maximum(towards[..., 2], 0.0) / distance2
        arriving = np.maximum(towards @ normal, 0.0) / distance2
        return np.asarray((0.55 * leaving * arriving * self.sees(points[:, :2], places)).sum(axis=1))

    def sees(self, places: NDArray[np.float64], sources: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether the ways (N, M) from places (N, 2) to sources (M, 2) stay clear of the building's corner."""
        corner = self.corner + (DOOR_RECESS + 0.01) * self.inwards.sum(
            axis=0
        )  # doors lie behind walls' faces
        depth = ((places - corner) @ self.inwards.T)[:, None]
        change = (sources - corner) @ self.inwards.T - depth
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = -depth / change
        enters = np.where(depth > 0, 0.0, np.where(change > 0, crossing, np.inf))
        leaves = np.where((depth > 0) & (change < 0), crossing, np.inf)
        leaves = np.where((depth <= 0) & (change <= 0), -np.inf, leaves)
        return np.asarray(enters.max(axis=2) + 1e-6 >= np.minimum(leaves.min(axis=2), 1.0))

    def _second_gap(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance (N,) from points (N, 3) to the second nearest of walls, floor and ceiling, metres."""
        gaps = [points[:, 2], np.abs(self.height - points[:, 2])]
        for a, b in zip(self.outline, np.roll(self.outline, -1, axis=0), strict=True):
            length = float(np.linalg.norm(b - a))
            along = (b - a) / length
            s = (points[:, :2] - a) @ along
            out = (points[:, :2] - a) @ np.array([-along[1], along[0]])
            before = (out > -1e-6) & (s > -1e-6) & (s < length + 1e-6)
            recessed = (out > -0.15) & (s > 0.01) & (s < length - 0.01)
            gaps.append(np.where(before | recessed, np.abs(out), np.inf))
        return np.asarray(np.sort(np.stack(gaps), axis=0)[1])
