# SPDX-License-Identifier: Apache-2.0
"""Leaves of another colour than the crop's: weeds that grow into its leaves are told by nothing else.

What colour the crop has is learned on the way, from what grows in the middle of its rows. Only ratios of channels
count: light and shade change all three alike.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.perception.vegetation import Picture

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Colours = NDArray[np.int16]

#: Grey levels added to each channel, so that the noise of dark pixels is no colour.
_DARK = 10.0
#: Colours are the logarithms of red and of blue over green, told apart by so much, from the least up, in so many bins.
_BIN, _LEAST, _BINS = 0.025, (-1.0, -1.5), (64, 80)
#: Logarithms are whole numbers of so many parts of a bin.
_PARTS = 8
_LOG = np.rint(_PARTS * np.log(np.arange(256.0) + _DARK) / _BIN).astype(np.int16)
#: Standard deviation by which what was seen of a colour counts for its neighbours, bins.
_ALIKE = 1.0
#: Fewest pixels that tell the colour of the crop in a picture, and the share of its word.
_FEWEST, _SLOWLY = 200, 0.1
#: How far beyond the pixels that are surely of another colour those beside them belong to the same leaf, px.
_BESIDE = 2


@dataclass
class CropColour:
    """Learns what colours the crop has, and finds leaves that have another.

    Args:
        blur: standard deviation of the blur before, px.
        usual: share of the crop's leaves whose colours, the most frequent ones, are taken for its own: what is left
            are its weeds, and what withers.
        core: width of leaves that can be told, px: borders of leaves are mixed with the soil behind.

    Raises:
        ValueError: naming the setting that makes no sense.
    """

    blur: float = 0.8
    usual: float = 0.97
    core: int = 3
    _seen: Array | None = field(default=None, init=False, repr=False, compare=False)
    _other: Mask = field(default_factory=lambda: np.zeros(_BINS, bool), init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not 0.0 <= self.blur <= 20.0:
            raise ValueError(f"blur must lie in [0, 20] px, not {self.blur}")
        if not 0.0 < self.usual < 1.0:
            raise ValueError(f"usual must lie in (0, 1), not {self.usual}")
        if not 1 <= self.core <= 99:
            raise ValueError(f"core must lie in [1, 99] px, not {self.core}")

    def reset(self) -> None:
        """Forget what was learned."""
        self._seen = None
        self._other[:] = False

    def of(self, picture: Picture) -> Colours:
        """Number (H, W) of the colour of each pixel of a picture, uint8 (H, W, 3) BGR."""
        if self.blur > 0.2:
            picture = np.asarray(cv2.GaussianBlur(picture, (0, 0), self.blur))
        blue, green, red = cv2.split(cv2.LUT(picture, _LOG))
        row, column = (
            np.clip((part - green - np.int16(_PARTS * low / _BIN)) // np.int16(_PARTS), 0, count - 1)
            for part, low, count in zip((red, blue), _LEAST, _BINS, strict=True)
        )
        return np.asarray(row * np.int16(_BINS[1]) + column, np.int16)

    def learn(self, colours: Colours) -> None:
        """Take in colours (N,), as of `of`, of what grows where the crop stands; most of it is crop."""
        if len(colours) < _FEWEST:
            return
        count = np.bincount(colours, minlength=_BINS[0] * _BINS[1]).reshape(_BINS) / len(colours)
        share = np.asarray(cv2.GaussianBlur(count, (0, 0), _ALIKE), np.float64)
        seen = share if self._seen is None else self._seen + _SLOWLY * (share - self._seen)
        ranked = np.sort(seen, axis=None)
        rarest = np.searchsorted(np.cumsum(ranked), (1.0 - self.usual) * ranked.sum())
        self._seen, self._other = seen, seen < ranked[rarest]

    def foreign(self, colours: Colours, mask: Mask) -> Mask:
        """Pixels (H, W) of a mask of leaves whose colours (H, W) are not the crop's; none before these are known."""
        if self._seen is None:
            return np.zeros_like(mask)
        unlike = (self._other.ravel()[colours] & mask).view(np.uint8)
        core = cv2.erode(unlike, np.ones((self.core, self.core), np.uint8))
        reach = self.core + 2 * _BESIDE
        around = cv2.dilate(core, np.ones((reach, reach), np.uint8)) > 0
        return np.asarray(around & (unlike > 0))
