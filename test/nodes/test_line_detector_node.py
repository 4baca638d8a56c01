# SPDX-License-Identifier: Apache-2.0
"""The line detector as a process: pictures in, lines of the rectified picture out, good ones after bad ones."""

from __future__ import annotations

import array
from collections.abc import Iterator

import cv2
import numpy as np
import pytest
from node_bench import NodeBench
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, RegionOfInterest

from robot_vision.geometry import Camera
from robot_vision.ros.images import image_message
from robot_vision.ros.messages import lines_from_message

WIDTH, HEIGHT = 320, 240
EDGE = 160.5  # between the dark columns up to 160 and the bright ones from 161
CAMERA = Camera(300.0, 300.0, 159.5, 119.5, WIDTH, HEIGHT)
BENT = Camera(300.0, 300.0, 159.5, 119.5, WIDTH, HEIGHT, distortion=(-0.25, 0.05, 0.0, 0.0, 0.0))


def half_bright(width: int = WIDTH, height: int = HEIGHT) -> NDArray[np.uint8]:
    """A picture of one upright edge."""
    picture = np.full((height, width, 3), 40, np.uint8)
    picture[:, int(width / 2 + 1) :] = 200
    return cv2.GaussianBlur(picture, (0, 0), 1.0)


def info_of(camera: Camera) -> CameraInfo:
    return CameraInfo(**camera.camera_info())


@pytest.fixture(scope="module")
def bench(ros_domain: int) -> Iterator[NodeBench]:
    bench = NodeBench(ros_domain, "line_detector", {"ready_patience": 0.1})
    try:
        bench.speaks(Image, "image", 5)
        bench.speaks(CameraInfo, "camera_info")
        bench.speaks(RegionOfInterest, "attention")
        bench.hears(PointCloud2, "lines")
        bench.connect()
        yield bench
    finally:
        bench.close()


def show(bench: NodeBench, picture: NDArray[np.uint8]) -> PointCloud2:
    message = image_message(bench.header(), picture)
    bench.say("image", message)
    cloud = bench.answer("lines", message.header)
    assert cloud.header == message.header
    return cloud


def assert_edge_found(cloud: PointCloud2, column: float = EDGE) -> None:
    ends = lines_from_message(cloud).endpoints
    assert len(ends), "no line found"
    longest = ends[np.argmax(np.hypot(ends[:, 2] - ends[:, 0], ends[:, 3] - ends[:, 1]))]
    np.testing.assert_allclose(longest[[0, 2]], column, atol=0.15)
    assert abs(longest[3] - longest[1]) > 200


def test_without_calibration_it_finds_lines_and_says_what_is_missing(bench: NodeBench) -> None:
    assert_edge_found(show(bench, half_bright()))
    bench.until(lambda: "raw picture" in bench.state("message"), "it says that there is no calibration")
    assert bench.state("level") == "1"
    assert "publish camera_info" in bench.state("what to try")


def test_a_picture_without_lines_is_answered_by_an_empty_cloud(bench: NodeBench) -> None:
    cloud = show(bench, np.full((HEIGHT, WIDTH, 3), 90, np.uint8))
    assert (cloud.width, len(cloud.data)) == (0, 0)
    assert [field.name for field in cloud.fields] == ["x1", "y1", "x2", "y2", "strength"]


BAD_PICTURES = {
    "encoding": (lambda picture: setattr(picture, "encoding", "32FC4"), "32FC4"),
    "empty": (lambda picture: setattr(picture, "data", array.array("B")), "empty"),
    "no size": (lambda picture: setattr(picture, "width", 0), "no size"),
    "cut off": (lambda picture: setattr(picture, "data", picture.data[:1000]), "1000 bytes"),
    "step": (lambda picture: setattr(picture, "step", 3), "step 3"),
}


@pytest.mark.parametrize("fault", BAD_PICTURES)
def test_bad_picture_gets_a_line_and_the_next_good_one_lines(bench: NodeBench, fault: str) -> None:
    spoil, words = BAD_PICTURES[fault]
    bad = image_message(bench.header(), half_bright())
    spoil(bad)
    bench.say("image", bad)
    bench.log_line("/image", words)
    assert bench.answer("lines", bad.header).width == 0
    assert_edge_found(show(bench, half_bright()))


