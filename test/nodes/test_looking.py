# SPDX-License-Identifier: Apache-2.0
"""A camera on a head among real processes: what the estimator makes of its joints, and the loop over `look_at`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="nodes cannot be tested without rclpy")

from bag_graph import Graph, new_graph
from geometry_msgs.msg import PointStamped, PoseWithCovarianceStamped, TwistStamped
from node_bench import NodeBench
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CameraInfo, CompressedImage, JointState, PointCloud2
from std_msgs.msg import Header
from test_vp_estimator_node import CAMERA, HEIGHT_M, corridor_edges

from robot_vision.bags.messages import header_stamp_ns
from robot_vision.geometry import rotation_from_rpy
from robot_vision.perception import LineSegments
from robot_vision.ros.messages import heading_from_message, lines_to_message
from robot_vision.ros.processes import NodeProcess
from robot_vision.simulation.world import standard_camera

RATE = 10


@pytest.fixture(scope="module")
def bench(ros_domain: int) -> Iterator[NodeBench]:
    bench = NodeBench(ros_domain, "vp_estimator", {"camera.height": HEIGHT_M, "ready_patience": 0.1})
    try:
        for kind, topic in (
            (PointCloud2, "lines"),
            (CameraInfo, "camera_info"),
            (JointState, "joint_states"),
        ):
            bench.speaks(kind, topic)
        for kind, topic in (
            (PointCloud2, "vanishing_points"),
            (PoseWithCovarianceStamped, "heading"),
            (PointStamped, "look_at"),
        ):
            bench.hears(kind, topic)
        bench.connect()
        bench.say_surely("camera_info", CameraInfo(**CAMERA.camera_info()))
        yield bench
    finally:
        bench.close()


def seen(yaw: float, pan: float) -> LineSegments:
    """A corridor's edges before a robot in its middle, turned by `yaw`, whose head looks along `pan`."""
    camera = replace(CAMERA, pan=pan)
    base = (corridor_edges().reshape(-1, 3) - (0.0, 0.0, HEIGHT_M)) @ rotation_from_rpy(0.0, 0.0, yaw)
    optical = (base @ camera.optical_to_base).reshape(-1, 2, 3)
    pixels = camera.pixels(optical[(optical[..., 2] > 0.3).all(axis=1)].reshape(-1, 3)).reshape(-1, 4)
    inside = (pixels > -200).all(axis=1) & (pixels < 840).all(axis=1)
    return LineSegments.from_endpoints(pixels[inside])


def say_joints(bench: NodeBench, header: Header, names: list[str], angles: list[float]) -> None:
    message = JointState(header=Header(stamp=header.stamp), name=names, position=angles)
    bench.say_surely("joint_states", message)


def look(bench: NodeBench, yaw: float, pan: float) -> Header:
    header = bench.header()
    say_joints(bench, header, ["left_wheel", "camera_pan", "camera_tilt"], [3.0, pan, 0.0])
    bench.say("lines", lines_to_message(header, seen(yaw, pan)))
    bench.answer("vanishing_points", header)
    return header


def test_the_heading_is_the_robots_while_the_camera_pans(bench: NodeBench) -> None:
    """Wheels alone say nothing of a head: until its joints are heard, the camera is fixed."""
    header = bench.header()
    say_joints(bench, header, ["left_wheel"], [7.0])
    bench.say("lines", lines_to_message(header, seen(0.1, 0.0)))
    assert heading_from_message(bench.answer("heading", header)).yaw == pytest.approx(0.1, abs=0.01)
    for pan in 0.5 * np.sin(0.3 * np.arange(20)):
        header = look(bench, 0.1, float(pan))
        assert heading_from_message(bench.answer("heading", header)).yaw == pytest.approx(0.1, abs=0.02)
        point = bench.answer("look_at", header)
        assert point.header.frame_id == "base_link"
        assert point.point.x > 0.0 and math.isfinite(point.point.y + point.point.z)


def test_joints_that_are_no_angles_or_too_old_are_told_and_no_heading_is_said(bench: NodeBench) -> None:
    look(bench, 0.1, 0.2)
    header = bench.header()
    say_joints(bench, header, ["camera_pan"], [math.nan])
    bench.log_line("/joint_states", "camera_pan is nan")
    say_joints(bench, header, ["camera_pan"], [40.0])
    bench.log_line("/joint_states", "told in radians")
    say_joints(bench, header, ["camera_pan"], [])
    bench.log_line("/joint_states", "no position")
    late = bench.header(step_ns=400_000_000)
    bench.say("lines", lines_to_message(late, seen(0.1, 0.2)))
    assert bench.answer("vanishing_points", late).width == 0
    bench.log_line("/joint_states", "where the camera looked is not known", "0.43 s old")
    header = look(bench, 0.1, 0.2)
    assert bench.answer("vanishing_points", header).width > 0
    assert all(message.header.stamp != late.stamp for message in bench.said("heading"))


