# SPDX-License-Identifier: Apache-2.0
"""Driving live without ROS: commands take effect in time, walls do not give way, nothing is left to chance."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.simulation import SimulationError
from robot_vision.simulation.live import LiveDrive, LiveSettings
from robot_vision.simulation.record import asked_world
from robot_vision.simulation.scene import Scene, quad
from robot_vision.simulation.texture import Texture
from robot_vision.simulation.vehicle import VehicleSettings
from robot_vision.simulation.world import SceneObject, StraightLane, World, walls_around

SHARP = VehicleSettings(lag=0.0, most_acceleration=1e6, most_turn_acceleration=1e6)


def oblong(x: float, y: float, length: float, width: float) -> NDArray[np.float64]:
    return np.array([(x, y), (x + length, y), (x + length, y + width), (x, y + width)])


def hall(*objects: SceneObject) -> World:
    """10 by 2 m, seen by a small camera."""
    floor = oblong(0, -1, 10, 2)
    plate = quad((6.0, 0.6, 0.1), (0, -0.9, 0), (0, 0, 1.6), Texture.plain((0.6, 0.6, 0.6)))
    return World(
        "hall",
        Scene((plate,), (0.2, 0.2, 0.2)),
        "corridor",
        StraightLane(10.0, 2.0),
        floor=(floor,),
        objects=(*walls_around(floor), *objects),
        camera=Camera(46.0, 46.0, 31.5, 23.5, 64, 48, height_m=0.6, pitch=0.09),
    )


def test_a_command_takes_effect_after_its_delay_and_holds_until_it_is_too_old() -> None:
    drive = LiveDrive(hall(), LiveSettings(vehicle=SHARP, delay=0.02, timeout=0.25, rate=10))
    start = drive.state.x
    drive.steer(1.0, 0.0, 0)
    for _ in range(5):
        drive.advance()
    assert drive.state.x - start == pytest.approx(0.25 - 0.02, abs=2 / 600)
    assert drive.state.speed == 0.0
    assert not drive.obeys


def test_the_newest_command_counts() -> None:
    drive = LiveDrive(hall(), LiveSettings(vehicle=SHARP, delay=0.0, rate=10))
    start = drive.state.x
    drive.steer(1.0, 0.0)
    drive.steer(0.5, 0.0)
    drive.advance()
    assert drive.state.x - start == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ((1.0, 0.0, 0), "0.60 s old; not obeyed"),
        ((1.0, 0.0, 700_000_000), "0.10 s ahead"),
        ((float("nan"), 0.0, None), "make no sense"),
        ((1.0, float("inf"), None), "make no sense"),
    ],
)
def test_commands_that_must_not_be_obeyed_are_refused(
    command: tuple[float, float, int | None], words: str
) -> None:
    drive = LiveDrive(hall(), LiveSettings(rate=10))
    for _ in range(6):
        drive.advance()
    with pytest.raises(SimulationError, match=words):
        drive.steer(*command)
    drive.advance()
    assert drive.way == 0.0


def test_a_wall_stops_the_robot_and_is_counted_once() -> None:
    drive = LiveDrive(hall(), LiveSettings(yaw=np.pi / 2, rate=10))
    for _ in range(30):
        drive.steer(0.5, 0.0)
        drive.advance()
    assert (drive.score.contacts, drive.score.touched) == (1, "wall 3")
    assert drive.in_contact
    assert drive.state.y == pytest.approx(1.0 - 0.3, abs=0.01)
    for _ in range(10):
        drive.steer(-0.5, 0.0)
        drive.advance()
    assert not drive.in_contact
    assert drive.state.y < 0.5
    for _ in range(20):
        drive.steer(0.5, 0.0)
        drive.advance()
    assert drive.score.contacts == 2


def test_how_long_the_robot_has_stood_is_known() -> None:
    drive = LiveDrive(hall(), LiveSettings(vehicle=SHARP, delay=0.0, timeout=0.25, rate=10))
    drive.advance()
    assert drive.stood_s == pytest.approx(0.1)
    for speed, turn_rate in ((1.0, 0.0), (0.0, 0.5)):  # one that turns on the spot does not stand
        drive.steer(speed, turn_rate)
        drive.advance()
        assert drive.stood_s == 0.0
    for _ in range(4):  # the command of 0.2 s is obeyed until 0.45 s, and it is 0.7 s by then
        drive.advance()
    assert drive.stood_s == pytest.approx(0.25, abs=2 / 600)


def test_what_is_passed_closely_is_measured() -> None:
    box = SceneObject("box", oblong(4, 0.35, 0.3, 0.3), 1.0)
    drive = LiveDrive(hall(box), LiveSettings(rate=10, vehicle=SHARP, settling=1.0))
    while not drive.at_the_end:
        drive.steer(1.0, 0.0)
        drive.advance()
    assert drive.score.contacts == 0
    assert (drive.score.closest, drive.score.nearest) == (pytest.approx(0.1), "box")
    assert drive.score.offset_rms == pytest.approx(0.0, abs=1e-9)
    assert drive.lane_pose is not None and 8.5 <= drive.lane_pose.along < 8.7


def test_the_score_begins_after_settling() -> None:
    drive = LiveDrive(hall(), LiveSettings(rate=10, offset=0.2, settling=2.0, vehicle=SHARP))
    assert np.isnan(drive.score.offset_rms)
    while drive.way < 3.0:
        drive.steer(1.0, 0.0)
        drive.advance()
    assert drive.score.offset_rms == pytest.approx(0.2)
    assert drive.score.offset_worst == pytest.approx(0.2)


def test_the_same_commands_give_the_same_pictures_and_readings() -> None:
    def driven(seed: int) -> tuple[list[bytes], list[tuple[float, ...]]]:
        drive = LiveDrive(hall(), LiveSettings(rate=20, lean=0.02, roughness=0.005), seed)
        pictures, readings = [], []
        for number in range(12):
            pictures.append(drive.picture().tobytes())
            drive.steer(0.8, 0.3 * np.sin(number))
            readings += [tuple(said.reading) for said in drive.advance()]
        return pictures, readings

    assert driven(3) == driven(3)
    assert driven(3) != driven(4)


def test_a_body_leans_within_its_limit_and_pictures_show_it() -> None:
    still, leaning = (LiveDrive(hall(), LiveSettings(lean=lean, noise=0.0)) for lean in (0.0, 0.0175))
    leans = []
    for _ in range(60):
        leaning.advance()
        leans.append((leaning.state.roll, leaning.state.pitch))
    assert np.abs(leans).max() <= 0.0175
    assert np.std(leans, axis=0).min() > 0.003
    assert not np.array_equal(still.picture(), leaning.picture())


def test_odometry_comes_thirty_times_a_second_at_any_rate_of_pictures() -> None:
    drive = LiveDrive(hall(), LiveSettings(rate=20))
    times = [said.time_ns for _ in range(40) for said in drive.advance()]
    np.testing.assert_allclose(np.diff(times) / 1e9, 1 / 30, atol=1e-8)
    assert len(times) == 60


@pytest.mark.parametrize("seed", range(4))
def test_no_maze_is_over_before_the_first_step(seed: int) -> None:
    world, _ = asked_world("maze", seed, {})
    drive = LiveDrive(world)
    assert not drive.at_the_end
    assert world.lane is not None
    assert drive.lane_pose is not None and drive.lane_pose.along < 0.9 * world.lane.length


def test_who_would_start_in_a_wall_is_told() -> None:
    with pytest.raises(SimulationError, match="would start inside wall 3"):
        LiveDrive(hall(), LiveSettings(offset=0.9))
    with pytest.raises(SimulationError, match="divide 600"):
        LiveSettings(rate=7)
    with pytest.raises(SimulationError, match="delay must be 0 or more"):
        LiveSettings(delay=-0.1)
