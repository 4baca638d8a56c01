# SPDX-License-Identifier: Apache-2.0
"""Ways to a goal: on grids of free floor, and through mazes that are known or not yet."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from robot_vision.planning.clearance import room_around, with_clearance
from robot_vision.planning.descent import descend
from robot_vision.planning.distance import ExactField, distance_field, exact_field, shortest_way
from robot_vision.planning.explorer import Exploration, MazeExplorer
from robot_vision.planning.fields import connected_field, cost_field
from robot_vision.planning.floor_map import FloorMap
from robot_vision.planning.frontiers import frontiers
from robot_vision.planning.grid import NoWayError, PlanningError
from robot_vision.planning.maze import Maze, MazeError
from robot_vision.planning.maze_grid import maze_from_grid, maze_to_grid
from robot_vision.planning.navigator import Navigator, Route
from robot_vision.planning.path import nearest_reachable, plan_path
from robot_vision.planning.pictures import draw_field, draw_maze, letters
from robot_vision.planning.quest import Quest
from robot_vision.planning.speed_run import Racer, SpeedRun, fastest_run, shortest_run

if TYPE_CHECKING:
    from robot_vision.planning.maze_runner import MazeRunner
    from robot_vision.planning.wall_evidence import WallEvidence

__all__ = [
    "ExactField",
    "Exploration",
    "FloorMap",
    "Maze",
    "MazeError",
    "MazeExplorer",
    "MazeRunner",
    "Navigator",
    "NoWayError",
    "PlanningError",
    "Quest",
    "Racer",
    "Route",
    "SpeedRun",
    "WallEvidence",
    "connected_field",
    "cost_field",
    "descend",
    "distance_field",
    "draw_field",
    "draw_maze",
    "exact_field",
    "fastest_run",
    "frontiers",
    "letters",
    "maze_from_grid",
    "maze_to_grid",
    "nearest_reachable",
    "plan_path",
    "room_around",
    "shortest_run",
    "shortest_way",
    "with_clearance",
]

#: They know plans of the floor; those who only plan need not wait until everything that sees has been imported.
_BY_CAMERA = {
    "MazeRunner": "robot_vision.planning.maze_runner",
    "WallEvidence": "robot_vision.planning.wall_evidence",
}


def __getattr__(name: str) -> Any:
    if name not in _BY_CAMERA:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_BY_CAMERA[name]), name)
