# SPDX-License-Identifier: Apache-2.0
"""Watches a simulated drive until its end: what is told of it, as one line that changes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from robot_vision.ros.processes import NodeProcess, ProcessError
from robot_vision.simulation.record import START_NS

if TYPE_CHECKING:
    from rich.console import Console

TOUCHED = 3
"""Exit code of a simulator whose vehicle has touched something."""
_WAIT_S = 0.1
_TELL_EVERY_NS = 1_000_000_000


class Watcher(ABC):
    """What is told of a drive.

    Attributes:
        stamp_ns: of the newest moment heard of.
        over: whether the drive may end.
    """

    def __init__(self) -> None:
        self.stamp_ns, self.over = START_NS, False

    @abstractmethod
    def topics(self) -> list[tuple[type, str, Callable[[Any], None]]]:
        """Type, name and who hears it of each topic."""

    @abstractmethod
    def told(self) -> str:
        """What is known by now, without the time."""

    def __str__(self) -> str:
        return f"{(self.stamp_ns - START_NS) / 1e9:5.1f} s  {self.told()}"


def watch(
    status: Watcher, simulator: NodeProcess, others: list[NodeProcess], domain: int, console: Console
) -> None:
    """Show one line that changes, or on a console that is none a line a second, until the drive ends.

    Args:
        status: hears what is told.
        simulator: the drive ends with it, or when the status says so: then it is stopped.
        others: nodes that must not end before.
        domain: of the graph.
        console: where it is told.

    Raises:
        ProcessError: a node ended before the drive did, or the simulator failed.
    """
    import rclpy
    from rclpy.context import Context
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.signals import SignalHandlerOptions

    from robot_vision.ros.qos import NEWEST
    from robot_vision.ros.run import use_transport_profile

    use_transport_profile()
    context = Context()
    rclpy.init(context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("watcher", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    for kind, topic, callback in status.topics():
        node.create_subscription(kind, topic, callback, NEWEST)
    told_ns = START_NS
    try:
        with console.status("starting; the first time kernels are compiled") as line:
            while simulator.running and not status.over:
                executor.spin_once(timeout_sec=_WAIT_S)
                if status.stamp_ns > START_NS:
                    line.update(str(status))
                if status.stamp_ns - told_ns >= _TELL_EVERY_NS and not console.is_terminal:
                    told_ns = status.stamp_ns
                    console.print(str(status))
                _look_after(others)
    finally:
        executor.remove_node(node)
        node.destroy_node()
        executor.shutdown()
        context.try_shutdown()
    code = simulator.stop() if status.over else simulator.wait(_WAIT_S)
    if code not in (0, TOUCHED):
        raise ProcessError(
            "\n".join(["the drive failed; the log of simulator ends with:", *simulator.log[-20:]])
        )
    console.print(str(status))


def _look_after(nodes: list[NodeProcess]) -> None:
    for node in nodes:
        if not node.running:
            raise ProcessError(
                "\n".join([f"{node.node} ended before the drive; its log ends with:", *node.log[-20:]])
            )
