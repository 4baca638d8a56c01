# SPDX-License-Identifier: Apache-2.0
"""Plan and map of the floor against the truth of simulated drives, on a real road, and what they cost."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.floor_scores import MapScores, PictureScores, joined, score_map
from bench.floor_truth import floor_truth
from bench.long_drive import Look, long_drive
from bench.report import Cell, Row, Table, at_least, at_most
from bench.road_motion import road_table
from bench.sources import MissingSetError
from robot_vision.mapping import PlanViewMapper, Pose
from robot_vision.perception import HeadingEstimator, LineDetector
from robot_vision.simulation.body import BodyState
from robot_vision.simulation.drive import STEPS_PER_SECOND
from robot_vision.simulation.record import ODOMETRY_RATE, build_world, drive_of
from robot_vision.simulation.renderer import Renderer
from robot_vision.simulation.sensors import CameraSensor, WheelOdometry
from robot_vision.simulation.sky import Clouds
from robot_vision.simulation.world import World, standard_camera

RATE = 15
CRATES: dict[str, float] = {"crates": 4, "disguised": 4, "bins": 1}
Asked = tuple[str, dict[str, float], int]
#: World, parameters and seed; none of these seeds was looked at while settings were chosen.
CORRIDORS: tuple[Asked, ...] = (
    ("corridor", {}, 101),
    ("corridor", CRATES, 102),
    ("corridor", CRATES, 103),
    ("corridor_blocked", {}, 104),
)
PATHS: tuple[Asked, ...] = (("path", {}, 105), ("path", {}, 106))
SECONDS, QUICK_S = 6.0, 2.0
_TRUTH_EVERY = 3
LONG_DRIVE = 10_000
_LOOKS = 30
"""Pictures of the first drive that the long drive is made of."""


@dataclass
class Drives:
    """Scores of several drives through worlds of one kind."""

    pictures: PictureScores = field(default_factory=PictureScores)
    maps: list[MapScores] = field(default_factory=list)
    clearance: list[bool] = field(default_factory=list)
    cpu_s: list[float] = field(default_factory=list)
    looks: list[Look] = field(default_factory=list)


def run(quick: bool) -> list[Table]:
    """Measure; with two seconds of the first drive of each kind when it is to be quick."""
    seconds = QUICK_S if quick else SECONDS
    kinds = [_drives(worlds[: 1 if quick else None], seconds) for worlds in (CORRIDORS, PATHS)]
    tables = [_table(kinds), _cost_table(kinds, 600 if quick else LONG_DRIVE)]
    try:
        tables.append(road_table())
    except MissingSetError as missing:
        tables.append(Table(f"KITTI, straight road: skipped, {missing}", ["off by"], []))
    return tables


def _drives(worlds: Any, seconds: float) -> Drives:
    drives = Drives()
    for name, parameters, seed in worlds:
        _drive(build_world(name, seed, parameters), seed, seconds, drives)
    return drives


def _drive(world: World, seed: int, seconds: float, drives: Drives) -> None:
    mapper, detector, estimator = PlanViewMapper(), LineDetector(), HeadingEstimator()
    told, true = [], []
    for number, (picture, reading, state) in enumerate(_pictures(world, seed, seconds)):
        stamp = number / RATE
        lines = detector.detect(np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8))
        points = estimator.update(lines, world.camera, stamp, float(reading[4])).vanishing_points
        began = time.process_time()
        pose = Pose(*(float(value) for value in reading[:3]))
        estimate = mapper.update(picture, lines, points, world.camera, stamp, pose)
        drives.cpu_s.append(time.process_time() - began)
        if len(drives.looks) < _LOOKS:
            drives.looks.append(Look(picture, lines, points, pose))
        told.append(pose[:2])
        true.append((state.x, state.y))
        if estimate.layers is not None and number % _TRUTH_EVERY == 0:
            drives.pictures.add(world, floor_truth(world, state), estimate.layers.boundary)
        _score_clearance(world, state, estimate.clearance, mapper.clearance.front, drives)
    grid = mapper.map.grid()
    if grid is not None:
        drives.maps.append(score_map(world, grid, np.array(told), np.array(true)))


def _score_clearance(
    world: World, state: BodyState, told: float | None, front: float, drives: Drives
) -> None:
    """Right within 5 % or 0.1 m once the box in the way is 5 m or less ahead of the robot's front."""
    box = next((item for item in world.objects if item.name == "box"), None)
    if box is None:
        return
    truth = float(box.footprint[:, 0].min()) - state.x - front
    if 0.64 < truth < 5.0:  # nearer, its foot is below the picture
        drives.clearance.append(told is not None and abs(told - truth) < max(0.1, 0.05 * truth))


