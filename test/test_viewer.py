# SPDX-License-Identifier: Apache-2.0
"""A bag in the viewer: what each message becomes, and a recording that the viewer itself reads back."""

from __future__ import annotations

import re
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rerun as rr

from robot_vision.bags import BagReader, BagWriter, messages
from robot_vision.bags.clouds import occupancy_grid, point_cloud
from robot_vision.viewer import Target, ViewerError, view
from robot_vision.viewer.archetypes import shown

CORRIDOR = Path(__file__).resolve().parents[1] / "bags" / "corridor.mcap"


def one(topic: str, kind: str, message: Any) -> tuple[str, Any]:
    (only,) = shown(topic, kind, message)
    return only


def rows_by_entity(recording: Path) -> Counter[str]:
    """Rows of each entity as the viewer's own tool prints them."""
    tool = Path(sys.executable).with_name("rerun")
    said = subprocess.run(
        [tool, "rrd", "print", recording], capture_output=True, text=True, check=True, timeout=120
    )
    rows: Counter[str] = Counter()
    for count, entity in re.findall(r"with (\d+) rows.* - (/\S+)", said.stdout):
        rows[entity] += int(count)
    return rows


def test_a_recorded_drive_becomes_a_recording_with_every_picture(tmp_path: Path) -> None:
    recording = tmp_path / "corridor.rrd"
    steps: list[tuple[int, int | None]] = []
    count = view(CORRIDOR, Target.FILE, recording, lambda done, total: steps.append((done, total)))
    topics = BagReader(CORRIDOR).topics
    rows = rows_by_entity(recording)
    assert rows["/camera/image/compressed"] == topics["/image/compressed"].count
    assert rows["/curves/offset/truth/heading"] == topics["/truth/heading"].count
    assert rows["/odom/odom"] == topics["/odom"].count
    assert rows["/plan/truth/map"] == topics["/truth/map"].count
    assert steps[-1] == (count, count)
    assert count == sum(info.count for name, info in topics.items() if name != "/camera_info")


def test_lines_lie_on_the_picture() -> None:
    cloud = np.zeros(2, [(name, "<f4") for name in ("x1", "y1", "x2", "y2", "strength")])
    cloud["x1"], cloud["y2"] = (3.0, 5.0), (7.0, 9.0)
    path, drawn = one("lines", "sensor_msgs/msg/PointCloud2", point_cloud(1, "camera", cloud))
    assert path == "camera/lines"
    assert drawn.strips.as_arrow_array().to_pylist()[1] == [[5.0, 0.0], [0.0, 9.0]]


def test_a_vanishing_point_at_infinity_has_no_place_on_the_picture() -> None:
    kinds = [("x", "<f4"), ("u", "<f4"), ("v", "<f4"), ("id", "<u4"), ("role", "<u4")]
    cloud = np.zeros(2, kinds)
    cloud["u"], cloud["v"], cloud["id"], cloud["role"] = (320.0, np.inf), (240.0, 240.0), (7, 8), (1, 3)
    _, drawn = one("vanishing_points", "sensor_msgs/msg/PointCloud2", point_cloud(1, "camera", cloud))
    assert drawn.positions.as_arrow_array().to_pylist() == [[320.0, 240.0]]
    assert drawn.labels.as_arrow_array().to_pylist() == ["7"]


def test_what_a_heading_does_not_know_is_no_curve() -> None:
    known = messages.lane_heading(1, "row", 0.1, 0.25, 0.001, 0.001)
    curves = dict(shown("heading", "geometry_msgs/msg/PoseWithCovarianceStamped", known))
    assert set(curves) == {"curves/offset/heading", "curves/angle/heading/yaw"}
    assert curves["curves/offset/heading"].scalars.as_arrow_array().to_pylist() == [0.25]
    yaw_only = messages.lane_heading(1, "row", 0.1, None, 0.001)
    assert [
        path for path, _ in shown("heading", "geometry_msgs/msg/PoseWithCovarianceStamped", yaw_only)
    ] == ["curves/angle/heading/yaw"]


