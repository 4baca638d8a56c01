# SPDX-License-Identifier: Apache-2.0
"""The simulator among others: who commands it, what it sends when, and how it says that something is wrong."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="the simulator cannot be tested without rclpy")

from bag_graph import Graph, new_graph
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CompressedImage

from robot_vision.bags.messages import header_stamp_ns
from robot_vision.ros.processes import NodeProcess, ProcessError
from robot_vision.simulation.record import START_NS

SHORT = ["length=8", "door_spacing=50"]
RATE = 10


@pytest.fixture
def graph() -> Iterator[Graph]:
    with new_graph() as opened:
        yield opened


class Drive:
    """A simulator in lockstep, and the hand that steers it."""

    def __init__(self, graph: Graph, **parameters: Any) -> None:
        self.graph = graph
        self.pictures = graph.hear("image/compressed", CompressedImage)
        self.truth = graph.hear("truth/odom", Odometry)
        self.odometry = graph.hear("odom", Odometry)
        self.clock = graph.hear("/clock", Clock)
        self.states: list[DiagnosticStatus] = []
        graph.node.create_subscription(
            DiagnosticArray,
            "/diagnostics",
            lambda message: self.states.extend(message.status),
            QoSProfile(depth=50),
        )
        self.hand = graph.node.create_publisher(TwistStamped, "steering", QoSProfile(depth=10))
        usual = {"settings": SHORT, "rate": RATE, "transport": "compressed", "lockstep": True}
        self.process = NodeProcess(
            "simulator",
            {**usual, "wait_timeout": 60.0, **parameters},
            environment={"ROS_DOMAIN_ID": str(graph.domain)},
        )

    def wait_for_picture(self, count: int) -> int:
        """Stamp of the count-th picture."""
        self.graph.until(lambda: len(self.pictures) >= count, f"picture {count}")
        return header_stamp_ns(self.pictures[count - 1])

    def steer(self, stamp: int, speed: float, turn: float = 0.0) -> None:
        message = TwistStamped()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        message.twist.linear.x, message.twist.angular.z = speed, turn
        self.hand.publish(message)

    def end(self) -> tuple[int, dict[str, Any]]:
        """Exit code and summary of the drive."""
        self.graph.until(lambda: not self.process.running, "the end of the simulator")
        code = self.process.wait(5.0)
        (line,) = (line for line in self.process.log if "summary: " in line)
        return code, json.loads(line.partition("summary: ")[2])

    def close(self) -> None:
        self.process.stop()
        self.process.remove_shared_memory()


def spoken(cdr: bytes) -> Any:
    return deserialize_message(cdr, Odometry)


def driven(graph: Graph, count: int) -> tuple[list[bytes], list[bytes], list[bytes]]:
    """Drive a few pictures in S-curves."""
    drive = Drive(graph, seconds=count / RATE, lean=0.01, seed=5)
    try:
        for number in range(1, count + 1):
            stamp = drive.wait_for_picture(number)
            assert stamp == START_NS + (number - 1) * 10**9 // RATE
            drive.steer(stamp, 0.6, 0.5 * math.sin(number / 2))
        code, summary = drive.end()
        assert (code, summary["without_steering"], summary["pictures"]) == (0, 0, count)
        assert summary["ended"] == "time"
    finally:
        drive.close()
    return drive.pictures, drive.odometry, drive.truth


def test_in_lockstep_the_same_steering_gives_the_same_bytes(graph: Graph) -> None:
    pictures, odometry, truth = driven(graph, 8)
    stamps = [header_stamp_ns(cdr) for cdr in odometry]
    assert stamps == sorted(set(stamps))
    assert {header_stamp_ns(cdr) for cdr in pictures} <= set(stamps)
    with new_graph() as other:
        assert driven(other, 8) == (pictures, odometry, truth)


def test_the_world_stands_still_until_its_picture_is_answered(graph: Graph) -> None:
    drive = Drive(graph, lockstep_timeout=30.0)
    try:
        first = drive.wait_for_picture(1)
        drive.steer(first + 1, 1.0)  # of no picture, and ahead of time
        graph.until(lambda: any("not obeyed" in state.message for state in drive.states), "a complaint")
        assert len(drive.pictures) == 1
        drive.steer(first, 0.5)
        second = drive.wait_for_picture(2)
        drive.steer(second, math.nan)
        graph.until(lambda: any("make no sense" in state.message for state in drive.states), "a complaint")
        assert len(drive.pictures) == 2
        drive.steer(second, 0.5)
        assert drive.wait_for_picture(3) == START_NS + 2 * 10**9 // RATE
        graph.until(lambda: len(drive.truth) >= 3, "truth")
        assert (
            0
            < spoken(drive.truth[2]).pose.pose.position.x - spoken(drive.truth[0]).pose.pose.position.x
            < 0.1
        )
    finally:
        drive.close()


def test_without_steering_the_vehicle_stops_and_says_so(graph: Graph) -> None:
    drive = Drive(graph, lockstep_timeout=0.1, seconds=3.0)
    try:
        for number in range(1, 11):
            drive.steer(drive.wait_for_picture(number), 0.8)
        code, summary = drive.end()
        assert code == 0
        assert summary["without_steering"] == 20
        graph.until(lambda: len(drive.truth) == 30, "the last truth")
        speeds = [spoken(cdr).twist.twist.linear.x for cdr in drive.truth]
        assert speeds[10] > 0.5
        assert speeds[13] == pytest.approx(0.8, abs=0.1)  # the last command still holds
        assert speeds[-1] == pytest.approx(0.0, abs=0.01)
        assert any("no steering to the picture at" in line for line in drive.process.log)
        assert any("no steering" in state.message for state in drive.states)
    finally:
        drive.close()


def test_steering_that_is_too_old_is_not_obeyed(graph: Graph) -> None:
    drive = Drive(graph, lockstep_timeout=0.1, stand_limit=2.0)
    try:
        first = drive.wait_for_picture(1)
        drive.wait_for_picture(8)
        drive.steer(first, 1.0)
        code, summary = drive.end()
        assert (code, summary["way_m"], summary["ended"]) == (0, 0.0, "stands")
        assert any("s old; not obeyed" in line for line in drive.process.log)
    finally:
        drive.close()


def test_a_touched_wall_is_told_counted_and_ends_with_a_code_of_its_own(graph: Graph) -> None:
    turned = math.pi / 2
    drive = Drive(graph, lockstep_timeout=0.1, seconds=2.0, **{"start.yaw": turned})
    try:
        for number in range(1, 21):
            drive.steer(drive.wait_for_picture(number), 1.0)
        code, summary = drive.end()
        assert code == 3
        assert (summary["contacts"], summary["closest_m"]) == (1, 0.0)
        assert summary["touched"].startswith("wall")
        told = [state for state in drive.states if state.name == "/simulator: drive"]
        values = {item.key: item.value for item in told[-1].values}
        assert (values["contacts"], told[-1].level) == ("1", DiagnosticStatus.ERROR)
        assert any("touched wall" in line for line in drive.process.log)
    finally:
        drive.close()


def test_in_real_time_it_drives_by_the_last_word_and_ends(graph: Graph) -> None:
    drive = Drive(graph, lockstep=False, seconds=1.0)
    try:
        stamp = drive.wait_for_picture(1)
        drive.steer(0, 0.5)  # no stamp: of a person's hand
        code, summary = drive.end()
        assert (code, summary["pictures"], stamp) == (0, RATE, START_NS)
        assert 0.05 < summary["way_m"] < 0.5
        times = [deserialize_message(cdr, Clock).clock for cdr in drive.clock]
        seconds = [time.sec + 1e-9 * time.nanosec - START_NS // 10**9 for time in times]
        assert seconds == sorted(set(seconds))
        assert seconds[-1] == pytest.approx(0.9 + 1 / 30, abs=0.07)
    finally:
        drive.close()


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"world": "moon"}, "there is no world 'moon'; there is: corridor"),
        ({"settings": ["width=0.1"]}, "width must be between"),
        ({"settings": ["width"]}, "write it as name=value"),
        ({"rate": 7}, "divide 600, not 7"),
        ({"vehicle": "tank"}, "vehicle must be one of"),
        ({"start.offset": 0.9}, "the robot would start inside wall"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(
    parameters: dict[str, Any], words: str, ros_domain: int
) -> None:
    process = NodeProcess("simulator", parameters)
    assert process.wait(60.0) == 2
    lines = [line for line in process.log if line.strip()]
    assert len(lines) == 1, lines
    assert words in lines[0]


def test_ctrl_c_ends_a_drive_with_its_summary(graph: Graph) -> None:
    drive = Drive(graph, lockstep_timeout=30.0)
    try:
        drive.steer(drive.wait_for_picture(1), 0.5)
        drive.wait_for_picture(2)
        assert drive.process.stop() == 0
        assert any("summary: " in line for line in drive.process.log)
    except ProcessError as error:
        pytest.fail(str(error))
    finally:
        drive.close()
