# SPDX-License-Identifier: Apache-2.0
"""Makes a bag of a world: what the robot's sensors would have said, and beside it what was true."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from robot_vision.geometry import Camera
from robot_vision.simulation import sensed
from robot_vision.simulation.asked import Value, settings_of, sort_out
from robot_vision.simulation.corridor import BlockedSettings, CorridorSettings, corridor, corridor_blocked
from robot_vision.simulation.drive import (
    STEPS_PER_SECOND,
    FollowSettings,
    Motion,
    WeavingSettings,
    weaving,
)
from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.field import field
from robot_vision.simulation.field_plan import FieldSettings
from robot_vision.simulation.floor_plan import Surroundings
from robot_vision.simulation.follow import following
from robot_vision.simulation.maze import MazeSettings, maze
from robot_vision.simulation.odometry import Reading
from robot_vision.simulation.path import PathSettings, path
from robot_vision.simulation.plate import PlateSettings, plate
from robot_vision.simulation.renderer import Renderer
from robot_vision.simulation.road import RoadSettings, road
from robot_vision.simulation.sensed import PictureFormat
from robot_vision.simulation.sensors import CameraSensor, WheelOdometry
from robot_vision.simulation.sky import Clouds
from robot_vision.simulation.truth import Said, TruthTeller
from robot_vision.simulation.world import StraightLane, World

START_NS = 1_700_000_000_000_000_000
"""Stamp of the first picture, so that the same command gives the same bag."""
ODOMETRY_RATE = 30
END_GAP = 1.5
"""Metres a weaving robot keeps from the end of the lane."""

Progress = Callable[[int, int], None]
"""Called with (pictures made, pictures in all)."""


@dataclass(frozen=True)
class WorldKind:
    """A world that can be asked for by name: its parameters and how it is built from them and a seed."""

    settings: type[Any]
    build: Callable[[Any, int], World]
    about: str


WORLDS: Mapping[str, WorldKind] = MappingProxyType(
    {
        "corridor": WorldKind(
            CorridorSettings, corridor, "office corridor with doors, lamps and a window at its end"
        ),
        "corridor_blocked": WorldKind(
            BlockedSettings,
            corridor_blocked,
            "corridor with a person-sized box in the way, waste bins and a chair",
        ),
        "field": WorldKind(FieldSettings, field, "field of row crops with weeds, gaps and a headland"),
        "maze": WorldKind(
            MazeSettings, maze, "maze of any drawing, or grown, at the size of mice or of rooms"
        ),
        "plate": WorldKind(PlateSettings, plate, "room with an inspection plate of holes"),
        "road": WorldKind(RoadSettings, road, "country road that winds between hedges, its paint worn"),
        "path": WorldKind(
            PathSettings, path, "path of flagstones between pillars, with bollards and litter bins"
        ),
    }
)


@dataclass(frozen=True)
class RecordingSettings:
    """How pictures are kept.

    Attributes:
        quality: of the JPEG pictures, 1 to 100.
        rate: pictures a second.
    """

    quality: int = 79
    rate: int = 15

    def __post_init__(self) -> None:
        if not 1 <= self.quality <= 100:
            raise SimulationError(f"recording: quality must be between 1 and 100, not {self.quality}")
        if not 0 < self.rate <= 60 or STEPS_PER_SECOND % self.rate:
            raise SimulationError(
                f"recording: rate must be at most 60 and divide {STEPS_PER_SECOND}, not {self.rate}"
            )


@dataclass(frozen=True)
class Recording:
    """What was recorded: the bag, its number of pictures and its size in bytes."""

    path: Path
    pictures: int
    size: int


def record(
    world: str,
    output: str | os.PathLike[str],
    seed: int = 0,
    seconds: float = 15.0,
    progress: Progress | None = None,
    parameters: Mapping[str, Value] | None = None,
) -> Recording:
    """Record a world by name.

    Args:
        world: one of WORLDS.
        output: the bag to write.
        seed: of the world, the drive, and all noise.
        seconds: how long.
        progress: told about each picture.
        parameters: by name, of the world (see its settings), of its drive (WeavingSettings or FollowSettings)
            and of the recording (RecordingSettings), in SI units; as values or as texts.

    Raises:
        SimulationError: unknown world, unknown or impossible parameter, negative seed.
        BagError: the bag cannot be written.
    """
    made, how = asked_world(world, seed, parameters or {})
    return record_world(made, drive_of(made, seconds, seed), made.camera, output, seed, progress, how)


def asked_world(world: str, seed: int, parameters: Mapping[str, Value]) -> tuple[World, RecordingSettings]:
    """Build a world with the drive that is asked for, and say how it is to be recorded.

    Args:
        world: one of WORLDS.
        seed: of the world.
        parameters: as for `record`.

    Raises:
        SimulationError: as for `record`.
    """
    known = (kind_of(world).settings, RecordingSettings, FollowSettings, WeavingSettings)
    shape, keeping, *driving = sort_out(f"world {world!r}", parameters, known)
    how = settings_of(RecordingSettings, keeping)
    made = build_world(world, seed, shape)
    names = {item.name for item in fields(made.drive)}
    wrong = [name for given in driving for name in given if name not in names]
    if wrong:
        raise SimulationError(
            f"world {world!r} has no parameter {wrong[0]!r}; its drive has: {', '.join(sorted(names))}"
        )
    changes = {name: value for given in driving for name, value in given.items()}
    return replace(made, drive=settings_of(type(made.drive), changes, made.drive)), how


def kind_of(world: str) -> WorldKind:
    """The kind of world that has a name.

    Raises:
        SimulationError: there is none.
    """
    kind = WORLDS.get(world)
    if kind is None:
        raise SimulationError(f"there is no world {world!r}; there is: {', '.join(sorted(WORLDS))}")
    return kind


def build_world(world: str, seed: int = 0, parameters: Mapping[str, Value] | None = None) -> World:
    """Build a world by name.

    Args:
        world: one of WORLDS.
        seed: of what is left to chance in it.
        parameters: of its settings, in SI units; as values or as texts.

    Raises:
        SimulationError: unknown world, unknown or impossible parameter, negative seed.
    """
    kind = kind_of(world)
    if seed < 0:
        raise SimulationError(f"seed must not be negative, not {seed}")
    (shape,) = sort_out(f"world {world!r}", parameters or {}, (kind.settings,))
    return kind.build(settings_of(kind.settings, shape), seed)


def drive_of(world: World, seconds: float, seed: int) -> Motion:
    """The drive by which a world records itself.

    Raises:
        SimulationError: as `weaving` and `following`; the motion leaves the lane or touches something.
    """
    if isinstance(world.drive, WeavingSettings):
        motion = weaving(seconds, world.drive, seed)
        _check_lane(world, motion)
    else:
        motion = following(world, seconds, world.drive, seed)
    _check_room(world, motion)
    return motion


def record_world(
    world: World,
    motion: Motion,
    camera: Camera,
    output: str | os.PathLike[str],
    seed: int = 0,
    progress: Progress | None = None,
    settings: RecordingSettings | None = None,
) -> Recording:
    """Drive through a world and write pictures, odometry and truth.

    Topics: image/compressed, camera_info, odom; truth/heading (where there is a lane), truth/odom,
    truth/attitude, truth/plants (where any grow), truth/map and truth/shadows (where the floor is known).

    Raises:
        SimulationError: the motion is too short for a picture.
        BagError: the bag cannot be written; no half-written one is left under its name.
    """
    from robot_vision.bags import BagWriter

    how = settings or RecordingSettings()
    count = int(motion.seconds * how.rate + 1e-6)
    if count == 0:
        raise SimulationError(f"{motion.seconds:.3f} s are too short for a picture at {how.rate} a second")
    renderer = Renderer(world.scene, camera)
    sensor, clouds = CameraSensor(seed), Clouds(world.clouds, seed)
    readings = WheelOdometry(seed).read(motion, ODOMETRY_RATE)
    teller, form = TruthTeller(world, camera), PictureFormat(True, how.quality)
    told = 0
    with BagWriter(output, compression="zstd") as bag:
        _write_lasting(bag, teller)
        for picture in range(count):
            step = picture * STEPS_PER_SECOND // how.rate
            while told < len(readings) and told * STEPS_PER_SECOND // ODOMETRY_RATE <= step:
                reading = Reading(*(float(value) for value in readings[told]))
                at = START_NS + told * 1_000_000_000 // ODOMETRY_RATE
                _write(bag, at, sensed.odometry(at, reading))
                told += 1
            stamp = START_NS + picture * 1_000_000_000 // how.rate
            state = motion.state(step)
            light = renderer.render(state.camera_pose(camera))
            clouds.dim(light, step / STEPS_PER_SECOND)
            taken = sensor.capture(light)
            _write(bag, stamp, sensed.camera_info(stamp, camera))
            _write(bag, stamp, form.say(stamp, taken))
            for said in teller.at(stamp, state):
                _write(bag, stamp, said)
            if progress is not None:
                progress(picture + 1, count)
    path = Path(output)
    return Recording(path, count, path.stat().st_size)


def _check_lane(world: World, motion: Motion) -> None:
    """Weaving knows no lane: look whether it stays in this one."""
    lane = world.lane
    if not isinstance(lane, StraightLane) or (lane.x, lane.y, lane.yaw) != (0.0, 0.0, 0.0):
        raise SimulationError(f"{world.name}: weaving needs a straight lane along x; use FollowSettings")
    reach = float(motion.x.max()) + world.camera.x_m
    if reach > lane.length - END_GAP:
        raise SimulationError(
            f"{world.name}: {motion.seconds:g} s of driving end at {reach:.1f} m, but it is "
            f"{lane.length:g} m long: give length={np.ceil(reach + END_GAP):g} or less time"
        )
    margin = lane.width / 2 - float(np.abs(motion.y).max())
    if margin < 0.15:
        raise SimulationError(
            f"{world.name}: the robot would touch a wall; give a smaller sway or a larger width "
            f"than {lane.width:g} m"
        )


def _check_room(world: World, motion: Motion) -> None:
    """Look ten times a second whether the robot would touch something."""
    surroundings = Surroundings(world)
    for step in range(0, len(motion.x), STEPS_PER_SECOND // 10):
        room = surroundings.at(float(motion.x[step]), float(motion.y[step]), float(motion.yaw[step]))
        if room.clearance == 0.0:
            raise SimulationError(
                f"{world.name}: the robot would touch {room.nearest} after {step / STEPS_PER_SECOND:.1f} s; "
                "give a smaller sway, less time or more room"
            )


def _write(bag: Any, stamp: int, said: Said) -> None:
    bag.write(f"/{said.topic}", said.type_name, stamp, said.message)


def _write_lasting(bag: Any, teller: TruthTeller) -> None:
    """Write what holds for the whole drive, to be replayed for those who come later, too."""
    from robot_vision.bags.qos import OfferedQoS

    for said in teller.lasting(START_NS):
        bag.add_topic(f"/{said.topic}", said.type_name, OfferedQoS(durability="transient_local", depth=1))
        _write(bag, START_NS, said)
