# SPDX-License-Identifier: Apache-2.0
"""Keeps the nodes from pictures to steering running as one graph, until somebody ends it."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable
from typing import Any

from robot_vision.demo.show import NODES
from robot_vision.ros.processes import Graph, ProcessError

LOOK_S = 0.5  # how often it is looked whether all processes live


def run_graph(
    transport: str, height_m: float, pitch: float, namespace: str, say: Callable[[str], Any]
) -> None:
    """Run line_detector, vp_estimator and corridor_steering until SIGINT or SIGTERM.

    The graph lives in the ROS domain of this process, so that the outside world hears it.

    Args:
        transport: how pictures come, raw or compressed.
        height_m: of the camera over the ground, m; 0: not known, then there is no offset.
        pitch: of the camera, rad; down is positive.
        namespace: of all names.
        say: takes each line of the nodes' logs.

    Raises:
        ProcessError: a node has ended by itself; the others are ended, too.
    """
    settings: dict[str, dict[str, Any]] = {name: {} for name in NODES}
    settings["line_detector"] = {"transport": transport}
    settings["vp_estimator"] = {"camera.height": height_m, "camera.pitch": pitch}
    settings["corridor_steering"] = {"mind_lean": True, "camera.pitch": pitch}
    stopped = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopped.set())
    outside = {
        "ROS_DOMAIN_ID": os.environ.get("ROS_DOMAIN_ID", "0"),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET"),
    }
    with Graph(outside, on_line=lambda node, line: say(line)) as graph:
        nodes = [graph.start(name, settings[name], {"__ns": namespace}) for name in NODES]
        while not stopped.wait(LOOK_S):
            ended = [node for node in nodes if not node.running]
            if ended:
                raise ProcessError(
                    f"{ended[0].node} has ended with code {ended[0].returncode}; see its log above"
                )
