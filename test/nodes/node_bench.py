# SPDX-License-Identifier: Apache-2.0
"""One real node process between a test that speaks to it and hears what it says, over DDS."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any

import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from std_msgs.msg import Header

from robot_vision.ros.processes import NodeProcess

TIMEOUT_S = 60.0
PERIOD_NS = 33_333_333


class NodeBench:
    """Starts a node, speaks to it on the topics it hears, and collects what it says."""

    def __init__(
        self,
        domain: int,
        node: str,
        parameters: Mapping[str, Any] | None = None,
        remaps: Mapping[str, str] | None = None,
    ) -> None:
        self.name = node
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node("bench", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.process = NodeProcess(node, parameters, remaps, environment={"ROS_DOMAIN_ID": str(domain)})
        self._said: dict[str, list[Any]] = {}
        self._publishers: dict[str, Publisher] = {}
        self._now_ns = 1_000_000_000
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._hear_diagnostics, 50)
        self.sent: dict[str, int] = {}
        self.states: list[dict[str, str]] = []

    def close(self) -> None:
        self.process.stop()
        self.process.remove_shared_memory()
        self.node.destroy_node()
        self.executor.shutdown()
        rclpy.shutdown(context=self.context)

    def speaks(self, kind: type, topic: str, qos: QoSProfile | int = 10) -> None:
        """Advertise a topic the node hears."""
        self._publishers[topic] = self.node.create_publisher(kind, topic, qos)

    def falls_silent(self, topic: str) -> None:
        """Advertise a topic no longer."""
        self.node.destroy_publisher(self._publishers.pop(topic))

    def hears(self, kind: type, topic: str) -> None:
        """Collect what the node says on a topic."""
        said = self._said[topic] = []
        self.node.create_subscription(kind, topic, said.append, QoSProfile(depth=100))

    def connect(self) -> None:
        """Wait until the node is ready and both sides of every topic know each other."""
        self.process.wait_until_up()
        self.until(
            lambda: all(publisher.get_subscription_count() for publisher in self._publishers.values()),
            f"{self.name} hears {', '.join(self._publishers)}",
        )
        self.until(lambda: self.state("ready") == "true", f"{self.name} is ready")

    def until(self, condition: Callable[[], Any], what: str) -> None:
        end = time.monotonic() + TIMEOUT_S
        while not condition():
            assert self.process.running, "\n".join([f"{self.name} has died:", *self.process.log])
            assert time.monotonic() < end, "\n".join([f"waited in vain until {what}:", *self.process.log])
            self.executor.spin_once(timeout_sec=0.05)

    def next_stamp(self, step_ns: int = PERIOD_NS) -> Time:
        self._now_ns += step_ns
        return Time(sec=self._now_ns // 10**9, nanosec=self._now_ns % 10**9)

    def header(self, frame: str = "camera", step_ns: int = PERIOD_NS) -> Header:
        return Header(stamp=self.next_stamp(step_ns), frame_id=frame)

    def say(self, topic: str, message: Any) -> None:
        self._publishers[topic].publish(message)
        self.sent[topic] = self.sent.get(topic, 0) + 1

    def say_surely(self, topic: str, message: Any) -> None:
        """Say something and wait until the node has received it."""
        self.say(topic, message)
        assert self._publishers[topic].wait_for_all_acked(Duration(seconds=10)), f"{topic} did not arrive"

    def said(self, topic: str) -> list[Any]:
        return self._said[topic]

    def answer(self, topic: str, header: Header) -> Any:
        """Wait for what the node says on a topic with the stamp of a header."""

        def found() -> list[Any]:
            return [message for message in self._said[topic] if message.header.stamp == header.stamp]

        self.until(found, f"an answer on {topic} for {header.stamp}")
        return found()[0]

    def log_line(self, *parts: str) -> str:
        """Wait for a line of the node's log that holds all of these."""

        def found() -> list[str]:
            return [line for line in self.process.log if all(part in line for part in parts)]

        self.until(found, f"it logs {parts}")
        return found()[0]

    def log_count(self, *parts: str) -> int:
        return sum(all(part in line for part in parts) for line in self.process.log)

    def state(self, key: str) -> str:
        """What the latest diagnostics say under a key, or `message`, or `level`."""
        return self.states[-1].get(key, "") if self.states else ""

    def set_parameter(self, name: str, value: Any) -> Any:
        """Set a parameter of the running node; returns what it answers."""
        client = AsyncParameterClient(self.node, self.name)
        self.until(client.services_are_ready, "its parameter services are there")
        future = client.set_parameters([Parameter(name, value=value)])
        self.until(future.done, f"it answers to {name}")
        return future.result().results[0]

    def call(self, kind: Any, service: str, request: Any) -> Any:
        client = self.node.create_client(kind, service)
        self.until(client.service_is_ready, f"the service {service} is there")
        future = client.call_async(request)
        self.until(future.done, f"it answers {service}")
        self.node.destroy_client(client)
        return future.result()

    def _hear_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == f"/{self.name}":
                values = {value.key: value.value for value in status.values}
                self.states.append({**values, "message": status.message, "level": str(status.level[0])})
