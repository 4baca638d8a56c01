# SPDX-License-Identifier: Apache-2.0
"""Pictures that the filter of a row refuses, followed in their turn: when they agree for long, the filter is wrong."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from robot_vision.perception.crop_rows.row_filter import OFFSET, Motion, RowFilter

Array = NDArray[np.float64]


@dataclass
class RowDispute:
    """Gives the word to refused pictures once they agree with each other and odometry over a stretch of way.

    A filter that began with a wrong picture is too sure of itself to take in right ones. What a few weeds in a gap look
    like changes with each step; rows stay where they are.

    Args:
        agreed: way over which they must, m: by then other plants are seen than at its beginning.
        aside: share of the spacing by which their row may lie beside the filter's: farther off is another row.
    """

    agreed: float = 1.2
    aside: float = 0.25
    _rival: RowFilter | None = field(default=None, init=False, repr=False, compare=False)
    _way: float = field(default=0.0, init=False, repr=False, compare=False)

    def predict(self, motion: Motion) -> None:
        """Carry the refused on, as the filter does."""
        if self._rival is not None:
            self._rival.predict(motion)
            self._way += abs(motion.speed or 0.0) * motion.seconds

    def settle(self) -> None:
        """The filter has believed a picture: there is no dispute."""
        self._rival, self._way = None, 0.0

    def refused(
        self, row_filter: RowFilter, measured: Array, covariance: Array, doubt: float, spacing: float
    ) -> RowFilter | None:
        """Take in what the filter refused; returns the filter to go on with instead, None when it stays.

        Args:
            row_filter: that refused.
            measured: as of `RowFilter.update`, as the next two.
            covariance: of it.
            doubt: factor on that.
            spacing: between rows, m.
        """
        rival = self._rival
        if rival is None or not rival.update(measured, covariance, doubt):
            rival, self._way = replace(row_filter), 0.0
            self._rival = rival if rival.update(measured, covariance, doubt) else None
            return None
        off = abs(float(rival.expected()[OFFSET] - row_filter.expected()[OFFSET]))
        if self._way < self.agreed or off > self.aside * spacing:
            return None
        self.settle()
        return rival
