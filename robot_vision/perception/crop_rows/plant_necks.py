# SPDX-License-Identifier: Apache-2.0
"""Small plants that hang on larger leaves by a neck: of a weed of the crop's colour no more is told by one picture.

Leaves of the crop have necks as well. Which of the two it is tells the height, and the height tells the robot's way:
a leaf of the crop moves over the ground faster than a weed below it.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.perception.crop_rows.plant_cells import PlantCells

#: Half the width of the necks that are cut, m: from the narrowest up.
_NECKS_M = 0.006, 0.012, 0.018, 0.024
#: Radius of the largest plant that is cut off, and of the smallest blob that one is cut off, in radii of a usual plant.
_MOST, _FROM = 0.32, 0.48
#: Cells of it that an erosion leaves at least: the jags of leaves leave less.
_CORE = 2
#: Leaves are seen from above on so much ground, m from the nearest in view.
_NEAR_M = 1.3


def cut_necks(
    grown: NDArray[np.uint8], cells: PlantCells, radius: float, side: float, least: float
) -> NDArray[np.bool_]:
    """Cut small plants off large blobs on which they hang by a neck: each gets its own label.

    A neck is what an erosion parts; what it parts grows back, a cell farther (an opening, part by part).

    Args:
        grown: (H, W) cells in which something grows, 1, and bare ones, 0.
        cells: of the same window; relabelled in place.
        radius: of a usual plant of the crop, cells.
        side: of a cell, m.
        least: cells of the smallest plant that is cut off.

    Returns:
        Which of the cells (N,) of `cells` now belong to what hung on others, of which a large blob is left.
    """
    near = min(max(int(_NEAR_M / side), 1), len(grown))
    labels = cells.labels[:near]
    of, least_left = cells.label, np.pi * (_FROM * radius) ** 2
    large = cells.sizes > least_left
    large[0] = False
    leaves = (large[labels] & (grown[:near] > 0)).astype(np.uint8)
    first, most = cells.count, np.pi * (_MOST * radius) ** 2
    for half in _NECKS_M:
        reach = max(int(half / side + 0.5), 1)
        parts, eroded = cv2.connectedComponents(
            cv2.erode(leaves, _disc(reach)), connectivity=4, ltype=cv2.CV_16U
        )
        part = np.asarray(eroded, np.uint16)
        core = np.bincount(part.ravel(), minlength=parts)
        small = (core >= _CORE) & (core <= most)
        small[0] = False
        # what goes on beyond the ground looked at is not known to be small
        small[part[[0, -1]].ravel()] = False
        back = np.asarray(cv2.dilate(np.where(small[part], part, np.uint16(0)), _disc(reach + 1)), np.uint16)
        back[leaves == 0] = 0
        amount = np.bincount(back.ravel(), minlength=parts)
        own = (amount >= least) & (amount <= most)
        own[0] = False
        names = cells.count - 1 + np.cumsum(own)
        mine = own[back]
        labels[mine] = names[back[mine]]
        leaves[mine] = 0
        cells.count += int(own.sum())
    return np.asarray((cells.label >= first) & (cells.sizes[of] > least_left))


def _disc(reach: int) -> NDArray[np.uint8]:
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1)), np.uint8)
