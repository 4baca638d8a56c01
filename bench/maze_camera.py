# SPDX-License-Identifier: Apache-2.0
"""Mazes the robot has never seen: explored and run by one camera and odometry that drifts, without touching a wall?

Lines, vanishing points, plan of the floor, walls, pose and steering are the library objects of the nodes; nothing of
the simulation but pictures, odometry and the place of the camera reaches them. The maze's size, its cells' side, the
start and the goal cells are known, as in a contest. Whether the robot was where it believed to be is scored, too.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.maze_drives import contest_maze
from bench.report import Cell, Row, Table, at_least, at_most
from robot_vision.control import PathPursuit
from robot_vision.demo.maze_drive import drive_settings
from robot_vision.mapping import PlanViewMapper, Pose
from robot_vision.perception import HeadingEstimator, LineDetector
from robot_vision.planning import Exploration, Maze, MazeExplorer, MazeRunner
from robot_vision.simulation.live import STANDING, LiveDrive, LiveSettings, OdometryAt
from robot_vision.simulation.maze import grown, maze_world

DRIVE = {name: value for name, value in drive_settings("maze_runner").items() if name != "timeout"}
"""Of the pursuit: the timeout is the node's."""
CELL_M = 1.0
"""At this size the camera sits 0.33 m over the floor, the walls are 0.28 m high."""
RATE, STRIDE = 15, 3
"""Commands a second, and how many come for each picture."""
ENTERED = 0.1
"""Cells behind a border at which a robot counts as being in the next cell."""
MOST_S_PER_CELL = 12.0
SEED = 0
GROWN = ((4, 5), (9, 5), (16, 5))
"""Size and seed of the mazes that are grown."""
CONTEST = ("04_test_01", "09MM2019C_Cheese", "16MM2016H_Kansai")
COUNTED = {"goal": ("goal",), "proof": ("goal", "proof"), "home": ("goal", "proof", "home")}


@dataclass(frozen=True)
class CameraRun:
    """How a maze was explored and run.

    Attributes:
        done: whether the robot came home and stands in a goal after its run.
        steps: taken in each stage.
        track_true: whether the cells it believed to be in are those it was in.
        shortest: steps of the shortest way it found.
        ran: steps of its run.
        wrong: walls it believes to know that are not so.
        contacts: walls touched.
        closest_m: least room to a wall.
        worst_m: greatest error of the place it believed to be at.
        time_s: simulated.
        perfect: the same maze explored with perfect sight.
    """

    done: bool
    steps: dict[str, int]
    track_true: bool
    shortest: int
    ran: int
    wrong: int
    contacts: int
    closest_m: float
    worst_m: float
    time_s: float
    perfect: Exploration

    def ratio(self, until: str) -> float:
        """Steps until the goal, the proof or home over those with perfect sight; nan if it did not get there."""
        told = {"goal": self.perfect.steps_to_goal, "proof": self.perfect.steps_to_proof}
        own = sum(self.steps.get(stage, 0) for stage in COUNTED[until])
        return own / told.get(until, self.perfect.steps_home) if self.done else np.nan


class Explorer:
    """The chain from picture to steering, without DDS."""

    def __init__(self, maze: Maze, drive: LiveDrive, cell: float) -> None:
        heading = round(1 - drive.world.beginning[2] / (np.pi / 2)) % 4
        self.runner = MazeRunner(maze.size, maze.goals, maze.start, heading, cell)
        self._camera = drive.world.camera
        self._detector, self._estimator = LineDetector(), HeadingEstimator()
        self._mapper = PlanViewMapper(low_borders=False)
        self._pursuit = PathPursuit(**DRIVE)
        self._last = STANDING

    def move(self, readings: list[OdometryAt]) -> None:
        """Hear odometry."""
        for at in readings:
            self.runner.move(at.time_ns * 1e-9, Pose(*at.reading[:3]))
            self._last = at

    def look(self, picture: NDArray[np.uint8], now: float) -> None:
        """See a picture."""
        odometry = self._last.reading
        lines = self._detector.detect(np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8))
        points = self._estimator.update(lines, self._camera, now, odometry.turn_rate).vanishing_points
        seen = points.weight > 0.0
        self.runner.see_directions(now, points.directions[seen], points.sigma[seen], self._camera)
        estimate = self._mapper.update(picture, lines, points, self._camera, now, Pose(*odometry[:3]))
        self.runner.see_plan(now, estimate.plan_view, self._camera.x_m)

    def steer(self, now: float) -> tuple[float, float]:
        """Say speed (m/s) and turn rate (rad/s)."""
        route, pose = self.runner.route(), self.runner.pose
        if pose is None:
            return 0.0, 0.0
        told = self._pursuit.update(route.points, (pose.x, pose.y, pose.yaw), now, route.seen)
        return told.speed, told.turn_rate


Look = Callable[[Explorer, LiveDrive, float], None]


def by_camera(mouse: Explorer, drive: LiveDrive, now: float) -> None:
    """Show the explorer what the camera takes."""
    mouse.look(drive.picture(), now)


