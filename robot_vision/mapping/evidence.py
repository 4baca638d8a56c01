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


@dataclass(frozen=True)
class Evidence:
    """How much appearance and parallax weigh.

    Args:
        likeness: log ratio of appearance that floor must show: where both are as likely it is none.
        parallax: score for each unit of the log ratio by which a plane above the floor explains a pixel better.
        certain: log ratio below which parallax says nothing.
        mirror: log ratio of a plane below the floor that makes a pixel a reflection, whatever it looks like.
        limit: greatest amount of the score.
    """

    likeness: float = 1.0
    parallax: float = 6.0
    certain: float = 0.25
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
        limit, certain = np.float32(self.limit), np.float32(self.certain)
        stands = np.minimum(np.maximum(raised - certain, 0.0) * np.float32(self.parallax), 2 * limit)
        lies = np.minimum(np.maximum(-np.maximum(raised, mirrored) - certain, 0.0) * np.float32(self.parallax), 2 * limit)
        shines = (mirrored > self.mirror) & (mirrored > 0.7 * raised)
        score = np.where(shines, limit, score - stands + lies)
        return np.clip(score, -limit, limit)


def sharp(gray: NDArray[np.uint8], contrast: float, rows: int) -> Mask:
    """Where an edge sharper than `contrast` (grey levels a pixel) lies within `rows` above or below, (H, W).

    Where floor meets a thing there is an edge; the glare of a lamp and the shade about a thing end softly.
    """
    down = cv2.Sobel(gray, cv2.CV_32F, 0, 1, scale=1.0 / 8.0)
    across = cv2.Sobel(gray, cv2.CV_32F, 1, 0, scale=1.0 / 8.0)
    strength = np.maximum(np.abs(down), np.abs(across))
    return np.asarray(cv2.dilate(strength, np.ones((2 * rows + 1, 3), np.uint8)) > contrast)
