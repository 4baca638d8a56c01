# SPDX-License-Identifier: Apache-2.0
"""The cells of a window in which something grows, and which blob each belongs to while blobs are cut into plants."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.intp]


@dataclass
class PlantCells:
    """Cells in which something grows.

    Attributes:
        row: (N,) of the cells in the window.
        column: (N,) of them.
        labels: int32 (rows, columns) number of the blob of each cell of the window, 0 where it is bare; between leaves
            that belong together that of the blob before it was cut.
        count: of labels, the bare one included.
    """

    row: Rows
    column: Rows
    labels: NDArray[np.int32]
    count: int

    @staticmethod
    def of(grown: NDArray[np.uint8], joined: NDArray[np.uint8]) -> PlantCells:
        """Blobs of what hangs together.

        Args:
            grown: (rows, columns) 1 in cells in which something grows.
            joined: likewise, and 1 in the cells between leaves that belong together.
        """
        count, components = cv2.connectedComponents(joined, connectivity=8, ltype=cv2.CV_32S)
        row, column = (np.ascontiguousarray(part) for part in np.nonzero(grown))
        return PlantCells(row, column, np.asarray(components, np.int32), count)

    @property
    def label(self) -> Rows:
        """Blob (N,) of each cell."""
        return np.asarray(self.labels[self.row, self.column], np.intp)

    @property
    def sizes(self) -> Rows:
        """Cells (count,) of each blob."""
        return np.bincount(self.label, minlength=self.count)

    def at(self, places: Rows) -> Rows:
        """Blobs (M,) at cells (M, 2)."""
        return np.asarray(self.labels[places[:, 0], places[:, 1]], np.intp)

    def share(self, seeds: Rows, of: NDArray[np.integer[Any]]) -> None:
        """Give each cell of blobs to the nearest of the seeds (M, 2), which lie in blobs (M,): these are new blobs."""
        if not len(seeds):
            return
        from robot_vision.perception.crop_rows.plant_kernels import share_among_seeds

        order = np.argsort(of, kind="stable")
        first = np.searchsorted(of[order], np.arange(self.count + 1))
        names = np.arange(self.count, self.count + len(seeds))
        label = self.label
        share_among_seeds(label, self.row, self.column, first, seeds[order], names)
        self.labels[self.row, self.column] = label
        self.count += len(seeds)
