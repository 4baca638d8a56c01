# SPDX-License-Identifier: Apache-2.0
"""Waiting for other nodes to say that they are ready, before the first picture goes out."""

from __future__ import annotations

from collections.abc import Iterable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus

from robot_vision.ros.diagnostics import TOPIC
from robot_vision.ros.node import VisionNode
from robot_vision.ros.qos import EVERY


class AwaitedNodes:
    """Hears on `/diagnostics` which of the nodes awaited are ready.

    Args:
        node: who waits.
        names: of the nodes awaited; a relative name is looked for in the namespace of `node`. Empty texts do not
            count, as a parameter of no names holds one.
    """

    def __init__(self, node: VisionNode, names: Iterable[str]) -> None:
        self._names = frozenset(_resolved(node.get_namespace(), name) for name in names if name)
        self._ready: set[str] = set()
        if self._names:
            node.hear(DiagnosticArray, TOPIC, self._hear, EVERY)

    def __bool__(self) -> bool:
        """Whether anybody is awaited at all."""
        return bool(self._names)

    @property
    def names(self) -> frozenset[str]:
        """The nodes awaited, with their namespaces."""
        return self._names

    def missing(self) -> list[str]:
        """Say in words who is not ready yet."""
        return [
            f"{name.lstrip('/')} has not said that it is ready" for name in sorted(self._names - self._ready)
        ]

    def _hear(self, message: DiagnosticArray) -> None:
        self._ready |= {f"/{status.name.lstrip('/')}" for status in message.status if _says_ready(status)}


def _resolved(namespace: str, name: str) -> str:
    return name if name.startswith("/") else f"{namespace.rstrip('/')}/{name}"


def _says_ready(status: DiagnosticStatus) -> bool:
    return any(item.key == "ready" and item.value == "true" for item in status.values)