def _pictures(
    world: World, seed: int, seconds: float
) -> Iterator[tuple[NDArray[np.uint8], NDArray[np.float64], BodyState]]:
    """Pictures of a recorded drive with odometry and the true state, as `record_world` writes them."""
    motion = drive_of(world, seconds, seed)
    readings = WheelOdometry(seed).read(motion, ODOMETRY_RATE)
    renderer, sensor, clouds = (
        Renderer(world.scene, world.camera),
        CameraSensor(seed),
        Clouds(world.clouds, seed),
    )
    for number in range(int(motion.seconds * RATE + 1e-6)):
        step = number * STEPS_PER_SECOND // RATE
        state = motion.state(step)
        light = renderer.render(state.camera_pose(world.camera))
        clouds.dim(light, step / STEPS_PER_SECOND)
        _, data = cv2.imencode(".jpg", sensor.capture(light), [cv2.IMWRITE_JPEG_QUALITY, 90])
        picture = np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), np.uint8)
        yield picture, readings[min(number * ODOMETRY_RATE // RATE, len(readings) - 1)], state


def _table(kinds: list[Drives]) -> Table:
    def row(name: str, values: list[float], marks: list[Any], unit: str = "%", digits: int = 1) -> Row:
        factor = 100.0 if unit == "%" else 1.0
        cells = [
            None if np.isnan(value) else Cell(factor * value, mark)
            for value, mark in zip(values, marks, strict=True)
        ]
        return Row(name, unit, cells, digits)

    def mean(name: str) -> list[float]:
        return [float(np.mean(getattr(kind.pictures, name) or [np.nan])) for kind in kinds]

    def maps(name: str) -> list[float]:
        return [float(np.mean([getattr(scores, name) for scores in kind.maps])) for kind in kinds]

    def distance(share: float) -> list[float]:
        return [float(np.quantile(kind.pictures.distance or [np.nan], share)) for kind in kinds]

    def seen(kind: str) -> list[float]:
        return [joined([drives.pictures.found], kind) for drives in kinds]

    def mapped(kind: str) -> list[float]:
        return [joined([scores.found for scores in drives.maps], kind) for drives in kinds]

    def both(mark: Any) -> list[Any]:
        return [mark, mark]

    rows = [
        row("floor of a picture up to 6 m, IoU", mean("iou"), [at_least(97), at_least(93)]),
        row("floor of the map, IoU", maps("iou"), both(at_least(95))),
        row("objects of 0.2 m or more seen, pictures", seen("distinct"), both(at_least(95))),
        row("objects that look like the floor seen, pictures", seen("disguised"), both(at_least(50))),
        row("objects of 0.2 m or more in the map", mapped("distinct"), both(None)),
        row("objects that look like the floor in the map", mapped("disguised"), both(at_least(90))),
        row("free cells of the map called taken", maps("false_of_free"), both(at_most(3))),
        row("taken cells of the map that are free", maps("false_of_taken"), both(at_most(3)), digits=2),
        row("shadow called object, pictures", mean("shadow"), both(at_most(8))),
        row("shadow called object, map", maps("shadow_away"), both(at_most(2))),
        row("the same with cells within 15 cm of an object", maps("shadow"), both(at_most(2))),
        row("distance of seen objects, error, median", distance(0.5), both(at_most(3))),
        row("distance of seen objects, error, p95", distance(0.95), both(at_most(8))),
        row(
            "clearance within 5 % or 0.1 m, from 5 m on",
            [float(np.mean(kind.clearance)) if kind.clearance else np.nan for kind in kinds],
            both(at_least(100)),
        ),
    ]
    title = "Plan of the floor: simulated drives, against their truth"
    note = "free: more than 15 cm from anything real; seeds other than those the settings were chosen on"
    return Table(title, ["corridor", "path"], rows, [note])


def _cost_table(kinds: list[Drives], long: int) -> Table:
    spent = 1e3 * np.array([second for kind in kinds for second in kind.cpu_s])
    rows = [
        Row("a picture, median", "ms", [Cell(float(np.median(spent)), at_most(40.0))]),
        Row("a picture, p95", "ms", [Cell(float(np.quantile(spent, 0.95)))]),
        *long_drive(kinds[0].looks, standard_camera(), long),
    ]
    return Table("Plan of the floor: CPU on one core, 640x480", ["mapper"], rows)
