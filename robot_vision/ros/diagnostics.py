# SPDX-License-Identifier: Apache-2.0
"""Tells on /diagnostics, in plain words, how a node fares: whether it is ready, what it counts, what to try.

Said once a second, and at once when level, message or readiness change.
"""

from __future__ import annotations

import re
import time
from enum import IntEnum
from typing import Final

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node
from rclpy.qos import QoSProfile

TOPIC: Final = "/diagnostics"
PERIOD_S: Final = 1.0
#: Changes are told at once, but never more often than this.
SHORTEST_PAUSE_S: Final = 0.1
#: What may differ between two messages that say the same.
NUMBER: Final = re.compile(r"[-+]?\d[\d.,e+-]*")


class Level(IntEnum):
    """How bad it is."""

    OK = 0
    WARN = 1
    ERROR = 2


class Diagnostics:
    """The state of one node, and its publisher.

    Attributes:
        heard: pictures (or what stands for them) that came in.
        answered: answers that went out.
        skipped: pictures that were sent but never examined, because a newer one had come.
        lost: pictures that the transport lost.
        complaints: bad inputs so far.
        last_complaint: the latest of them.
        latency_ms: from the stamp of the last picture to its answer, by the node's clock.
        processing_ms: spent on the last answer.
        details: what else a node has to tell, by name.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publisher = node.create_publisher(DiagnosticArray, TOPIC, QoSProfile(depth=10))
        self.heard = 0
        self.answered = 0
        self.skipped = 0
        self.lost = 0
        self.complaints = 0
        self.last_complaint = ""
        self.latency_ms = 0.0
        self.processing_ms = 0.0
        self.details: dict[str, str] = {}
        self._ready = False
        self._waits_for = "starting"
        self._level = Level.OK
        self._message = "waits for the first picture"
        self._advice = ""
        self._told: tuple[Level, str, bool] | None = None
        self._told_at = -PERIOD_S

    @property
    def ready(self) -> bool:
        """Whether the node is warm and connected."""
        return self._ready

    def report(self, level: Level, message: str, advice: str = "") -> None:
        """Set how the node fares; a message that differs only in its numbers is no change."""
        self._level, self._message, self._advice = level, message, advice
        self._tell_if_changed()

    def set_ready(self, waits_for: str) -> None:
        """Set what the node still waits for; empty: it is ready."""
        self._ready, self._waits_for = not waits_for, waits_for
        self._tell_if_changed()

    def tick(self) -> None:
        """Tell when a second is over or a change could not be told at once; call it often."""
        if time.monotonic() - self._told_at >= PERIOD_S:
            self._tell()
        else:
            self._tell_if_changed()

    def _state(self) -> tuple[Level, str, bool]:
        if self._ready or self._level is Level.ERROR:
            return self._level, self._message, self._ready
        return Level.WARN, self._waits_for, False

    def _change(self) -> tuple[Level, str, bool]:
        level, message, ready = self._state()
        return level, NUMBER.sub("#", message), ready

    def _tell_if_changed(self) -> None:
        if self._change() != self._told and time.monotonic() - self._told_at >= SHORTEST_PAUSE_S:
            self._tell()

    def _tell(self) -> None:
        level, message, ready = self._state()
        self._told = self._change()
        self._told_at = time.monotonic()
        values = {
            "ready": "true" if ready else "false",
            "pictures in": str(self.heard),
            "answers out": str(self.answered),
            "skipped": str(self.skipped),
            "lost": str(self.lost),
            "last latency ms": f"{self.latency_ms:.1f}",
            "last processing ms": f"{self.processing_ms:.1f}",
            "bad inputs": str(self.complaints),
            "last bad input": self.last_complaint,
            "what to try": self._advice,
            **self.details,
        }
        status = DiagnosticStatus(
            level=bytes([level]),
            name=self._node.get_fully_qualified_name(),
            message=message,
            hardware_id="robot_vision",
            values=[KeyValue(key=key, value=value) for key, value in values.items()],
        )
        array = DiagnosticArray(status=[status])
        array.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(array)
