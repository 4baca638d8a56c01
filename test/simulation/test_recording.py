# SPDX-License-Identifier: Apache-2.0
"""Recorded bags: what stands in them is complete, true, and the same every time."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from robot_vision.bags import BagError, BagReader, decode
from robot_vision.bags.messages import stamp_ns, yaw_of
from robot_vision.geometry import Camera
from robot_vision.geometry.rotation import quaternion_to_rotation, rpy_from_rotation
from robot_vision.simulation import (
    WORLDS,
    SimulationError,
    optical_pose,
    record,
    record_world,
    standard_camera,
)
from robot_vision.simulation.drive import STEPS_PER_SECOND, WeavingSettings, weaving
from robot_vision.simulation.record import drive_of
from robot_vision.simulation.scene import Scene, quad
from robot_vision.simulation.texture import Texture
from robot_vision.simulation.world import SceneObject, StraightLane, World

CORRIDOR = Path(__file__).resolve().parents[2] / "bags" / "corridor.mcap"
PLANS = {"/truth/map", "/truth/shadows"}
TOPICS = {"/image/compressed", "/camera_info", "/odom", "/truth/heading", "/truth/odom", "/truth/attitude"}


def messages(bag: Path) -> dict[str, list[Any]]:
    """All messages of a bag by topic."""
    found: dict[str, list[Any]] = {}
    for message in BagReader(bag).messages():
        found.setdefault(message.topic, []).append(decode(message.cdr, message.type_name))
    return found


def decoded(message: Any) -> NDArray[np.uint8]:
    """The picture (H, W, 3) in a CompressedImage."""
    picture = cv2.imdecode(message.data, cv2.IMREAD_COLOR)
    assert picture is not None
    return np.asarray(picture, np.uint8)


@pytest.fixture(scope="module")
def corridor() -> dict[str, list[Any]]:
    return messages(CORRIDOR)


def test_the_corridor_in_the_house_is_whole_and_small(corridor: dict[str, list[Any]]) -> None:
    assert CORRIDOR.stat().st_size <= 6_000_000
    assert set(corridor) == TOPICS | PLANS
    counts = {topic: len(found) for topic, found in corridor.items()}
    assert {counts[topic] for topic in TOPICS - {"/odom"}} == {225}
    stamps = [stamp_ns(picture) for picture in corridor["/image/compressed"]]
    np.testing.assert_allclose(np.diff(stamps) / 1e9, 1 / 15, atol=1e-8)
    for topic in TOPICS - {"/odom"}:
        assert [stamp_ns(message) for message in corridor[topic]] == stamps
    picture = decoded(corridor["/image/compressed"][0])
    assert picture.shape == (480, 640, 3)
    camera = Camera.from_camera_info(corridor["/camera_info"][0], height_m=0.6, pitch=float(np.radians(5.0)))
    assert camera == standard_camera()


def test_the_corridor_in_the_house_exercises_yaw_and_offset(corridor: dict[str, list[Any]]) -> None:
    poses = [message.pose.pose for message in corridor["/truth/heading"]]
    yaws, offsets = np.array([(yaw_of(pose.orientation), pose.position.y) for pose in poses]).T
    assert np.degrees(np.ptp(yaws)) > 18
    assert np.ptp(offsets) > 0.5
    assert np.abs(offsets).max() <= 0.35
    assert {message.header.frame_id for message in corridor["/truth/heading"]} == {"corridor"}


def test_truth_agrees_with_itself(corridor: dict[str, list[Any]]) -> None:
    for heading, odometry, attitude in zip(
        corridor["/truth/heading"], corridor["/truth/odom"], corridor["/truth/attitude"], strict=True
    ):
        assert heading.pose.pose.position.y == odometry.pose.pose.position.y
        assert yaw_of(heading.pose.pose.orientation) == pytest.approx(yaw_of(odometry.pose.pose.orientation))
        turn = attitude.orientation
        roll, pitch, yaw = rpy_from_rotation(quaternion_to_rotation([turn.x, turn.y, turn.z, turn.w]))
        # The body leans by up to 0.3 degrees; a camera mounted 5 degrees down rolls by 1 / cos 5 degrees as much.
        assert np.degrees(abs(roll)) <= 0.3001 / np.cos(np.radians(5.3))
        assert np.degrees(abs(pitch) - 5.0) <= 0.3001
        assert yaw == pytest.approx(0.0, abs=1e-9)


def test_odometry_follows_the_truth_and_drifts_a_little(corridor: dict[str, list[Any]]) -> None:
    told, true = corridor["/odom"][-1].pose.pose, corridor["/truth/odom"][-1].pose.pose
    start = corridor["/truth/odom"][0].pose.pose
    yaw = yaw_of(start.orientation)
    moved = np.array([true.position.x - start.position.x, true.position.y - start.position.y])
    moved = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]]) @ moved
    error = np.hypot(told.position.x - moved[0], told.position.y - moved[1])
    assert 1e-3 < error < 0.05 * np.hypot(*moved)
    first = corridor["/odom"][0]
    assert (first.header.frame_id, first.child_frame_id) == ("odom", "base_link")
    assert first.pose.pose.position.x == 0.0


@pytest.mark.parametrize("seed", [0, 1, 7])
def test_a_drive_is_that_of_a_unicycle(seed: int) -> None:
    motion = weaving(16.0, seed=seed)
    dx, dy, turn = (np.diff(values) * STEPS_PER_SECOND for values in (motion.x, motion.y, motion.yaw))
    middle = (motion.yaw[:-1] + motion.yaw[1:]) / 2
    np.testing.assert_allclose(dx * np.cos(middle) + dy * np.sin(middle), motion.speed[:-1], atol=1e-6)
    np.testing.assert_allclose(dy * np.cos(middle) - dx * np.sin(middle), 0.0, atol=1e-6)
    np.testing.assert_allclose(turn, motion.turn_rate[:-1], atol=1e-9)
    assert np.abs(np.diff(motion.speed)).max() * STEPS_PER_SECOND < 4.0  # m/s²
    assert np.abs(np.diff(motion.turn_rate[:-1])).max() * STEPS_PER_SECOND < 6.0  # rad/s²
    limits = WeavingSettings()
    assert np.abs(motion.y).max() <= limits.sway
    assert np.abs(motion.yaw).max() <= limits.swing + 1e-9
    assert max(np.abs(motion.roll).max(), np.abs(motion.pitch).max()) <= limits.shake


def test_pictures_show_the_true_pose(tmp_path: Path) -> None:
    """An edge in the recorded pictures lies where the recorded truth projects it."""
    plate = quad((6.0, 0.6, 0.1), (0, -0.9, 0), (0, 0, 1.6), Texture.plain((0.6, 0.6, 0.6)))
    camera = standard_camera()
    world = World("plate", Scene((plate,), (0.2, 0.2, 0.2)), "corridor", StraightLane(12.0, 2.0))
    record_world(
        world, weaving(2.0, WeavingSettings(shake=0.02), seed=3), camera, tmp_path / "plate.mcap", seed=3
    )
    found = messages(tmp_path / "plate.mcap")
    worst = 0.0
    for picture, odometry, attitude in zip(
        found["/image/compressed"], found["/truth/odom"], found["/truth/attitude"], strict=True
    ):
        grey = (decoded(picture).mean(axis=2) / 255.0) ** 2.2
        turn = attitude.orientation
        roll, pitch, _ = rpy_from_rotation(quaternion_to_rotation([turn.x, turn.y, turn.z, turn.w]))
        place = odometry.pose.pose
        pose = optical_pose(
            camera,
            place.position.x,
            place.position.y,
            yaw_of(place.orientation),
            roll - camera.roll,
            pitch - camera.pitch,
        )
        ends = np.array([[6.0, -0.3, 0.4], [6.0, -0.3, 1.0]])
        (u0, v0), (u1, v1) = camera.pixels((ends - pose[:3, 3]) @ pose[:3, :3])
        errors = []
        for row in range(int(min(v0, v1)) + 1, int(max(v0, v1))):
            expected = u0 + (u1 - u0) * (row - v0) / (v1 - v0)
            start = round(expected) - 8
            light = grey[row, start : start + 17]
            low, high = light[-3:].mean(), light[:3].mean()
            errors.append(start - 0.5 + ((light - low) / (high - low)).sum() - expected)
        assert len(errors) > 30
        worst = max(worst, abs(float(np.mean(errors))))
    assert worst < 0.15


def test_the_same_command_gives_the_same_bag(tmp_path: Path) -> None:
    for name, seed in (("a", 5), ("b", 5), ("c", 6)):
        record("corridor", tmp_path / name, seed=seed, seconds=0.21, parameters={"length": 10.0})
    first, again, other = ((tmp_path / name).read_bytes() for name in "abc")
    assert first == again
    assert first != other


def test_progress_is_told(tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    made = record(
        "corridor",
        tmp_path / "bag.mcap",
        seconds=0.2,
        parameters={"length": 8.0},
        progress=lambda done, total: told.append((done, total)),
    )
    assert told == [(1, 3), (2, 3), (3, 3)]
    assert made.pictures == 3
    assert made.size == (tmp_path / "bag.mcap").stat().st_size


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"world": "moon"}, "no world 'moon'; there is: corridor"),
        ({"parameters": {"widht": 2.0}}, "no parameter 'widht'; it has: .*width"),
        ({"parameters": {"width": 0.3}}, "width must be between 1 and 6 m"),
        ({"parameters": {"length": float("nan")}}, "length must be a finite number"),
        ({"seconds": 0.0}, "seconds must be between"),
        ({"seconds": 0.01}, "too short for a picture"),
        ({"seconds": 60.0}, "give length="),
        ({"parameters": {"width": 1.0, "sway": 0.5, "swing": 0.4}}, "would touch a wall"),
        ({"seed": -1}, "seed must not be negative"),
    ],
)
def test_what_cannot_be_recorded_is_said_in_one_line(
    tmp_path: Path, asked: dict[str, Any], words: str
) -> None:
    with pytest.raises(SimulationError, match=words) as caught:
        record(**{"world": "corridor", "output": tmp_path / "bag.mcap", **asked})
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_no_half_written_bag_is_left(tmp_path: Path) -> None:
    def stop(done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        record("corridor", tmp_path / "bag.mcap", seconds=0.5, parameters={"length": 8.0}, progress=stop)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(BagError):
        record("corridor", tmp_path / "nowhere" / "bag.mcap", seconds=0.5, parameters={"length": 8.0})


FULL_DISK = """
import resource, sys
from robot_vision.cli import main
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv.pop(1)),) * 2)
main()
"""


@pytest.mark.parametrize("room", [100, 400_000])
def test_a_full_disk_is_said_in_one_line(tmp_path: Path, room: int) -> None:
    """A limit on the size of files stands for the disk: the system refuses the write that goes beyond."""
    record(
        "corridor", tmp_path / "warm.mcap", seconds=0.1
    )  # what is compiled is kept, before there is no room
    (tmp_path / "warm.mcap").unlink()
    bag = tmp_path / "bag.mcap"
    asked = ["simulate", "corridor", "--seconds", "1.2", "--set", "quality=95", "-o", str(bag)]
    run = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(room), *asked], capture_output=True, text=True, check=False
    )
    assert run.returncode == 2, run.stderr
    assert run.stderr.strip().splitlines() == [f"robot-vision: cannot write {bag}: File too large"]
    assert list(tmp_path.iterdir()) == []


def test_a_bag_that_is_there_survives_a_failure(tmp_path: Path) -> None:
    bag = tmp_path / "bag.mcap"
    bag.write_bytes(b"an older one")

    def stop(done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        record("corridor", bag, seconds=0.5, progress=stop)
    assert bag.read_bytes() == b"an older one"
    assert list(tmp_path.iterdir()) == [bag]


def test_a_recording_carries_the_plan_of_its_floor(tmp_path: Path) -> None:
    record("corridor", tmp_path / "bag.mcap", seconds=0.2, parameters={"length": "8", "rate": "30"})
    topics = BagReader(tmp_path / "bag.mcap").topics
    assert topics["/image/compressed"].count == 6
    for name in ("/truth/map", "/truth/shadows"):
        assert topics[name].count == 1
        qos = topics[name].qos
        assert qos is not None and qos.durability == "transient_local"
    (grid,) = messages(tmp_path / "bag.mcap")["/truth/map"]
    area = (grid.data == 0).sum() * grid.info.resolution**2
    assert area == pytest.approx(8 * 2, rel=0.01)
    assert grid.header.frame_id == "corridor"


def test_a_drive_through_an_object_is_refused(tmp_path: Path) -> None:
    plate = quad((6.0, 0.6, 0.1), (0, -0.9, 0), (0, 0, 1.6), Texture.plain((0.6, 0.6, 0.6)))
    box = SceneObject("box", np.array([(3, -0.1), (3.4, -0.1), (3.4, 0.3), (3, 0.3)]), 1.0)
    world = World("hall", Scene((plate,)), "corridor", StraightLane(12.0, 2.0), objects=(box,))
    with pytest.raises(SimulationError, match="hall: the robot would touch box after [12]"):
        drive_of(world, 4.0, 1)


def test_every_world_says_what_it_is() -> None:
    assert "corridor" in WORLDS
    assert all(kind.about for kind in WORLDS.values())
