# SPDX-License-Identifier: Apache-2.0
"""Which nozzle of a boom is to open for which weed, and when; never where it would hit the crop, never blindly."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping.plant_leaves import CELL_M
from robot_vision.mapping.plants import PlantKind, Plants

Array = NDArray[np.float64]

#: A nozzle is meant for a weed when its lane covers this share of the weed's radius about its middle, or so much, m.
_AIM, _LEAST_AIM = 0.5, 0.008
#: From what may be crop at least so many standard deviations of its place are kept; fewer where its leaves were looked
#: at, as from these the safety distance is kept as well.
_CAUTION, _CAUTION_LEAVES = 1.0, 0.5
#: Leaves this near to a weed's own circle may be its own; farther off than the other they do not matter, m.
_OWN, _ASIDE = 0.012, 0.15
#: Slower than this nobody can say when a weed comes under the nozzle, m/s.
_SLOWEST = 0.05


class Fate(IntEnum):
    """What became of a plant under the boom."""

    CROP = 0
    SPRAYED = 1
    SPARED = 2
    """A weed too near the crop."""
    UNSURE = 3
    """Not surely a weed, hence not sprayed."""


@dataclass(frozen=True)
class Spray:
    """What is to be sprayed from now on.

    Attributes:
        weeds: (M,) what the jets are to reach; a weed of several lanes stands there several times. Where a jet over
            all of it would come too near the crop, place and area are those of the part that is clear.
        lanes: (M,) nozzle of each, 0 the rightmost.
        times: (M,) s until the middle of the weed is under the jet, less the latency: when to open the valve.
        reason: in plain words why nothing is sprayed at all; empty when all is well.
    """

    weeds: Plants
    lanes: NDArray[np.intp]
    times: Array
    reason: str = ""

    def __len__(self) -> int:
        return len(self.lanes)


@dataclass
class SprayPlanner:
    """Plans for a row of nozzles.

    Args:
        lanes: number of nozzles.
        width: of the lane of each, m; they lie side by side, the middle of the boom at y = 0.
        boom_x: of the boom ahead of base_link, m; behind it is negative.
        latency: from the command to the jet on the ground, s.
        safety: distance kept from the leaves of the crop, m.
        margin: sprayed before and behind a weed, m.

    Raises:
        ValueError: naming the setting that makes no sense.
    """

    lanes: int = 24
    width: float = 0.04
    boom_x: float = -0.3
    latency: float = 0.1
    safety: float = 0.02
    margin: float = 0.01
    counts: NDArray[np.intp] = field(
        default_factory=lambda: np.zeros(len(Fate), np.intp), init=False, repr=False, compare=False
    )
    _ahead: dict[int, Fate] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not 1 <= self.lanes <= 1000:
            raise ValueError(f"lanes must lie in [1, 1000], not {self.lanes}")
        if not (np.isfinite(self.width) and self.width > 0.0):
            raise ValueError(f"width must be a positive number of metres, not {self.width}")
        if not np.isfinite(self.boom_x):
            raise ValueError(f"boom_x must be a number of metres, not {self.boom_x}")
        for name in ("latency", "safety", "margin"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) >= 0.0):
                raise ValueError(f"{name} must not be negative, nor {getattr(self, name)}")

    @property
    def middles(self) -> Array:
        """Distance (lanes,) of each lane's middle to the left of base_link, m."""
        return np.asarray(self.width * (np.arange(self.lanes) - 0.5 * (self.lanes - 1)))

    def reset(self) -> None:
        """Forget the plants ahead, and the counts."""
        self._ahead.clear()
        self.counts[:] = 0

    def plan(
        self, plants: Plants, speed: float | None, blind: str = "", leaves: Array | None = None
    ) -> Spray:
        """Say what to spray and when.

        Args:
            plants: around the robot now.
            speed: of the robot ahead, m/s; None: not known.
            blind: why the plants are not to be relied on; nothing is sprayed then.
            leaves: (L, 2) where leaves of the crop were seen, as `PlantMap.leaves`: the safety distance is kept from
                these as well. None: nobody has looked.
        """
        if speed is None:
            blind = blind or "no odometry tells when a weed will be under the boom"
        elif speed < _SLOWEST:
            blind = blind or "the robot stands still"
        if blind or speed is None:
            self._count(plants, np.zeros(len(plants), bool), np.zeros(len(plants), bool))
            return Spray(Plants.none(), np.zeros(0, np.intp), np.zeros(0), blind)
        reached = np.abs(plants.places[:, 1]) < 0.5 * self.lanes * self.width + plants.radii
        reached &= plants.places[:, 0] > self.boom_x - plants.radii - self.margin - self.latency * speed
        weeds = np.flatnonzero((plants.kinds == PlantKind.WEED) & reached)
        begin, end = self._clear(plants, weeds, leaves)
        ahead = plants.places[weeds, 0] - self.boom_x
        in_time = ahead[:, None] + end > self.latency * speed
        aim = np.maximum(_AIM * plants.radii[weeds], _LEAST_AIM)
        aim += np.sqrt(plants.covariance[weeds, 1, 1])
        across = np.abs(plants.places[weeds, 1, None] - self.middles[None, :])
        meant = across < 0.5 * self.width + aim[:, None]
        open_lanes = meant & (begin <= -self.margin) & (end >= self.margin)
        # The lane over the middle of a weed must be among those that may open
        hit = np.asarray((open_lanes & (across <= 0.5 * self.width + 1e-9)).any(axis=1))
        weed, lane = np.nonzero(open_lanes & hit[:, None] & in_time)
        self._count(plants, _marked(plants, weeds[hit]), _marked(plants, weeds[meant.any(axis=1) & ~hit]))
        begin, end = begin[weed, lane], end[weed, lane]
        parts = plants.take(weeds[weed])
        parts.places[:, 0] += 0.5 * (begin + end)
        parts.areas[:] = np.pi * (0.5 * (end - begin) - self.margin) ** 2
        return Spray(parts, lane, (parts.places[:, 0] - self.boom_x) / speed - self.latency)

    def _clear(self, plants: Plants, weeds: NDArray[np.intp], leaves: Array | None) -> tuple[Array, Array]:
        """The part of the way about each weed (M,) on which a jet of each lane keeps off what may be crop.

        Returns:
            Where it begins and ends ahead of the weed's middle, (M, lanes) each, m; the margin is in it. It begins
            ahead of the middle, or ends behind it, where the middle itself is too near.
        """
        half = np.repeat((plants.radii[weeds] + self.margin)[:, None], self.lanes, axis=1)
        unsure = np.maximum(np.linalg.det(plants.covariance), 0.0) ** 0.25
        crop = plants.kinds != PlantKind.WEED
        places, radii = plants.places[crop], plants.radii[crop]
        caution = np.where(_in_leaf(places, radii, leaves), _CAUTION_LEAVES, _CAUTION)
        reach = radii + np.maximum(self.safety, caution * unsure[crop])
        behind, before = self._kept_off(plants.places[weeds], places, reach)
        if leaves is not None and len(leaves) and len(weeds):
            far = plants.radii[weeds].max() + _ASIDE
            low, high = plants.places[weeds].min(axis=0) - far, plants.places[weeds].max(axis=0) + far
            leaves = leaves[((leaves > low) & (leaves < high)).all(axis=1)]
            covered = _not_their_own(leaves, plants.places[weeds], plants.radii[weeds])
            for k, weed in enumerate(weeds):
                place = plants.places[[weed]]
                near = covered[_square(covered, place[0]) < (plants.radii[weed] + _ASIDE) ** 2]
                back, front = self._kept_off(place, near, np.full(len(near), self.safety + 0.5 * CELL_M))
                behind[k], before[k] = np.maximum(behind[k], back[0]), np.minimum(before[k], front[0])
        return np.maximum(-half, behind), np.minimum(half, before)

    def _kept_off(self, weeds: Array, places: Array, reach: Array) -> tuple[Array, Array]:
        """The way about weeds (M, 2) farther than (N,) from places (N, 2) in each lane: (M, lanes) each, m."""
        wide = np.abs(places[:, 1]) < 0.5 * self.lanes * self.width + reach
        places, reach = places[wide], reach[wide]
        aside = np.abs(places[:, 1, None] - self.middles[None, :]) - 0.5 * self.width
        near = aside < reach[:, None]
        chord = np.sqrt(np.maximum(reach[:, None] ** 2 - np.maximum(aside, 0.0) ** 2, 0.0))
        away = (places[None, :, 0] - weeds[:, None, 0])[:, :, None]
        behind = np.where(near & (away < 0.0), away + chord, -np.inf).max(axis=1, initial=-np.inf)
        before = np.where(near & (away >= 0.0), away - chord, np.inf).min(axis=1, initial=np.inf)
        return np.asarray(behind), np.asarray(before)

    def _count(self, plants: Plants, sprayed: NDArray[np.bool_], spared: NDArray[np.bool_]) -> None:
        """Note what becomes of plants ahead, and count those that the boom has passed since the last picture."""
        fates = np.full(len(plants), Fate.UNSURE)
        fates[plants.kinds == PlantKind.CROP] = Fate.CROP
        fates[spared] = Fate.SPARED
        fates[sprayed] = Fate.SPRAYED
        inside = np.abs(plants.places[:, 1]) < 0.5 * self.lanes * self.width
        ahead = plants.places[:, 0] > self.boom_x
        for number in plants.ids[~ahead].tolist():
            if number in self._ahead:
                self.counts[self._ahead.pop(number)] += 1
        there = ahead & inside
        self._ahead = {
            number: Fate(fate)
            for number, fate in zip(plants.ids[there].tolist(), fates[there].tolist(), strict=True)
        }