class Loop:
    """Simulator, line detector and estimator in lockstep; the test steers."""

    def __init__(
        self, graph: Graph, pictures: int, eyes: dict[str, Any] | None = None, **parameters: Any
    ) -> None:
        camera = standard_camera()
        environment = {"ROS_DOMAIN_ID": str(graph.domain)}
        self.graph = graph
        self.pictures = graph.hear("image/compressed", CompressedImage)
        self.joints = graph.hear("joint_states", JointState)
        self.headings = graph.hear("heading", PoseWithCovarianceStamped)
        self.truth = graph.hear("truth/heading", PoseWithCovarianceStamped)
        self.looks = graph.hear("look_at", PointStamped)
        self.hand = graph.node.create_publisher(TwistStamped, "steering", QoSProfile(depth=10))
        place = {"camera.height": camera.height_m, "camera.pitch": camera.pitch}
        simulated = {
            "settings": ["length=20"],
            "rate": RATE,
            "transport": "compressed",
            "lockstep": True,
            "lockstep_timeout": 20.0,
            "head.on": True,
            "seed": 3,
            "seconds": pictures / RATE,
            "wait_for_nodes": ["line_detector", "vp_estimator"],
            "wait_timeout": 60.0,
            **parameters,
        }
        self.processes = [
            NodeProcess(node, own, environment=environment)
            for node, own in (
                ("line_detector", {"transport": "compressed", "use_sim_time": True}),
                ("vp_estimator", {"use_sim_time": True, **(place if eyes is None else eyes)}),
                ("simulator", simulated),
            )
        ]

    def steer(self, picture: int, speed: float, turn_rate: float) -> None:
        """Answer a picture once it has come."""
        self.graph.until(lambda: len(self.pictures) > picture, f"picture {picture}")
        message = TwistStamped()
        stamp = header_stamp_ns(self.pictures[picture])
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        message.twist.linear.x, message.twist.angular.z = speed, turn_rate
        self.hand.publish(message)

    def close(self) -> None:
        for process in self.processes:
            process.stop()
            process.remove_shared_memory()


def heard(raw: list[bytes], kind: Any) -> dict[int, Any]:
    return {header_stamp_ns(cdr): deserialize_message(cdr, kind) for cdr in raw}


def test_in_the_loop_the_head_looks_where_the_robot_turns_to_and_the_heading_stays_true() -> None:
    pictures = 24
    with new_graph() as graph:
        loop = Loop(graph, pictures)
        try:
            for picture in range(pictures):
                turning = 8 <= picture < 15
                loop.steer(picture, 0.4 if not turning else 0.0, 0.9 if turning else 0.0)
            graph.until(lambda: not loop.processes[-1].running, "the end of the drive")
            # A point that cannot be looked at is told; the simulator has ended, so this is of the log alone.
            assert loop.processes[-1].wait(5.0) == 0, "\n".join(loop.processes[-1].log)
            assert not any("no look_at" in line for line in loop.processes[-1].log)
        finally:
            loop.close()
    joints = heard(loop.joints, JointState)
    pans = {
        stamp: dict(zip(said.name, said.position, strict=True))["camera_pan"]
        for stamp, said in joints.items()
    }
    stamps = [header_stamp_ns(cdr) for cdr in loop.pictures]
    assert set(stamps) <= set(pans), "the joints are told with the stamp of each picture"
    assert max(pans.values()) > math.radians(12.0)
    truth = heard(loop.truth, PoseWithCovarianceStamped)
    errors = [
        heading_from_message(said).yaw - heading_from_message(truth[stamp]).yaw
        for stamp, said in heard(loop.headings, PoseWithCovarianceStamped).items()
    ]
    assert len(errors) >= pictures - 4
    assert math.degrees(np.abs(errors).max()) < 0.6
    assert set(heard(loop.looks, PointStamped)) >= set(stamps[:-1])


def test_an_estimator_that_cannot_say_where_to_look_does_not_hold_up_the_drive() -> None:
    """Without the height of the camera it advertises look_at and says none."""
    pictures = 6
    with new_graph() as graph:
        loop = Loop(graph, pictures, {}, lockstep_timeout=1.5)
        try:
            for picture in range(pictures):
                loop.steer(picture, 0.4, 0.0)
            graph.until(lambda: not loop.processes[-1].running, "the end of the drive")
            log = "\n".join(loop.processes[-1].log)
        finally:
            loop.close()
    assert "/look_at: none to the picture at 0.00 s" in log
    assert log.count("/look_at: none") == 1
    assert '"without_steering": 0' in log


@pytest.mark.parametrize(
    ("frame", "point", "words"),
    [
        ("map", (3.0, 0.0, 0.0), "frame 'map'"),
        ("base_link", (math.nan, 0.0, 0.0), "not finite"),
        ("base_link", (-3.0, 0.5, 0.0), "behind the camera"),
    ],
)
def test_a_point_that_cannot_be_looked_at_gets_a_line(
    pointing: tuple[Graph, Loop, Any], frame: str, point: tuple[float, float, float], words: str
) -> None:
    graph, loop, publisher = pointing
    message = PointStamped(header=Header(frame_id=frame))
    message.point.x, message.point.y, message.point.z = point
    publisher.publish(message)
    simulator = loop.processes[-1]
    graph.until(lambda: any("/look_at" in line and words in line for line in simulator.log), words)
    assert simulator.running


@pytest.fixture(scope="module")
def pointing() -> Iterator[tuple[Graph, Loop, Any]]:
    """A simulator that stands at its first picture, and a hand that points."""
    with new_graph() as graph:
        loop = Loop(graph, 100, wait_for_nodes=["line_detector"], lockstep_timeout=600.0)
        publisher = graph.node.create_publisher(PointStamped, "look_at", QoSProfile(depth=10))
        try:
            graph.until(lambda: loop.pictures, "the first picture")
            graph.until(lambda: publisher.get_subscription_count(), "the simulator hears look_at")
            yield graph, loop, publisher
        finally:
            loop.close()
