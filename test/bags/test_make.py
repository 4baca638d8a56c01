# SPDX-License-Identifier: Apache-2.0
"""Pictures, calibration and poses of every form become a bag that says the same."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from robot_vision.bags import BagError, BagReader, decode, make_bag, messages
from robot_vision.bags.pictures import natural_key
from robot_vision.bags.trajectory import odometry_from_camera
from robot_vision.geometry import Camera

DATA = Path(os.environ.get("ROBOT_VISION_DATA", Path(__file__).resolve().parents[3] / "shared" / "data"))
YAML = """\
image_width: 64
image_height: 48
camera_name: test
camera_matrix: {rows: 3, cols: 3, data: [50, 0, 31, 0, 51, 24, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.1, 0.01, 0, 0, 0]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
projection_matrix: {rows: 3, cols: 4, data: [50, 0, 31, 0, 0, 51, 24, 0, 0, 0, 1, 0]}
"""


def picture(number: int, height: int = 48, width: int = 64) -> NDArray[np.uint8]:
    return np.random.default_rng(number).integers(0, 256, (height, width, 3), np.uint8)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "pictures"
    made.mkdir()
    for number in range(12):
        cv2.imwrite(str(made / f"{number}.png"), picture(number))
    (made / "notes.txt").write_text("not a picture")
    return made


def contents(path: Path) -> list[Any]:
    return [decode(message.cdr, message.type_name) for message in BagReader(path)]


def straight_poses(count: int, step: float = 0.5) -> NDArray[np.float64]:
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, 2, 3] = np.arange(count) * step
    return poses


def write_poses(path: Path, poses: NDArray[np.float64]) -> Path:
    path.write_text("\n".join(" ".join(f"{value:.9e}" for value in pose[:3].ravel()) for pose in poses))
    return path


def test_a_folder_becomes_pictures_in_natural_order(folder: Path, tmp_path: Path) -> None:
    told: list[tuple[int, int | None]] = []
    made = make_bag(
        folder, tmp_path / "a.mcap", rate_hz=20, progress=lambda done, total: told.append((done, total))
    )
    got = contents(tmp_path / "a.mcap")
    assert (made.pictures, made.width, made.height, made.warnings) == (12, 64, 48, ())
    for number, message in enumerate(got):
        assert np.array_equal(messages.picture(message), picture(number))
        assert messages.stamp_ns(message) == 1_000_000_000 + number * 50_000_000
    assert told == [(number + 1, 12) for number in range(12)]


def test_numbers_in_names_count_as_numbers() -> None:
    names = ["a10.png", "a9.png", "B1.png", "a9b2.png", "1.png", "02.png"]
    assert sorted(names, key=natural_key) == ["1.png", "02.png", "a9.png", "a9b2.png", "a10.png", "B1.png"]


def test_jpeg_files_go_in_as_they_are(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    cv2.imwrite(str(path), picture(0))
    make_bag(path, tmp_path / "a.mcap", transport="compressed", prefix="front")
    assert list(BagReader(tmp_path / "a.mcap").topics) == ["/front/image/compressed"]
    assert bytes(contents(tmp_path / "a.mcap")[0].data) == path.read_bytes()


@pytest.mark.parametrize(("transport", "worst"), [("compressed", 80), ("png", 0)])
def test_pictures_can_be_compressed(folder: Path, tmp_path: Path, transport: Any, worst: int) -> None:
    make_bag([folder / "3.png"], tmp_path / "a.mcap", transport=transport, quality=95)
    got = messages.picture(contents(tmp_path / "a.mcap")[0]).astype(int)
    assert got.shape == (48, 64, 3) and np.abs(got - picture(3)).mean() <= worst


def test_grey_files_stay_grey(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "a.png"), picture(0)[..., 0])
    make_bag(tmp_path / "a.png", tmp_path / "a.mcap")
    assert contents(tmp_path / "a.mcap")[0].encoding == "mono8"


def test_a_video_keeps_its_rate(tmp_path: Path) -> None:
    video = tmp_path / "a.avi"
    out = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (64, 48))
    for number in range(10):
        out.write(np.full((48, 64, 3), number * 20, np.uint8))
    out.release()
    made = make_bag(video, tmp_path / "a.mcap")
    got = contents(tmp_path / "a.mcap")
    assert made.pictures == 10 and made.duration_s == pytest.approx(9 / 25)
    assert [round(messages.picture(message).mean() / 20) for message in got] == list(range(10))


def test_what_belongs_together_has_one_stamp_and_the_picture_comes_last(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "c.yaml").write_text(YAML)
    poses = write_poses(tmp_path / "poses.txt", straight_poses(12))
    make_bag(folder, tmp_path / "a.mcap", calibration=tmp_path / "c.yaml", poses=poses, rate_hz=10)
    got = list(BagReader(tmp_path / "a.mcap"))
    assert [message.topic for message in got] == ["/camera_info", "/odom", "/image"] * 12
    for i in range(0, 36, 3):
        assert len({messages.header_stamp_ns(message.cdr) for message in got[i : i + 3]}) == 1
    info = decode(got[0].cdr, got[0].type_name)
    assert (info.width, info.height, list(info.k)) == (64, 48, [50, 0, 31, 0, 51, 24, 0, 0, 1])
    assert info.d[0] == -0.1
    odom = decode(got[4].cdr, got[4].type_name)
    assert (odom.header.frame_id, odom.child_frame_id) == ("odom", "base_link")
    assert odom.pose.pose.position.x == pytest.approx(0.5) and odom.twist.twist.linear.x == pytest.approx(5.0)


@pytest.mark.parametrize(
    "calibration",
    ["50,51,31,24", (50.0, 51.0, 31.0, 24.0), Camera(50, 51, 31, 24, 64, 48), "50 51 31 24 -0.1 0.01 0 0 0"],
)
def test_numbers_and_cameras_are_calibrations(folder: Path, tmp_path: Path, calibration: Any) -> None:
    make_bag(folder / "1.png", tmp_path / "a.mcap", calibration=calibration)
    assert list(contents(tmp_path / "a.mcap")[0].k) == [50, 0, 31, 0, 51, 24, 0, 0, 1]


@pytest.mark.parametrize("label", ["{}: ", ""])
def test_a_kitti_calibration_gives_the_first_projection(folder: Path, tmp_path: Path, label: str) -> None:
    lines = [label.format(f"P{i}") + f"50 0 31 {shift} 0 50 24 0 0 0 1 0" for i, shift in enumerate((0, -27))]
    (tmp_path / "calib.txt").write_text("\n".join(lines))
    make_bag(folder / "1.png", tmp_path / "a.mcap", calibration=tmp_path / "calib.txt")
    assert list(contents(tmp_path / "a.mcap")[0].p) == [50, 0, 31, 0, 0, 50, 24, 0, 0, 0, 1, 0]


def test_a_circle_to_the_left_is_a_circle_to_the_left() -> None:
    """Drive a circle of 5 m at 1 m/s with a tilted camera ahead of the base: the base must be found on it."""
    rate, radius, count = 10.0, 5.0, 60
    camera = Camera(50, 50, 31, 24, 64, 48, height_m=1.2, pitch=0.2, roll=0.05, x_m=0.7)
    mount = np.eye(4)
    mount[:3, :3], mount[:3, 3] = camera.optical_to_base, (0.7, 0.0, 1.2)
    angle = np.arange(count) / rate / radius
    base = np.tile(np.eye(4), (count, 1, 1))
    base[:, :3, :3] = Rotation.from_euler("z", angle[:, None]).as_matrix()
    base[:, 0, 3], base[:, 1, 3] = radius * np.sin(angle), radius * (1 - np.cos(angle))
    world = np.linalg.inv(base[0] @ mount) @ base @ mount
    way = odometry_from_camera(world, rate, camera)
    assert np.allclose(way.positions, base[:, :3, 3], atol=1e-9)
    assert np.allclose(Rotation.from_quat(way.quaternions).as_euler("xyz")[:, 2], angle, atol=1e-9)
    assert np.allclose(way.angular, (0, 0, 1 / radius), atol=1e-9)
    assert np.allclose(way.linear, (1, 0, 0), atol=1e-4)  # the chord is shorter than the arc by theta^2 / 24


def test_an_unreadable_picture_is_left_out_and_nothing_else(folder: Path, tmp_path: Path) -> None:
    (folder / "5.png").write_bytes(b"broken")
    made = make_bag(folder, tmp_path / "a.mcap", poses=straight_poses(12), rate_hz=10)
    assert made.pictures == 11 and len(made.warnings) == 1 and "5.png is left out" in made.warnings[0]
    bag = BagReader(tmp_path / "a.mcap")
    stamps = [round((m.log_time_ns - 10**9) / 1e8) for m in bag.messages(["/image"])]
    assert stamps == [number for number in range(12) if number != 5]
    places = [decode(m.cdr, m.type_name).pose.pose.position.x for m in bag.messages(["/odom"])]
    assert places == pytest.approx([number * 0.5 for number in stamps])


def bad(folder: Path, tmp_path: Path, what: str) -> dict[str, Any]:
    """Prepare one kind of bad input; returns the arguments of make_bag."""
    if what == "size":
        cv2.imwrite(str(folder / "7.png"), picture(7, 40, 64))
    elif what == "all broken":
        for path in folder.glob("*.png"):
            path.write_bytes(b"broken")
    elif what == "empty":
        for path in folder.glob("*.png"):
            path.unlink()
    elif what == "yaml size":
        (tmp_path / "c").write_text(YAML.replace("64", "65"))
    elif what == "yaml focal":
        (tmp_path / "c").write_text(YAML.replace("[50, 0, 31", "[0, 0, 31"))
    elif what == "yaml word":
        (tmp_path / "c").write_text(YAML.replace("image_width: 64", "image_width: wide"))
    elif what == "yaml matrix":
        (tmp_path / "c").write_text("image_width: 64\nimage_height: 48\ncamera_matrix: 5\n")
    elif what == "yaml key":
        (tmp_path / "c").write_text("camera_matrix: {data: [50, 0, 31, 0, 51, 24, 0, 0, 1]}\n")
    elif what == "nonsense":
        (tmp_path / "c").write_text("hello\n")
    elif what == "pose words":
        (tmp_path / "poses").write_text("1 0 0 0 0 1 0 0 0 0 1 zero\n")
    elif what == "pose count":
        (tmp_path / "poses").write_text("1 0 0 0 0 1 0 0 0 0 1\n")
    elif what == "pose skew":
        (tmp_path / "poses").write_text("2 0 0 0 0 1 0 0 0 0 1 0\n")
    arguments: dict[str, Any] = {}
    if (tmp_path / "c").exists() or what == "no calibration":
        arguments["calibration"] = tmp_path / "c"
    if (tmp_path / "poses").exists() or what == "no poses":
        arguments["poses"] = tmp_path / "poses"
    return arguments


@pytest.mark.parametrize(
    ("what", "words"),
    [
        ("size", r"7\.png has 64 x 40 pixels, the pictures before it 64 x 48"),
        ("all broken", r"none of the pictures could be read.*0\.png"),
        ("empty", "no picture in the folder"),
        ("yaml size", "is for 65 x 48 pixels, but the pictures have 64 x 48"),
        ("yaml focal", "calibration .*fx"),
        ("yaml word", "image_width must be a whole number of pixels, not 'wide'"),
        ("yaml matrix", "camera_matrix must hold its numbers under data, not 5"),
        ("yaml key", "lacks image_width"),
        ("nonsense", "neither a yaml"),
        ("no calibration", "no calibration file"),
        ("no poses", "poses .* cannot be read: No such file"),
        ("pose words", "line 1: .*zero"),
        ("pose count", "line 1: a pose is 12 finite numbers, not 11"),
        ("pose skew", "line 1: .*not a rotation"),
    ],
)
def test_bad_input_gives_one_line_and_no_bag(folder: Path, tmp_path: Path, what: str, words: str) -> None:
    arguments = bad(folder, tmp_path, what)
    with pytest.raises(BagError, match=words) as caught:
        make_bag(folder, tmp_path / "a.mcap", **arguments)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.glob("a.mcap*"))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"rate_hz": 0.0}, "rate of 0"),
        ({"rate_hz": float("nan")}, "rate of nan"),
        ({"transport": "smoke"}, "transport is one of"),
        ({"quality": 0, "transport": "compressed"}, "quality goes from 1"),
        ({"calibration": "1,2,3"}, "not 3 in all"),
        ({"calibration": "nan,50,31,24"}, "fx"),
        ({"prefix": "bad name"}, "'bad name' cannot stand before a topic"),
        ({"prefix": "1//x"}, "'1//x' cannot stand before a topic"),
        ({"poses": straight_poses(11)}, "11 poses for 12 pictures"),
    ],
)
def test_bad_settings_are_refused(
    folder: Path, tmp_path: Path, arguments: dict[str, Any], words: str
) -> None:
    with pytest.raises(BagError, match=words):
        make_bag(folder, tmp_path / "a.mcap", **arguments)
    assert not list(tmp_path.glob("a.mcap*"))


@pytest.mark.parametrize(
    ("name", "words"),
    [("nothing", "there is no"), ("a.txt", "neither a picture nor a video"), ("a.mp4", "video")],
)
def test_what_is_no_source_is_refused(tmp_path: Path, name: str, words: str) -> None:
    if name != "nothing":
        (tmp_path / name).write_bytes(b"hello")
    with pytest.raises(BagError, match=words):
        make_bag(tmp_path / name, tmp_path / "a.mcap")


def test_the_real_road_becomes_a_bag(tmp_path: Path) -> None:
    road = DATA / "kitti_straight"
    if not road.is_dir():
        pytest.skip(f"real pictures are not there: {road} (set ROBOT_VISION_DATA)")
    made = make_bag(
        road / "image_l",
        tmp_path / "kitti.mcap",
        calibration=road / "calib.txt",
        poses=road / "poses.txt",
        rate_hz=10,
    )
    assert (made.pictures, made.width, made.height) == (51, 1226, 370)
    bag = BagReader(made.path)
    info = decode(next(bag.messages(["/camera_info"])).cdr, "sensor_msgs/msg/CameraInfo")
    assert info.k[0] == pytest.approx(707.0912) and info.p[3] == 0.0
    odom = [decode(message.cdr, message.type_name) for message in bag.messages(["/odom"])]
    assert all(11 < message.twist.twist.linear.x < 13 for message in odom)
    assert odom[-1].pose.pose.position.x > 55 and abs(odom[-1].pose.pose.position.y) < 2
    assert messages.picture(decode(next(bag.messages(["/image"])).cdr, "sensor_msgs/msg/Image")).shape == (
        370,
        1226,
    )
