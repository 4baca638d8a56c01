# SPDX-License-Identifier: Apache-2.0
"""The lines of a corridor as a camera at a known place sees them, projected from its edges in space."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from line_scenes import clutter
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.perception import LineSegments

Array = NDArray[np.float64]

CAMERA = Camera(460.0, 460.0, 319.5, 239.5, 640, 480, height_m=0.6, pitch=float(np.deg2rad(5.0)))
_NEAREST = 0.3


@dataclass(frozen=True)
class Corridor:
    """A straight corridor along x, its middle at y = 0, all in metres.

    Attributes:
        width, height, length: of the space.
        skirting: height of the upper edge of the skirting.
        joint: place (to the left) of a joint in the floor, None where there is none.
        walls: the sides whose lines are seen, +1 left, -1 right.
        doors: distance between doors on each side.
        lamps: places (to the left) of edges of lamps that run along the ceiling.
        boxes: that stand on the floor: places (along, to the left) of the middle of the front, width and height.
    """

    width: float = 2.0
    height: float = 2.6
    length: float = 20.0
    skirting: float = 0.08
    joint: float | None = 0.35
    walls: tuple[int, ...] = (1, -1)
    doors: float = 3.0
    lamps: tuple[float, ...] = ()
    boxes: tuple[tuple[float, float, float, float], ...] = ()

    def edges(self) -> Array:
        """(N, 2, 3) edges in space, cut at the doors."""
        found: list[list[tuple[float, float, float]]] = []
        places = np.arange(-1.0, self.length, self.doors)
        for side in self.walls:
            y = 0.5 * self.width * side
            for door in places + (0.7 if side > 0 else 0.0):
                first, last = door + 1.0, door + self.doors
                found += [[(first, y, z), (last, y, z)] for z in (0.0, self.skirting)]
                found += [[(x, y, 0.0), (x, y, 2.03)] for x in (door, door + 1.0)]
                found.append([(door, y, 2.03), (door + 1.0, y, 2.03)])
            found.append([(-1.0, y, self.height), (self.length, y, self.height)])
        half = 0.5 * self.width
        found += [[(self.length, -half, z), (self.length, half, z)] for z in (0.0, self.height)]
        found += [[(x, y, self.height), (x + 3.0, y, self.height)] for x in (2.0, 8.0) for y in self.lamps]
        if self.joint is not None:
            found += [[(x, self.joint, 0.0), (x + 4.0, self.joint, 0.0)] for x in (0.0, 5.0, 10.0)]
        for x, middle, width, height in self.boxes:
            sides = (middle - width / 2, middle + width / 2)
            found += [[(x, y, 0.0), (x, y, height)] for y in sides]
            found += [[(x, sides[0], z), (x, sides[1], z)] for z in (0.0, height)]
        return np.array(found)


def seen_lines(
    corridor: Corridor,
    offset: float,
    yaw: float,
    random: np.random.Generator,
    camera: Camera = CAMERA,
    along: float = 0.0,
    noise: float = 0.3,
    others: int = 15,
) -> LineSegments:
    """Lines that a robot sees.

    Args:
        corridor: it stands in.
        offset, yaw: of the robot, to the left of the middle (m) and counter-clockwise (rad).
        random: source of chance.
        camera: with the attitude it truly has.
        along: how far down the corridor the robot stands, m.
        noise: standard deviation of each end, px.
        others: number of lines that are clutter.
    """
    edges = corridor.edges()
    # Densely along each edge: what lies before the camera and within the picture is seen.
    share = np.linspace(0.0, 1.0, 600)[None, :, None]
    points = edges[:, :1] + share * (edges[:, 1:] - edges[:, :1])
    turn = np.array([[np.cos(yaw), np.sin(yaw), 0.0], [-np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    assert camera.height_m is not None
    body = (points - [along, offset, 0.0]) @ turn.T - [camera.x_m, 0.0, camera.height_m]
    optical = body @ camera.optical_to_base
    ends = []
    for edge in optical:
        before = edge[edge[:, 2] > _NEAREST]
        if len(before) < 2:
            continue
        pixels = camera.pixels(before)
        inside = ((pixels >= 0) & (pixels <= [camera.width - 1, camera.height - 1])).all(axis=1)
        if inside.any():
            first, last = np.flatnonzero(inside)[[0, -1]]
            ends.append(np.concatenate([pixels[first], pixels[last]]))
    lines = np.array(ends) + random.normal(0.0, noise, (len(ends), 4))
    long = np.hypot(*(lines[:, 2:] - lines[:, :2]).T) > 15.0
    return LineSegments.from_endpoints(np.concatenate([lines[long], clutter(random, others)]))


def without_height(camera: Camera) -> Camera:
    """The same camera, nobody knows how high."""
    return replace(camera, height_m=None)
