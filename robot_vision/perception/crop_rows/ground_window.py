# SPDX-License-Identifier: Apache-2.0
"""The ground before the robot seen from above, in a window of square cells at the height of the leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.geometry.rotation import rotation_from_rpy

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Marks of a cell of the window: something grows there; likewise, at the border of the picture.
GROWS, CUT = 1, 3
#: Share of the ground grown over from which on the crop closes: what stands out then is mostly its own leaves.
_CLOSES = 0.45


@dataclass(frozen=True)
class Lean:
    """How the camera stood over the leaves: roll and pitch (rad), logarithm of its height over the usual."""

    roll: float = 0.0
    pitch: float = 0.0
    height: float = -0.02


@dataclass(frozen=True)
class GroundWindow:
    """The ground before the robot seen from above, in square cells.

    Attributes:
        cells: uint8 (rows, columns); row 0 the nearest, column 0 the rightmost; 0 bare or not in the picture.
        seen: bool (rows, columns): in the picture, not at its border.
        foreign: bool (rows, columns): what grows there has another colour than the crop.
        corner: (2,) ahead and left of base_link of the middle of cell (0, 0), m.
        side: of a cell, m.
        fall: height of the camera over the window's plane, m.
    """

    cells: NDArray[np.uint8]
    seen: Mask
    foreign: Mask
    corner: Array
    side: float
    fall: float

    @property
    def closes(self) -> bool:
        """Whether the crop closes over the ground."""
        return bool(np.count_nonzero(self.cells) >= _CLOSES * np.count_nonzero(self.seen))

    def at(self, places: Array) -> tuple[NDArray[np.intp], Mask]:
        """Cells (N, 2) of places (N, 2) in the window's plane, and whether they are in view."""
        index = np.rint((places - self.corner) / self.side).astype(np.intp)
        shape = np.array(self.cells.shape)
        inside = ((index >= 0) & (index < shape)).all(axis=1)
        index = np.clip(index, 0, shape - 1)
        return index, inside & self.seen[index[:, 0], index[:, 1]]


def nearest_ground(camera: Camera, lean: Lean) -> float:
    """Nearest ground in the middle column of a picture, m ahead of the camera."""
    ray = camera.rays([[0.5 * (camera.width - 1.0), camera.height - 1.0]])[0]
    ray = rotation_from_rpy(lean.roll, lean.pitch, 0.0) @ camera.optical_to_base @ ray
    assert camera.height_m is not None
    return float(camera.height_m * np.exp(lean.height) * ray[0] / max(-ray[2], 1e-3))


def pixels_of_plane(camera: Camera, lean: Lean, fall: float) -> Array:
    """Homography (3, 3) from a place (ahead, left, 1) of the camera on a plane so far below it to pixels."""
    places = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -fall]])
    to_body = rotation_from_rpy(lean.roll, lean.pitch, 0.0).T
    return np.asarray(camera.matrix @ camera.optical_to_base.T @ to_body @ places)
