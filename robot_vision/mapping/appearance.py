# SPDX-License-Identifier: Apache-2.0
"""Learns what the floor looks like from the floor just before the robot, and tells where the picture looks like it."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

Scores = NDArray[np.float32]
Pixels = NDArray[np.uint8]

_BINS = 32
_LIGHT_SPREAD, _COLOUR_SPREAD = 1.2, 0.8
"""Blur of the histograms along lightness and the colour axes, bins: neighbouring tints belong together."""


@dataclass
class FloorAppearance:
    """Two histograms of colour, one of the floor before the robot and one of what stands above the horizon.

    The logarithm of their ratio tells the floor from the rest (Ulrich and Nourbakhsh 2000 take the first of them
    alone). What neither has ever shown looks like no floor.

    Args:
        memory: share of the old histogram that a picture leaves; the first one counts whole.
        unseen: density given to every tint, as share of an even spread over all.
        limit: greatest amount of the answer: no single pixel is certain.
    """

    memory: float = 0.9
    unseen: float = 0.6
    limit: float = 3.0
    _floor: Scores | None = field(default=None, init=False, repr=False)
    _other: Scores | None = field(default=None, init=False, repr=False)
    _ratio: Scores | None = field(default=None, init=False, repr=False)

    def reset(self) -> None:
        """Forget what the floor looks like."""
        self._floor = self._other = self._ratio = None

    @property
    def knows(self) -> bool:
        """Whether a floor has been learnt."""
        return self._floor is not None

    def learn(self, lab: Pixels, sample: NDArray[np.bool_], above: Pixels) -> None:
        """Take in the floor before the robot.

        Args:
            lab: (H, W, 3) the part of the picture that may show floor, CIE Lab of OpenCV.
            sample: (H, W) which of its pixels are floor for certain.
            above: (K, W, 3) the part above the horizon.
        """
        self._floor = self._mixed(self._floor, _histogram(np.compress(sample.ravel(), lab.reshape(-1, 3), 0)))
        self._other = self._mixed(self._other, _histogram(above.reshape(-1, 3)[::3]))
        even = np.float32(self.unseen / _BINS**3)
        other = np.float32(0.5) * self._other + np.float32(20.0) * even
        self._ratio = np.clip(np.log((self._floor + even) / other), -self.limit, self.limit)

    def score(self, lab: Pixels) -> Scores:
        """Log ratio (H, W) of floor to anything else, positive for floor.

        Raises:
            ValueError: nothing has been learnt yet.
        """
        if self._ratio is None:
            raise ValueError("no floor has been learnt yet")
        return np.asarray(self._ratio.take(_codes(lab)))

    def _mixed(self, old: Scores | None, new: Scores) -> Scores:
        if old is None:
            return new
        share = np.float32(self.memory)
        return np.asarray(share * old + (1 - share) * new)


def _codes(lab: Pixels) -> NDArray[np.uint16]:
    """Number of the histogram's bin (H, W): 8 levels of lightness a bin, 4 of each colour axis about grey."""
    code = (lab[..., 0] >> 3).astype(np.uint16)
    for axis in (1, 2):
        code <<= 5
        code |= (np.clip(lab[..., axis], 64, 191) - np.uint8(64)) >> 2
    return code


def _histogram(lab: Pixels) -> Scores:
    """Smoothed shares (32768,) of Lab pixels (N, 3)."""
    counts = np.bincount(_codes(lab).ravel(), minlength=_BINS**3).astype(np.float32)
    counts /= max(float(counts.sum()), 1.0)
    sheet = counts.reshape(_BINS, _BINS * _BINS)
    sheet = np.asarray(
        cv2.GaussianBlur(sheet, (1, 7), 1.0, sigmaY=_LIGHT_SPREAD, borderType=cv2.BORDER_CONSTANT), np.float32
    )
    # One below the other and so far apart that no level of lightness blurs into the next.
    planes = np.zeros((_BINS, _BINS + 2, _BINS), np.float32)
    planes[:, :_BINS] = sheet.reshape(_BINS, _BINS, _BINS)
    stack = cv2.GaussianBlur(
        planes.reshape(-1, _BINS), (5, 5), _COLOUR_SPREAD, borderType=cv2.BORDER_CONSTANT
    )
    return np.asarray(stack.reshape(planes.shape)[:, :_BINS].ravel(), np.float32)
