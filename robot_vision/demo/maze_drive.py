# SPDX-License-Identifier: Apache-2.0
"""The demonstration in a maze nobody has told the nodes: they explore it by one camera and run the shortest way."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.bags.messages import stamp_ns
from robot_vision.demo.drawing import DrawingError
from robot_vision.demo.watching import TOUCHED, Watcher, watch
from robot_vision.places import shared_file
from robot_vision.ros.processes import Graph, NodeProcess
from robot_vision.ros.replays import START_S
from robot_vision.simulation.maze import MazeSettings, maze

if TYPE_CHECKING:
    from rich.console import Console

NODES = ("line_detector", "vp_estimator", "plan_view_mapper", "maze_runner")
SIDE = 4
"""Rows and columns of the maze."""
RATE = 6
ANSWER_S = 10.0
"""How long the simulator waits for the steering to one picture."""
_OVER, _TOLD = "the run is over", "; steps: "
_PIXELS = 480
"""Height of the picture that is left."""
_KEPT = 8
"""Pictures that wait for their plan of the floor."""
_PAPER, _UNKNOWN, _WALL = (255, 255, 255), (225, 225, 225), (40, 40, 40)
_TRUE, _BELIEVED = (200, 130, 40), (30, 30, 220)


def drive_settings(node: str) -> dict[str, Any]:
    """Parameters with which a node explores a maze of cells of 1 m by one camera, from config/maze_camera.yaml.

    Raises:
        PlaceError: the file is missing.
    """
    from ruamel.yaml import YAML

    told = YAML(typ="safe").load(shared_file("config/maze_camera.yaml"))
    return dict(told[f"/**/{node}"]["ros__parameters"])


def run_maze(out: Path, seconds: float, seed: int, console: Console) -> None:
    """Let the real nodes explore and run a maze, and leave demo.png and demo.mcap in a folder.

    Args:
        out: the folder; made if it is not there.
        seconds: of simulated time at most.
        seed: of the maze and of all noise.
        console: where the drive is told.

    Raises:
        PlaceError: the settings of the drive are missing.
        ProcessError: a node ended before the drive did.
        DrawingError: the picture cannot be written.
    """
    world = maze(MazeSettings(rows=SIDE, columns=SIDE, cell=1.0), seed)
    place = {
        "camera.height": world.camera.height_m,
        "camera.pitch": world.camera.pitch,
        "camera.x": world.camera.x_m,
    }
    facing = ("east", "north", "west", "south")[round(world.beginning[2] / (math.pi / 2)) % 4]
    settings: dict[str, dict[str, Any]] = {
        "line_detector": {},
        "vp_estimator": place,
        "plan_view_mapper": {
            **place,
            **drive_settings("plan_view_mapper"),
            "robot.width": world.robot_width,
        },
        "maze_runner": {
            **place,
            **drive_settings("maze_runner"),
            "rows": SIDE,
            "columns": SIDE,
            "heading": facing,
        },
    }
    out.mkdir(parents=True, exist_ok=True)
    bag = out / "demo.mcap"
    console.print(f"maze: simulator -> {' -> '.join(NODES)} -> simulator, each a process of its own")
    with Graph() as graph:
        written = {
            "output": bag,
            "overwrite": True,
            "exclude": ["image", "lines/overlay", "plan_view/overlay"],
        }
        recorder = graph.start("bag_recorder", written, nice=10)
        recorder.wait_for_line("recording")
        nodes = [graph.start(name, {"use_sim_time": True, **settings[name]}) for name in NODES]
        simulator = graph.start(
            "simulator",
            {
                "world": "maze",
                "seed": seed,
                "settings": [f"rows={SIDE}", f"columns={SIDE}", "cell=1.0"],
                "seconds": seconds,
                "rate": RATE,
                "lockstep": True,
                "lockstep_timeout": ANSWER_S,
                "end_with_lane": False,
                "wait_for_nodes": list(NODES),
                "wait_timeout": START_S,
            },
        )
        status = _MazeWatcher(nodes[-1])
        domain = int(graph.environment["ROS_DOMAIN_ID"])
        watch(status, simulator, [recorder, *nodes], domain, console)
    if simulator.returncode == TOUCHED:
        console.print("[red]the robot has touched something[/]")
    if not status.over:
        console.print(f"[red]not run to its end within {seconds:g} s[/]")
    picture = out / "demo.png"
    if not cv2.imwrite(str(picture), status.drawn()):
        raise DrawingError(f"{picture} cannot be written")
    for path in (picture, bag):
        console.print(f"{path}  {path.stat().st_size / 1e6:.1f} MB")


class _MazeWatcher(Watcher):
    """What the runner is about, where it believes to be and where it is; and its picture."""

    def __init__(self, runner: NodeProcess) -> None:
        super().__init__()
        self._runner = runner
        self._maze: Any = None
        self._truth: dict[int, tuple[float, float]] = {}
        self._way: list[tuple[float, float]] = []
        self._believed: list[tuple[float, float]] = []
        self._worst = 0.0
        self._pictures: dict[int, NDArray[np.uint8]] = {}
        self._shown: tuple[int, NDArray[np.uint8]] | None = None

    def topics(self) -> list[tuple[type, str, Callable[[Any], None]]]:
        """See `Watcher`."""
        from geometry_msgs.msg import PoseWithCovarianceStamped
        from nav_msgs.msg import OccupancyGrid, Odometry
        from sensor_msgs.msg import Image

        return [
            (Image, "image", self._hear_picture),
            (OccupancyGrid, "plan_view", self._hear_plan),
            (OccupancyGrid, "maze", self._hear_maze),
            (Odometry, "truth/odom", self._hear_truth),
            (PoseWithCovarianceStamped, "pose", self._hear_pose),
        ]

    def told(self) -> str:
        """See `Watcher`."""
        line = next((line for line in reversed(self._runner.log) if _TOLD in line), "; looks for the goal")
        about = line.split("]: ")[-1].lstrip("; ")
        return f"place {100 * self._worst:.1f} cm wrong at most  {about}"

    def drawn(self) -> NDArray[np.uint8]:
        """The picture that showed most floor, and the maze as it is known, with the way driven and believed."""
        sheets = [] if self._shown is None else [self._shown[1]]
        if self._maze is not None:
            sheets.append(_plan(self._maze, self._way, self._believed))
        if not sheets:
            raise DrawingError("nothing to draw: the nodes said nothing")
        return np.asarray(np.hstack([_as_high(sheet) for sheet in sheets]), np.uint8)

    def _hear_picture(self, message: Any) -> None:
        pixels = np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, 3)
        self._pictures[stamp_ns(message)] = pixels
        for stamp in list(self._pictures)[:-_KEPT]:
            del self._pictures[stamp]

    def _hear_plan(self, message: Any) -> None:
        free = int((np.asarray(message.data, np.int8) == 0).sum())
        picture = self._pictures.get(stamp_ns(message))
        if picture is not None and (self._shown is None or free > self._shown[0]):
            self._shown = free, picture

    def _hear_maze(self, message: Any) -> None:
        self._maze = message

    def _hear_truth(self, message: Any) -> None:
        self.stamp_ns = stamp_ns(message)
        place = message.pose.pose.position
        self._truth[self.stamp_ns] = place.x, place.y

    def _hear_pose(self, message: Any) -> None:
        place, true = message.pose.pose.position, self._truth.pop(stamp_ns(message), None)
        if true is not None:
            self._way.append(true)
            self._believed.append((place.x, place.y))
            self._worst = max(self._worst, math.dist(true, self._believed[-1]))
        self.over = self.over or any(_OVER in line for line in self._runner.log)


def _plan(
    message: Any, way: list[tuple[float, float]], believed: list[tuple[float, float]]
) -> NDArray[np.uint8]:
    """The maze as it is known, north up: the way driven in blue, the one believed in red."""
    info = message.info
    cells = np.asarray(message.data, np.int8).reshape(info.height, info.width)
    picture = np.full((*cells.shape, 3), _UNKNOWN, np.uint8)
    picture[cells == 0], picture[cells > 0] = _PAPER, _WALL
    scale = max(1, _PIXELS // info.height)
    picture = np.repeat(np.repeat(picture[::-1], scale, axis=0), scale, axis=1)
    origin = info.origin.position.x, info.origin.position.y
    for track, colour, width in ((way, _TRUE, 4), (believed, _BELIEVED, 1)):
        columns, rows = ((np.array(track).reshape(-1, 2) - origin) / info.resolution * scale).T
        points = np.column_stack([columns, len(picture) - rows]).round().astype(np.int32)
        cv2.polylines(picture, [points], False, colour, width, cv2.LINE_AA)
    return picture


def _as_high(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A picture of the height of all."""
    width = round(picture.shape[1] * _PIXELS / picture.shape[0])
    return np.asarray(cv2.resize(picture, (width, _PIXELS), interpolation=cv2.INTER_AREA), np.uint8)
