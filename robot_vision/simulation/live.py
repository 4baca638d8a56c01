# SPDX-License-Identifier: Apache-2.0
"""A world with a vehicle in it that obeys commands as they come: the loop from camera to steering is closed here."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.simulation.body import BodyState, RoughGround, Sway
from robot_vision.simulation.drive import STEPS_PER_SECOND
from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.floor_plan import Room, Surroundings
from robot_vision.simulation.head import Head, HeadSettings
from robot_vision.simulation.lane import LanePose
from robot_vision.simulation.odometry import Odometer, Reading
from robot_vision.simulation.record import END_GAP, ODOMETRY_RATE
from robot_vision.simulation.renderer import Renderer
from robot_vision.simulation.score import DriveScore, known
from robot_vision.simulation.sensors import CameraSensor, WheelOdometry
from robot_vision.simulation.sky import Clouds
from robot_vision.simulation.vehicle import Vehicle, VehicleSettings
from robot_vision.simulation.world import World

END_SHARE = 0.15
"""Of the lane's length: a lane through a small maze is over so near to its end, if that is nearer than END_GAP."""
_LOOK_STEPS = 10
"""Contact is looked for 60 times a second: every 17 mm at 1 m/s."""
_STILL = 0.01
"""Slower than this, m/s and rad/s, the robot stands."""
_PARTED_M = 0.02
"""A contact is over when there is so much room again."""
_ODOMETRY_STEPS = STEPS_PER_SECOND // ODOMETRY_RATE


@dataclass(frozen=True)
class LiveSettings:
    """How a world is driven through.

    Attributes:
        rate: pictures a second.
        vehicle: what is driven.
        offset: of the start to the left of the world's own start, metres.
        yaw: of the start relative to it, radians, counter-clockwise.
        lean: greatest roll and pitch of the body while it drives, radians.
        roughness: standard deviation of the ground's height, metres.
        noise: factor on the noise of camera and wheels; 0: none.
        delay: from a picture to the moment its steering takes effect, seconds.
        timeout: a command older than this is not obeyed: the vehicle stops, seconds.
        settling: metres of way that do not count for the score, in which the start is steered out.
        width: of the robot, metres; None: as the world has it.
        length: likewise.
        head: that turns the camera; None: the camera is fixed to the body.
    """

    rate: int = 15
    vehicle: VehicleSettings = field(default_factory=VehicleSettings)
    offset: float = 0.0
    yaw: float = 0.0
    lean: float = 0.0
    roughness: float = 0.0
    noise: float = 1.0
    delay: float = 0.03
    timeout: float = 0.5
    settling: float = 5.0
    width: float | None = None
    length: float | None = None
    head: HeadSettings | None = None

    def __post_init__(self) -> None:
        if not 0 < self.rate <= 60 or STEPS_PER_SECOND % self.rate:
            raise SimulationError(f"rate must be at most 60 and divide {STEPS_PER_SECOND}, not {self.rate}")
        for name in ("lean", "noise", "delay", "settling"):
            if not 0 <= getattr(self, name) < np.inf:
                raise SimulationError(f"{name} must be 0 or more, not {getattr(self, name)}")
        if self.timeout <= 0:
            raise SimulationError(f"timeout must be positive, not {self.timeout} s")


class OdometryAt(NamedTuple):
    """A reading of the wheels and its time in nanoseconds since the start."""

    time_ns: int
    reading: Reading


STANDING = OdometryAt(0, Reading(0.0, 0.0, 0.0, 0.0, 0.0))
"""What the wheels say before they have moved."""


class _Command(NamedTuple):
    given: int  # step of the picture it answers
    starts: int  # step at which it takes effect
    speed: float
    turn_rate: float


