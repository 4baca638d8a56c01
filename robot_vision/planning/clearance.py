# SPDX-License-Identifier: Apache-2.0
"""Room for the robot: where its middle may be, and which places lie in the middle of the free floor."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_vision.planning.grid import PlanningError, checked_grid

_FULL_TURNS = cv2.DIST_MASK_PRECISE


def room_around(free: ArrayLike, resolution: float = 1.0) -> NDArray[np.float64]:
    """Metres between each free cell's square and the nearest wall's square (R, C); 0 in walls. Outside is a wall.

    A robot whose middle is anywhere in a cell, its border included, is at least so far from every wall: ways along
    the borders of cells keep the distance too.
    """
    walls = np.pad(~checked_grid(free), 2, constant_values=True).astype(np.uint8)
    # squares i, j apart have a gap of hypot(i - 1, j - 1): that of the centres once walls have grown by one cell
    grown = cv2.dilate(walls, np.ones((3, 3), np.uint8))
    gap = cv2.distanceTransform(1 - grown, cv2.DIST_L2, _FULL_TURNS)
    return np.asarray(gap[2:-2, 2:-2] * resolution, np.float64)


def with_clearance(free: ArrayLike, clearance: float, resolution: float = 1.0) -> NDArray[np.bool_]:
    """Free cells all of whose points are at least `clearance` metres from every wall, bool (R, C).

    Raises:
        PlanningError: the clearance is negative or no number.
    """
    grid = checked_grid(free)
    if not (np.isfinite(clearance) and clearance >= 0.0):
        raise PlanningError(f"clearance must be 0 or more, not {clearance} m")
    if clearance == 0.0:
        return grid
    return np.asarray(grid & (room_around(grid, resolution) >= clearance - 1e-6 * resolution))


def price_of_nearness(
    free: ArrayLike, wide: float, most: float, resolution: float = 1.0
) -> NDArray[np.float64]:
    """Prices that draw ways to the middle: 1 from `wide` metres of room on, rising to 1 + `most` at walls, inf in them.

    Raises:
        PlanningError: a number is not positive.
    """
    if not (wide > 0.0 and most > 0.0):
        raise PlanningError(f"wide and most must be positive, not {wide} and {most}")
    grid = checked_grid(free)
    near = np.clip(1.0 - room_around(grid, resolution) / wide, 0.0, 1.0)
    return np.where(grid, 1.0 + most * near**2, np.inf)
