# SPDX-License-Identifier: Apache-2.0
"""A small graph around the bag nodes: real processes, and a listener in the test that waits."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import QoSProfile

from robot_vision.bags import BagWriter, messages

TIMEOUT = 60.0
IMAGE = "sensor_msgs/msg/Image"
ODOMETRY = "nav_msgs/msg/Odometry"


class Graph:
    """Everything that runs in one ROS domain of its own."""

    def __init__(self, domain: int) -> None:
        self.domain = domain
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node("listener", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.processes: list[subprocess.Popen[str]] = []

    def start(self, node: str, *arguments: str, env: dict[str, str] | None = None, **parameters: Any) -> Any:
        command = [sys.executable, "-m", f"robot_vision.nodes.{node}", "--ros-args", *arguments]
        for name, value in parameters.items():
            command += ["-p", f"{name}:={value}"]
        environment = {**os.environ, "ROS_DOMAIN_ID": str(self.domain), **(env or {})}
        process = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
        self.processes.append(process)
        return process

    def hear(self, topic: str, kind: Any, depth: int = 500) -> list[bytes]:
        heard: list[bytes] = []
        self.node.create_subscription(kind, topic, heard.append, QoSProfile(depth=depth), raw=True)
        return heard

    def until(self, condition: Callable[[], Any], what: str) -> None:
        end = time.monotonic() + TIMEOUT
        while not condition():
            assert time.monotonic() < end, f"waited {TIMEOUT} s in vain: {what}; {self._processes()}"
            self.executor.spin_once(timeout_sec=0.05)

    def _processes(self) -> str:
        """How the processes fare, for whoever waited in vain."""
        codes = {" ".join(process.args[2:]): process.poll() for process in self.processes}
        return "; ".join(
            f"{name}: {'runs' if code is None else f'ended with {code}'}" for name, code in codes.items()
        )

    def ended(self, process: Any) -> str:
        """Wait for the end of a process that must end well; returns what it said."""
        self.until(lambda: process.poll() is not None, f"the end of {process.args[2]}")
        said = str(process.stderr.read())
        assert process.returncode == 0, said
        return said

    def interrupt(self, process: Any, number: int = signal.SIGINT) -> str:
        process.send_signal(number)
        return self.ended(process)

    def call(self, service: str, kind: Any) -> Any:
        client = self.node.create_client(kind, service)
        self.until(client.service_is_ready, f"the service {service}")
        future = client.call_async(kind.Request())
        self.until(future.done, f"an answer of {service}")
        self.node.destroy_client(client)
        return future.result()

    def close(self) -> None:
        for process in self.processes:
            if process.poll() is None:
                process.terminate()
                try:
                    process.wait(10)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()
            if process.stderr is not None:
                process.stderr.close()
        self.node.destroy_node()
        self.executor.shutdown()
        rclpy.shutdown(context=self.context)


_graphs = 0


@contextmanager
def new_graph() -> Iterator[Graph]:
    """Open a graph in a domain that no other test run is likely to use."""
    global _graphs
    _graphs += 1
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    graph = Graph(1 + (os.getpid() * 13 + _graphs) % 100)
    try:
        yield graph
    finally:
        graph.close()


def write_drive(
    path: Path, pictures: int = 5, size: tuple[int, int] = (48, 64), rate_hz: float = 20.0
) -> Path:
    """Write a bag: odometry of the picture's stamp and, halfway to the next picture, another one."""
    import numpy as np

    with BagWriter(path) as bag:
        for i in range(pictures):
            stamp = 10**9 + round(i * 1e9 / rate_hz)
            odometry = messages.odometry(stamp, (i, 0, 0), (0, 0, 0, 1))
            picture = np.full((*size, 3), i % 256, np.uint8)
            between = stamp + round(0.5e9 / rate_hz)
            bag.write("/image", IMAGE, stamp, messages.image(stamp, "camera", picture))
            bag.write("/odom", ODOMETRY, stamp, odometry)
            bag.write("/odom", ODOMETRY, between, messages.odometry(between, (i + 0.5, 0, 0), (0, 0, 0, 1)))
    return path
