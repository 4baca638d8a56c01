# SPDX-License-Identifier: Apache-2.0
"""Random stones and lines on the ground before random cameras, for the tests of this room."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from hypothesis import strategies as st
from random_cameras import angles, cameras, numbers

from robot_vision.geometry import Camera, GroundPlane


@dataclass(frozen=True)
class Rail:
    """A line on the ground, seen: marks (N, 2) px at distances (N,) m, its direction (3,) in the optical frame."""

    camera: Camera
    marks: np.ndarray
    distances: np.ndarray
    direction: np.ndarray


@st.composite
def views(draw: st.DrawFn) -> Camera:
    """Cameras without a lens that look down on the ground, at any roll."""
    camera = draw(cameras(pitch=0.0, roll=0.5)).rectified()
    return replace(camera, pitch=draw(numbers(0.1, 1.2)))


@st.composite
def rails(draw: st.DrawFn, least: int = 3, most: int = 8) -> Rail:
    """A line of any direction on the ground through the middle of the view, marked at uneven spacings."""
    camera = draw(views())
    ground = GroundPlane(camera)
    middle = ground.from_pixels([[camera.cx, camera.cy]])[0]
    depth = float(np.hypot(camera.height_m, np.hypot(*(middle - (camera.x_m, 0.0)))))
    azimuth = draw(angles)
    along = np.array([np.cos(azimuth), np.sin(azimuth)])
    gaps = np.array(draw(st.lists(numbers(0.2, 1.0), min_size=least - 1, max_size=most - 1)))
    distances = np.concatenate([[0.0], np.cumsum(gaps)])
    # Half of the line before and half behind the middle, together two thirds as long as the middle is far.
    places = (distances / distances[-1] - 0.5) * depth / 1.5
    marks = ground.to_pixels(middle + places[:, None] * along)
    return Rail(camera, marks, distances, camera.optical_to_base.T @ np.append(along, 0.0))


def stone(middle: np.ndarray, sides: tuple[float, float], turn: float) -> np.ndarray:
    """Corners (4, 2) in order of a rectangle on the ground."""
    across, along = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    signs = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
    return middle + signs[:, :1] * sides[0] * across + signs[:, 1:] * sides[1] * along


def garden(camera: Camera, count: int, seed: int, width: float | None = None) -> np.ndarray:
    """Corners (N, 4, 2) px of stones laid anyhow on the ground in view; equally wide if a width is given."""
    random = np.random.default_rng(seed)
    ground = GroundPlane(camera)
    robot = (camera.x_m, 0.0)
    reach = float(np.hypot(*(ground.from_pixels([[camera.cx, camera.cy]])[0] - robot)))
    size = 0.2 * np.hypot(reach, camera.height_m or 0.0)
    stones: list[np.ndarray] = []
    while len(stones) < count:
        place = random.uniform((0.0, 0.0), (camera.width - 1.0, camera.height - 1.0))
        middle = ground.from_pixels([place])[0]
        sides = width or random.uniform(0.5, 1.5) * size, random.uniform(0.5, 1.5) * size
        if not np.hypot(*(middle - robot)) < 1.5 * reach:  # nan, above the horizon, too
            continue
        corners = ground.to_pixels(stone(middle, sides, random.uniform(0.0, np.pi)))
        if np.isfinite(corners).all():
            stones.append(corners)
    return np.array(stones)
