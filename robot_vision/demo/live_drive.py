# SPDX-License-Identifier: Apache-2.0
"""The demonstration without a recording: the graph drives through a simulated world, and one can watch."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robot_vision.bags.messages import stamp_ns, yaw_of
from robot_vision.demo.show import NODES, present
from robot_vision.demo.watching import TOUCHED, Watcher, watch
from robot_vision.ros.processes import Graph
from robot_vision.ros.replays import START_S
from robot_vision.simulation.record import build_world

if TYPE_CHECKING:
    from rich.console import Console

START_OFFSET_M, START_YAW = 0.3, math.radians(8.0)
LEAN = math.radians(0.5)


def run_live(world: str, out: Path, seconds: float, seed: int, console: Console) -> None:
    """Let the real nodes drive through a world, and leave demo.png, demo.mp4 and demo.mcap in a folder.

    Args:
        world: its name.
        out: the folder; made if it is not there.
        seconds: of simulated time, less if the lane is over before.
        seed: of the world and of all noise.
        console: where the drive is told.

    Raises:
        SimulationError: there is no such world, or none with a lane.
        ProcessError: a node ended before the drive did.
        DrawingError: a result cannot be written.
    """
    camera = build_world(world, seed).camera
    out.mkdir(parents=True, exist_ok=True)
    bag = out / "demo.mcap"
    settings: dict[str, dict[str, Any]] = {name: {"use_sim_time": True} for name in NODES}
    settings["line_detector"]["transport"] = "compressed"
    settings["vp_estimator"] |= {"camera.height": camera.height_m, "camera.pitch": camera.pitch}
    console.print(f"{world}: simulator -> {' -> '.join(NODES)} -> simulator, each a process of its own")
    with Graph() as graph:
        written = {"output": bag, "overwrite": True, "exclude": ["lines/overlay"]}
        recorder = graph.start("bag_recorder", written, nice=10)
        recorder.wait_for_line("recording")
        nodes = [graph.start(name, settings[name]) for name in NODES]
        simulator = graph.start(
            "simulator",
            {
                "world": world,
                "seed": seed,
                "seconds": seconds,
                "transport": "compressed",
                "start.offset": START_OFFSET_M,
                "start.yaw": START_YAW,
                "lean": LEAN,
                "wait_for_nodes": list(NODES),
                "wait_timeout": START_S,
            },
        )
        domain = int(graph.environment["ROS_DOMAIN_ID"])
        watch(_LaneWatcher(), simulator, [recorder, *nodes], domain, console)
    if simulator.returncode == TOUCHED:
        console.print("[red]the robot has touched something[/]")
    present(bag, bag, out, console)


class _LaneWatcher(Watcher):
    """The newest heading, its truth and the steering."""

    def __init__(self) -> None:
        super().__init__()
        self._heading = self._truth = self._steering = "none yet"
        self._truths: dict[int, str] = {}

    def topics(self) -> list[tuple[type, str, Callable[[Any], None]]]:
        """See `Watcher`."""
        from geometry_msgs.msg import PoseWithCovarianceStamped, TwistStamped

        return [
            (PoseWithCovarianceStamped, "heading", self.hear_heading),
            (PoseWithCovarianceStamped, "truth/heading", self.hear_truth),
            (TwistStamped, "steering", self.hear_steering),
        ]

    def hear_heading(self, message: Any) -> None:
        """Take what the nodes found."""
        stamp = stamp_ns(message)
        if stamp in self._truths:
            self._heading, self._truth = _lane_text(message), self._truths[stamp]
            self._truths = {later: text for later, text in self._truths.items() if later > stamp}

    def hear_truth(self, message: Any) -> None:
        """Take what is true; it comes before what was found in the same picture."""
        self.stamp_ns = stamp_ns(message)
        self._truths[self.stamp_ns] = _lane_text(message)

    def hear_steering(self, message: Any) -> None:
        """Take what is commanded."""
        turn = math.degrees(message.twist.angular.z)
        self._steering = f"{message.twist.linear.x:.2f} m/s {turn:+5.1f} °/s"

    def told(self) -> str:
        """See `Watcher`."""
        return f"heading, offset: {self._heading}  (truth {self._truth})  steering {self._steering}"


def _lane_text(message: Any) -> str:
    pose = message.pose.pose
    return f"{math.degrees(yaw_of(pose.orientation)):+6.2f}° {100 * pose.position.y:+6.1f} cm"
