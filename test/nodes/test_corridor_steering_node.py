# SPDX-License-Identifier: Apache-2.0
"""The steering as a process: it steers by headings, and stands still when it cannot or may not."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped, TwistStamped
from nav_msgs.msg import Path
from node_bench import NodeBench
from sensor_msgs.msg import Imu, Range
from std_srvs.srv import SetBool

from robot_vision.control import CorridorSteering
from robot_vision.perception.attitude import Attitude
from robot_vision.perception.lane import LaneHeading
from robot_vision.ros.messages import attitude_to_message, heading_to_message, path_to_message
from robot_vision.ros.node import stamp_ns

SPEED = 0.6


@pytest.fixture(scope="module")
def bench(ros_domain: int) -> Iterator[NodeBench]:
    bench = NodeBench(ros_domain, "corridor_steering", {"speed": SPEED, "timeout": 20.0})
    try:
        bench.speaks(PoseWithCovarianceStamped, "heading")
        bench.speaks(Range, "clearance")
        bench.speaks(Path, "path_ahead")
        bench.speaks(Imu, "attitude")
        bench.hears(TwistStamped, "steering")
        bench.connect()
        yield bench
    finally:
        bench.close()


def lane_at(yaw: float = 0.0, offset: float = 0.0) -> LaneHeading:
    return LaneHeading(yaw, 1e-4, offset, 1e-4)


def steer(bench: NodeBench, lane: LaneHeading) -> TwistStamped:
    message = heading_to_message(bench.header(), lane)
    bench.say("heading", message)
    answer: TwistStamped = bench.answer("steering", message.header)
    assert answer.header.frame_id == "base_link"
    return answer


def start_anew(bench: NodeBench) -> None:
    bench.next_stamp(-900_000_000)


def is_still(message: TwistStamped) -> bool:
    return message.twist.linear.x == 0.0 and message.twist.angular.z == 0.0


def test_before_any_heading_it_says_nothing(bench: NodeBench) -> None:
    before = len(bench.states)
    bench.until(lambda: len(bench.states) > before + 1, "it lives on for a second")
    assert bench.said("steering") == []


def test_it_steers_as_the_library_does(bench: NodeBench) -> None:
    law = CorridorSteering(speed=SPEED)
    start_anew(bench)
    steer(bench, lane_at())  # whose stamp goes back and so starts the law anew
    start_anew(bench)
    for yaw, offset in [(0.1, 0.2), (0.05, 0.15), (0.0, 0.1), (-0.2, -0.4)] * 5:
        said = steer(bench, lane_at(yaw, offset))
        wanted = law.update(lane_at(yaw, offset), 1e-9 * stamp_ns(said.header.stamp))
        assert said.twist.linear.x == pytest.approx(wanted.speed, abs=1e-9)
        assert said.twist.angular.z == pytest.approx(wanted.turn_rate, abs=1e-9)
    assert said.twist.linear.x > 0.1


def test_a_robot_left_of_the_middle_turns_right(bench: NodeBench) -> None:
    start_anew(bench)
    for _ in range(10):
        said = steer(bench, lane_at(0.0, 0.3))
    assert said.twist.angular.z < -0.01


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("NaN yaw", "orientation"),
        ("NaN offset", "position.y is nan"),
        ("no orientation", "orientation"),
        ("negative variance", "negative"),
        ("unknown yaw", "unknown"),
    ],
)
def test_a_bad_heading_gets_a_line_and_the_next_good_one_steering(
    bench: NodeBench, fault: str, words: str
) -> None:
    message = heading_to_message(bench.header(), lane_at())
    if fault == "NaN yaw":
        message.pose.pose.orientation.z = float("nan")
    elif fault == "NaN offset":
        message.pose.pose.position.y = float("nan")
    elif fault == "no orientation":
        message.pose.pose.orientation.w = 0.0
    elif fault == "negative variance":
        message.pose.covariance[35] = -1.0
    else:
        message.pose.covariance[35] = 1e6
    bench.say_surely("heading", message)
    bench.log_line("/heading", words)
    assert not any(
        said.header.stamp == message.header.stamp and not is_still(said) for said in bench.said("steering")
    )
    steer(bench, lane_at())


def clearance(bench: NodeBench, metres: float, age_ns: int = 0) -> None:
    bench.next_stamp(age_ns)
    header = bench.header("base_link")
    message = Range(header=header, min_range=0.1, max_range=20.0, range=metres)
    now = stamp_ns(header.stamp) - age_ns
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(now, 10**9)
    bench.say_surely("clearance", message)


def test_it_stops_before_what_stands_in_the_way(bench: NodeBench) -> None:
    start_anew(bench)
    for _ in range(40):
        free = steer(bench, lane_at())
    assert free.twist.linear.x > 0.4
    clearance(bench, 0.3)
    assert steer(bench, lane_at()).twist.linear.x == 0.0
    bench.until(lambda: "stands 0.3 m ahead" in bench.state("message"), "it says why")
    clearance(bench, math.inf)
    assert steer(bench, lane_at()).twist.linear.x > 0.0


def test_when_clearance_falls_silent_it_stands_still(bench: NodeBench) -> None:
    start_anew(bench)
    steer(bench, lane_at())
    clearance(bench, 9.0, age_ns=20_100_000_000)
    assert is_still(steer(bench, lane_at()))
    bench.until(lambda: "nobody looks at what is ahead" in bench.state("message"), "it says why")
    clearance(bench, 9.0)
    assert not is_still(steer(bench, lane_at()))


def test_a_clearance_that_is_no_number_is_refused(bench: NodeBench) -> None:
    clearance(bench, math.nan)
    bench.log_line("/clearance", "range is nan")
    steer(bench, lane_at())


def test_silence_makes_it_stand_still_once_with_the_stamp_of_the_last_picture(bench: NodeBench) -> None:
    start_anew(bench)
    assert bench.set_parameter("timeout", 0.5).successful
    last = steer(bench, lane_at(0.1, 0.1))
    bench.until(lambda: "no heading for 0.5 s" in bench.state("message"), "it says that it stands still")
    before = len(bench.states)
    bench.until(lambda: len(bench.states) > before + 1, "another second is over")
    after = [said for said in bench.said("steering") if said.header.stamp == last.header.stamp]
    assert len(after) == 2
    assert is_still(after[1])
    assert bench.said("steering")[-1] is after[1]
    assert bench.set_parameter("timeout", 20.0).successful
    assert not is_still(steer(bench, lane_at()))


def test_disabled_it_stands_still_at_once_and_enabled_it_goes_on(bench: NodeBench) -> None:
    start_anew(bench)
    last = steer(bench, lane_at())
    answer = bench.call(SetBool, "enable", SetBool.Request(data=False))
    assert answer.success
    bench.until(lambda: is_still(bench.said("steering")[-1]), "it stands still")
    assert bench.said("steering")[-1].header.stamp == last.header.stamp
    count = len(bench.said("steering"))
    bench.say_surely("heading", heading_to_message(bench.header(), lane_at()))
    bench.until(lambda: bench.state("message") == "disabled", "it says that it is disabled")
    assert bench.call(SetBool, "corridor_steering/enable", SetBool.Request(data=True)).success
    assert not is_still(steer(bench, lane_at()))
    assert len(bench.said("steering")) == count + 1


def test_a_heading_said_again_and_again_does_not_keep_it_moving(bench: NodeBench) -> None:
    start_anew(bench)
    steer(bench, lane_at())
    frozen = bench.header()
    bench.say_surely("heading", heading_to_message(frozen, lane_at()))
    bench.until(lambda: bench.said("steering")[-1].header.stamp == frozen.stamp, "it steers by it once")
    count = len(bench.said("steering"))
    bench.say_surely("heading", heading_to_message(frozen, lane_at()))
    bench.log_line("/heading", "does not advance")
    assert len(bench.said("steering")) == count


def test_limits_change_live_and_nonsense_is_refused(bench: NodeBench) -> None:
    assert bench.set_parameter("speed", 0.2).successful
    start_anew(bench)
    for _ in range(40):
        said = steer(bench, lane_at())
    assert 0.15 < said.twist.linear.x <= 0.2
    refused = bench.set_parameter("speed", -1.0)
    assert not refused.successful
    assert "speed" in refused.reason
    assert bench.set_parameter("speed", SPEED).successful


def test_a_clock_that_jumps_back_gets_a_line_and_steering_goes_on(bench: NodeBench) -> None:
    steer(bench, lane_at())
    start_anew(bench)
    steer(bench, lane_at())
    bench.log_line("/heading", "went back")


def test_on_a_road_it_waits_for_the_path_of_the_picture_and_follows_it(bench: NodeBench) -> None:
    start_anew(bench)
    steer(bench, lane_at())
    for _ in range(10):
        header = bench.header()
        bench.say_surely("heading", heading_to_message(header, lane_at(), "road"))
        assert not any(said.header.stamp == header.stamp for said in bench.said("steering"))
        bench.say_surely("path_ahead", path_to_message(header, [(x, 0.05 * x * x) for x in range(6)]))
        said = bench.answer("steering", header)
    assert said.twist.angular.z > 0.01  # the road bends to the left, though the robot heads along it
    broken = path_to_message(bench.header(), [(0.0, 0.0), (math.nan, 0.0)])
    bench.say_surely("path_ahead", broken)
    bench.log_line("/path_ahead", "point 1 of the path")
    steer(bench, lane_at())


def lean(bench: NodeBench, roll: float, pitch: float) -> None:
    attitude = Attitude.from_angles(roll, pitch, 1e-6 * np.eye(2))
    bench.say_surely("attitude", attitude_to_message(bench.header(), attitude))


def test_a_robot_that_leans_slows_and_says_so(bench: NodeBench) -> None:
    assert bench.set_parameter("mind_lean", True).successful
    assert bench.set_parameter("camera.pitch", 0.3).successful
    start_anew(bench)
    for _ in range(40):
        lean(bench, 0.0, 0.3)  # the camera as it is mounted
        upright = steer(bench, lane_at())
    assert upright.twist.linear.x > 0.4
    for _ in range(40):
        lean(bench, 0.4, 0.3)
        leaning = steer(bench, lane_at())
    assert leaning.twist.linear.x == pytest.approx(0.0, abs=1e-6)
    bench.until(lambda: "tip over" in bench.state("message"), "it says why")
    broken = attitude_to_message(bench.header(), Attitude.from_angles(0.0, 0.3, 1e-6 * np.eye(2)))
    broken.orientation_covariance[0] = -1.0
    bench.say_surely("attitude", broken)
    bench.log_line("/attitude", "absent")
    assert bench.set_parameter("mind_lean", False).successful
    assert bench.set_parameter("camera.pitch", 0.0).successful
    assert steer(bench, lane_at()).twist.linear.x > 0.0
