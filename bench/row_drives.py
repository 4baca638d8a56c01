# SPDX-License-Identifier: Apache-2.0
"""Drives through simulated fields, in one process: recorded as bags are, or closed through tracker and steering."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_vision.control import CorridorSteering
from robot_vision.perception.crop_rows.row_filter import Motion
from robot_vision.perception.crop_rows.tracker import RowEstimate, RowTracker
from robot_vision.simulation.body import BodyState
from robot_vision.simulation.drive import STEPS_PER_SECOND
from robot_vision.simulation.drive import Motion as Drive
from robot_vision.simulation.live import LiveDrive, LiveSettings
from robot_vision.simulation.odometry import Reading
from robot_vision.simulation.record import ODOMETRY_RATE, build_world, drive_of
from robot_vision.simulation.renderer import Renderer
from robot_vision.simulation.sensors import CameraSensor, WheelOdometry
from robot_vision.simulation.sky import Clouds
from robot_vision.simulation.world import World

RATE = 10
SETTLING_M = 3.0
LONGEST_S = 60


@dataclass
class Told:
    """What was said and true along one drive, one entry a picture.

    Attributes:
        along: true way along the lane, m.
        offset: true, m.
        errors: (offset, yaw) said less true, m and rad; nan where nothing was said.
        variances: claimed with them.
        ends: way along the lane at which the rows were said to end, m; nan where no end was known.
        reasons: why a picture gave nothing.
        stopped: whether the steering came to a stop by itself.
    """

    along: list[float] = field(default_factory=list)
    offset: list[float] = field(default_factory=list)
    errors: list[tuple[float, float]] = field(default_factory=list)
    variances: list[tuple[float, float]] = field(default_factory=list)
    ends: list[float] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    stopped: bool = False

    def take(self, world: World, place: tuple[float, float, float], estimate: RowEstimate) -> None:
        """Take down one picture; `place` is x, y (m) and yaw (rad) in the world."""
        assert world.lane is not None
        pose = world.lane.locate(*place)
        lane = estimate.lane
        self.along.append(pose.along)
        self.offset.append(pose.offset)
        self.ends.append(np.nan if estimate.end is None else pose.along + estimate.end)
        self.reasons.append(estimate.reason)
        if lane is None:
            self.errors.append((np.nan, np.nan))
            self.variances.append((np.nan, np.nan))
        else:
            self.errors.append((lane.offset - pose.offset, lane.yaw - pose.yaw))
            self.variances.append((lane.offset_variance, lane.yaw_variance))

    def rms(self) -> NDArray[np.float64]:
        """Root mean square errors of offset (m) and yaw (rad): (2,)."""
        return np.asarray(np.sqrt(np.nanmean(np.square(self.errors), axis=0)))

    def normalised(self) -> NDArray[np.float64]:
        """Mean squared errors over their variances: (2,), 1 when honest."""
        return np.asarray(np.nanmean(np.square(self.errors) / np.array(self.variances), axis=0))

    def kept(self) -> NDArray[np.float64]:
        """True offsets after settling, m."""
        along = np.array(self.along)
        return np.asarray(np.array(self.offset)[along > along[0] + SETTLING_M])


def recorded(settings: dict[str, Any], seed: int, seconds: float) -> Told:
    """Let the tracker look at a drive as `robot-vision simulate field` records it.

    Args:
        settings: of the field.
        seed: of field, drive and noise.
        seconds: of the drive.
    """
    world, _, pictures = recorded_pictures(settings, seed, seconds)
    tracker, told = RowTracker(_spacing(settings)), Told()
    for picture, state, since in pictures:
        told.take(world, (state.x, state.y, state.yaw), tracker.update(picture, world.camera, moved(since)))
    return told


def recorded_pictures(
    settings: dict[str, Any], seed: int, seconds: float
) -> tuple[World, Drive, Iterator[tuple[NDArray[np.uint8], BodyState, list[Reading]]]]:
    """A field, the drive through it, and picture by picture where the robot is and what the wheels said since."""
    world = build_world("field", seed, settings)
    motion = drive_of(world, seconds, seed)
    readings = [Reading(*map(float, row)) for row in WheelOdometry(seed).read(motion, ODOMETRY_RATE)]

    def pictures() -> Iterator[tuple[NDArray[np.uint8], BodyState, list[Reading]]]:
        renderer, sensor = Renderer(world.scene, world.camera), CameraSensor(seed)
        clouds = Clouds(world.clouds, seed)
        for number, step in enumerate(_steps(motion)):
            state = motion.state(step)
            light = renderer.render(state.camera_pose(world.camera))
            clouds.dim(light, step / STEPS_PER_SECOND)
            yield sensor.capture(light), state, readings[3 * number - 2 : 3 * number + 1] if number else []

    return world, motion, pictures()


def closed(settings: dict[str, Any], seed: int, speed: float, live: LiveSettings, past_end: bool) -> Told:
    """Let tracker and steering drive through a field by themselves.

    Args:
        settings: of the field.
        seed: of field and noise.
        speed: wanted, m/s.
        live: how the world is driven through; at 10 pictures a second.
        past_end: drive on until the steering stops by itself.
    """
    world = build_world("field", seed, settings)
    drive, law = (
        LiveDrive(world, live, seed),
        CorridorSteering(
            speed=speed,
            lookahead=1.6,
            most_acceleration=1.0,
            stop_distance=0.1,
            yaw_trusted=0.1,
            offset_trusted=0.12,
        ),
    )
    tracker, told, since = RowTracker(_spacing(settings)), Told(), list[Reading]()
    for _ in range(LONGEST_S * live.rate):
        estimate = tracker.update(drive.picture(), world.camera, moved(since))
        steering = law.update(estimate.lane, 1e-9 * drive.time_ns, estimate.end)
        drive.steer(steering.speed, steering.turn_rate, drive.time_ns)
        state = drive.state
        told.take(world, (state.x, state.y, state.yaw), estimate)
        told.stopped = steering.speed == 0.0 and drive.way > SETTLING_M
        assert world.lane is not None
        over = told.along[-1] > world.lane.length + 2.0
        if told.stopped or over or (drive.at_the_end and not past_end):
            break
        since = [said.reading for said in drive.advance()]
    return told


def _spacing(settings: dict[str, Any]) -> float:
    return float(settings.get("spacing", 0.5))


def _steps(motion: Drive) -> Iterator[int]:
    yield from range(0, len(motion.x) - 1, STEPS_PER_SECOND // RATE)


def moved(since: list[Reading]) -> Motion:
    """The motion that readings since the last picture tell."""
    if not since:
        return Motion(0.0)
    speed, turn_rate = np.mean([(said.speed, said.turn_rate) for said in since], axis=0).tolist()
    return Motion(len(since) / ODOMETRY_RATE, speed, turn_rate)
