# SPDX-License-Identifier: Apache-2.0
"""The graph drives through a corridor by itself: whether it touches a wall, and how well it keeps to the middle."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from bench.replay import LINES, MAPPER, STEERING, VANISHING
from bench.report import Cell, Mark, Row, Table, at_least, at_most
from robot_vision.ros.processes import Graph, ProcessError
from robot_vision.ros.replays import START_S, wait_for_end
from robot_vision.simulation.world import standard_camera

SEEDS, QUICK_SEEDS = range(1, 11), range(1, 2)
WAY_M, WIDTH_M, ROBOT_M = 30.0, 2.0, 0.5
SPEED = 1.0
OFFSET_M, YAW, LEAN = 0.4, math.radians(10.0), math.radians(1.0)
BLOCKED_S = 13.0
STAND_S = 2.0
"""A robot that has stood so long drives no more; each picture without steering costs the lockstep its time-out."""
BOX_FRONT_M, START_M, ROBOT_FRONT_M = 10.0, 1.2, 0.3
"""Along the corridor: where the box begins and base_link starts; the robot reaches so far before that."""
SIMULATOR = "simulator"
SUMMARY = "summary: "
TOUCHED = 3  # exit code of a simulator whose vehicle has touched something


def run(quick: bool) -> list[Table]:
    """Drive with ten seeds, with one when it is to be quick.

    Raises:
        ProcessError: a node failed.
    """
    seeds = QUICK_SEEDS if quick else SEEDS
    free, blocked = [drive(seed) for seed in seeds], [drive_at_box(seed) for seed in seeds]
    return [_table(free), _blocked_table(seeds, blocked)]


def drive_at_box(seed: int) -> dict[str, Any]:
    """Let the nodes, the mapper among them, drive at a box that stands in the way; see `drive`."""
    return drive(
        seed,
        mapped=True,
        rate=10,
        world="corridor_blocked",
        settings=[""],
        seconds=BLOCKED_S,
        stand_limit=0.0,
    )


def room_before_box(driven: dict[str, Any]) -> float:
    """What is left between the robot's front and the box at the end of a drive, m."""
    return BOX_FRONT_M - START_M - ROBOT_FRONT_M - float(driven["way_m"])


def drive(
    seed: int,
    parameters: dict[str, dict[str, Any]] | None = None,
    mapped: bool = False,
    **settings: Any,
) -> dict[str, Any]:
    """Let the real nodes drive 30 m of corridor in lockstep, from 0.4 m and 10 degrees off, to its end.

    A robot that stands for good ends a drive, too.

    Args:
        seed: of the corridor, of noise and leaning.
        parameters: of the nodes, by node; None: those for the corridor.
        mapped: whether the floor is mapped, so that something looks at what is ahead.
        settings: further parameters of the simulator.

    Returns:
        What the simulator says at the end: ended (lane, time or stands), way_m, contacts, closest_m, offset_rms_m,
        offset_worst_m, pictures, without_steering, …

    Raises:
        ProcessError: a node failed.
    """
    camera = standard_camera()
    parameters = parameters or {
        LINES: {},
        VANISHING: {"camera.height": camera.height_m, "camera.pitch": camera.pitch},
        STEERING: {"speed": SPEED},
    }
    if mapped:
        parameters[MAPPER] = {**parameters[VANISHING], "robot.width": ROBOT_M}
    simulated = {
        "world": "corridor",
        "seed": seed,
        "settings": [f"length={WAY_M + 3:g}", f"width={WIDTH_M:g}"],  # it starts 1.2 m from one end
        "lockstep": True,
        "lockstep_timeout": 5.0,
        "start.offset": OFFSET_M,
        "start.yaw": YAW,
        "lean": LEAN,
        "width": ROBOT_M,
        "stand_limit": STAND_S,
        "wait_for_nodes": list(parameters),
        "wait_timeout": START_S,
        **settings,
    }
    with Graph() as graph:
        nodes = [graph.start(node, {"use_sim_time": True, **own}) for node, own in parameters.items()]
        simulator = graph.start(SIMULATOR, simulated)
        try:
            wait_for_end(simulator, nodes)
        except ProcessError:
            if simulator.returncode != TOUCHED:
                raise
    (line,) = (line for line in simulator.log if SUMMARY in line)
    summary: dict[str, Any] = json.loads(line.partition(SUMMARY)[2])
    return summary


def _blocked_table(seeds: Sequence[int], drives: list[dict[str, Any]]) -> Table:
    def cells(values: list[float], mark: Mark | None = None) -> list[Cell]:
        return [Cell(value, mark) for value in values]

    room = [room_before_box(driven) for driven in drives]
    rows = [
        Row("things touched", "", cells([float(d["contacts"]) for d in drives], at_most(0.0)), 0),
        Row("left before the box, not too little", "m", cells(room, at_least(0.3)), 2),
        Row("left before the box, not too much", "m", cells(room, at_most(1.5)), 2),
        Row("room to anything, least", "m", cells([float(d["closest_m"]) for d in drives]), 2),
        Row("off the middle at the end", "m", cells([float(d["offset_m"]) for d in drives]), 2),
    ]
    note = "with the offset not known the robot stays off the middle, where a waste bin may stop it before the box does"
    title = f"Closed loop through the nodes: {len(drives)} drives at a box in the way, by seed"
    return Table(title, [str(seed) for seed in seeds], rows, [note])


def _table(drives: list[dict[str, Any]]) -> Table:
    def values(name: str) -> list[float]:
        return [math.nan if drive[name] is None else float(drive[name]) for drive in drives]

    stood = float(sum(drive["ended"] == "stands" for drive in drives))
    rms, worst = 1e3 * np.array(values("offset_rms_m")), 1e3 * np.array(values("offset_worst_m"))
    rows = [
        Row("driven, shortest", "m", [Cell(min(values("way_m")), at_least(WAY_M))]),
        Row("drives ended by standing", "", [Cell(stood, at_most(0.0))], 0),
        Row("walls touched, all drives", "", [Cell(sum(values("contacts")), at_most(0.0))], 0),
        Row("room to the walls, least", "m", [Cell(min(values("closest_m")))], 2),
        Row("offset after 5 m, RMS, worst drive", "mm", [Cell(float(rms.max()), at_most(30.0))]),
        Row("offset after 5 m, RMS, median drive", "mm", [Cell(float(np.median(rms)))]),
        Row("offset after 5 m, greatest of all", "mm", [Cell(float(worst.max()))]),
        Row("pictures without steering in time", "", [Cell(sum(values("without_steering")))], 0),
    ]
    title = (
        f"Closed loop: {len(drives)} drives of {WAY_M:g} m at {SPEED:g} m/s, {WIDTH_M:g} m wide, in lockstep"
    )
    note = "each starts 0.4 m and 10 degrees off; noise, roll and pitch of up to 1 degree"
    return Table(title, ["through the nodes"], rows, [note])
