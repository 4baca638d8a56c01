# SPDX-License-Identifier: Apache-2.0
"""Listens to a running graph and writes down when what arrived: `python -m bench.probe`, a process by itself.

It ends when it has heard answers and then none for a while.
"""

from __future__ import annotations

import json
import time
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped, TwistStamped
from sensor_msgs.msg import PointCloud2

from robot_vision.bags.messages import header_stamp_ns
from robot_vision.ros.diagnostics import TOPIC as DIAGNOSTICS
from robot_vision.ros.node import VisionNode
from robot_vision.ros.parameters import Setting
from robot_vision.ros.qos import EVERY
from robot_vision.ros.run import run_node

TOPICS = {
    "lines": PointCloud2,
    "vanishing_points": PointCloud2,
    "heading": PoseWithCovarianceStamped,
    "steering": TwistStamped,
}


class Probe(VisionNode):
    """Hears the answers of the graph as bytes, so that listening takes as little as it can."""

    SETTINGS: ClassVar = (
        Setting("output", "", "the file to write", live=False),
        Setting("silence", 2.5, "end after so long without an answer, s", 0.1, 60.0, live=False),
    )

    def __init__(self) -> None:
        super().__init__("probe")
        self._heard: dict[str, list[tuple[int, int, int]]] = {topic: [] for topic in TOPICS}
        self._diagnostics: dict[str, list[dict[str, float]]] = {}
        self._last_s: float | None = None
        for topic, kind in TOPICS.items():
            self.create_subscription(kind, topic, self._receiver_of(topic), EVERY, raw=True)
        self.hear(DiagnosticArray, DIAGNOSTICS, self._hear_diagnostics, EVERY)
        self.create_timer(0.1, self._end_after_silence, clock=self.steady_clock)
        self.use_settings()

    def stop(self) -> None:
        """Write down what was heard."""
        said = {"topics": self._heard, "diagnostics": self._diagnostics}
        Path(self.settings["output"]).write_text(json.dumps(said), encoding="utf-8")

    def _receiver_of(self, topic: str) -> Any:
        return partial(_write_down, self._heard[topic], self._note_time)

    def _note_time(self) -> None:
        self._last_s = time.monotonic()

    def _hear_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            numbers = {item.key: float(item.value) for item in status.values if _is_number(item.value)}
            self._diagnostics.setdefault(status.name.lstrip("/"), []).append(numbers)

    def _end_after_silence(self) -> None:
        if self._last_s is not None and time.monotonic() - self._last_s > self.settings["silence"]:
            self.exit_code = 0


def _write_down(rows: list[tuple[int, int, int]], note_time: Any, cdr: bytes, info: dict[str, Any]) -> None:
    now = time.time_ns()
    rows.append((header_stamp_ns(cdr), int(info["source_timestamp"]), now))
    note_time()


def _is_number(text: str) -> bool:
    return text.replace(".", "", 1).isdecimal()


def main(args: list[str] | None = None) -> None:
    """Run the probe until the graph falls silent."""
    run_node(Probe, args)


if __name__ == "__main__":
    main()
