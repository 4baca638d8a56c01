# SPDX-License-Identifier: Apache-2.0
"""Brings together what appearance and motion say of each pixel: floor above zero, something else below."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping.plane_motion import Parallax

Scores = NDArray[np.float32]
Mask = NDArray[np.bool_]

_FEWEST = 100
"""Pixels of certain floor, counted one in six, without which nothing is known of a pair of pictures."""


@dataclass(frozen=True)
class Evidence:
    """How much appearance and parallax weigh.

    Args:
        likeness: log ratio of appearance that floor must show: where both are as likely it is none.
        parallax: score for all of what floor should show and does, or for as much against it.
        expected: share of what floor usually shows that makes floor as likely as not.
        clear: share of what floor should show that it must usually show for parallax to count whole.
        enough: log ratio that floor must be able to show for parallax to count whole.
        mirror: log ratio of a plane below the floor that makes a pixel a reflection, whatever it looks like.
        limit: greatest amount of the score.
    """

    likeness: float = 1.0
    parallax: float = 6.0
    expected: float = 0.4
    clear: float = 0.6
    enough: float = 0.5
    mirror: float = 0.3
    limit: float = 3.0

    def score(self, likeness: Scores, parallax: Parallax | None) -> Scores:
        """Score (H, W) of floor.

        Args:
            likeness: (H, W) log ratio of appearance.
            parallax: of the same part of the picture, None without an earlier picture.
        """
        score = likeness - np.float32(self.likeness)
        if parallax is None:
            return np.asarray(score)
        raised, mirrored = parallax.raised, parallax.mirrored
        limit = np.float32(self.limit)
        shown = np.asarray(-raised / np.maximum(parallax.telling, np.float32(0.05)), np.float32)
        usual = self._usual(shown, likeness, parallax.telling)
        trust = np.float32(min(max(usual, 0.0) / self.clear, 1.0))
        weight = trust * np.minimum(parallax.telling / np.float32(self.enough), np.float32(1.0))
        against = np.float32(self.expected * usual)
        moves = np.clip((shown - against) * np.float32(self.parallax), -limit, limit) * weight
        shines = (mirrored > self.mirror) & (mirrored > 0.7 * raised) & _over_floor(score > 0.0)
        score = np.where(shines, limit, score + moves)
        return np.asarray(np.clip(score, -limit, limit), np.float32)

    def _usual(self, shown: Scores, likeness: Scores, telling: Scores) -> float:
        """What floor shows in this pair of pictures: less than all where they do not fit each other well."""
        floor = (likeness[::2, ::3] > self.likeness + 1.0) & (telling[::2, ::3] > self.enough / 2.0)
        if floor.sum() < _FEWEST:
            return 0.0
        return float(np.median(shown[::2, ::3][floor]))


def _over_floor(floor: Mask) -> Mask:
    """What lies above floor (H, W) in its column: a mirror is part of the floor before it, a thing too near is not."""
    return np.logical_or.accumulate(floor[::-1], axis=0)[::-1]


def sharp(gray: NDArray[np.uint8], contrast: float, rows: int) -> Mask:
    """Where an edge sharper than `contrast` (grey levels a pixel) lies within `rows` above or below, (H, W).

    Where floor meets a thing there is an edge; the glare of a lamp and the shade about a thing end softly.
    """
    down, across = (cv2.Sobel(gray, cv2.CV_16S, *order) for order in ((0, 1), (1, 0)))
    strength = cv2.max(np.abs(down), np.abs(across))
    # Sobel adds up the differences over two pixels, with weights that sum to four.
    edge = (strength > int(8.0 * contrast)).astype(np.uint8)
    return np.asarray(cv2.dilate(edge, np.ones((2 * rows + 1, 3), np.uint8)), np.bool_)
