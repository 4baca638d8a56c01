# SPDX-License-Identifier: Apache-2.0
"""Plants with their numbers, and the lanes of the nozzles that are to open, drawn over a picture."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.geometry.rotation import rotation_from_rpy
from robot_vision.mapping.plants import PlantKind, Plants
from robot_vision.perception.crop_rows.ground_window import Lean
from robot_vision.planning.sprayer import Spray, SprayPlanner

Picture = NDArray[Any]
Array = NDArray[np.float64]

#: BGR, from a set that people with any colour vision can tell apart (Okabe and Ito).
COLOURS = {
    PlantKind.CROP: (233, 180, 86),
    PlantKind.WEED: (167, 121, 204),
    PlantKind.UNSURE: (66, 228, 240),
}
JET = (0, 159, 230)
_AROUND = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
_SHIFT = 4


def draw_spray(
    picture: Picture, camera: Camera, lean: Lean, plants: Plants, spray: Spray, planner: SprayPlanner
) -> Picture:
    """Draw each plant as a circle as large as its leaves, with its number, and a box for each jet.

    Args:
        picture: BGR uint8 (H, W, 3), drawn into.
        camera: rectified, with its height.
        lean: of the body, as the rows have it.
        plants: around the robot.
        spray: what is to be sprayed.
        planner: that planned it.

    Returns:
        The same picture.
    """
    half = 0.5 * planner.width
    for place, radius, lane in zip(spray.weeds.places, spray.weeds.radii, spray.lanes, strict=True):
        reach, middle = radius + planner.margin, planner.middles[lane]
        corners = (
            place[0] + np.array([-reach, reach, reach, -reach]),
            middle + half * np.array([-1, -1, 1, 1]),
        )
        _outline(picture, _pixels(camera, lean, np.column_stack(corners), 0.0), JET, 1)
    for number, place, radius, height, kind in zip(
        plants.ids, plants.places, plants.radii, plants.heights, plants.kinds, strict=True
    ):
        ring = place + radius * np.column_stack([np.cos(_AROUND), np.sin(_AROUND)])
        outline = _pixels(camera, lean, ring, float(height))
        if not _outline(picture, outline, COLOURS[PlantKind(kind)], 2):
            continue
        right, low = np.rint(outline.max(axis=0)).astype(int).tolist()
        cv2.putText(
            picture,
            str(number),
            (right, low),
            cv2.FONT_HERSHEY_SIMPLEX,
            0.33,
            (255, 255, 255),
            1,
            cv2.LINE_AA,
        )
    return picture


def _pixels(camera: Camera, lean: Lean, places: Array, height: float) -> Array:
    """Pixels (N, 2) of places (N, 2) in base_link, so high above the ground."""
    level = np.full(len(places), height - float(camera.height_m or 1.0))
    points = np.column_stack([places[:, 0] - camera.x_m, places[:, 1], level])
    return np.asarray(
        camera.pixels(points @ rotation_from_rpy(lean.roll, lean.pitch, 0.0) @ camera.optical_to_base)
    )


def _outline(picture: Picture, pixels: Array, colour: tuple[int, int, int], thickness: int) -> bool:
    """Draw a closed line where all of it can be drawn; tells whether it was."""
    inside = bool(np.isfinite(pixels).all() and (np.abs(pixels) < 4000.0).all())
    if inside:
        ends = np.rint(pixels * (1 << _SHIFT)).astype(np.int32)
        cv2.polylines(picture, [ends], True, colour, thickness, cv2.LINE_AA, _SHIFT)
    return inside
