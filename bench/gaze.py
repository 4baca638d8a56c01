# SPDX-License-Identifier: Apache-2.0
"""What a head that goes where `look_at` says adds to a fixed camera: the way in view, and how well it is known."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bench.gaze_drives import RATE, Moment, along_lane, on_road, share_in_view, with_lens
from bench.report import Cell, Row, Table
from robot_vision.geometry.rotation import wrap_angle
from robot_vision.simulation.head import HeadSettings
from robot_vision.simulation.lane import Lane
from robot_vision.simulation.record import build_world
from robot_vision.simulation.world import World

SEEDS, QUICK_SEEDS = range(201, 204), range(201, 202)
"""None of those with which the planner's settings were chosen."""
SECONDS, QUICK_SECONDS = 14.0, 6.0
SETTLING_S = 4.0
STRETCH_M, CORNERS_M = (3.0, 15.0), (1.5, 6.0)
"""Of the way ahead that is to be in view, on roads and in corridors 2 m wide."""
ROADS = {
    "the bends it usually has, a lens of 70 degrees": ({}, 460.0, 8.0),
    "the sharpest bends, a lens of 70 degrees": ({"curvature": 0.05, "bend": 40.0}, 460.0, 5.0),
    "the sharpest bends, a lens of 50 degrees": ({"curvature": 0.05, "bend": 40.0}, 686.0, 5.0),
}
"""Settings of the road, focal length (px), speed (m/s)."""
MAZE = {"cell": 2.0, "rows": 8.0, "columns": 8.0}
EYE_M, EYE_PITCH = 0.45, 0.1
"""Of the camera in the maze, below the walls' upper edge: what lies behind them is not in view."""


@dataclass(frozen=True)
class Score:
    """How a drive went after settling, N pictures.

    Attributes:
        in_view: (N,) share of a stretch of the way ahead that is in the picture.
        yaw: (N,) error of the heading, rad; nan where none is said.
        curvature: (N,) error of the curvature beside the robot, 1/m; nan likewise.
        far: (N,) error of the way's direction at the end of that stretch, rad; nan likewise.
        pan: (N,) of the head, rad.
    """

    in_view: NDArray[np.float64]
    yaw: NDArray[np.float64]
    curvature: NDArray[np.float64]
    far: NDArray[np.float64]
    pan: NDArray[np.float64]

    @property
    def longest_without(self) -> float:
        """Longest time without a heading, s."""
        longest = run = 0
        for missing in np.isnan(self.yaw):
            run = run + 1 if missing else 0
            longest = max(longest, run)
        return longest / RATE


def run(quick: bool) -> list[Table]:
    """Drive with both cameras through the same worlds."""
    seeds, seconds = (QUICK_SEEDS, QUICK_SECONDS) if quick else (SEEDS, SECONDS)
    return [*(_road(name, seeds, seconds) for name in ROADS), _corners(seeds, seconds)]


def _road(name: str, seeds: Iterable[int], seconds: float) -> Table:
    settings, focal, speed = ROADS[name]
    worlds = {seed: with_lens(build_world("road", seed, settings), focal) for seed in seeds}
    scores = [
        [score(world, on_road(world, seed, head, seconds, speed)) for seed, world in worlds.items()]
        for head in (None, HeadSettings())
    ]
    return _table(f"Road, {name}: {len(worlds)} drives of {seconds:g} s at {speed:g} m/s", scores)


def _corners(seeds: Iterable[int], seconds: float) -> Table:
    worlds = {seed: maze(seed) for seed in seeds}
    scores = [
        [
            score(world, along_lane(world, seed, head, seconds), CORNERS_M, axes=True)
            for seed, world in worlds.items()
        ]
        for head in (None, HeadSettings())
    ]
    title = f"Corridors with corners, a lens of 50 degrees: {len(worlds)} drives of {seconds:g} s along their middle"
    return _table(title, scores, CORNERS_M)


def maze(seed: int) -> World:
    """Corridors of 2 m with corners, seen from below the upper edge of their walls."""
    world = build_world("maze", seed, MAZE)
    seen = with_lens(world, 686.0)
    return replace(seen, camera=replace(seen.camera, height_m=EYE_M, pitch=EYE_PITCH))


def score(
    world: World, moments: Iterable[Moment], stretch: tuple[float, float] = STRETCH_M, axes: bool = False
) -> Score:
    """Hold each picture of a drive against the truth.

    Args:
        world: driven through.
        moments: of the drive.
        stretch: of the way ahead that is to be in view, from and to, m.
        axes: whether the way is told by corridors along the axes of the world, whichever the robot comes from, and not
            by a lane that rounds corners.
    """
    assert world.lane is not None
    middle: Lane = getattr(world.lane, "road", world.lane)
    rows = []
    for moment in moments:
        if moment.time_s < SETTLING_S:
            continue
        state, way = moment.state, moment.way
        pose = middle.locate(state.x, state.y, state.yaw)
        ahead = [
            world.lane.point(pose.along + away)[:2] for away in np.arange(stretch[0], stretch[1] + 0.25, 0.5)
        ]
        true_yaw = state.yaw if axes else pose.yaw
        yaw = math.nan if way.lane is None else wrap_angle(way.lane.yaw - true_yaw)
        yaw = math.remainder(yaw, math.pi / 2) if axes else yaw
        bend = far = math.nan
        if way.road is not None:
            # The line followed may be the middle of a lane: its own curvature is what the estimate tells
            aside = pose.offset - way.road.offset
            bend = way.road.curvature - pose.curvature / (1.0 - aside * pose.curvature)
            there = middle.point(pose.along + stretch[1]).yaw - state.yaw
            far = wrap_angle(float(way.road.bearings([stretch[1]])[0][0]) - there)
        rows.append((share_in_view(moment, np.array(ahead)), yaw, bend, far, moment.camera.pan))
    return Score(*np.array(rows).T)


def _table(title: str, scores: list[list[Score]], stretch: tuple[float, float] = STRETCH_M) -> Table:
    def cells(value: Callable[[list[Score]], float]) -> list[Cell]:
        return [Cell(float(value(drives))) for drives in scores]

    def joined(drives: list[Score], name: str) -> NDArray[np.float64]:
        return np.concatenate([getattr(one, name) for one in drives])

    def rms(drives: list[Score], name: str) -> float:
        values = joined(drives, name)
        return float(np.sqrt(np.nanmean(values**2))) if np.isfinite(values).any() else math.nan

    rows = [
        Row(
            f"way from {stretch[0]:g} to {stretch[1]:g} m ahead in view",
            "%",
            cells(lambda drives: 100.0 * joined(drives, "in_view").mean()),
        ),
        Row("heading error, RMS", "deg", cells(lambda drives: math.degrees(rms(drives, "yaw"))), 2),
        Row("curvature error, RMS", "1/km", cells(lambda drives: 1e3 * rms(drives, "curvature")), 1),
        Row(
            f"direction {stretch[1]:g} m ahead, error, RMS",
            "deg",
            cells(lambda drives: math.degrees(rms(drives, "far"))),
            2,
        ),
        Row(
            "pictures without a heading",
            "%",
            cells(lambda drives: 100.0 * np.isnan(joined(drives, "yaw")).mean()),
        ),
        Row(
            "longest time without, all drives",
            "s",
            cells(lambda drives: max(one.longest_without for one in drives)),
        ),
        Row("pan, mean", "deg", cells(lambda drives: math.degrees(np.abs(joined(drives, "pan")).mean()))),
    ]
    return Table(title, ["fixed camera", "on a head"], rows)
