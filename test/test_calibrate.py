# SPDX-License-Identifier: Apache-2.0
"""The command calibrate on recorded drives: how near the truth it comes, what it leaves, what it admits."""

from __future__ import annotations

import math
import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from ruamel.yaml import YAML
from typer.testing import CliRunner, Result

from robot_vision import cli
from robot_vision.bags import BagError, BagReader, BagWriter, make_bag
from robot_vision.bags.calibration import read_calibration
from robot_vision.calibrate.drive import read_drive
from robot_vision.perception.calibration import CameraCalibration, CameraCalibrator, KnownLengths

ROOT = Path(__file__).resolve().parents[1]
BAGS = ROOT / "bags"
DATA = Path(os.environ.get("ROBOT_VISION_DATA", ROOT.parent / "shared" / "data"))
PICTURES = 32


def calibrate(bag: Path, out: Path, *options: str) -> Result:
    arguments = ["calibrate", str(bag), "--out", str(out), "--most", str(PICTURES), *options]
    return CliRunner().invoke(cli.app, arguments)


def parameters(out: Path) -> dict[str, float]:
    found = YAML(typ="safe").load(out / "parameters.yaml")
    return dict(found["/**"]["ros__parameters"])


def blind_copy(bag: Path, copy: Path) -> Path:
    """The pictures of a bag without its camera_info."""
    with BagWriter(copy) as written:
        for message in BagReader(bag).messages(["image/compressed"]):
            written.write(message.topic, message.type_name, message.log_time_ns, message.cdr)
    return copy


@pytest.fixture(scope="module")
def corridor(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    folder = tmp_path_factory.mktemp("corridor")
    bag = blind_copy(BAGS / "corridor.mcap", folder / "blind.mcap")
    return folder / "out", calibrate(bag, folder / "out", "--corridor-width", "2.0")


def test_the_corridor_tells_focal_length_lean_and_height(corridor: tuple[Path, Result]) -> None:
    out, result = corridor
    assert result.exit_code == 0, result.output
    camera = read_calibration(out / "camera.yaml", 640, 480)
    assert camera.fx == camera.fy == pytest.approx(460.0, rel=0.01)
    assert (camera.cx, camera.cy) == (319.5, 239.5)
    place = parameters(out)
    assert place["camera.pitch"] == pytest.approx(math.radians(5.0), abs=math.radians(0.1))
    assert place["camera.roll"] == pytest.approx(0.0, abs=math.radians(0.1))
    assert place["camera.height"] == pytest.approx(0.6, rel=0.01)


def test_it_says_how_sure_it_is_and_shows_it(corridor: tuple[Path, Result]) -> None:
    out, result = corridor
    for words in ("focal length", "±", "told by", "the corridor's width of 2 m", "camera.yaml"):
        assert words in result.output
    picture = cv2.imread(str(out / "calibration.png"))
    assert picture is not None and picture.shape[1] > 1000
    assert "# focal length 4" in (out / "camera.yaml").read_text(encoding="utf-8")


def test_stones_tell_the_height(tmp_path: Path) -> None:
    result = calibrate(BAGS / "path.mcap", tmp_path, "--stone-width", "0.4")
    assert result.exit_code == 0, result.output
    assert parameters(tmp_path)["camera.height"] == pytest.approx(0.6, rel=0.01)
    assert "the stones' width of 0.4 m" in result.output


def test_crop_rows_tell_the_pitch_and_the_height_over_their_leaves(tmp_path: Path) -> None:
    result = calibrate(BAGS / "field.mcap", tmp_path, "--row-spacing", "0.5")
    assert result.exit_code == 0, result.output
    place = parameters(tmp_path)
    assert place["camera.pitch"] == pytest.approx(math.radians(35.0), abs=math.radians(1.0))
    assert 1.4 - 0.12 < place["camera.height"] < 1.4
    assert "over their leaves" in result.output


def test_a_winding_road_tells_no_focal_length_and_the_one_given_is_kept(tmp_path: Path) -> None:
    result = calibrate(BAGS / "road.mcap", tmp_path)
    assert "not told" in result.output
    assert read_calibration(tmp_path / "camera.yaml", 640, 480).fx == 460.0
    assert "the focal length given, since the pictures do not tell" in result.output


def test_nothing_told_leaves_no_file_that_looks_like_an_answer(tmp_path: Path) -> None:
    make_bag(*noise(tmp_path, 4))
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "camera.yaml").write_text("of an earlier drive", encoding="utf-8")
    result = calibrate(tmp_path / "noise.mcap", tmp_path / "out")
    assert result.exit_code == 1
    assert "camera.yaml is not written" in result.output
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["calibration.png"]