def test_the_same_fault_again_and_again_fills_no_log(bench: NodeBench) -> None:
    for _ in range(30):
        bad = image_message(bench.header(), half_bright())
        bad.encoding = "mystery"
        bench.say("image", bad)
        bench.answer("lines", bad.header)
    assert bench.log_count("'mystery'") <= 2
    bench.until(lambda: int(bench.state("bad inputs") or 0) >= 30, "all of them are counted")
    assert_edge_found(show(bench, half_bright()))


def test_a_size_that_changes_without_calibration_is_followed(bench: NodeBench) -> None:
    assert_edge_found(show(bench, half_bright(400, 240)), 200.5)
    assert_edge_found(show(bench, half_bright()))


@pytest.mark.parametrize(
    ("fault", "words"),
    [("zero focal", "focal"), ("NaN", "nan"), ("all zero", "not calibrated"), ("no size", "width")],
)
def test_bad_calibration_gets_a_line_and_lines_go_on(bench: NodeBench, fault: str, words: str) -> None:
    info = info_of(CAMERA)
    if fault == "zero focal":
        info.k[0] = 0.0
    elif fault == "NaN":
        info.k[4] = float("nan")
    elif fault == "all zero":
        info.k = np.zeros(9)
    else:
        info.width = 0
    bench.say_surely("camera_info", info)
    bench.log_line("/camera_info", words)
    assert_edge_found(show(bench, half_bright()))


def test_a_clock_that_jumps_back_gets_a_line_and_lines_go_on(bench: NodeBench) -> None:
    show(bench, half_bright())
    bench.next_stamp(-900_000_000)
    assert_edge_found(show(bench, half_bright()))
    bench.log_line("/image", "went back by 0.867 s")


def test_an_impossible_setting_is_refused_live_with_the_reason(bench: NodeBench) -> None:
    refused = bench.set_parameter("edge_contrast", 200.0)
    assert not refused.successful
    assert "must not exceed contrast" in refused.reason
    refused = bench.set_parameter("method", "guess")
    assert not refused.successful
    assert "trace, hough" in refused.reason
    refused = bench.set_parameter("min_length", -1.0)
    assert not refused.successful
    assert_edge_found(show(bench, half_bright()))


def test_a_setting_changes_live(bench: NodeBench) -> None:
    assert bench.set_parameter("min_length", 5000.0).successful
    assert show(bench, half_bright()).width == 0
    assert bench.set_parameter("min_length", 15.0).successful
    assert_edge_found(show(bench, half_bright()))


