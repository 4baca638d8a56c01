# SPDX-License-Identifier: Apache-2.0
"""Drives the graph from picture to steering at the pace of a camera, while a probe and the books of Linux watch."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.arrivals import Heard, read_heard
from bench.machine import Load, between, look
from bench.replay import LINES, STEERING, VANISHING
from bench.sources import ROOT
from bench.stream import RATE_HZ
from robot_vision.ros.processes import Graph, NodeProcess, ProcessError, ros_arguments
from robot_vision.ros.replays import START_S

NODES = (LINES, VANISHING, STEERING)
PROBE = "probe"
PROBE_END_S = 30.0


@dataclass(frozen=True)
class Drive:
    """What one drive gave."""

    heard: Heard
    load: Load


def drive(bag: Path, pictures: int, scratch: Path, rate: float = 1.0, record: bool = False) -> Drive:
    """Replay a bag of pictures, stamped anew as they are sent, through the nodes.

    Args:
        bag: as `write_stream` makes it.
        pictures: in it.
        scratch: a folder for what is written.
        rate: seconds of the bag in a second.
        record: whether a bag_recorder takes down everything but the overlay, pictures included.

    Raises:
        ProcessError: a process ended too early.
    """
    heard = scratch / "heard.json"
    with Graph() as graph:
        if record:
            output = {"output": scratch / "recorded.mcap", "overwrite": True, "exclude": ["lines/overlay"]}
            graph.start("bag_recorder", output).wait_for_line("recording")
        nodes = [graph.start(node) for node in NODES]
        probe = _start_probe(graph, heard)
        try:
            settings: dict[str, Any] = {
                "bag": bag,
                "restamp": True,
                "rate": float(rate),
                "exit_at_end": False,
                "wait_for_nodes": [*NODES, PROBE],
                "wait_timeout": START_S,
            }
            player = graph.start("bag_player", settings)
            player.wait_for_line("replaying", START_S + 10.0)
            watched = {process.node: process.pid for process in graph.processes} | {PROBE: probe.pid}
            before = look(watched)
            player.wait_for_line("end of", 60.0 + 2.0 * pictures / (RATE_HZ * rate))
            after = look(watched)
            said = probe.communicate(timeout=PROBE_END_S)[0]
        except subprocess.TimeoutExpired as error:
            raise ProcessError("the probe heard nothing; did the nodes live?\n" + _logs(nodes)) from error
        finally:
            if probe.poll() is None:
                probe.terminate()
                probe.communicate()
    if probe.returncode:
        raise ProcessError(f"the probe ended with code {probe.returncode}:\n{said}")
    return Drive(read_heard(heard), between(before, after, os.cpu_count() or 1))


def _start_probe(graph: Graph, output: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "bench.probe", *ros_arguments({"output": output}, {})],
        cwd=ROOT,
        env={**os.environ, **graph.environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def _logs(nodes: list[NodeProcess]) -> str:
    return "\n".join(line for node in nodes for line in node.log[-5:])
