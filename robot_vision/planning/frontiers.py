# SPDX-License-Identifier: Apache-2.0
"""Where a map ends and can be made to grow: free places beside what nobody has seen."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_vision.planning.distance import distance_field
from robot_vision.planning.grid import Cell

_CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)


def frontiers(roomy: ArrayLike, unknown: ArrayLike, smallest: int = 1, reach: int = 1) -> NDArray[np.bool_]:
    """Cells from where something unseen is near, in patches that are worth a drive (Yamauchi 1997).

    Args:
        roomy: bool (R, C), known to be free, with room for the robot.
        unknown: bool (R, C).
        smallest: number of cells of the smallest patch.
        reach: how many cells away the unseen may be.

    Returns:
        bool (R, C).
    """
    near = np.asarray(unknown, np.bool_).astype(np.uint8)
    near = cv2.dilate(near, _CROSS, iterations=reach).astype(np.uint8)
    edge = (near.astype(np.bool_) & np.asarray(roomy, np.bool_)).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(edge, connectivity=8)
    large = stats[:, cv2.CC_STAT_AREA] >= smallest
    large[0] = False
    return np.asarray(large[labels])


def nearest_frontier(roomy: NDArray[np.bool_], edge: NDArray[np.bool_], robot: Cell) -> Cell | None:
    """The frontier cell with the shortest way from the robot; None if none can be reached.

    Args:
        roomy: bool (R, C), where the robot may be; it stands on such a cell.
        edge: bool (R, C), frontier cells.
        robot: its cell.
    """
    away = distance_field(roomy, robot)
    away[~edge] = np.inf
    row, column = (int(part) for part in np.unravel_index(int(np.argmin(away)), away.shape))
    return (row, column) if np.isfinite(away[row, column]) else None