def test_a_plan_is_shown_with_its_first_row_below_and_the_unknown_grey() -> None:
    cells = np.array([[0, 100], [-1, 0]], np.int8)
    path, drawn = one("map", "nav_msgs/msg/OccupancyGrid", occupancy_grid(1, "odom", cells, 0.05, (0.0, 0.0)))
    assert path == "plan/map"
    assert np.frombuffer(bytes(drawn.buffer.as_arrow_array().to_pylist()[0]), np.uint8).tolist() == [
        128,
        255,
        255,
        0,
    ]


def test_a_picture_keeps_its_own_bytes() -> None:
    data = b"\x89PNG and more"
    path, drawn = one(
        "front/image/compressed",
        "sensor_msgs/msg/CompressedImage",
        messages.compressed_bytes(1, "camera", data, "png"),
    )
    assert path == "camera/front/image/compressed"
    assert drawn.media_type.as_arrow_array().to_pylist() == ["image/png"]
    assert isinstance(drawn, rr.EncodedImage)


def test_a_bag_of_nothing_that_can_be_seen_is_refused_by_name(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "clock.mcap") as bag:
        bag.write("/clock", "rosgraph_msgs/msg/Clock", 1, messages.clock(1))
    with pytest.raises(ViewerError, match="/clock"):
        view(tmp_path / "clock.mcap", Target.FILE, tmp_path / "x.rrd")


def test_a_message_that_is_none_is_named_and_all_others_are_shown(tmp_path: Path) -> None:
    kind = "sensor_msgs/msg/Image"
    good = messages.image(1, "camera", np.zeros((2, 3), np.uint8))
    odd = messages.image(1, "camera", np.zeros((2, 3), np.uint8), "64FC1")
    turned = messages.imu(1, "base_link", (0.0, 0.0, 0.0, 0.0), np.zeros((3, 3)))
    with BagWriter(tmp_path / "odd.mcap") as bag:
        for topic, message in (("/image", good), ("/odd", odd), ("/image", good), ("/odd", odd)):
            bag.write(topic, kind, 1, message)
        bag.write("/attitude", "sensor_msgs/msg/Imu", 1, turned)
    said: list[str] = []
    assert view(tmp_path / "odd.mcap", Target.FILE, tmp_path / "odd.rrd", complain=said.append) == 2
    assert len(said) == 2
    assert "/odd" in said[0] and "64FC1" in said[0]
    assert "/attitude" in said[1] and "quaternion" in said[1]
    with BagWriter(tmp_path / "none.mcap") as bag:
        bag.write("/odd", kind, 1, odd)
    with pytest.raises(ViewerError, match="64FC1"):
        view(tmp_path / "none.mcap", Target.FILE, tmp_path / "none.rrd")


def test_a_distance_function_is_shown_as_its_map_with_its_first_row_below() -> None:
    metres = np.array([[0.0, 1.0], [2.0, np.inf]], np.float32)
    path, drawn = one("distance_field", "sensor_msgs/msg/Image", messages.image(1, "odom", metres))
    assert path == "plan/distance_field"
    shown_rows = np.frombuffer(bytes(drawn.buffer.as_arrow_array().to_pylist()[0]), np.float32)
    assert shown_rows.tolist() == [2.0, np.inf, 0.0, 1.0]


def test_the_bag_itself_is_not_written_over(tmp_path: Path) -> None:
    bag = tmp_path / "drive.mcap"
    bag.write_bytes(CORRIDOR.read_bytes())
    with pytest.raises(ViewerError, match="the bag itself"):
        view(bag, Target.FILE, tmp_path / "." / "drive.mcap")
    assert bag.read_bytes() == CORRIDOR.read_bytes()
    with pytest.raises(ViewerError, match="No such file"):
        view(bag, Target.FILE, tmp_path / "nowhere" / "x.rrd")


def test_without_the_viewer_one_line_says_how_to_get_it() -> None:
    code = "import sys; sys.modules['rerun'] = None; from robot_vision.cli import main; main()"
    run = subprocess.run(
        [sys.executable, "-c", code, "view", str(CORRIDOR)],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert run.returncode == 2
    assert (
        run.stderr.strip() == "robot-vision: the viewer is not installed: pip install 'robot_vision[viewer]'"
    )
