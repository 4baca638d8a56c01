# SPDX-License-Identifier: Apache-2.0
"""Ways to a goal: on grids of free floor, and through mazes that are known or not yet."""

from robot_vision.planning.maze import Maze, MazeError

__all__ = ["Maze", "MazeError"]
