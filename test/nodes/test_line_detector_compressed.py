# SPDX-License-Identifier: Apache-2.0
"""Compressed pictures through the line detector, and what happens to those that come too fast."""

from __future__ import annotations

import array
from collections.abc import Iterator

import cv2
import numpy as np
import pytest
from node_bench import NodeBench
from sensor_msgs.msg import CompressedImage, PointCloud2

from robot_vision.ros.processes import NodeProcess

SENT = 60
TOPIC = "front/picture"
REMAPS = {"image/compressed": TOPIC}


@pytest.fixture(scope="module")
def bench(ros_domain: int) -> Iterator[NodeBench]:
    bench = NodeBench(ros_domain, "line_detector", {"transport": "compressed", "ready_patience": 0.1}, REMAPS)
    try:
        bench.speaks(CompressedImage, TOPIC, SENT)
        bench.hears(PointCloud2, "lines")
        bench.connect()
        yield bench
    finally:
        bench.close()


def jpeg(bench: NodeBench, width: int = 320, height: int = 240) -> CompressedImage:
    picture = np.full((height, width), 40, np.uint8)
    picture[:, width // 2 :] = 200
    data = cv2.imencode(".jpg", picture)[1].tobytes()
    return CompressedImage(header=bench.header(), format="jpeg", data=array.array("B", data))


def assert_lines_found(bench: NodeBench) -> None:
    message = jpeg(bench)
    bench.say(TOPIC, message)
    assert bench.answer("lines", message.header).width > 0


def test_who_waits_for_raw_pictures_is_told_of_the_compressed_ones(ros_domain: int, bench: NodeBench) -> None:
    process = NodeProcess("line_detector", remaps={"__node": "mistaken", **REMAPS})
    try:
        process.wait_for_line("]: up; ")
        bench.name, name = "mistaken", bench.name
        bench.states.clear()
        bench.until(lambda: "set transport:=compressed" in bench.state("message"), "it says what to try")
        bench.name = name
        bench.states.clear()
    finally:
        process.stop()
    bench.until(lambda: bench.state("ready") == "true", "the other one lives on")


def test_lines_of_a_jpeg_picture(bench: NodeBench) -> None:
    assert_lines_found(bench)


@pytest.mark.parametrize(
    ("keep", "words"),
    [(0, "empty"), (700, "cut off after 700 bytes"), (-1, "no picture that can be decoded")],
)
def test_a_bad_picture_gets_a_line_and_the_next_good_one_lines(
    bench: NodeBench, keep: int, words: str
) -> None:
    message = jpeg(bench)
    message.data = array.array("B", b"no picture at all") if keep < 0 else message.data[:keep]
    bench.say(TOPIC, message)
    bench.log_line(f"/{TOPIC}", words)
    assert bench.answer("lines", message.header).width == 0
    assert_lines_found(bench)


def test_pictures_that_come_too_fast_are_skipped_and_counted_and_the_newest_is_answered(
    bench: NodeBench,
) -> None:
    pictures = [jpeg(bench, 1600, 1200) for _ in range(SENT)]
    for picture in pictures:
        bench.say(TOPIC, picture)
    bench.answer("lines", pictures[-1].header)

    def counted() -> int:
        return sum(int(bench.state(key)) for key in ("pictures in", "skipped"))

    bench.until(lambda: counted() >= bench.sent[TOPIC], "every picture is counted")
    assert counted() == bench.sent[TOPIC]
    assert int(bench.state("skipped")) > 0
    assert_lines_found(bench)
