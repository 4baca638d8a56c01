# SPDX-License-Identifier: Apache-2.0
"""Rows drawn over the picture they were found in."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.geometry.rotation import rotation_from_rpy
from robot_vision.perception.crop_rows.ground_fit import (
    CURVATURE,
    HEIGHT,
    OFFSET,
    PITCH,
    ROLL,
    YAW,
    RowsOnGround,
)
from robot_vision.perception.crop_rows.tracker import RowEstimate

Picture = NDArray[Any]
Array = NDArray[np.float64]

#: BGR, from a set that people with any colour vision can tell apart (Okabe and Ito).
OWN, OTHER, END = (0, 94, 213), (178, 114, 0), (66, 228, 240)
_SHIFT = 4
_SIDE_ROWS = 6


def draw_rows(picture: Picture, camera: Camera, estimate: RowEstimate) -> Picture:
    """Draw the robot's own row, its neighbours, where they end, and offset and yaw in words.

    Args:
        picture: BGR uint8 (H, W, 3), drawn into.
        camera: rectified, with its height.
        estimate: for this picture.

    Returns:
        The same picture.
    """
    if estimate.rows is not None:
        far = 12.0 if estimate.end is None else max(estimate.end, 0.5)
        for row in range(-_SIDE_ROWS, _SIDE_ROWS + 1):
            places = row_pixels(estimate.rows, camera, row, far)
            colour, thickness = (OWN, 3) if row == 0 else (OTHER, 1)
            ends = np.rint(places * (1 << _SHIFT)).astype(np.int32)
            cv2.polylines(picture, [ends], False, colour, thickness, cv2.LINE_AA, _SHIFT)
    lane = estimate.lane
    words = estimate.reason or "no rows"
    if lane is not None:
        words = f"{1e3 * lane.offset:+.0f} mm  {np.degrees(lane.yaw):+.1f} deg  {estimate.reason}"
    if estimate.end is not None:
        words += f"  end {estimate.end:.1f} m"
    (wide, high), _ = cv2.getTextSize(words, cv2.FONT_HERSHEY_SIMPLEX, 0.6, 1)
    cv2.rectangle(picture, (0, 0), (wide + 16, high + 16), (0, 0, 0), -1)
    cv2.putText(picture, words, (8, high + 8), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (255, 255, 255), 1, cv2.LINE_AA)
    return picture


def row_pixels(rows: RowsOnGround, camera: Camera, row: int, far: float) -> Array:
    """Pixels (M, 2) of a row, 0 the robot's own, counted to the left, from the robot up to `far` metres ahead."""
    values = rows.values
    way = np.linspace(0.2, far, 40)
    aside = np.full_like(way, row * rows.spacing)
    bend = values[CURVATURE]
    # Along an arc about the same centre as the robot's own row
    along = way * np.sinc(bend * way / (2.0 * np.pi))
    x = along * np.cos(0.5 * bend * way) - aside * np.sin(bend * way)
    y = along * np.sin(0.5 * bend * way) + aside * np.cos(bend * way) - values[OFFSET]
    sine, cosine = np.sin(values[YAW]), np.cos(values[YAW])
    height = (camera.height_m or 1.0) * np.exp(values[HEIGHT])
    points = np.column_stack(
        [cosine * x + sine * y - camera.x_m, cosine * y - sine * x, np.full_like(x, -height)]
    )
    leaning = points @ rotation_from_rpy(float(values[ROLL]), float(values[PITCH]), 0.0)
    pixels = camera.pixels(leaning @ camera.optical_to_base)
    inside = np.isfinite(pixels).all(axis=1) & (np.abs(pixels) < 1e4).all(axis=1)
    return np.asarray(pixels[inside])
