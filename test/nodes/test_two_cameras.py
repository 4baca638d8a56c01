# SPDX-License-Identifier: Apache-2.0
"""Two publishers of one topic count their messages each for itself: that is no loss."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from node_bench import NodeBench
from sensor_msgs.msg import Image, PointCloud2

from robot_vision.ros.images import image_message


@pytest.fixture(scope="module")
def bench(ros_domain: int) -> Iterator[NodeBench]:
    bench = NodeBench(ros_domain, "line_detector", {"ready_patience": 0.1})
    try:
        bench.speaks(Image, "image", 5)
        bench.hears(PointCloud2, "lines")
        bench.connect()
        yield bench
    finally:
        bench.close()


def picture(bench: NodeBench) -> Image:
    return image_message(bench.header(), np.full((48, 64), 90, np.uint8))


def test_pictures_of_two_publishers_in_turn_are_not_taken_for_skipped_ones(bench: NodeBench) -> None:
    second = bench.node.create_publisher(Image, "image", 5)
    greetings: list[Image] = []

    def greeted() -> bool:
        """Whether an answer to the second has come: only then does the node know it for sure."""
        greetings.append(picture(bench))
        second.publish(greetings[-1])
        stamps = [greeting.header.stamp for greeting in greetings]
        return any(cloud.header.stamp in stamps for cloud in bench.said("lines"))

    bench.until(greeted, "the node hears the second publisher")
    before = int(bench.state("skipped"))
    turns = [
        *["first"] * (len(greetings) + 5),
        "second",
        "first",
    ]  # to a single counter the last is far ahead
    for turn in turns:
        message = picture(bench)
        if turn == "second":
            second.publish(message)
        else:
            bench.say("image", message)
        bench.answer("lines", message.header)
    bench.until(lambda: int(bench.state("answers out")) > len(turns), "all of them are counted as answered")
    assert int(bench.state("skipped")) == before
