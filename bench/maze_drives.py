# SPDX-License-Identifier: Apache-2.0
"""A vehicle with its lag and limits driven through contest mazes whose plan is known: does it touch a wall?"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.report import Cell, Row, Table, at_least, at_most
from bench.sources import data_set
from robot_vision.control import PathPursuit
from robot_vision.planning import FloorMap, Maze, Navigator
from robot_vision.simulation import floor_plan
from robot_vision.simulation.live import LiveDrive, LiveSettings
from robot_vision.simulation.maze import maze_world

MAZES = (
    "16MM2012CX",
    "16MM2013CX",
    "16MM2014CX",
    "16MM2015CX",
    "16MM2016CX",
    "16MM2017CX",
    "16MM2018CX",
    "16MM2016H_Kansai",
    "16MM2017H_Cheese",
    "16MM2018H_semi",
)
CELL_M = 0.18
ROUTE = {"radius": 0.37, "middle": 0.47, "astray": 0.28, "arrival": 0.11}
"""Of the planner in the maze's cells; the vehicle is 0.45 cells wide and 0.55 long."""
DRIVE = {"speed": 1.4, "lookahead": 0.33, "most_acceleration": 3.3}
"""In cells and seconds."""
TURNS = {"most_turn_rate": 2.0, "most_turn_acceleration": 6.0, "latency": 0.18}
MOST_S = 600.0


@dataclass(frozen=True)
class Drive:
    """How a drive went.

    Attributes:
        arrived: whether at the goal.
        contacts: walls touched.
        closest_m: least room to them.
        time_s: simulated.
        way_m: driven.
        unanswered: pictures that no steering answered in time; through the nodes only.
    """

    arrived: bool
    contacts: int
    closest_m: float
    time_s: float
    way_m: float
    unanswered: int = 0


def planner_settings(cell: float) -> dict[str, float]:
    """Parameters of maze_planner for a maze with cells of this size, m."""
    scaled = {name: cell * value for name, value in (*ROUTE.items(), *DRIVE.items())}
    return {**scaled, **TURNS}


def drive(maze: Maze, cell: float = CELL_M, rate: int = 15, seed: int = 0) -> Drive:
    """Drive from the start to a goal by the true plan and the true place, as the node maze_planner does."""
    world = maze_world(maze, cell, seed)
    live = LiveDrive(world, LiveSettings(rate=rate, noise=0.0), seed)
    plan = floor_plan.occupancy(world)
    given = planner_settings(cell)
    navigator = Navigator(**{name: given[name] for name in ROUTE})
    pursuit = PathPursuit(**{name: given[name] for name in (*DRIVE, *TURNS)})
    navigator.see_map(FloorMap(plan.cells, plan.resolution, (*plan.origin, 0.0)))
    row, column = maze.goals[0]
    navigator.set_goal((column + 0.5) * cell, (row + 0.5) * cell)
    arrived = False
    while live.time_ns < MOST_S * 1e9:
        state = live.state
        route = navigator.route(state.x, state.y)
        arrived = navigator.has_arrived(state.x, state.y)
        if arrived or not len(route.points):
            break
        pose = state.x, state.y, state.yaw
        told = pursuit.update(route.points, pose, live.time_ns * 1e-9, route.seen)
        live.steer(told.speed, told.turn_rate, live.time_ns)
        live.advance()
    said: dict[str, Any] = live.summary()
    closest = said["closest_m"]
    return Drive(
        arrived,
        int(said["contacts"]),
        math.nan if closest is None else float(closest),
        float(said["time_s"]),
        float(said["way_m"]),
    )


def contest_maze(name: str) -> Maze:
    """Read one of the contest mazes.

    Raises:
        MissingSetError: it is not there.
    """
    folder: Path = data_set("mazes", f"{name}.maze")
    return Maze.read(folder / f"{name}.maze")


def run(quick: bool) -> list[Table]:
    """Drive through ten mazes, through two when it is to be quick.

    Raises:
        MissingSetError: the mazes are not there.
    """
    names = MAZES[:2] if quick else MAZES
    drives = [drive(contest_maze(name)) for name in names]
    rows = [
        Row("goals reached", "", [Cell(sum(one.arrived for one in drives), at_least(len(names)))], 0),
        Row("walls touched, all drives", "", [Cell(sum(one.contacts for one in drives), at_most(0))], 0),
        Row("room to the walls, least", "mm", [Cell(1e3 * min(one.closest_m for one in drives))]),
        Row("driven", "m", [Cell(sum(one.way_m for one in drives))]),
        Row("mean speed", "m/s", [Cell(sum(d.way_m for d in drives) / sum(d.time_s for d in drives))], 2),
    ]
    title = f"{len(names)} contest mazes of 16 x 16 cells of {CELL_M:g} m, driven by their true plan"
    return [
        Table(
            title,
            ["maze_planner's library"],
            rows,
            ["the floor between two walls is 168 mm wide, the vehicle 81 mm"],
        )
    ]
