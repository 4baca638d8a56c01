# SPDX-License-Identifier: Apache-2.0
"""Pairs of lines vote on the Gaussian sphere for the direction they would have if they were parallel in space.

The number of voters is bounded, so the cost is too, however many lines there are: the longest lines vote, because
they point best and because long straight edges are seldom clutter. The votes only propose; all lines decide later.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry.sphere import EqualAreaCells, normalised
from robot_vision.perception.vanishing.bundle import Bundle

Array = NDArray[np.float64]


def proposals(bundle: Bundle, cells: EqualAreaCells, voters: int, most: int) -> Array:
    """Directions of the fullest cells, fullest first.

    Args:
        bundle: lines, longest first.
        cells: the division of the sphere.
        voters: number of lines whose pairs vote.
        most: number of proposals wanted.

    Returns:
        (K, 3) unit directions, z >= 0, K <= most; each is the mean of the votes in its cell.
    """
    from robot_vision.perception.vanishing import kernels

    total, mean = np.empty(len(cells)), np.empty((len(cells), 3))
    kernels.pair_votes(bundle.lines[:voters], bundle.weight[:voters], *cells.layout, total, mean)
    most = min(most, len(cells))
    fullest = np.argpartition(-total, most - 1)[:most]
    fullest = fullest[np.lexsort((fullest, -total[fullest]))]
    return normalised(mean[fullest[total[fullest] > 0.0]])
