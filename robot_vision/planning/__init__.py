# SPDX-License-Identifier: Apache-2.0
"""Ways to a goal: on grids of free floor, and through mazes that are known or not yet."""

from robot_vision.planning.distance import ExactField, distance_field, exact_field, shortest_way
from robot_vision.planning.grid import NoWayError, PlanningError
from robot_vision.planning.maze import Maze, MazeError

__all__ = [
    "ExactField",
    "Maze",
    "MazeError",
    "NoWayError",
    "PlanningError",
    "distance_field",
    "exact_field",
    "shortest_way",
]
