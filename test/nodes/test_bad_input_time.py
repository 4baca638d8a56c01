# SPDX-License-Identifier: Apache-2.0
"""Time as bad input: a simulated clock that stands still, runs on, and jumps back."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped, TwistStamped
from node_bench import NodeBench
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header

from robot_vision.perception.lane import LaneHeading
from robot_vision.ros.messages import heading_to_message

LANE = LaneHeading(0.1, 1e-4, 0.1, 1e-4)


@pytest.fixture(scope="module")
def bench(ros_domain: int) -> Iterator[NodeBench]:
    bench = NodeBench(ros_domain, "corridor_steering", {"use_sim_time": True, "timeout": 0.5})
    try:
        bench.speaks(PoseWithCovarianceStamped, "heading")
        bench.speaks(Clock, "/clock")
        bench.hears(TwistStamped, "steering")
        bench.connect()
        yield bench
    finally:
        bench.close()


def at(bench: NodeBench, ms: int) -> Time:
    """Set the clock and wait until the node has it."""
    now = Time(sec=ms // 1000, nanosec=ms % 1000 * 1_000_000)
    bench.say_surely("/clock", Clock(clock=now))
    return now


def steer(bench: NodeBench, ms: int) -> TwistStamped:
    header = Header(stamp=at(bench, ms), frame_id="camera")
    bench.say("heading", heading_to_message(header, LANE))
    answer: TwistStamped = bench.answer("steering", header)
    return answer


def test_silence_is_measured_by_the_clock_of_the_replay_which_may_stand_still(bench: NodeBench) -> None:
    assert steer(bench, 10_000).twist.linear.x > 0.0
    before = len(bench.states)
    bench.until(lambda: len(bench.states) > before + 1, "a second is over while /clock stands still")
    assert len(bench.said("steering")) == 1
    at(bench, 10_400)
    steer(bench, 10_450)
    at(bench, 10_900)
    assert steer(bench, 10_940).twist.linear.x > 0.0
    at(bench, 11_500)
    bench.until(lambda: len(bench.said("steering")) == 4, "it stands still after half a second of the replay")
    assert bench.said("steering")[-1].twist.linear.x == 0.0
    assert bench.said("steering")[-1].header.stamp == bench.said("steering")[-2].header.stamp


def test_a_clock_that_jumps_back_gets_a_line_and_steering_goes_on(bench: NodeBench) -> None:
    steer(bench, 20_000)
    assert steer(bench, 5_000).twist.linear.x > 0.0
    bench.log_line("/clock", "jumped back by 15.000 s")
    assert steer(bench, 5_050).twist.linear.x > 0.0
