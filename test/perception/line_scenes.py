# SPDX-License-Identifier: Apache-2.0
"""Scenes of lines that are parallel in space, projected with a known error, for the tests of this room."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from robot_vision.geometry import Camera
from robot_vision.geometry.sphere import angle_between
from robot_vision.perception import LineSegments, VanishingPoints

Array = NDArray[np.float64]

#: Edges of real things are not straighter than this (`vanishing.bundle.DIRECTION_SIGMA`), rad.
CROOKED = math.radians(0.35)


@dataclass(frozen=True)
class LineScene:
    """Lines with what is true of them.

    Attributes:
        lines: shuffled.
        camera: true.
        directions: (K, 3) unit, z >= 0.
        labels: (N,) the direction each line leads to, -1 for clutter.
    """

    lines: LineSegments
    camera: Camera
    directions: Array
    labels: NDArray[np.intp]


def random_camera(random: np.random.Generator, focal: tuple[float, float] = (0.6, 2.0)) -> Camera:
    """640x480, focal length in shares of the width, the principal point moved by up to 5 %."""
    f = 640 * random.uniform(*focal)
    return Camera(f, f, 319.5 + random.uniform(-32, 32), 239.5 + random.uniform(-24, 24), 640, 480)


def random_axes(random: np.random.Generator) -> Array:
    """Three orthogonal directions (3, 3) in any orientation."""
    return np.asarray(Rotation.random(random_state=random).as_matrix())


def upright_axes(random: np.random.Generator, lean: float = 0.15, turn: float = 0.7) -> Array:
    """Forward, down and right (rows) as a robot on a floor sees them, leaning and turned a little (rad)."""
    pitch, yaw, roll = random.uniform(-lean, lean), random.uniform(-turn, turn), random.uniform(-lean, lean)
    turned = Rotation.from_euler("yxz", [yaw, pitch, roll]).as_matrix()
    return np.asarray(np.array([[0, 0, 1], [0, 1, 0], [1, 0, 0]], float) @ turned.T)


def lines_to(
    random: np.random.Generator,
    camera: Camera,
    direction: Array,
    count: int,
    noise: float = 0.3,
    crooked: float = 0.0,
    length: tuple[float, float] = (30.0, 160.0),
) -> Array:
    """Segments (count, 4) px whose endless lines lead to a direction, ends moved by `noise` px.

    Args:
        random: source of chance.
        camera: of the picture.
        direction: (3,) towards which the lines lead.
        count: how many.
        noise: standard deviation of each end, px.
        crooked: standard deviation of each line's own direction besides, rad.
        length: shortest and longest, px.
    """
    point = camera.matrix @ direction
    found: list[Array] = []
    while len(found) < count:
        middle = random.uniform((10, 10), (camera.width - 10, camera.height - 10))
        along = point[:2] - point[2] * middle
        reach = random.uniform(*length) / 2
        # A line that leads to a point does not contain it.
        if np.hypot(*along) < (reach + 15) * abs(point[2]):
            continue
        angle = (
            math.atan2(along[1], along[0]) + random.normal(0, crooked)
            if crooked
            else math.atan2(*along[::-1])
        )
        half = reach * np.array([math.cos(angle), math.sin(angle)])
        ends = np.concatenate([middle - half, middle + half])
        inside = (ends >= 0).all() and (ends <= [camera.width - 1, camera.height - 1] * 2).all()
        if inside:
            found.append(ends if random.random() < 0.5 else ends[[2, 3, 0, 1]])
    return np.array(found).reshape(-1, 4) + random.normal(0, noise, (count, 4))


def clutter(random: np.random.Generator, count: int, size: tuple[int, int] = (640, 480)) -> Array:
    """Segments (count, 4) px of random place, direction and length."""
    middles = random.uniform((0, 0), size, (count, 2))
    angles = random.uniform(0, math.pi, count)
    half = random.uniform(8, 60, count)[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.concatenate([middles - half, middles + half], axis=1)


def scene(
    random: np.random.Generator,
    camera: Camera,
    directions: Array,
    counts: list[int],
    share_of_clutter: float = 0.0,
    noise: float = 0.3,
    crooked: float = 0.0,
) -> LineScene:
    """Lines to several directions, and clutter that makes up a share of all lines."""
    ends = [lines_to(random, camera, d, n, noise, crooked) for d, n in zip(directions, counts, strict=True)]
    others = round(sum(counts) * share_of_clutter / (1.0 - share_of_clutter))
    ends.append(clutter(random, others))
    labels = np.concatenate([np.full(n, k) for k, n in enumerate(counts)] + [np.full(others, -1)])
    order = random.permutation(len(labels))
    directions = np.where(directions[:, 2:] < 0, -directions, directions)
    return LineScene(
        LineSegments.from_endpoints(np.concatenate(ends)[order]),
        camera,
        directions,
        labels[order].astype(np.intp),
    )


def nearest(points: VanishingPoints, direction: Array) -> tuple[int, float]:
    """Index of the vanishing point nearest a direction, and how far off it is (rad)."""
    assert len(points), "no vanishing point at all"
    away = angle_between(points.directions, direction)
    return int(away.argmin()), float(away.min())
