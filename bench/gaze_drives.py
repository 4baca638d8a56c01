# SPDX-License-Identifier: Apache-2.0
"""Drives with a camera that is fixed, and with one on a head that goes where `look_at` says, in one process."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.control import CorridorSteering
from robot_vision.geometry import Camera
from robot_vision.perception import LineDetector
from robot_vision.perception.gaze import Gaze
from robot_vision.perception.odometry import MotionHistory
from robot_vision.perception.way import Kind, WayEstimate, WayEstimator
from robot_vision.simulation.body import BodyState
from robot_vision.simulation.drive import STEPS_PER_SECOND, FollowSettings
from robot_vision.simulation.follow import following
from robot_vision.simulation.head import Head, HeadSettings
from robot_vision.simulation.live import LiveDrive, LiveSettings
from robot_vision.simulation.renderer import Renderer
from robot_vision.simulation.sensors import CameraSensor
from robot_vision.simulation.vehicle import VehicleSettings
from robot_vision.simulation.world import World

Array = NDArray[np.float64]

RATE = 10


@dataclass(frozen=True)
class Moment:
    """One picture of a drive: what it told, and what is true.

    Attributes:
        time_s: since the start.
        way: what the picture told.
        gaze: where to look next.
        state: where the robot was.
        camera: as it looked.
        picture: uint8 (H, W, 3) BGR.
    """

    time_s: float
    way: WayEstimate
    gaze: Gaze | None
    state: BodyState
    camera: Camera
    picture: NDArray[np.uint8]


def on_road(
    world: World, seed: int, head: HeadSettings | None, seconds: float, speed: float
) -> Iterator[Moment]:
    """Drive along a road as the pictures tell, the loop of steering and that of looking closed."""
    able = VehicleSettings(kind="ackermann", most_speed=12.0)
    how = LiveSettings(rate=RATE, vehicle=able, lean=np.radians(0.3), head=head, timeout=0.5)
    drive = LiveDrive(world, how, seed)
    steering = CorridorSteering(speed=speed, lookahead=4.0, most_acceleration=1.0)
    eyes = _Eyes(Kind.ROAD)
    while drive.time_ns < seconds * 1e9 and not drive.at_the_end and not drive.in_contact:
        now = drive.time_ns / 1e9
        picture = drive.picture()
        way, gaze = eyes.see(picture, drive.camera, now)
        yield Moment(now, way, gaze, drive.state, drive.camera, picture)
        command = steering.update(way.lane, now, path=way.path)
        drive.steer(command.speed, command.turn_rate)
        if drive.head is not None and gaze is not None:
            drive.head.look_at(gaze.point.tolist())
        for said in drive.advance():
            eyes.motion.add(said.time_ns / 1e9, said.reading.speed, said.reading.turn_rate)


def along_lane(world: World, seed: int, head: HeadSettings | None, seconds: float) -> Iterator[Moment]:
    """Drive along a lane by what is true, whatever the pictures tell; only the loop of looking is closed."""
    assert isinstance(world.drive, FollowSettings)
    motion = following(world, seconds, world.drive, seed)
    turning = None if head is None else Head(head, world.camera)
    renderer, sensor, eyes = Renderer(world.scene, world.camera), CameraSensor(seed), _Eyes(Kind.CORRIDOR)
    steps = STEPS_PER_SECOND // RATE
    for number in range(int(seconds * RATE)):
        now, state = number / RATE, motion.state(number * steps)
        camera = world.camera if turning is None else turning.camera
        picture = sensor.capture(renderer.render(state.camera_pose(camera)))
        eyes.motion.add(now, state.speed, state.turn_rate)
        way, gaze = eyes.see(picture, camera, now)
        yield Moment(now, way, gaze, state, camera, picture)
        if turning is not None and gaze is not None:
            turning.look_at(gaze.point.tolist())
            for _ in range(steps):
                turning.step(1 / STEPS_PER_SECOND)


class _Eyes:
    """From pictures to the way, as the nodes do it."""

    def __init__(self, kind: Kind) -> None:
        self.motion = MotionHistory()
        self._lines, self._ways = LineDetector(), WayEstimator(kind=kind, path_length=30.0)
        self._before = 0.0

    def see(self, picture: NDArray[np.uint8], camera: Camera, now: float) -> tuple[WayEstimate, Gaze | None]:
        lines = self._lines.detect(np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8))
        speed, turn_rate = self.motion.mean(self._before, now)
        self._before = now
        return self._ways.update(lines, camera, now, speed, turn_rate), self._ways.look()


def with_lens(world: World, focal: float) -> World:
    """The same world seen through another lens, px."""
    return replace(world, camera=replace(world.camera, fx=focal, fy=focal))


def share_in_view(moment: Moment, points: Array) -> float:
    """Share of floor points (N, 2) of the world, m, that are in the picture."""
    pose = moment.state.camera_pose(moment.camera)
    places = np.column_stack([points, np.zeros(len(points))])
    u, v = moment.camera.pixels((places - pose[:3, 3]) @ pose[:3, :3]).T
    inside = (u >= 0) & (u <= moment.camera.width - 1) & (v >= 0) & (v <= moment.camera.height - 1)
    return float(inside.mean())
