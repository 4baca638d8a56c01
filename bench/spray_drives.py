# SPDX-License-Identifier: Apache-2.0
"""A sprayer driven through simulated fields: what it knew of each plant, and what its jets hit, by the truth."""

from __future__ import annotations

import time
from collections import defaultdict
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from bench.row_drives import RATE, moved, recorded_pictures
from bench.spray_misses import cause_of_miss
from robot_vision.geometry import Camera
from robot_vision.mapping.plant_map import PlantMap
from robot_vision.mapping.plants import Plants
from robot_vision.perception.crop_rows.row_filter import Motion
from robot_vision.perception.crop_rows.tracker import RowEstimate, RowTracker
from robot_vision.planning.sprayer import Spray, SprayPlanner
from robot_vision.simulation.body import BodyState
from robot_vision.simulation.drive import STEPS_PER_SECOND
from robot_vision.simulation.drive import Motion as Drive
from robot_vision.simulation.world import World

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SPACING_M = 0.5
SETTLING_M = 3.0
"""Way from the start before which plants do not count: the first ones are not seen from afar."""
ENTERS_M, ASIDE_M = 2.4, 0.48
"""Plants come into view this far ahead of base_link, and count up to this far to its sides, m."""
SAME_M = 0.04
"""A plant of the map is a true one when it is this near, or nearer than the radius of the true one."""
FEWEST_PICTURES = 8
"""In which a plant must be in view to count as one that came and went."""
BEFORE_S = 0.3
"""Before a missed weed came under the boom, it is asked why."""
STEP = STEPS_PER_SECOND // 200
"""Of the motion, between two looks at where the jets are."""


@dataclass(frozen=True, eq=False)
class Seen:
    """One picture of a drive with what the tracker made of it."""

    picture: NDArray[np.uint8]
    rows: RowEstimate
    motion: Motion
    state: BodyState


@dataclass(frozen=True, eq=False)
class Outing:
    """A drive with its truth; looked at once, judged as often as wanted."""

    seen: list[Seen]
    camera: Camera
    drive: Drive
    truth: TruePlants


@dataclass(frozen=True, eq=False)
class TruePlants:
    """The plants of a world: places (N, 2), radii (N,) of circles as large as their leaves, weed (N,)."""

    places: Array
    radii: Array
    weed: Mask

    def from_robot(self, x: float, y: float, yaw: float) -> Array:
        """Places (N, 2) in base_link, m."""
        cos, sin = np.cos(yaw), np.sin(yaw)
        away = self.places - (x, y)
        return np.column_stack([away @ (cos, sin), away @ (-sin, cos)])


@dataclass
class Tally:
    """Counts over drives; see `SHARES`."""

    counts: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    errors: list[Array] = field(default_factory=list)
    surprises: list[float] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)

    def add(self, other: Tally) -> None:
        """Take in what another drive counted."""
        for name, count in other.counts.items():
            self.counts[name] += count
        self.errors += other.errors
        self.surprises += other.surprises
        self.seconds += other.seconds

    def share(self, part: str, whole: str) -> float:
        """A count as a share of another, %."""
        return 100.0 * self.counts[part] / self.counts[whole] if self.counts[whole] else float("nan")


def outing(settings: dict[str, Any], seed: int, seconds: float) -> Outing:
    """Drive through a field as `robot-vision simulate field` does, tracker included."""
    world, drive, pictures = recorded_pictures(settings, seed, seconds)
    tracker, seen = RowTracker(SPACING_M), list[Seen]()
    for picture, state, since in pictures:
        motion = moved(since)
        seen.append(Seen(picture, tracker.update(picture, world.camera, motion), motion, state))
    return Outing(seen, world.camera, drive, _truth(world))


def _truth(world: World) -> TruePlants:
    return TruePlants(
        np.array([(plant.x, plant.y) for plant in world.plants]),
        np.sqrt(np.array([plant.area for plant in world.plants]) / np.pi),
        np.array([plant.kind == "weed" for plant in world.plants]),
    )


