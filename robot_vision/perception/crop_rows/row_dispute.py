# SPDX-License-Identifier: Apache-2.0
"""Pictures that the filter of a row refuses, followed in their turn: when they agree for long, the filter is wrong."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from robot_vision.perception.crop_rows.row_filter import OFFSET, Motion, RowFilter

Array = NDArray[np.float64]

_CREDIT_M = 3.0
"""Way over which the credit of a filter fades, and what it has refused is forgotten."""
_PICTURE_M = 0.15
"""Pictures nearer to each other than this show the same plants, and count for less than one."""
_STEP_M = 0.5
"""Way from one picture that agrees to the next that counts at most."""


@dataclass
class RowDispute:
    """Gives the word to refused pictures once they agree with each other and odometry over a stretch of way.

    A filter that began with a wrong picture is too sure of itself to take in right ones, and a search that begins where
    it says may find there what it looks for. What a few weeds in a gap look like changes with each step; rows stay
    where they are. A filter has credit, the number of pictures that it has believed of late: it keeps the word until it
    has refused more that agree than that. There is no dispute without odometry: nobody knows what should agree.

    Args:
        agreed: way over which they must, m: by then other plants are seen than at its beginning.
        pictures: so many must, at least.
        aside: share of the spacing by which their row may lie beside the filter's: farther off is another row.

    Raises:
        ValueError: naming the setting that is no positive number.
    """

    agreed: float = 1.2
    pictures: int = 5
    aside: float = 0.25
    _rival: RowFilter | None = field(default=None, init=False, repr=False, compare=False)
    _way: float = field(default=0.0, init=False, repr=False, compare=False)
    _since: float = field(default=0.0, init=False, repr=False, compare=False)
    _count: int = field(default=0, init=False, repr=False, compare=False)
    _refused: float = field(default=0.0, init=False, repr=False, compare=False)
    _moved: float = field(default=0.0, init=False, repr=False, compare=False)
    _credit: float = field(default=0.0, init=False, repr=False, compare=False)

    @property
    def goes_on(self) -> bool:
        """Whether refused pictures are followed."""
        return self._rival is not None

    def __post_init__(self) -> None:
        for name in ("agreed", "pictures", "aside"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise ValueError(f"{name} must be a positive number, not {getattr(self, name)}")

    def predict(self, motion: Motion) -> None:
        """Carry the refused on, as the filter does."""
        self._moved = abs(motion.speed or 0.0) * max(motion.seconds, 0.0)
        kept = float(np.exp(-self._moved / _CREDIT_M))
        self._credit *= kept
        self._refused *= kept
        self._since += self._moved
        if motion.speed is None or self._since > self.agreed:
            self.settle()
        if self._rival is not None:
            self._rival.predict(motion)

    def trust(self) -> None:
        """The filter has believed a picture without a doubt."""
        self._credit += self._weight

    def reset(self) -> None:
        """Another filter has the word, or none."""
        self._credit = 0.0
        self.settle()

    def settle(self) -> None:
        """There is no dispute."""
        self._rival = None
        self._restart()

    def hear(
        self,
        row_filter: RowFilter,
        measured: Array,
        covariance: Array,
        doubt: float,
        spacing: float,
        believed: bool,
    ) -> RowFilter | None:
        """Take in what a picture says by itself; returns the filter to go on with instead, None when it stays.

        Args:
            row_filter: that has the word.
            measured: as of `RowFilter.update`, as the next two.
            covariance: of it.
            doubt: factor on that.
            spacing: between rows, m.
            believed: whether the filter believes the picture, as it understands it.
        """
        if row_filter.agrees(measured, covariance):
            # by itself the picture says nothing against the filter
            if believed:
                self.settle()
            return None
        rival = self._rival
        if rival is None or not rival.update(measured, covariance, doubt):
            self.settle()
            if not believed:
                rival = replace(row_filter)
                self._rival = rival if rival.update(measured, covariance, doubt) else None
            return None
        # Way without a picture that agrees, as across a gap, is none over which they have agreed
        self._way += min(self._since, _STEP_M)
        self._since = 0.0
        self._count += 1
        self._refused += 0.0 if believed else self._weight
        off = abs(float(rival.expected()[OFFSET] - row_filter.expected()[OFFSET]))
        if self._way < self.agreed or self._count < self.pictures or off > self.aside * spacing:
            return None
        if self._refused <= self._credit:
            return None
        self.reset()
        rival.bend = row_filter.bend  # may have been set since
        return rival

    @property
    def _weight(self) -> float:
        """Of a picture: pictures of a robot that stands show the same again and again."""
        return min(self._moved / _PICTURE_M, 1.0)

    def _restart(self) -> None:
        self._way = self._since = self._refused = 0.0
        self._count = 0
