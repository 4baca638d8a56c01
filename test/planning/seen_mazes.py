# SPDX-License-Identifier: Apache-2.0
"""What a camera over the floor of a maze could tell at best: plans of the floor by casting rays, without pictures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.mapping import PlanView, Pose
from robot_vision.planning import Maze

RESOLUTION, HALF_WIDTH, LENGTH = 0.05, 4.0, 8.0
HALF_VIEW, NEAR, THICK = 0.6, 0.36, 0.15
"""Bearing to both sides (rad), nearest floor seen (m from the camera), and depth of what ends the floor (m)."""
WALL = 0.067
EYE = 1 / 9
CAMERA = Camera(460.0, 460.0, 319.5, 239.5, 640, 480, height_m=1 / 3, pitch=0.2618, x_m=EYE)


def plan_from(
    maze: Maze,
    pose: Pose,
    noise: float = 0.0,
    random: np.random.Generator | None = None,
    shadow: tuple[float, float] = (0.0, 0.0),
) -> PlanView:
    """The plan of the floor seen from a pose in a maze of cells of 1 m.

    Args:
        maze: all of it.
        pose: of base_link.
        noise: of where floor ends, m.
        random: makes the noise.
        shadow: from walls to the edge of their shadows, where floor seems to end, m.
    """
    bearings = np.linspace(-HALF_VIEW, HALF_VIEW, 241)
    eye = np.array([pose.x + EYE * np.cos(pose.yaw), pose.y + EYE * np.sin(pose.yaw)])
    ends = _distances(maze, eye, pose.yaw + bearings, shadow)
    if random is not None:
        ends += noise * random.standard_normal(len(ends))
    ends = np.maximum(ends, NEAR)
    rows, columns = round(2 * HALF_WIDTH / RESOLUTION), round(LENGTH / RESOLUTION)
    x, y = np.meshgrid(
        (np.arange(columns) + 0.5) * RESOLUTION, (np.arange(rows) + 0.5) * RESOLUTION - HALF_WIDTH
    )
    away, bearing = np.hypot(x - EYE, y), np.arctan2(y, x - EYE)
    seen = (np.abs(bearing) < HALF_VIEW) & (away > NEAR)
    end = ends[np.clip(np.rint((bearing + HALF_VIEW) / (2 * HALF_VIEW) * 240).astype(int), 0, 240)]
    cells = np.full(x.shape, -1, np.int8)
    cells[seen & (away < end - 0.03)] = 0
    cells[seen & (away >= end - 0.015) & (away < end + THICK)] = 100
    return PlanView(cells, RESOLUTION, (0.0, -HALF_WIDTH))


def directions_from(yaw: float) -> NDArray[np.float64]:
    """Directions (2, 3) of the walls in the optical frame of a robot with that yaw."""
    azimuths = -yaw + np.array([0.0, np.pi / 2])
    base = np.column_stack([np.cos(azimuths), np.sin(azimuths), np.zeros(2)])
    found = base @ CAMERA.optical_to_base
    return np.asarray(np.where(found[:, 2:] < 0.0, -found, found))


def _distances(
    maze: Maze, eye: NDArray[np.float64], angles: NDArray[np.float64], shadow: tuple[float, float]
) -> NDArray[np.float64]:
    """From a place to the nearest face of a wall, or its shadow's edge, along rays (N,), m."""
    rays = np.column_stack([np.cos(angles), np.sin(angles)])
    nearest = np.full(len(angles), np.inf)
    for axis, walls in ((0, maze.upright), (1, maze.across.T)):
        for line in range(walls.shape[1]):
            ahead = np.sign(rays[:, axis])
            face = line - ahead * (WALL / 2 + np.maximum(-ahead * shadow[axis], 0.0))
            with np.errstate(divide="ignore", invalid="ignore"):
                way = (face - eye[axis]) / rays[:, axis]
                along = eye[1 - axis] + way * rays[:, 1 - axis]
            inside = np.isfinite(way) & (way > 0.0) & (along >= 0.0) & (along < len(walls))
            here = np.where(inside, along, 0.0).astype(int)
            nearest = np.where(inside & walls[here, line], np.fmin(nearest, way), nearest)
    return nearest