class LiveDrive:
    """Drives one vehicle through one world, from picture to picture.

    What it touches stops it; it may back off or turn away from there. The same commands at the same
    times give the same pictures.

    Args:
        world: where.
        settings: how.
        seed: of noise and leaning.

    Raises:
        SimulationError: the robot would start inside something, or settings that make no sense.

    Attributes:
        score: how it went so far.
        head: that turns the camera; None where it is fixed.
    """

    def __init__(self, world: World, settings: LiveSettings | None = None, seed: int = 0) -> None:
        how = settings or LiveSettings()
        self.world, self.settings = world, how
        x, y, yaw = world.beginning
        self._vehicle = Vehicle(
            how.vehicle, x - how.offset * np.sin(yaw), y + how.offset * np.cos(yaw), yaw + how.yaw
        )
        self._surroundings = Surroundings(world, how.width, how.length)
        self.score = DriveScore(how.settling)
        room = self._room()
        if room.clearance == 0.0:
            raise SimulationError(f"{world.name}: the robot would start inside {room.nearest}")
        self.score.see(room)
        random = np.random.default_rng((seed, 8))
        self._sways = [Sway.draw(random, how.lean) for _ in range(2)]
        self._ground = RoughGround(how.roughness, seed)
        self.head = None if how.head is None else Head(how.head, world.camera)
        self._renderer = Renderer(world.scene, world.camera)
        usual = CameraSensor()
        self._sensor = CameraSensor(
            seed, noise=how.noise * usual.noise, dark_noise=how.noise * usual.dark_noise
        )
        self._clouds = Clouds(world.clouds, seed)
        self._odometer = Odometer(_wheels(how.noise, seed))
        self._commands: deque[_Command] = deque()
        self._step = self._moved = 0
        self._rolled = self._turned = 0.0
        self._in_contact = False
        self._free = self._vehicle.x, self._vehicle.y, self._vehicle.yaw

    @property
    def time_ns(self) -> int:
        """Simulated time since the start, nanoseconds."""
        return self._step * 1_000_000_000 // STEPS_PER_SECOND

    @property
    def way(self) -> float:
        """Metres rolled since the start."""
        return self._vehicle.way

    @property
    def state(self) -> BodyState:
        """Where the robot is now, how it moves and leans."""
        vehicle, time = self._vehicle, self._step / STEPS_PER_SECOND
        roll, pitch = (float(sway.at(time)[0]) for sway in self._sways)
        rough_roll, rough_pitch, rise = (float(part[0]) for part in self._ground.lean(vehicle.way))
        return BodyState(
            vehicle.x,
            vehicle.y,
            vehicle.yaw,
            vehicle.speed,
            vehicle.turn_rate,
            roll + rough_roll,
            pitch + rough_pitch,
            rise,
        )

    @property
    def camera(self) -> Camera:
        """The camera as it looks now."""
        return self.world.camera if self.head is None else self.head.camera

    @property
    def in_contact(self) -> bool:
        """Whether the robot leans on something."""
        return self._in_contact

    @property
    def stood_s(self) -> float:
        """How long the robot has stood by now, simulated seconds."""
        return (self._step - self._moved) / STEPS_PER_SECOND

    @property
    def lane_pose(self) -> LanePose | None:
        """Where the robot is in its lane; None where there is none."""
        lane, vehicle = self.world.lane, self._vehicle
        return None if lane is None else lane.locate(vehicle.x, vehicle.y, vehicle.yaw)

    @property
    def at_the_end(self) -> bool:
        """Whether the lane is over."""
        lane, pose = self.world.lane, self.lane_pose
        if lane is None or pose is None:
            return False
        return pose.along >= lane.length - min(END_GAP, END_SHARE * lane.length)

    def picture(self) -> NDArray[np.uint8]:
        """What the camera takes now, uint8 (H, W, 3) BGR; once a moment: each has noise of its own."""
        light = self._renderer.render(self.state.camera_pose(self.camera))
        self._clouds.dim(light, self._step / STEPS_PER_SECOND)
        return self._sensor.capture(light)

    def summary(self) -> dict[str, float | int | str | None]:
        """Numbers and names for a report: seconds, metres, radians; None for what is not known."""
        pose = self.lane_pose
        return {
            "time_s": known(self.time_ns / 1e9),
            "way_m": known(self.way),
            "offset_m": None if pose is None else known(pose.offset),
            "yaw_rad": None if pose is None else known(pose.yaw),
            **self.score.summary(),
        }

    def warm_up(self) -> None:
        """Compile what makes pictures, without taking one."""
        self._renderer.render(self.state.camera_pose(self.world.camera))

    def steer(self, speed: float, turn_rate: float, picture_ns: int | None = None) -> None:
        """Give a command; it holds until another one takes effect or its time is over.

        Args:
            speed: m/s ahead.
            turn_rate: rad/s, counter-clockwise.
            picture_ns: time of the picture it answers; None: now.

        Raises:
            SimulationError: it is too old to be obeyed, is from the future, or is not finite.
        """
        if not (np.isfinite(speed) and np.isfinite(turn_rate)):
            raise SimulationError(
                f"a speed of {speed} m/s and a turn rate of {turn_rate} rad/s make no sense"
            )
        time_ns = self.time_ns if picture_ns is None else picture_ns
        age = (self.time_ns - time_ns) / 1e9
        if age > self.settings.timeout:
            raise SimulationError(f"it answers a picture {age:.2f} s old; not obeyed")
        if age < 0:
            raise SimulationError(f"its stamp is {-age:.2f} s ahead of the simulated time; not obeyed")
        given = round(time_ns * STEPS_PER_SECOND / 1e9)
        starts = max(self._step, given + round(self.settings.delay * STEPS_PER_SECOND))
        self._commands.append(_Command(given, starts, float(speed), float(turn_rate)))

    @property
    def obeys(self) -> bool:
        """Whether there is a command young enough to be obeyed."""
        return self._command() is not None

    def advance(self) -> list[OdometryAt]:
        """Drive on to the moment of the next picture; returns what the wheels said up to and with it."""
        said = []
        for _ in range(STEPS_PER_SECOND // self.settings.rate):
            self._drive_a_step()
            if self._step % _ODOMETRY_STEPS == 0:
                seconds = 1 / ODOMETRY_RATE
                reading = self._odometer.read(self._rolled / seconds, self._turned / seconds, seconds)
                said.append(OdometryAt(self.time_ns, reading))
                self._rolled = self._turned = 0.0
        pose = self.lane_pose
        if pose is not None:
            self.score.follow(self.way, pose.offset)
        return said

    def _drive_a_step(self) -> None:
        command = self._command()
        speed, turn_rate = (command.speed, command.turn_rate) if command else (0.0, 0.0)
        vehicle = self._vehicle
        vehicle.step(speed, turn_rate, 1 / STEPS_PER_SECOND)
        if self.head is not None:
            self.head.step(1 / STEPS_PER_SECOND)
        self._step += 1
        if max(abs(vehicle.speed), abs(vehicle.turn_rate)) > _STILL:
            self._moved = self._step
        self._rolled += vehicle.speed / STEPS_PER_SECOND
        self._turned += vehicle.turn_rate / STEPS_PER_SECOND
        if self._step % _LOOK_STEPS == 0 or self._in_contact:
            self._look_for_contact()

    def _look_for_contact(self) -> None:
        room, vehicle = self._room(), self._vehicle
        if room.clearance > 0.0:
            self._free = vehicle.x, vehicle.y, vehicle.yaw
            self._in_contact = self._in_contact and room.clearance < _PARTED_M
            self.score.see(room)
            return
        if not self._in_contact:
            self.score.touch(room)
        self._in_contact = True
        vehicle.x, vehicle.y, vehicle.yaw = self._free  # what stands there does not give way
        vehicle.halt()

    def _room(self) -> Room:
        vehicle = self._vehicle
        return self._surroundings.at(vehicle.x, vehicle.y, vehicle.yaw)

    def _command(self) -> _Command | None:
        """The newest command that has taken effect, unless it is too old."""
        while len(self._commands) > 1 and self._commands[1].starts <= self._step:
            self._commands.popleft()
        if not self._commands or self._commands[0].starts > self._step:
            return None
        oldest = self._step - round(self.settings.timeout * STEPS_PER_SECOND)
        return self._commands[0] if self._commands[0].given >= oldest else None


def _wheels(noise: float, seed: int) -> WheelOdometry:
    usual = WheelOdometry()
    return WheelOdometry(
        seed,
        noise * usual.speed_scale,
        noise * usual.turn_scale,
        noise * usual.speed_noise,
        noise * usual.turn_noise,
    )