def test_calibrated_lines_are_those_of_the_rectified_picture(bench: NodeBench) -> None:
    """An upright line left of the centre, bent by the lens, is straight where an ideal camera sees it."""
    column = 40.0
    rectified = np.full((HEIGHT, WIDTH), 40, np.uint8)
    rectified[:, 41:] = 200
    rows, columns = np.indices((HEIGHT, WIDTH)).reshape(2, -1)
    seen = BENT.rectified_pixels(np.column_stack([columns, rows])).astype(np.float32)
    bent = cv2.remap(
        cv2.GaussianBlur(rectified, (0, 0), 1.0),
        seen[:, 0].reshape(HEIGHT, WIDTH),
        seen[:, 1].reshape(HEIGHT, WIDTH),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    bench.say_surely("camera_info", info_of(BENT))
    found = lines_from_message(show(bench, bent))
    upright = found[np.abs(found.midpoints[:, 0] - column) < 20.0]
    longest = upright.endpoints[np.argmax(upright.lengths)]
    assert upright.lengths.max() > 150
    np.testing.assert_allclose(longest[[0, 2]], column + 0.5, atol=0.3)
    bench.until(lambda: bench.state("level") == "0", "all is well with a calibration")


def test_a_picture_of_another_size_than_its_calibration_says_nothing_wrong(bench: NodeBench) -> None:
    bench.say_surely("camera_info", info_of(CAMERA))
    assert_edge_found(show(bench, half_bright()))
    assert show(bench, half_bright(400, 240)).width == 0
    bench.log_line("/image", "400 x 240", "camera_info is for 320 x 240")
    assert_edge_found(show(bench, half_bright()))


def test_the_overlay_is_drawn_for_who_listens(bench: NodeBench) -> None:
    bench.say_surely("camera_info", info_of(CAMERA))
    bench.hears(Image, "lines/overlay")
    bench.until(lambda: bench.node.count_publishers("lines/overlay"), "the overlay is advertised")
    drawn: Image | None = None
    while drawn is None:
        message = image_message(bench.header(), half_bright())
        bench.say("image", message)
        bench.answer("lines", message.header)
        drawn = bench.said("lines/overlay")[-1] if bench.said("lines/overlay") else None
    assert (drawn.encoding, drawn.width, drawn.height) == ("bgr8", WIDTH, HEIGHT)
    pixels = np.frombuffer(drawn.data, np.uint8).reshape(HEIGHT, WIDTH, 3).astype(int)
    coloured = np.abs(pixels - pixels[:, :, :1]).max(axis=2) > 40
    assert coloured[:, 155:167].sum() > 150
    assert not coloured[:, :120].any()


def looks_at(bench: NodeBench, region: RegionOfInterest) -> PointCloud2:
    """What is found where it is told to look, after a picture seen as a whole."""
    assert_edge_found(show(bench, half_bright()))
    bench.say_surely("attention", region)
    return show(bench, half_bright())


def rows_of(cloud: PointCloud2) -> tuple[float, float]:
    rows = lines_from_message(cloud).endpoints[:, 1::2]
    return float(rows.min()), float(rows.max())


def test_only_the_region_is_searched_while_it_holds(bench: NodeBench) -> None:
    bench.say_surely("camera_info", info_of(CAMERA))
    region = RegionOfInterest(x_offset=100, y_offset=80, width=120, height=100)
    assert rows_of(looks_at(bench, region)) == pytest.approx((80, 179), abs=8.0)
    bench.until(lambda: "16 % of the picture" in bench.state("message"), "it says what share it looks at")
    assert rows_of(show(bench, half_bright())) == pytest.approx((80, 179), abs=8.0)
    # nobody says anything new: pictures 0.4 s later it holds no more
    message = image_message(bench.header(step_ns=400_000_000), half_bright())
    bench.say("image", message)
    assert_edge_found(bench.answer("lines", message.header))


def test_all_zero_means_everywhere_and_so_does_a_size_that_changes(bench: NodeBench) -> None:
    region = RegionOfInterest(x_offset=100, y_offset=80, width=120, height=100)
    assert rows_of(looks_at(bench, region))[1] < 200
    bench.say_surely("attention", RegionOfInterest())
    assert_edge_found(show(bench, half_bright()))
    bench.say_surely("attention", region)
    wide = Camera(300.0, 300.0, 199.5, 119.5, 400, HEIGHT)
    bench.say_surely("camera_info", info_of(wide))
    assert_edge_found(show(bench, half_bright(400, 240)), 200.5)
    bench.say_surely("camera_info", info_of(CAMERA))
    assert_edge_found(show(bench, half_bright()))


@pytest.mark.parametrize(
    ("region", "words"),
    [
        (RegionOfInterest(x_offset=300, width=100, height=100), "does not lie in a picture of 320 x 240"),
        (RegionOfInterest(width=100), "100 x 0"),
        (RegionOfInterest(x_offset=5), "0 x 0"),
    ],
)
def test_a_bad_region_gets_a_line_and_the_whole_picture_is_searched(
    bench: NodeBench, region: RegionOfInterest, words: str
) -> None:
    bench.say_surely("camera_info", info_of(CAMERA))
    assert_edge_found(looks_at(bench, region))
    bench.log_line("/attention", words, "the whole picture is searched")


def test_at_age_zero_no_region_is_obeyed(bench: NodeBench) -> None:
    assert bench.set_parameter("attention.age", 0.0).successful
    assert_edge_found(looks_at(bench, RegionOfInterest(x_offset=100, y_offset=80, width=120, height=100)))
    assert bench.set_parameter("attention.age", 0.35).successful


def test_the_overlay_darkens_what_is_not_searched(bench: NodeBench) -> None:
    bench.say_surely("camera_info", info_of(CAMERA))
    bench.hears(Image, "lines/overlay")
    region = RegionOfInterest(x_offset=100, y_offset=80, width=120, height=100)

    def level(drawn: Image) -> int:
        return int(np.frombuffer(drawn.data, np.uint8).reshape(HEIGHT, WIDTH, 3)[20, 300, 0])

    bench.until(lambda: bench.node.count_publishers("lines/overlay"), "the overlay is advertised")
    while not bench.said("lines/overlay"):
        show(bench, half_bright())
    cloud = looks_at(bench, region)
    drawn = bench.answer("lines/overlay", cloud.header)
    assert level(drawn) == 100
