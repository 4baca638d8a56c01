# SPDX-License-Identifier: Apache-2.0
"""What rows look like from above, before any plant is cut out of them: how wide they are, and where their middle is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_vision.perception.crop_rows.ground_fit import lateral
from robot_vision.perception.crop_rows.ground_window import GROWS, GroundWindow

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Ground that tells how wide rows are (m ahead of the nearest), in so many bins; fewest cells and rounds of the fit.
_NEAR_M, _BINS, _FEWEST_CELLS, _ROUNDS = 1.2, 60, 100, 20
#: What grows this near to the line of a row tells the colour of the crop, radii of a usual plant.
_MIDDLE = 0.5
#: One in so many rows and columns of cells is asked for it.
_SPARSE = 3
#: Standard deviation of a plant about the line of its row, m.
_SOWN = 0.014


def row_radius(window: GroundWindow, rows: Array, spacing: float) -> float | None:
    """Radius of the crop's plants from how wide its rows are, m; None where hardly anything grows.

    What grows about a row scatters by half the radius of its plants; weeds, which stand anywhere, are told apart as
    the part that is spread evenly.

    Args:
        window: the ground.
        rows: (6,) as `RowsOnGround.values`.
        spacing: between rows, m.
    """
    row, column = np.nonzero(window.cells[: int(_NEAR_M / window.side) : 2, ::2])
    if len(row) < _FEWEST_CELLS:
        return None
    places = window.corner + 2.0 * window.side * np.column_stack([row, column])
    aside = lateral(places[:, 0], places[:, 1], rows)[0]
    aside -= spacing * np.round(aside / spacing)
    share, edges = np.histogram(aside, _BINS, (-0.5 * spacing, 0.5 * spacing))
    middle, share = 0.5 * (edges[1:] + edges[:-1]), share / share.sum()
    even, sigma, mean = 0.3, 0.15 * spacing, 0.0
    for _ in range(_ROUNDS):
        bell = (1.0 - even) * np.exp(-0.5 * ((middle - mean) / sigma) ** 2) / (np.sqrt(2.0 * np.pi) * sigma)
        own = bell / (bell + even / spacing)
        even = float(np.clip(1.0 - own @ share, 0.01, 0.95))
        mean = float((own * share) @ middle / (own @ share))
        sigma = float(np.sqrt((own * share) @ (middle - mean) ** 2 / (own @ share)) + 1e-4)
    return 2.0 * float(np.sqrt(max(sigma**2 - _SOWN**2, _SOWN**2 / 4.0)))


def middle_of_rows(window: GroundWindow, rows: Array, spacing: float, radius: float) -> Mask:
    """Some cells (rows, columns) that are grown over, well within the picture, in the middle of the crop's plants.

    Args:
        window: the ground.
        rows: (6,) as `RowsOnGround.values`.
        spacing: between rows, m.
        radius: of a usual plant of the crop, m.
    """
    row, column = _SPARSE * np.stack(np.nonzero(window.cells[::_SPARSE, ::_SPARSE] == GROWS))
    places = window.corner + window.side * np.column_stack([row, column])
    aside = lateral(places[:, 0], places[:, 1], rows)[0]
    inside = np.abs(aside - spacing * np.round(aside / spacing)) < _MIDDLE * radius
    middle = np.zeros(window.cells.shape, np.bool_)
    middle[row[inside], column[inside]] = True
    return middle