def explore(maze: Maze, seed: int = SEED, cell: float = CELL_M, look: Look = by_camera) -> CameraRun:
    """Explore a maze, prove the shortest way, go home and run it."""
    drive = LiveDrive(maze_world(maze, cell, seed), LiveSettings(rate=RATE), seed)
    mouse = Explorer(maze, drive, cell)
    perfect = MazeExplorer(maze).explore()
    readings, track, worst = [STANDING], [maze.start], 0.0
    most = MOST_S_PER_CELL * (perfect.steps_home + len(perfect.shortest_path))
    number, stage = 0, mouse.runner.stage
    while drive.time_ns < most * 1e9 and not drive.score.contacts:
        mouse.move(readings)
        now, state = drive.time_ns * 1e-9, drive.state
        if number % STRIDE == 0:
            look(mouse, drive, now)
        number += 1
        told = mouse.steer(now)
        there = _cell_after(track[-1], state.x / cell, state.y / cell)
        if there != track[-1]:
            track.append(there)
        pose = mouse.runner.pose
        if pose is not None:
            worst = max(worst, float(np.hypot(pose.x - state.x, pose.y - state.y)))
        if mouse.runner.stage != stage:
            stage = mouse.runner.stage
            _tell(maze, mouse.runner, drive, worst)
        if mouse.runner.stage == "done" and told == (0.0, 0.0) and abs(state.speed) < 0.01:
            break
        drive.steer(*told, drive.time_ns)
        readings = drive.advance()
    runner, seen = mouse.runner, mouse.runner.seen
    wrong = ((seen.walls_east != maze.walls_east) & ~seen.unknown_east).sum()
    wrong += ((seen.walls_north != maze.walls_north) & ~seen.unknown_north).sum()
    return CameraRun(
        done=runner.stage == "done" and track[-1] in maze.goals,
        steps={str(stage): steps for stage, steps in runner.steps.items()},
        track_true=track == runner.track,
        shortest=len(runner.shortest_path) - 1,
        ran=runner.steps.get("run", 0),
        wrong=int(wrong),
        contacts=drive.score.contacts,
        closest_m=float(drive.summary()["closest_m"] or 0.0),
        worst_m=worst,
        time_s=drive.time_ns * 1e-9,
        perfect=perfect,
    )


def _tell(maze: Maze, runner: MazeRunner, drive: LiveDrive, worst_m: float) -> None:
    """Say how far a run has got: the large ones take minutes."""
    room_m = float(drive.summary()["closest_m"] or 0.0)
    rows, columns = maze.size
    text = f"{rows} x {columns}, {drive.time_ns * 1e-9:.0f} s: {runner.summary}; "
    text += f"place at most {1e3 * worst_m:.0f} mm wrong, least room {1e3 * room_m:.0f} mm"
    print(text, file=sys.stderr, flush=True)


def _cell_after(cell: tuple[int, int], x: float, y: float) -> tuple[int, int]:
    """The cell a robot is in that was in `cell`; it is in the next one when its middle is well within (in cells)."""
    row, column = cell
    inside = abs(y - row - 0.5) < 0.5 + ENTERED and abs(x - column - 0.5) < 0.5 + ENTERED
    return cell if inside else (int(y // 1), int(x // 1))


def run(quick: bool) -> list[Table]:
    """Explore a maze of each size grown from a seed and one of contests; only the small ones when it is to be quick.

    Raises:
        MissingSetError: the contest mazes are not there.
    """
    count = 1 if quick else len(GROWN)
    mazes = {f"{size} x {size}, seed {seed}": grown(size, size, 0.12, seed) for size, seed in GROWN[:count]}
    mazes |= {name: contest_maze(name) for name in CONTEST[:count]}
    # the largest first: each core has something to do until the end
    order = sorted(mazes, key=lambda name: -mazes[name].size[0])
    workers = min(os.cpu_count() or 1, len(mazes))
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        runs = dict(zip(order, pool.map(explore, (mazes[name] for name in order)), strict=True))
    return [table({name: runs[name] for name in mazes})]


def table(runs: dict[str, CameraRun]) -> Table:
    """The results side by side."""
    every = list(runs.values())
    rows = [
        Row("explored, home, and run", "", [Cell(float(one.done), at_least(1)) for one in every], 0),
        Row("walls touched", "", [Cell(one.contacts, at_most(0)) for one in every], 0),
    ]
    for until, words in (("goal", "to the goal"), ("proof", "to proof"), ("home", "until home")):
        own = [sum(one.steps.get(stage, 0) for stage in COUNTED[until]) for one in every]
        rows.append(Row(f"steps {words}", "", [Cell(steps) for steps in own], 0))
        mark = at_most(1.3) if until != "goal" else None
        rows.append(Row("over perfect sight's", "", [Cell(one.ratio(until), mark) for one in every], 2))
    rows += [
        Row("run over shortest way", "", [Cell(_share(one), at_most(1.0)) for one in every], 2),
        Row("walls believed wrongly", "", [Cell(one.wrong, at_most(0)) for one in every], 0),
        Row("cells as believed", "", [Cell(float(one.track_true), at_least(1)) for one in every], 0),
        Row("error of place, worst", "mm", [Cell(1e3 * one.worst_m) for one in every], 0),
        Row("room to the walls, least", "mm", [Cell(1e3 * one.closest_m) for one in every], 0),
        Row("time, simulated", "s", [Cell(one.time_s) for one in every], 0),
    ]
    title = f"mazes of {CELL_M:g} m cells, seen by one camera {1000 * CELL_M / 3:.0f} mm over the floor"
    notes = ["odometry with its usual noise and scale errors of 1 % (way) and 1.5 % (turns)"]
    return Table(title, list(runs), rows, notes)


def _share(one: CameraRun) -> float:
    """Steps of the run over those of the shortest way there is."""
    return one.ran / (len(one.perfect.shortest_path) - 1) if one.done else np.nan
