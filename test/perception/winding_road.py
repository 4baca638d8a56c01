# SPDX-License-Identifier: Apache-2.0
"""The lines of a painted road that bends, as a camera at a known place on it sees them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from line_scenes import clutter
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.perception import LineSegments

Array = NDArray[np.float64]

CAMERA = Camera(460.0, 460.0, 319.5, 239.5, 640, 480, height_m=1.3, pitch=float(np.deg2rad(3.0)))
WIDTH_M, PAINT_M = 5.0, 0.12
_STEP_M = 0.05


@dataclass(frozen=True)
class Bends:
    """A road whose curvature is a wave along its middle.

    Attributes:
        sharpest: greatest curvature, 1/m.
        wavelength: from one bend to the left to the next, m.
        length: m.
    """

    sharpest: float = 0.02
    wavelength: float = 90.0
    length: float = 200.0

    def curvature(self, along: float) -> float:
        return float(self.sharpest * np.sin(2.0 * np.pi * along / self.wavelength))

    def middle(self) -> tuple[Array, Array]:
        """Points (N, 2) every 0.05 m and the directions (N,) there, by midpoints."""
        along = _STEP_M * np.arange(int(self.length / _STEP_M))
        rate = 2.0 * np.pi / self.wavelength
        heading = self.sharpest / rate * (1.0 - np.cos(rate * along))
        between = self.sharpest / rate * (1.0 - np.cos(rate * (along[:-1] + 0.5 * _STEP_M)))
        steps = _STEP_M * np.stack([np.cos(between), np.sin(between)], axis=1)
        return np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)]), heading


def seen_road(
    bends: Bends,
    along: float,
    offset: float,
    yaw: float,
    random: np.random.Generator,
    camera: Camera = CAMERA,
    noise: float = 0.3,
    others: int = 30,
) -> LineSegments:
    """Segments of the edges of both verge lines and of a dashed middle line, and clutter.

    Args:
        bends: of the road.
        along: place of the robot, m.
        offset, yaw: of the robot, to the left of the middle (m) and counter-clockwise from it (rad).
        random: source of chance.
        camera: with the attitude it truly has.
        noise: standard deviation of each end, px.
        others: number of lines that are clutter.
    """
    points, heading = bends.middle()
    here = round(along / _STEP_M)
    turn = heading[here] + yaw
    left = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    robot = points[here] + offset * left[here]
    forward = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    assert camera.height_m is not None
    ends = []
    for place in (0.5 * WIDTH_M, 0.0, -0.5 * WIDTH_M):
        for side in (0.5, -0.5):
            edge = (points + (place + side * PAINT_M) * left - robot) @ forward.T
            for first in range(here, min(here + round(40.0 / _STEP_M), len(edge) - 61), 60):
                if place == 0.0 and (first // 60) % 2:
                    continue  # between dashes
                piece = edge[[first, first + 60]]
                # Seen along this direction the paint, which is bright, lies on the left.
                ends.append(piece if side < 0.0 else piece[::-1])
    ground = np.array(ends) - [camera.x_m, 0.0]
    body = np.concatenate([ground, np.full((*ground.shape[:2], 1), -camera.height_m)], axis=2)
    optical = body @ camera.optical_to_base
    pixels = np.full(optical.shape[:2] + (2,), np.nan)
    before = (optical[..., 2] > 0.5).all(axis=1)
    pixels[before] = camera.pixels(optical[before].reshape(-1, 3)).reshape(-1, 2, 2)
    inside = ((pixels >= 0) & (pixels <= [camera.width - 1, camera.height - 1])).all(axis=(1, 2))
    lines = pixels[inside].reshape(-1, 4)
    lines = lines + random.normal(0.0, noise, lines.shape)
    long = np.hypot(*(lines[:, 2:] - lines[:, :2]).T) > 8.0
    return LineSegments.from_endpoints(np.concatenate([lines[long], clutter(random, others)]))