def noise(folder: Path, count: int) -> tuple[Path, Path]:
    random = np.random.default_rng(0)
    (folder / "in").mkdir()
    for number in range(count):
        grey = cv2.GaussianBlur(random.integers(0, 255, (120, 160), np.uint8), (0, 0), 2.0)
        assert cv2.imwrite(str(folder / "in" / f"{number}.png"), grey)
    return folder / "in", folder / "noise.mcap"


def test_a_spoilt_picture_costs_that_picture_only(tmp_path: Path) -> None:
    bag = tmp_path / "spoilt.mcap"
    with BagWriter(bag) as written:
        for number, message in enumerate(BagReader(BAGS / "corridor.mcap").messages(["image/compressed"])):
            cdr = message.cdr if number != 3 else message.cdr[:200] + bytes(len(message.cdr) - 200)
            if number < 6:
                written.write(message.topic, message.type_name, message.log_time_ns, cdr)
    drive = read_drive(bag, None, 100, lambda done, total: None)
    assert len(drive.lines) == 5
    assert len(drive.warnings) == 1 and "picture 3 is left out" in drive.warnings[0]


def renamed(bag: Path, copy: Path, *namespaces: str) -> Path:
    """A few pictures of the corridor and their calibration, once in each namespace."""
    with BagWriter(copy) as written:
        for number, message in enumerate(BagReader(bag).messages(["image/compressed", "camera_info"])):
            for namespace in namespaces if number < 12 else ():
                topic = f"{namespace}/{message.topic.lstrip('/')}"
                written.write(topic, message.type_name, message.log_time_ns, message.cdr)
    return copy


def test_the_camera_of_a_bag_may_have_a_namespace_but_must_be_the_only_one(tmp_path: Path) -> None:
    one = renamed(BAGS / "corridor.mcap", tmp_path / "one.mcap", "/front/camera")
    drive = read_drive(one, None, 100, lambda done, total: None)
    assert len(drive.lines) == 6 and drive.camera.fx == 460.0
    two = renamed(BAGS / "corridor.mcap", tmp_path / "two.mcap", "/left", "/right")
    with pytest.raises(BagError, match="/left/image/compressed, /right/image/compressed"):
        read_drive(two, None, 100, lambda done, total: None)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("no/such.mcap",), "no/such.mcap"),
        ((str(BAGS / "corridor.mcap"), "--calibration", "no/such.yaml"), "no/such.yaml"),
        ((str(BAGS / "corridor.mcap"), "--calibration", "0,460,320,240"), "fx"),
        ((str(BAGS / "corridor.mcap"), "--corridor-width", "-2"), "corridor_width"),
    ],
)
def test_what_cannot_be_used_is_refused_in_words(arguments: tuple[str, ...], words: str) -> None:
    result = CliRunner().invoke(cli.app, ["calibrate", *arguments])
    assert isinstance(result.exception, ValueError)
    assert type(result.exception).__module__.startswith("robot_vision.")
    assert words in str(result.exception)


def real(name: str, folder: str) -> Path:
    source = DATA / name / folder
    if not source.is_dir():
        pytest.skip(f"the pictures {name} are not at {source}; ROBOT_VISION_DATA names their place")
    return source


def found_in(bag: Path, calibration: str | None = None) -> CameraCalibration:
    drive = read_drive(bag, calibration, PICTURES, lambda done, total: None)
    return CameraCalibrator().calibrate(drive.lines, drive.camera, drive.stamps_s, KnownLengths())


def test_a_town_tells_the_focal_length(tmp_path: Path) -> None:
    make_bag(real("york_urban", "images"), tmp_path / "town.mcap")
    found = found_in(tmp_path / "town.mcap")
    assert found.focal.value == pytest.approx(674.9, rel=0.02)
    # By itself, half of the pictures come as near as this.
    assert np.nanmedian(np.abs(found.focal.own / 674.9 - 1.0)) < 0.05
    assert "contradict" in found.pitch.reason  # a camera held by hand


def test_a_road_looked_down_squarely_does_not(tmp_path: Path) -> None:
    source = real("kitti_straight", "image_l")
    calibration = str(source.parent / "calib.txt")
    make_bag(source, tmp_path / "road.mcap", calibration=calibration)
    found = found_in(tmp_path / "road.mcap")
    # Too few pictures tell of it, or those that seem to disagree: either way it is not told, and why is.
    assert not found.focal.known and "right angles" in found.focal.reason
    assert found.camera.fx == pytest.approx(707.0912)
    assert found.pitch.value == pytest.approx(math.radians(0.9), abs=math.radians(0.4))
