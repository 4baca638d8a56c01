# SPDX-License-Identifier: Apache-2.0
"""The player between real processes: what the bag holds arrives, when it should."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bag_graph import IMAGE, Graph, new_graph, write_drive
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger

from robot_vision.bags import BagReader, BagWriter, messages

STEERING = "geometry_msgs/msg/TwistStamped"


@pytest.fixture
def graph() -> Iterator[Graph]:
    with new_graph() as made:
        yield made


def stamps(cdrs: list[bytes]) -> list[int]:
    return [messages.header_stamp_ns(cdr) for cdr in cdrs]


def test_the_bag_arrives_byte_for_byte_and_the_player_ends(graph: Graph, tmp_path: Path) -> None:
    bag = write_drive(tmp_path / "a.mcap")
    images, odometry = graph.hear("image", Image), graph.hear("odom", Odometry)
    clock = graph.hear("/clock", Clock)
    player = graph.start("bag_player", bag=bag, rate=10.0)
    said = graph.ended(player)
    clocks = len({message.log_time_ns for message in BagReader(bag)})
    graph.until(lambda: (len(images), len(odometry), len(clock)) == (5, 10, clocks), "all messages")
    assert images == [message.cdr for message in BagReader(bag).messages(["image"])]
    assert odometry == [message.cdr for message in BagReader(bag).messages(["odom"])]
    times = [deserialize_message(cdr, Clock).clock for cdr in clock]
    assert [time.sec * 10**9 + time.nanosec for time in times] == sorted(
        {message.log_time_ns for message in BagReader(bag)}
    )
    assert "15 messages, 5 pictures" in said


def answer(graph: Graph, to: list[bytes]) -> Any:
    """Publish answers by hand: returns a function that answers the newest picture."""
    publisher = graph.node.create_publisher(TwistStamped, "steering", 10)

    def send(back: int = -1) -> None:
        message = TwistStamped()
        message.header = deserialize_message(to[back], Image).header
        publisher.publish(message)

    return send


def test_lockstep_holds_everything_later_until_the_answer_is_there(graph: Graph, tmp_path: Path) -> None:
    images, odometry = graph.hear("image", Image), graph.hear("odom", Odometry)
    send = answer(graph, images)
    player = graph.start(
        "bag_player", bag=write_drive(tmp_path / "a.mcap"), lockstep="steering", lockstep_timeout=3600.0
    )
    for count in range(1, 6):
        graph.until(lambda count=count: len(images) == count, "the next picture")  # type: ignore[misc]
        # the odometry of its stamp has been acknowledged before it, nothing later has been sent
        graph.until(lambda: stamps(odometry)[-1:] >= stamps(images)[-1:], "the odometry of its stamp")
        assert stamps(odometry)[-1] == stamps(images)[-1] and player.poll() is None
        send()
    said = graph.ended(player)
    graph.until(lambda: len(odometry) == 10, "the last odometry")
    assert "5 answered, 0 without an answer" in said


def test_lockstep_goes_on_when_no_answer_comes_and_counts_it(graph: Graph, tmp_path: Path) -> None:
    images = graph.hear("image", Image)
    send = answer(graph, images)
    player = graph.start(
        "bag_player", bag=write_drive(tmp_path / "a.mcap", 3), lockstep="steering", lockstep_timeout=0.2
    )
    graph.until(lambda: len(images) == 3, "all pictures")
    send(0)  # a late answer to the first picture answers nothing
    assert "0 answered, 3 without an answer in time" in graph.ended(player)


def test_pause_step_and_resume(graph: Graph, tmp_path: Path) -> None:
    images, odometry = graph.hear("image", Image), graph.hear("odom", Odometry)
    player = graph.start("bag_player", bag=write_drive(tmp_path / "a.mcap"), paused=True, rate=100.0)
    assert not graph.call("bag_player/pause", Trigger).success
    for count in (1, 2, 3):
        assert graph.call("bag_player/step", Trigger).success
        graph.until(lambda count=count: len(images) == count, "the picture of a step")  # type: ignore[misc]
    assert len(odometry) <= 5
    assert graph.call("bag_player/pause", Trigger).message == "it is held already"
    assert player.poll() is None and len(images) == 3
    assert graph.call("bag_player/resume", Trigger).success
    graph.ended(player)
    graph.until(lambda: len(images) == 5, "the rest")


def test_a_loop_sets_the_clock_back(graph: Graph, tmp_path: Path) -> None:
    images, clock = graph.hear("image", Image), graph.hear("/clock", Clock)
    player = graph.start("bag_player", bag=write_drive(tmp_path / "a.mcap", 3), loop=True, rate=10.0)
    graph.until(lambda: len(images) >= 7, "the third lap")
    graph.interrupt(player)
    got = stamps(images)[:7]
    assert got == [*got[:3], *got[:3], got[0]]
    times = [deserialize_message(cdr, Clock).clock for cdr in clock]
    seconds = [time.sec + time.nanosec * 1e-9 for time in times]
    assert any(later < earlier for earlier, later in zip(seconds, seconds[1:], strict=False))


def test_start_duration_topics_and_restamp(graph: Graph, tmp_path: Path) -> None:
    images, odometry, clock = (
        graph.hear("image", Image),
        graph.hear("odom", Odometry),
        graph.hear("/clock", Clock),
    )
    bag = write_drive(tmp_path / "a.mcap", 20)
    now = graph.node.get_clock().now().nanoseconds
    player = graph.start(
        "bag_player", bag=bag, start=0.25, duration=0.2, topics="[image]", restamp=True, rate=10.0
    )
    graph.ended(player)
    graph.until(lambda: len(images) == 5, "five pictures")
    assert [deserialize_message(cdr, Image).data[0] for cdr in images] == [5, 6, 7, 8, 9]
    assert not odometry and not clock
    assert now < stamps(images)[0] < stamps(images)[-1] < graph.node.get_clock().now().nanoseconds


def test_a_cut_off_bag_is_replayed_to_its_last_whole_chunk(graph: Graph, tmp_path: Path) -> None:
    bag, cut = write_drive(tmp_path / "a.mcap", 20, (480, 640)), tmp_path / "cut.mcap"
    cut.write_bytes(bag.read_bytes()[: bag.stat().st_size // 2])
    expected = [message.cdr for message in BagReader(cut).messages(["image"])]
    images = graph.hear("image", Image)
    said = graph.ended(graph.start("bag_player", bag=cut))
    graph.until(lambda: len(images) == len(expected), "what is left")
    assert images == expected and 5 < len(images) < 15
    assert said.count("is cut off") == 1


def test_namespaces_and_remaps_work(graph: Graph, tmp_path: Path) -> None:
    images = graph.hear("/robot/eye", Image)
    bag = write_drive(tmp_path / "a.mcap")
    graph.ended(graph.start("bag_player", "-r", "__ns:=/robot", "-r", "image:=eye", bag=bag, rate=10.0))
    graph.until(lambda: len(images) == 5, "all pictures")


def test_nobody_listening_is_said_and_does_not_hold_up_for_ever(graph: Graph, tmp_path: Path) -> None:
    player = graph.start("bag_player", bag=write_drive(tmp_path / "a.mcap"), wait_timeout=0.1, rate=10.0)
    said = graph.ended(player)
    assert "nobody listens to /image" in said


def test_types_that_are_not_installed_are_left_out_with_a_line(graph: Graph, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with BagWriter(path) as bag:
        bag.write("/thing", "my_msgs/msg/Thing", 1, b"\0\1\0\0")
        bag.write("/odom", "nav_msgs/msg/Odometry", 2, messages.odometry(2, (0, 0, 0), (0, 0, 0, 1)))
    odometry = graph.hear("odom", Odometry)
    said = graph.ended(graph.start("bag_player", bag=path))
    graph.until(lambda: len(odometry) == 1, "the other topic")
    assert "/thing is left out: its type my_msgs/msg/Thing is not installed" in said


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({}, "the parameter bag must name"),
        ({"bag": "nowhere.mcap"}, "there is no bag nowhere.mcap"),
        ({"bag": "BAG", "rate": -1.0}, "rate must lie between"),
        ({"bag": "BAG", "lockstep": "steering", "restamp": True}, "exclude each other"),
        ({"bag": "BAG", "topics": "[nothing]"}, "nothing to replay"),
    ],
)
def test_what_cannot_be_replayed_ends_with_one_line(
    graph: Graph, tmp_path: Path, parameters: dict[str, Any], words: str
) -> None:
    bag = write_drive(tmp_path / "a.mcap")
    player = graph.start("bag_player", **{k: bag if v == "BAG" else v for k, v in parameters.items()})
    graph.until(lambda: player.poll() is not None, "the end")
    said = player.stderr.read()
    assert player.returncode in (1, 2) and words in said and "Traceback" not in said


def test_an_answer_that_stands_in_the_bag_answers_nothing(graph: Graph, tmp_path: Path) -> None:
    bag = tmp_path / "a.mcap"
    with BagWriter(bag) as made:
        for stamp in (10**9, 2 * 10**9):
            made.write("/image", IMAGE, stamp, messages.image(stamp, "camera", np.zeros((4, 4), np.uint8)))
            made.write("/steering", STEERING, stamp, messages.twist_stamped(stamp, "base_link", 1.0, 0.0))
    graph.hear("image", Image)
    steering = graph.hear("steering", TwistStamped)
    player = graph.start("bag_player", bag=bag, lockstep="steering", lockstep_timeout=0.2, wait_timeout=1.0)
    said = graph.ended(player)
    assert "/steering is left out" in said and "0 answered, 2 without an answer" in said
    assert not steering


def test_who_publishes_the_same_is_named(graph: Graph, tmp_path: Path) -> None:
    graph.hear("image", Image)
    graph.node.create_publisher(Odometry, "odom", 10)
    player = graph.start("bag_player", bag=write_drive(tmp_path / "a.mcap", 2))
    assert "others publish /odom too" in graph.ended(player)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"topics": "image"}, "topics must be a list of texts"),
        ({"wait_for_nodes": "[1, 2]"}, "wait_for_nodes must be a list of texts"),
        ({"lockstep": "'a b'"}, "lockstep must hold names of topics, not 'a b'"),
        ({"start": 1000.0}, "start lies at 1000 s"),
    ],
)
def test_a_parameter_that_makes_no_sense_is_refused_in_one_line(
    graph: Graph, tmp_path: Path, parameters: dict[str, Any], words: str
) -> None:
    player = graph.start("bag_player", bag=write_drive(tmp_path / "a.mcap", 2), **parameters)
    graph.until(lambda: player.poll() is not None, "the refusal")
    said = player.stderr.read()
    assert player.returncode in (1, 2) and words in said and "Traceback" not in said


def test_nodes_are_awaited_in_the_namespace_of_the_player(graph: Graph, tmp_path: Path) -> None:
    publisher = graph.node.create_publisher(DiagnosticArray, "/diagnostics", 10)
    images = graph.hear("/front/image", Image)
    player = graph.start(
        "bag_player",
        "-r",
        "__ns:=/front",
        bag=write_drive(tmp_path / "a.mcap", 2),
        wait_for_nodes="[line_detector]",
        wait_timeout=3600.0,
    )

    def say_ready() -> bool:
        status = DiagnosticStatus(name="/front/line_detector", values=[KeyValue(key="ready", value="true")])
        publisher.publish(DiagnosticArray(status=[status]))
        return len(images) == 2

    graph.until(say_ready, "the pictures")
    graph.ended(player)
