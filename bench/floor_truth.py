# SPDX-License-Identifier: Apache-2.0
"""What each pixel of a rendered picture truly shows of the floor: by casting its ray at the objects of the world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation.body import BodyState
from robot_vision.simulation.world import World

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FLOOR, ELSEWHERE = 0, -1
_STEP = 2
"""Truth is told for every second pixel both ways: the working picture of the mapper."""
_LOOKED_AT_M = 18.0


@dataclass(frozen=True)
class FloorTruth:
    """Truth of a picture at half its size.

    Attributes:
        label: (H, W) 0 for visible floor, k + 1 for the k-th object of the world, -1 for anything else.
        distance: (H, W) of the ground behind the pixel from base_link, m; nan above the horizon.
        shadow: (H, W) visible floor in shadow.
    """

    label: NDArray[np.int16]
    distance: Array
    shadow: Mask


def floor_truth(world: World, state: BodyState) -> FloorTruth:
    """Tell the truth of the picture a world shows from a pose."""
    camera, pose = world.camera, state.camera_pose(world.camera)
    rows, columns = np.mgrid[0 : camera.height : _STEP, 0 : camera.width : _STEP] + (_STEP - 1) / 2.0
    rays = np.stack(
        [(columns - camera.cx) / camera.fx, (rows - camera.cy) / camera.fy, np.ones(rows.shape)], -1
    )
    rays = rays @ pose[:3, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(rays[..., 2] < -1e-4, -pose[2, 3] / rays[..., 2], np.nan)
    ground = pose[:2, 3] + rays[..., :2] * reach[..., None]
    distance = np.hypot(ground[..., 0] - state.x, ground[..., 1] - state.y)
    near = np.isfinite(distance) & (distance < _LOOKED_AT_M)
    places = ground[near]
    seen = np.full(len(places), ELSEWHERE, np.int16)
    for outline in world.floor:
        seen[_inside(places, outline)] = FLOOR
    _hide(seen, places, pose[:3, 3], world)
    label = np.full(distance.shape, ELSEWHERE, np.int16)
    label[near] = seen
    shadow = np.zeros(distance.shape, bool)
    for outline in world.shadows:
        shadow[near] |= _inside(places, outline)
    return FloorTruth(label, distance, shadow & (label == FLOOR))


def _hide(seen: NDArray[np.int16], places: Array, eye: Array, world: World) -> None:
    """Give ground (N, 2) that an object hides from an eye (3,) the number of the object, nearest first.

    The ray is at its lowest over an object where it leaves its (convex) footprint.
    """
    nearest = np.full(len(places), 2.0)
    along = places - eye[:2]
    for number, item in enumerate(world.objects):
        enter, leave = np.zeros(len(places)), np.ones(len(places))
        corners = item.footprint
        following = np.roll(corners, -1, axis=0)
        area = np.sum(corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0])
        for a, b in zip(corners, following, strict=True):
            inwards = np.sign(area) * np.array([a[1] - b[1], b[0] - a[0]])
            room, speed = (a - eye[:2]) @ inwards, along @ inwards
            with np.errstate(divide="ignore", invalid="ignore"):
                crossing = room / speed
            enter = np.where(speed > 0, np.maximum(enter, crossing), enter)
            leave = np.where(speed < 0, np.minimum(leave, crossing), leave)
            leave = np.where((speed == 0) & (room > 0), -1.0, leave)
        hidden = (enter < leave) & (eye[2] * (1.0 - leave) < item.height) & (enter < nearest)
        seen[hidden], nearest[hidden] = number + 1, enter[hidden]


def _inside(places: Array, outline: Array) -> Mask:
    """Which places (N, 2) lie inside an outline (K, 2), by the even-odd rule."""
    inside = np.zeros(len(places), bool)
    x, y = places.T
    for (x0, y0), (x1, y1) in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        if y0 == y1:
            continue
        crosses = ((y0 > y) != (y1 > y)) & (x < (x1 - x0) * (y - y0) / (y1 - y0) + x0)
        inside ^= crosses
    return inside
