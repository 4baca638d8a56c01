# SPDX-License-Identifier: Apache-2.0
"""A recorded drive on which one thing after the other goes wrong, replayed through the real nodes.

The drive is `bags/corridor.mcap`, every other picture of it. The truth it carries says of every cell that is called
free whether it may be.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from robot_vision.bags import BagReader, BagWriter, decode, messages
from robot_vision.geometry import Camera, rotation_from_rpy
from robot_vision.mapping import Pose
from robot_vision.ros.replays import replay
from robot_vision.simulation.world import standard_camera

CORRIDOR = Path(__file__).resolve().parents[2] / "bags" / "corridor.mcap"
NODES = ("line_detector", "vp_estimator", "plan_view_mapper")
PICTURE, INFO, ODOMETRY, GRID = (
    "sensor_msgs/msg/CompressedImage",
    "sensor_msgs/msg/CameraInfo",
    "nav_msgs/msg/Odometry",
    "nav_msgs/msg/OccupancyGrid",
)
#: What goes wrong, and for how many pictures of 2/15 s each.
PARTS = {
    "missing calibration": 2,
    "wrong calibration": 2,
    "nothing": 8,
    "lights out": 15,
    "lights on": 6,
    "slip": 22,
    "grip": 4,
    "knock": 13,
}
SLIP, KNOCK = 1.2, math.radians(-3.0)
CAMERA = standard_camera()
Stamps = dict[str, list[int]]


def knocked(shown: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """What the camera sees of the same when it has been turned up by 3 degrees."""
    turn = rotation_from_rpy(0.0, CAMERA.pitch, 0.0).T @ rotation_from_rpy(0.0, CAMERA.pitch + KNOCK, 0.0)
    level = replace(CAMERA, pitch=0.0, roll=0.0).optical_to_base
    way = CAMERA.matrix @ level.T @ turn @ level @ np.linalg.inv(CAMERA.matrix)
    size = (CAMERA.width, CAMERA.height)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return cv2.warpPerspective(shown, way, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)


def write_failures(path: Path) -> Stamps:
    """Write the drive; returns the stamps of the pictures of each part."""
    stamps: Stamps = {part: [] for part in PARTS}
    parts = [part for part, count in PARTS.items() for _ in range(count)]
    heard, told = None, np.zeros(2)
    with BagWriter(path) as bag:
        pictures = 0
        for message in BagReader(CORRIDOR).messages():
            if pictures >= 2 * len(parts) and message.topic == "/image/compressed":
                break
            part = parts[min(pictures // 2, len(parts) - 1)]
            cdr = decode(message.cdr, message.type_name)
            stamp = messages.stamp_ns(cdr)
            if message.topic == "/camera_info":
                if part == "missing calibration":
                    continue
                camera: Any = (
                    Camera(230.0, 230.0, 159.5, 119.5, 320, 240) if part == "wrong calibration" else CAMERA
                )
                bag.write(message.topic, INFO, stamp, messages.camera_info(stamp, "camera", camera))
            elif message.topic == "/odom":
                place = cdr.pose.pose.position
                here = np.array([place.x, place.y])
                told += (SLIP if part == "slip" else 1.0) * (here - (here if heard is None else heard))
                heard = here
                place.x, place.y = (float(value) for value in told)
                bag.write(message.topic, ODOMETRY, stamp, cdr)
            elif message.topic == "/image/compressed":
                pictures += 1
                if pictures % 2:
                    continue
                stamps[part].append(stamp)
                shown = messages.picture(cdr)
                if part == "lights out":
                    shown = (shown // 50).astype(np.uint8)
                elif part == "knock":
                    shown = knocked(shown)
                bag.write(message.topic, PICTURE, stamp, messages.compressed_image(stamp, "camera", shown))
    return stamps


class Answers:
    """What the mapper said, and what was true."""

    def __init__(self, bag: Path, stamps: Stamps) -> None:
        self.stamps = stamps
        said: dict[str, dict[int, Any]] = {"/plan_view": {}, "/map": {}, "/clearance": {}}
        self.words: list[tuple[int, str]] = []
        now = 0
        for message in BagReader(bag).messages():
            if message.topic in said:
                heard = decode(message.cdr, message.type_name)
                now = messages.stamp_ns(heard)
                said[message.topic][now] = heard
            elif message.topic == "/diagnostics":
                for status in decode(message.cdr, message.type_name).status:
                    if status.name == "/plan_view_mapper":
                        last = next(value.value for value in status.values if value.key == "last bad input")
                        self.words.append((now, f"{status.message} | {last}"))
        self.plans, self.maps, self.clearances = said.values()
        source = BagReader(CORRIDOR)
        (truth,) = source.messages(["/truth/map"])
        self._truth = decode(truth.cdr, truth.type_name)
        self._poses = {}
        for message in source.messages(["/truth/odom"]):
            place = decode(message.cdr, message.type_name)
            position, yaw = place.pose.pose.position, messages.yaw_of(place.pose.pose.orientation)
            self._poses[messages.stamp_ns(place)] = Pose(position.x, position.y, yaw)

    def of(self, part: str, of: dict[int, Any]) -> list[Any]:
        """The answers to the pictures of a part."""
        return [of[stamp] for stamp in self.stamps[part] if stamp in of]

    def says(self, words: str) -> bool:
        return any(words in said for _, said in self.words)

    def wrongly_free(self, stamp: int) -> tuple[int, int]:
        """How many cells of a plan are free, and how many of them truly are not, by more than a cell."""
        plan, truth, pose = self.plans[stamp], self._truth, self._poses[stamp]
        cells = np.array(plan.data).reshape(plan.info.height, plan.info.width)
        rows, columns = np.nonzero(cells == 0)
        cell, corner = plan.info.resolution, plan.info.origin.position
        there = np.stack(
            [corner.x + (columns + 0.5) * cell, corner.y + (rows + 0.5) * cell, np.ones(len(rows))]
        )
        x, y, _ = pose.matrix @ there
        really = np.array(truth.data, np.int16).reshape(truth.info.height, truth.info.width)
        open_floor = cv2.dilate((really == 0).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        origin = truth.info.origin.position
        r, c = (
            np.floor((part - low) / truth.info.resolution).astype(int)
            for part, low in ((y, origin.y), (x, origin.x))
        )
        inside = (r >= 0) & (r < really.shape[0]) & (c >= 0) & (c < really.shape[1])
        return len(rows), int((~open_floor[r[inside], c[inside]]).sum() + (~inside).sum())


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory, ros_domain: int) -> Answers:
    folder = tmp_path_factory.mktemp("failures")
    stamps = write_failures(folder / "failures.mcap")
    place = {"camera.height": float(CAMERA.height_m or 0.0), "camera.pitch": CAMERA.pitch}
    settings: dict[str, dict[str, Any]] = {
        "line_detector": {"transport": "compressed"},
        "vp_estimator": place,
        "plan_view_mapper": {**place, "transport": "compressed", "map.period": 0.0},
    }
    replay(
        folder / "failures.mcap",
        folder / "answers.mcap",
        NODES,
        "plan_view",
        settings,
        exclude=("image/compressed", "lines/overlay", "plan_view/overlay", "ground_points"),
        answer_s=0.7,
    )
    return Answers(folder / "answers.mcap", stamps)


@pytest.mark.parametrize(
    ("part", "words"),
    [
        ("missing calibration", "no distance on the floor without a calibration"),
        ("wrong calibration", "but camera_info is for 320 x 240"),
    ],
)
def test_without_a_calibration_that_fits_nothing_is_said_but_why(
    answers: Answers, part: str, words: str
) -> None:
    for of in (answers.plans, answers.maps, answers.clearances):
        assert answers.of(part, of) == []
    assert answers.says(words)


def test_what_is_called_free_is_free_before_between_and_after_the_failures(answers: Answers) -> None:
    for part in ("nothing", "lights on", "grip"):
        assert len(answers.of(part, answers.plans)) >= PARTS[part] - 1
        counts = [answers.wrongly_free(stamp) for stamp in answers.stamps[part] if stamp in answers.plans]
        free, wrong = np.sum(counts, axis=0)
        assert free > 300 * len(counts)
        # In the one picture where a wall's foot is not seen in a few columns slivers of free floor go through it: which
        # picture that is, if any, depends on the last digits of the machine's arithmetic
        assert wrong < 0.02 * free
        assert np.median([wrong / free for free, wrong in counts]) < 0.002
    assert answers.of("nothing", answers.maps)


def test_while_the_lights_are_out_nothing_is_free_and_the_map_stands_still(answers: Answers) -> None:
    plans = answers.of("lights out", answers.plans)
    assert len(plans) >= PARTS["lights out"] - 1
    assert all((np.array(plan.data) == -1).all() for plan in plans)
    assert answers.of("lights out", answers.clearances) == []
    assert answers.of("lights out", answers.maps) == []
    assert answers.says("the picture is dark")


def test_odometry_that_slips_is_told_and_soon_stays_out_of_the_map(answers: Answers) -> None:
    assert answers.says("more way than the floor shows: nothing goes into the map")
    late = answers.stamps["slip"][16:]
    assert not [stamp for stamp in late if stamp in answers.maps]
    assert all(stamp in answers.plans for stamp in late), "each picture still has its plan"
    free, wrong = np.sum([answers.wrongly_free(stamp) for stamp in late], axis=0)
    assert wrong < 0.01 * free


def test_a_knocked_camera_is_told_and_nothing_is_free_until_it_is_known_by_how_much(
    answers: Answers,
) -> None:
    stamps = answers.stamps["knock"]
    for stamp in stamps[:5]:
        assert (np.array(answers.plans[stamp].data) == -1).all()
        assert stamp not in answers.clearances
    told = [
        match[1] for _, said in answers.words if (match := re.search(r"knocked by ([\d.]+) degrees", said))
    ]
    assert float(told[0]) == pytest.approx(3.0, abs=0.3)
    free, wrong = np.sum([answers.wrongly_free(stamp) for stamp in stamps[8:]], axis=0)
    assert free > 300 * len(stamps[8:])
    assert wrong < 0.05 * free, "a tenth of a degree is 2 % at 6 m"
