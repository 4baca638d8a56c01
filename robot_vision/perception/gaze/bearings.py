# SPDX-License-Identifier: Apache-2.0
"""What is known by bearing all around the robot: where the way may lie that was lost, how long ago floor was seen."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

COUNT = 144
WIDTH = 2.0 * np.pi / COUNT
#: Middles of the bins, rad, left positive, from -pi.
BEARINGS: Array = np.asarray(-np.pi + WIDTH * (np.arange(COUNT) + 0.5), np.float64)
BEARINGS.setflags(write=False)

#: How the belief where a way lies that is out of sight spreads, rad in 1 s (standard deviation).
_SPREAD = 0.15
#: A way that is in view is found within this time, s.
_FOUND_WITHIN = 0.8
#: Share of the belief that goes in 1 s to where the robot heads, whatever was believed: it may know why it goes there.
_WHERE_IT_HEADS = 0.5
#: How near to where the robot heads a way is expected that was never seen (standard deviation), rad.
_AHEAD = 0.7
#: Floor that was seen so long ago is as good as new, s.
_FORGOTTEN = 1.5


def turned(values: Array, angle: float) -> Array:
    """Values (COUNT,) on the ring of bearings after the robot has turned by `angle`, rad counter-clockwise."""
    steps = angle / WIDTH
    whole = int(np.floor(steps))
    part = steps - whole
    return np.asarray((1.0 - part) * np.roll(values, -whole) + part * np.roll(values, -whole - 1))


def in_view(bearings: ArrayLike, pans: ArrayLike, half_view: float) -> Array:
    """Whether bearings (N,) lie in the view of a camera that looks along each of `pans` (C,): (C, N) of 0 and 1."""
    apart = np.asarray(bearings, np.float64) - np.asarray(pans, np.float64)[:, None]
    away = np.abs(np.mod(apart + np.pi, 2.0 * np.pi) - np.pi)
    return np.asarray(away <= half_view, np.float64)


class LostWay:
    """Belief about the bearing of a way that is not seen, as a search carries it on (Koopman 1946).

    A look that does not find the way makes it less likely where the look went; the robot's turning turns all.
    """

    def __init__(self) -> None:
        self.belief = _normal(0.0, _AHEAD)

    def seen(self, bearings: Array, sigmas: Array) -> None:
        """The way is in sight and leads along these bearings (K,), rad, each known to `sigmas` (K,)."""
        self.belief = _share(np.sum([_normal(b, s) for b, s in zip(bearings, sigmas, strict=True)], axis=0))

    def left(self, heads: float) -> None:
        """The robot leaves the way: the next one is expected where it heads, rad."""
        self.belief = _normal(heads, _AHEAD)

    def unseen(self, pan: float, half_view: float, seconds: float, turn: float, heads: float = 0.0) -> None:
        """A picture did not show it.

        Args:
            pan: of that picture, rad.
            half_view: what it shows to either side, rad.
            seconds: since the picture before.
            turn: of the robot since then, rad.
            heads: where it will head soon, rad from where it heads now.
        """
        belief = turned(self.belief, turn)
        spread = _SPREAD**2 * seconds / WIDTH**2
        # A step of diffusion as large as is stable; what is left over is less than a bin
        share = min(0.5 * spread, 0.25)
        belief = belief + share * (np.roll(belief, 1) - 2.0 * belief + np.roll(belief, -1))
        missed = 1.0 - np.exp(-seconds / _FOUND_WITHIN)
        belief = belief * (1.0 - missed * in_view(BEARINGS, [pan], half_view)[0])
        elsewhere = min(_WHERE_IT_HEADS * seconds, 1.0)
        self.belief = (1.0 - elsewhere) * _share(belief) + elsewhere * _normal(heads, _AHEAD)

    def chance(self, pans: Array, half_view: float) -> Array:
        """Chance (C,) that the way is in the view along each of `pans` (C,), rad."""
        return np.asarray(in_view(BEARINGS, pans, half_view) @ self.belief)


class SeenFloor:
    """How long ago the floor at each bearing was in view, as a share of what a look there would tell anew."""

    def __init__(self) -> None:
        self._news = np.ones(COUNT)

    def look(self, pan: float, half_view: float, seconds: float, turn: float) -> None:
        """A picture was taken along `pan`; `turn` (rad) is the robot's since the picture before."""
        news = 1.0 - (1.0 - turned(self._news, turn)) * np.exp(-seconds / _FORGOTTEN)
        self._news = news * (1.0 - in_view(BEARINGS, [pan], half_view)[0])

    def news(self, bearings: Array, pans: Array, half_view: float) -> Array:
        """Mean share (C,) of the floor at bearings (N,) that a look along each of `pans` (C,) would show anew."""
        there = np.floor((np.mod(bearings + np.pi, 2.0 * np.pi)) / WIDTH).astype(np.intp) % COUNT
        return np.asarray(in_view(bearings, pans, half_view) @ self._news[there] / max(len(bearings), 1))


def _normal(bearing: float, sigma: float) -> Array:
    away = np.mod(BEARINGS - bearing + np.pi, 2.0 * np.pi) - np.pi
    return _share(np.exp(-0.5 * (away / max(sigma, WIDTH)) ** 2))


def _share(belief: Array) -> Array:
    return np.asarray(belief / max(float(belief.sum()), 1e-12))
