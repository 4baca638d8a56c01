# SPDX-License-Identifier: Apache-2.0
"""Pictures of what was seen, drawn apart from the seeing."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.perception.region import Region
from robot_vision.perception.segments import LineSegments
from robot_vision.perception.vanishing.points import Role, VanishingPoints

Picture = NDArray[Any]
Colour = tuple[int, int, int]

#: BGR, from a set that people with any colour vision can tell apart (Okabe and Ito).
CLUTTER: Colour = (150, 150, 150)
COLOURS: dict[Role, Colour] = {
    Role.PRIMARY: (0, 94, 213),
    Role.VERTICAL: (178, 114, 0),
    Role.HORIZONTAL: (115, 158, 0),
    Role.OTHER: (167, 121, 204),
}
HORIZON: Colour = (66, 228, 240)
#: Drawing places lines to 1/16 px.
_SHIFT = 4


def draw_lines(picture: Picture, lines: LineSegments, points: VanishingPoints | None = None) -> Picture:
    """Lines over a picture, in the colour of the role of their vanishing point, clutter thin and grey.

    Args:
        picture: BGR uint8 (H, W, 3), drawn into.
        lines: segments in its pixels.
        points: with a label for each line; without, the strongest lines are drawn brightest.

    Returns:
        The same picture.
    """
    ends = np.rint(np.nan_to_num(lines.endpoints) * (1 << _SHIFT)).astype(int)
    if points is None:
        bright = np.clip(80.0 + 8.0 * lines.strength, 80.0, 255.0)
        for end, level in zip(ends, bright, strict=True):
            _segment(picture, end, (0, int(level), int(level)), 1)
        return picture
    colours = [COLOURS[Role(int(role))] for role in points.roles]
    for end, label in sorted(zip(ends, points.labels, strict=True), key=lambda drawn: int(drawn[1] >= 0)):
        _segment(picture, end, colours[label] if label >= 0 else CLUTTER, 2 if label >= 0 else 1)
    return picture


def draw_region(picture: Picture, region: Region) -> Picture:
    """Darken what lies outside the region that was searched.

    Args:
        picture: BGR uint8 (H, W, 3), drawn into.
        region: in its pixels.
    """
    outside = np.ones(picture.shape[:2], bool)
    outside[region.top : region.bottom, region.left : region.right] = False
    picture[outside] //= 2
    return picture


def draw_vanishing_points(picture: Picture, points: VanishingPoints) -> Picture:
    """The vanishing points that lie in the picture as rings, and the horizon through the horizontal ones.

    Args:
        picture: BGR uint8 (H, W, 3), drawn into.
        points: in its pixels.
    """
    height, width = picture.shape[:2]
    vertical = points.of(Role.VERTICAL)
    primary = points.of(Role.PRIMARY)
    if vertical is not None and primary is not None:
        _horizon(picture, points, vertical, primary)
    for place, role in zip(points.pixels, points.roles, strict=True):
        if np.isfinite(place).all() and 0 <= place[0] < width and 0 <= place[1] < height:
            centre = (round(place[0] * 16), round(place[1] * 16))
            radius = max(6, width // 50)
            cv2.circle(picture, centre, radius * 16, (255, 255, 255), 4, cv2.LINE_AA, _SHIFT)
            cv2.circle(picture, centre, radius * 16, COLOURS[Role(int(role))], 2, cv2.LINE_AA, _SHIFT)
    return picture


def _segment(picture: Picture, end: NDArray[np.int_], colour: Colour, thickness: int) -> None:
    cv2.line(
        picture,
        (int(end[0]), int(end[1])),
        (int(end[2]), int(end[3])),
        colour,
        thickness,
        cv2.LINE_AA,
        _SHIFT,
    )


def _horizon(picture: Picture, points: VanishingPoints, vertical: int, primary: int) -> None:
    """The image of the level plane: perpendicular to the vertical direction, through the primary point."""
    up, ahead = points.directions[vertical], points.directions[primary]
    up = up - float(up @ ahead) * ahead
    camera = points.camera
    columns = np.array([0.0, picture.shape[1] - 1.0])
    x = (columns - camera.cx) / camera.fx
    if abs(up[1]) < 0.2:
        return
    rows = camera.cy - camera.fy * (up[0] * x + up[2]) / up[1]
    first, last = (np.clip(np.rint(rows), -1e5, 1e5)).astype(int)
    cv2.line(picture, (int(columns[0]), int(first)), (int(columns[1]), int(last)), HORIZON, 1, cv2.LINE_AA)