def tend(out: Outing, plant_map: PlantMap, planner: SprayPlanner, tally: Tally) -> None:
    """Follow the plants of a drive, spray, and count."""
    follower, machine = _Follower(out, tally), _Machine(planner)
    said: list[tuple[Plants, Spray]] = []
    for number, seen in enumerate(out.seen):
        began = time.process_time()
        plants = plant_map.update(seen.picture, out.camera, seen.rows, SPACING_M, seen.motion)
        blind = "" if seen.rows.lane else "no row"
        spray = planner.plan(plants, seen.motion.speed, blind, plant_map.leaves)
        tally.seconds.append(time.process_time() - began)
        follower.look(seen.state, plants)
        machine.hear(number / RATE, spray, seen.motion.speed or 0.0)
        said.append((plants, spray))
    follower.judge()
    _judge_jets(out, machine, said, planner, tally)


class _Follower:
    """Compares the map with the truth while plants go from where they come into view to where they leave it."""

    def __init__(self, out: Outing, tally: Tally) -> None:
        self._out, self._tally = out, tally
        self._ids: dict[int, list[int]] = defaultdict(list)
        self._entered: set[int] = set()
        self._shown: dict[int, int] = defaultdict(int)
        self._left: set[int] = set()
        self._first = (out.seen[0].state.x, out.seen[0].state.y)

    def look(self, state: BodyState, plants: Plants) -> None:
        """Take one picture."""
        truth, camera = self._out.truth, self._out.camera
        here = truth.from_robot(state.x, state.y, state.yaw)
        pose = state.camera_pose(camera)
        ground = np.column_stack([truth.places, np.zeros(len(truth.places))])
        u, v = camera.pixels((ground - pose[:3, 3]) @ pose[:3, :3]).T
        beside = (np.abs(here[:, 1]) < ASIDE_M) & (here[:, 0] > 0.0)
        in_view = (
            beside & (here[:, 0] < ENTERS_M) & (u > 0) & (u < camera.width - 1) & (v < camera.height - 1)
        )
        moved_on = np.hypot(state.x - self._first[0], state.y - self._first[1]) > SETTLING_M - ENTERS_M
        if not moved_on:
            return
        self._entered |= set(np.flatnonzero(beside & (here[:, 0] > ENTERS_M)).tolist())
        self._left |= {n for n in np.flatnonzero(here[:, 0] < 0.6).tolist() if n in self._entered}
        true = np.array([n for n in np.flatnonzero(in_view).tolist() if n in self._entered], np.intp)
        for number in true.tolist():
            self._shown[number] += 1
        if not len(true) or not len(plants):
            return
        away = np.linalg.norm(here[true, None] - plants.places[None], axis=2)
        away[away > np.maximum(SAME_M, truth.radii[true])[:, None]] = 1e3
        mine, theirs = linear_sum_assignment(away)
        for n, k in zip(mine.tolist(), theirs.tolist(), strict=True):
            if away[n, k] >= 1e3:
                continue
            number = int(true[n])
            self._ids[number].append(int(plants.ids[k]))
            if here[number, 0] < 1.0:
                error = plants.places[k] - here[number]
                self._tally.errors.append(error)
                self._tally.surprises.append(
                    float(error @ np.linalg.solve(plants.covariance[k], error)) / 2.0
                )

    def judge(self) -> None:
        """Count the plants that came and went."""
        counts = self._tally.counts
        for number in sorted(n for n in self._left if self._shown[n] >= FEWEST_PICTURES):
            ids = self._ids.get(number, [])
            counts["passed"] += 1
            counts["found"] += bool(ids)
            counts["kept"] += len(set(ids)) == 1


class _Machine:
    """Valves that open when told to: jets reach the ground after the latency.

    Attributes:
        jets: (lane, begin, end), s since the first picture.
    """

    def __init__(self, planner: SprayPlanner) -> None:
        self._planner = planner
        self._done: set[tuple[int, int]] = set()
        self.jets: list[tuple[int, float, float]] = []

    def hear(self, now: float, spray: Spray, speed: float) -> None:
        """Take a `spray` message; open the valves that are due before the next one comes."""
        half = (spray.weeds.radii + self._planner.margin) / max(speed, 1e-3)
        for number, lane, due, span in zip(
            spray.weeds.ids.tolist(), spray.lanes.tolist(), spray.times.tolist(), half.tolist(), strict=True
        ):
            if due - span > 1.0 / RATE or (number, lane) in self._done:
                continue
            self._done.add((number, lane))
            begin, end = now + max(due - span, 0.0), now + due + span
            if end > begin:
                self.jets.append((lane, begin + self._planner.latency, end + self._planner.latency))


