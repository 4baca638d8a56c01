# SPDX-License-Identifier: Apache-2.0
"""Nodes as processes: they refuse nonsense in one line, end cleanly, and leave nothing behind when killed."""

from __future__ import annotations

import os
import re
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
import rclpy
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.context import Context

from robot_vision.places import shared_file
from robot_vision.ros.domains import FreeDomain
from robot_vision.ros.processes import Graph, NodeProcess, ProcessError, ros_arguments

NODES = ("line_detector", "vp_estimator", "corridor_steering")


@pytest.fixture(scope="module")
def graph(ros_domain: int) -> Iterator[Graph]:
    with Graph({"ROS_DOMAIN_ID": str(ros_domain)}) as graph:
        yield graph


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_nodes_with_code_0_and_no_odd_words(graph: Graph, number: int) -> None:
    processes = [graph.start(node) for node in NODES]
    for process in processes:
        process.wait_until_up()
    for process in processes:
        os.kill(process.pid, number)
    assert [process.wait(20.0) for process in processes] == [0, 0, 0]
    for process in processes:
        assert not [line for line in process.log if "[INFO]" not in line]


@pytest.mark.parametrize(
    ("node", "parameter", "value", "words"),
    [
        ("line_detector", "transport", "pigeon", "transport must be one of raw, compressed"),
        ("line_detector", "min_length", 5, "min_length must be a number such as 1.0, not 5"),
        ("line_detector", "edge_contrast", 100.0, "must not exceed contrast"),
        ("vp_estimator", "camera.height", -1.0, "camera.height must lie between 0 and 100, not -1"),
        ("vp_estimator", "lane.narrowest", 50.0, "lane.narrowest must be less than lane.widest"),
        ("corridor_steering", "timeout", float("nan"), "timeout must be a finite number"),
        ("corridor_steering", "enabled", "maybe", "enabled must be true or false"),
        (
            "line_detector",
            "qos_overrides./image.subscription.reliability",
            "perhaps",
            "qos_overrides of image",
        ),
    ],
)
def test_a_bad_parameter_is_refused_at_start_in_one_line(
    graph: Graph, node: str, parameter: str, value: object, words: str
) -> None:
    text = ".nan" if value != value else value
    arguments = ["--ros-args", "-p", f"{parameter}:={text}"]
    process = NodeProcess(node, arguments=arguments, environment=graph.environment)
    assert process.wait(60.0) == 2
    assert len(process.log) == 1
    assert process.log[0].startswith(f"{node}: ")
    assert words in process.log[0]


def test_waiting_for_a_node_that_ends_tells_why(graph: Graph) -> None:
    process = NodeProcess("line_detector", {"transport": "pigeon"}, environment=graph.environment)
    with pytest.raises(ProcessError, match=r"(?s)ended with code 2 .*must be one of raw, compressed"):
        process.wait_until_ready()


def segments_of(pid: int) -> set[Path]:
    maps = Path(f"/proc/{pid}/maps").read_text()
    return {Path(name) for name in re.findall(r"/dev/shm/fastrtps_[0-9a-f]{16}", maps)}


def test_what_a_killed_node_leaves_in_shared_memory_is_removed(graph: Graph) -> None:
    process = graph.start("corridor_steering")
    process.wait_until_up()
    own = segments_of(process.pid)
    assert own, "the profile of the package is not in use: no shared memory"
    process.kill()
    assert process.returncode == -signal.SIGKILL
    process.remove_shared_memory()
    assert not [segment for segment in own if segment.exists()]


def test_nodes_find_each_other_and_are_ready(graph: Graph) -> None:
    """The estimator is ready with detector and steering around it; the detector waits for pictures."""
    detector, estimator, steering = (graph.start(node) for node in NODES)
    estimator.wait_until_ready()
    steering.wait_until_ready()
    detector.wait_for_line("up; nobody publishes /image")
    assert not [line for line in detector.log if "ready" in line]


def test_domains_do_not_collide() -> None:
    domains = [FreeDomain() for _ in range(5)]
    try:
        numbers = [domain.id for domain in domains]
        assert len(set(numbers)) == 5
        assert all(1 <= number <= 101 for number in numbers)
    finally:
        for domain in domains:
            domain.close()


TEXTS = st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=12)
VALUES = st.one_of(
    st.booleans(),
    st.integers(-(2**40), 2**40),
    # rcl takes a number that is out of the normal range of double for a text
    st.floats(allow_nan=False, allow_infinity=False, allow_subnormal=False),
    TEXTS,
    st.lists(TEXTS, min_size=1, max_size=3),
)


@settings(max_examples=60)
@given(VALUES)
def test_a_parameter_arrives_as_it_was_given(ros_domain: int, value: object) -> None:
    context = Context()
    rclpy.init(args=ros_arguments({"given": value}, {}), context=context, domain_id=ros_domain)
    try:
        node = rclpy.create_node(
            "reader", context=context, automatically_declare_parameters_from_overrides=True
        )
        read = node.get_parameter("given").value
        node.destroy_node()
    finally:
        rclpy.shutdown(context=context)
    assert type(read) is type(value)
    assert read == value


@pytest.mark.parametrize("namespace", ["/", "/robot/front"])
def test_the_parameter_file_of_the_package_reaches_nodes_in_any_namespace(
    graph: Graph, namespace: str
) -> None:
    arguments = ["--ros-args", "--params-file", str(shared_file("config/corridor.yaml"))]
    process = NodeProcess(
        "line_detector",
        arguments=[*arguments, "-r", f"__ns:={namespace}"],
        environment=graph.environment,
    )
    process.wait_for_line(f"nobody publishes {namespace.rstrip('/')}/image/compressed")
    assert process.stop() == 0
