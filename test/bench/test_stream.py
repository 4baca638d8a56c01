# SPDX-License-Identifier: Apache-2.0
"""The pictures that latency is measured with: as many, as large and as often as they are said to be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench.corridor import score_attitude
from bench.kitti import primary_azimuths
from bench.sources import CORRIDOR, VARIABLE
from bench.stream import HEIGHT, RATE_HZ, WIDTH, write_stream
from robot_vision.bags import BagReader, BagWriter, decode, messages
from robot_vision.bags.clouds import point_cloud
from robot_vision.bags.make import DEFAULT_RATE_HZ, OPTICAL_FRAME, START_NS
from robot_vision.geometry.rotation import quaternion_from_rotation, rotation_from_rpy

CLOUD, IMU = "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/Imu"


def test_without_real_pictures_the_corridor_is_shown_forth_and_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "nowhere"))
    shown = write_stream(tmp_path / "pictures.mcap", 7)
    assert "corridor" in shown and "kitti_straight" in shown
    bag = BagReader(tmp_path / "pictures.mcap")
    assert {name: info.count for name, info in bag.topics.items()} == {"/camera_info": 7, "/image": 7}
    images = [decode(message.cdr, message.type_name) for message in bag.messages(["image"])]
    assert {(image.width, image.height, image.encoding) for image in images} == {(WIDTH, HEIGHT, "bgr8")}
    steps = np.diff([messages.stamp_ns(image) for image in images])
    assert steps == pytest.approx(1e9 / RATE_HZ, abs=1)
    recorded = next(iter(BagReader(CORRIDOR).messages(["image/compressed"])))
    first = messages.picture(decode(recorded.cdr, recorded.type_name))
    assert np.array_equal(messages.picture(images[0]), first)


def test_the_primary_azimuth_is_read_by_the_stamp_of_the_picture(tmp_path: Path) -> None:
    layout = np.dtype([(name, "<f4") for name in "xyz"] + [("role", "<u4")])
    clouds = {
        0: [(0.0, -1.0, 0.0, 2), (np.sin(0.1), 0.0, np.cos(0.1), 1)],
        2: [(1.0, 0.0, 0.0, 3)],  # no primary one
    }
    with BagWriter(tmp_path / "answers.mcap") as bag:
        for number, rows in clouds.items():
            stamp = START_NS + round(number * 1e9 / DEFAULT_RATE_HZ)
            bag.write(
                "/vanishing_points", CLOUD, stamp, point_cloud(stamp, OPTICAL_FRAME, np.array(rows, layout))
            )
    seen = primary_azimuths(tmp_path / "answers.mcap", 4)
    assert seen[0] == pytest.approx(0.1)
    assert np.isnan(seen[1:]).all()


def test_attitude_is_scored_by_the_stamp_of_the_picture(tmp_path: Path) -> None:
    def imu(stamp: int, roll: float, pitch: float) -> object:
        turn = quaternion_from_rotation(rotation_from_rpy(roll, pitch, 0.0)).tolist()
        return messages.imu(stamp, "camera_link", turn, np.diag([0.01**2, 0.02**2, 1e6]))

    with BagWriter(tmp_path / "drive.mcap") as bag:
        for stamp in (1, 2, 3):
            bag.write("/truth/attitude", IMU, stamp, imu(stamp, 0.0, 0.1))
        for stamp in (1, 3):
            bag.write("/attitude", IMU, stamp, imu(stamp, 0.01, 0.06))
    score = score_attitude(tmp_path / "drive.mcap")
    assert score.compared == 2
    assert (score.roll_rms, score.pitch_rms) == (pytest.approx(0.01), pytest.approx(0.04))
    assert score.normalised == pytest.approx((1.0 + 4.0) / 2.0, rel=1e-3)
