# SPDX-License-Identifier: Apache-2.0
"""The recorder between real processes: what was said is in the bag, however the recording ends."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from bag_graph import Graph, new_graph, write_drive
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Image
from std_srvs.srv import Trigger

from robot_vision.bags import BagReader


@pytest.fixture
def graph() -> Iterator[Graph]:
    with new_graph() as made:
        yield made


def count_in(path: Path) -> int:
    """Return how much odometry stands in a bag that is still growing."""
    if not path.exists() or path.stat().st_size < 8:
        return 0
    odometry = BagReader(path).topics.get("/odom")
    return odometry.count if odometry else 0


def readiness(graph: Graph) -> Callable[[str], str]:
    """What the newest diagnostics of the recorder say under a key, empty before they say anything."""
    heard = graph.hear("/diagnostics", DiagnosticArray)

    def said(key: str) -> str:
        states = [s for cdr in heard for s in deserialize_message(cdr, DiagnosticArray).status]
        mine = [s for s in states if s.name.endswith("bag_recorder")]
        return {"message": mine[-1].message, **{v.key: v.value for v in mine[-1].values}}[key] if mine else ""

    return said


@pytest.mark.parametrize("compression", ["none", "zstd"])
@pytest.mark.parametrize("topics", ["[image,odom]", "[]"])
def test_play_and_record_gives_the_same_messages_back(
    graph: Graph, tmp_path: Path, topics: str, compression: str
) -> None:
    bag, out = write_drive(tmp_path / "a.mcap", 20, (480, 640)), tmp_path / "out.mcap"
    named = {"topics": topics} if topics != "[]" else {}
    ready = readiness(graph)
    recorder = graph.start(
        "bag_recorder", output=out, compression=compression, wait_for_nodes="[bag_player]", **named
    )
    images = graph.hear("image", Image)
    player = graph.start("bag_player", bag=bag, paused=True)
    graph.until(lambda: ready("ready") == "true", "the recorder")
    graph.call("bag_player/resume", Trigger)
    graph.ended(player)
    graph.until(lambda: len(images) == 20, "all pictures")
    said = graph.interrupt(recorder)
    for topic in ("/image", "/odom"):
        got = [message.cdr for message in BagReader(out).messages([topic])]
        assert got == [message.cdr for message in BagReader(bag).messages([topic])]
    assert BagReader(out).warning is None and "0 dropped" in said


def publish(graph: Graph, count: int, qos: QoSProfile | int = 100) -> None:
    publisher = graph.node.create_publisher(Odometry, "odom", qos)
    graph.until(lambda: publisher.get_subscription_count() == 1, "the recorder")
    for number in range(count):
        message = Odometry()
        message.pose.pose.position.x = float(number)
        publisher.publish(message)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_recording_is_whole(graph: Graph, tmp_path: Path, number: int) -> None:
    out = tmp_path / "out.mcap"
    recorder = graph.start("bag_recorder", output=out, topics="[odom]")
    publish(graph, 30)
    graph.until(lambda: count_in(out) > 0, "the first chunk")
    graph.interrupt(recorder, number)
    bag = BagReader(out)
    assert bag.message_count == 30 and bag.warning is None


def test_a_killed_recording_is_read_to_its_last_chunk(graph: Graph, tmp_path: Path) -> None:
    out = tmp_path / "out.mcap"
    # without shared memory: a killed process would leave its segment behind
    recorder = graph.start(
        "bag_recorder", output=out, topics="[odom]", env={"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}
    )
    publish(graph, 30)
    graph.until(lambda: count_in(out) > 0, "the first chunk")
    recorder.kill()
    recorder.wait()
    bag = BagReader(out)
    assert len(list(bag)) > 0 and bag.warning is not None and "out.mcap is cut off" in bag.warning


@pytest.mark.parametrize(
    "qos",
    [
        QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT),
        QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL),
    ],
    ids=["best_effort", "transient_local"],
)
def test_the_recorder_takes_what_a_publisher_offers(graph: Graph, tmp_path: Path, qos: QoSProfile) -> None:
    out = tmp_path / "out.mcap"
    recorder = graph.start("bag_recorder", output=out)
    publish(graph, 3, qos)
    graph.until(lambda: count_in(out) == 3, "the messages in the bag")
    graph.interrupt(recorder)
    offered = BagReader(out).topics["/odom"].qos
    assert offered is not None
    assert offered.reliability == qos.reliability.name.lower()
    assert offered.durability == qos.durability.name.lower()


def test_topics_can_be_left_out(graph: Graph, tmp_path: Path) -> None:
    out = tmp_path / "out.mcap"
    recorder = graph.start("bag_recorder", output=out, exclude="[image]")
    image = graph.node.create_publisher(Image, "image", 10)
    publish(graph, 1)
    image.publish(Image())
    graph.until(lambda: count_in(out) == 1, "the odometry")
    graph.interrupt(recorder)
    assert "/odom" in BagReader(out).topics and "/image" not in BagReader(out).topics


def test_it_is_ready_once_all_that_a_node_says_is_connected(graph: Graph, tmp_path: Path) -> None:
    """The node of the test stands for one of the graph: it comes late, and says something new later still."""
    name = graph.node.get_name()
    said = readiness(graph)
    recorder = graph.start("bag_recorder", output=tmp_path / "out.mcap", wait_for_nodes=f"[{name}]")
    graph.until(lambda: f"{name} has not said" in said("message"), "it says for whom it waits")
    assert said("ready") == "false"
    odometry = graph.node.create_publisher(Odometry, "odom", 10)
    diagnostics = graph.node.create_publisher(DiagnosticArray, "/diagnostics", 10)
    ready = DiagnosticStatus(name=name, values=[KeyValue(key="ready", value="true")])

    def told_and_ready() -> bool:
        diagnostics.publish(DiagnosticArray(status=[ready]))
        return said("ready") == "true"

    graph.until(told_and_ready, "it is ready")
    assert odometry.get_subscription_count() == 1
    graph.interrupt(recorder)


def test_a_recording_is_not_overwritten_unless_asked(graph: Graph, tmp_path: Path) -> None:
    out = write_drive(tmp_path / "out.mcap")
    recorder = graph.start("bag_recorder", output=out)
    graph.until(lambda: recorder.poll() is not None, "the refusal")
    said = recorder.stderr.read()
    assert recorder.returncode == 1 and "exists already" in said and "Traceback" not in said
    assert BagReader(out).message_count == 15
    recorder = graph.start("bag_recorder", output=out, overwrite=True, topics="[odom]")
    publish(graph, 1)
    graph.until(lambda: count_in(out) == 1, "the new recording")
    graph.interrupt(recorder)
    assert BagReader(out).message_count == 1


def test_a_name_that_is_none_is_refused_in_one_line(graph: Graph, tmp_path: Path) -> None:
    recorder = graph.start("bag_recorder", output=tmp_path / "out.mcap", topics="['bad name']")
    graph.until(lambda: recorder.poll() is not None, "the refusal")
    said = recorder.stderr.read()
    assert recorder.returncode == 2 and "topics must hold names of topics, not 'bad name'" in said
    assert "Traceback" not in said