def _in_leaf(places: Array, radii: Array, leaves: Array | None) -> NDArray[np.bool_]:
    """Whether leaves (L, 2) were seen within such radii (N,) of places (N, 2); None: nobody has looked."""
    if leaves is None or not len(leaves):
        return np.zeros(len(places), np.bool_)
    near = [
        bool((_square(leaves, place) < radius**2).any()) for place, radius in zip(places, radii, strict=True)
    ]
    return np.array(near, np.bool_)


def _not_their_own(leaves: Array, weeds: Array, radii: Array) -> Array:
    """Those of the leaves (L, 2) that lie outside weeds (M, 2) of such radii (M,)."""
    crop = np.ones(len(leaves), np.bool_)
    for weed, radius in zip(weeds, radii, strict=True):
        crop &= _square(leaves, weed) > (radius + _OWN) ** 2
    return leaves[crop]


def _square(places: Array, place: Array) -> Array:
    """Squared distances (N,) of places (N, 2) from one (2,), m^2."""
    return np.asarray((places[:, 0] - place[0]) ** 2 + (places[:, 1] - place[1]) ** 2)


def _marked(plants: Plants, which: NDArray[np.intp]) -> NDArray[np.bool_]:
    marked = np.zeros(len(plants), np.bool_)
    marked[which] = True
    return marked