def _judge_jets(
    out: Outing, machine: _Machine, said: list[tuple[Plants, Spray]], planner: SprayPlanner, tally: Tally
) -> None:
    """Where the boom truly was while the valves were open, and what stood there."""
    drive, truth, counts = out.drive, out.truth, tally.counts
    steps = np.arange(0, len(out.seen) * STEPS_PER_SECOND // RATE, STEP)
    seconds = steps / STEPS_PER_SECOND
    cos, sin = np.cos(drive.yaw[steps]), np.sin(drive.yaw[steps])
    near = np.flatnonzero(np.abs(truth.places[:, 1] - np.median(drive.y[steps])) < 2.0)
    dx = truth.places[near, 0, None] - drive.x[steps]
    dy = truth.places[near, 1, None] - drive.y[steps]
    ahead = cos * dx + sin * dy - planner.boom_x  # (plants, steps)
    left = cos * dy - sin * dx
    crossing = np.abs(ahead).argmin(axis=1)
    rows = np.arange(len(near))
    passed = (np.abs(ahead[rows, crossing]) < 0.02) & (np.abs(left[rows, crossing]) < ASIDE_M)
    way = np.hypot(drive.x[steps] - drive.x[0], drive.y[steps] - drive.y[0])
    passed &= way[crossing] > SETTLING_M
    jets = np.zeros((planner.lanes, len(steps)), np.bool_)
    for lane, begin, end in machine.jets:
        jets[lane, (seconds >= begin) & (seconds <= end)] = True
    radii, weed = truth.radii[near], truth.weed[near]
    clear, middle = _clear_weeds(ahead, left, crossing, radii, weed, planner)
    for n in np.flatnonzero(passed):
        if weed[n]:
            lane = int((left[n, crossing[n]] + 0.5 * planner.lanes * planner.width) / planner.width)
            hit = bool(jets[lane, max(crossing[n] - 1, 0) : crossing[n] + 2].any())
            counts["weeds"] += 1
            counts["sprayed"] += hit
            counts["clear"] += bool(clear[n])
            counts["clear sprayed"] += hit and bool(clear[n])
            if clear[n] and not hit:
                number = max(int((seconds[crossing[n]] - BEFORE_S) * RATE), 0)
                state = out.seen[number].state
                place = truth.from_robot(state.x, state.y, state.yaw)[near[n]]
                counts[cause_of_miss(place, max(SAME_M, radii[n]), *said[number])] += 1
            counts["middle clear"] += bool(middle[n])
            counts["middle sprayed"] += hit and bool(middle[n])
        else:
            around = np.flatnonzero(np.abs(ahead[n]) < radii[n])
            aside = np.abs(left[n, around][None] - planner.middles[:, None]) - 0.5 * planner.width
            wet = jets[:, around] & (np.hypot(np.maximum(aside, 0.0), ahead[n, around][None]) < radii[n])
            counts["crop"] += 1
            counts["crop hit"] += bool(wet.any())


def _clear_weeds(
    ahead: Array, left: Array, crossing: NDArray[np.intp], radii: Array, weed: Mask, planner: SprayPlanner
) -> tuple[Mask, Mask]:
    """Weeds that who knew all could spray whole, or at least in the middle, and keep the safety distance.

    The margin before and behind is in both. That is told from the truth alone: what is planned has no say.
    """
    whole, middle = np.zeros((2, len(weed)), np.bool_)
    for n in np.flatnonzero(weed):
        x, y = ahead[:, crossing[n]], left[:, crossing[n]]
        crop = np.flatnonzero(~weed & (np.hypot(x - x[n], y - y[n]) < 0.6))
        lanes = planner.middles[np.abs(planner.middles - y[n]) <= 0.5 * planner.width + 1e-9]
        aside = np.maximum(np.abs(y[crop, None] - lanes) - 0.5 * planner.width, 0.0)
        for clear, half in ((whole, radii[n] + planner.margin), (middle, planner.margin)):
            away = np.maximum(np.abs(x[crop] - x[n]) - half, 0.0)[:, None]
            kept = np.hypot(away, aside) >= radii[crop, None] + planner.safety
            clear[n] = kept.all(axis=0).any()
    return whole, middle
