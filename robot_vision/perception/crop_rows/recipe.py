# SPDX-License-Identifier: Apache-2.0
"""The textbook's way (20.10): threshold, dilate, centre of mass of each plant, a Hough transform of the centres.

Every plant votes for all rows at once, with its area, modulo the spacing. It is kept to be compared with: where
plants of a row touch, one blob is one vote in the middle of nowhere.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.perception.crop_rows.votes import RowVotes, StraightRows
from robot_vision.perception.vegetation import Picture, VegetationMask

Array = NDArray[np.float64]

#: Largest plants that vote; smaller ones change nothing and cost time.
_MOST = 300
_COLUMNS = 41


@dataclass(frozen=True)
class ChapterRecipe:
    """Finds straight rows from the centres of plants.

    Args:
        mask: of plants, dilated.
        votes: whose limits of spacing, horizon and vanishing column are searched.
    """

    mask: VegetationMask = field(default_factory=lambda: VegetationMask(dilation=2))
    votes: RowVotes = field(default_factory=RowVotes)

    def find(self, picture: Picture, spacing: float | None, ratio: float | None) -> StraightRows:
        """The straight rows with the most votes.

        Args:
            picture: uint8 (H, W, 3) BGR or (H, W).
            spacing: at the last image row, px, if it is known.
            ratio: spacing at the first image row / at the last one, if it is known.
        """
        height, width = picture.shape[:2]
        centres, areas = plants(self.mask.of(picture))
        limits = self.votes
        spacings = np.geomspace(limits.narrowest, limits.widest, 24) * width if spacing is None else [spacing]
        ratios = np.linspace(limits.nearest, limits.farthest, 14) if ratio is None else [ratio]
        reach = 2.0 * limits.columns * width / 320.0
        columns = np.linspace(-reach, reach, _COLUMNS)
        best = StraightRows(float(spacings[0]), float(ratios[0]), 0.0, 0.0, 0.0, 0.0)
        if not len(areas):
            return best
        for bottom in spacings:
            for top in ratios:
                local = bottom * (1.0 - (1.0 - top) * (height - 1.0 - centres[:, 1]) / (height - 1.0))
                seen = local > limits.least * width / 320.0
                if not seen.any():
                    continue
                # The phase of a plant about a row through the vanishing column; all rows share it modulo 1
                aside = centres[seen, 0] - 0.5 * width
                density = 1.0 / local[seen]
                phase = aside * density - np.outer(columns, density - 1.0 / bottom)
                summed = np.exp(2j * np.pi * phase) @ areas[seen] / areas.sum()
                k = int(np.abs(summed).argmax())
                if abs(summed[k]) > best.votes:
                    offset = float(np.angle(summed[k]) / (2.0 * np.pi)) % 1.0
                    votes = float(abs(summed[k]))
                    best = StraightRows(float(bottom), float(top), float(columns[k]), 0.0, offset, votes)
        return best


def plants(mask: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Centres of mass (N, 2), px, and areas (N,), px^2, of the connected plants of a mask, the largest first."""
    _, _, boxes, centres = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    areas = boxes[1:, cv2.CC_STAT_AREA].astype(np.float64)
    order = np.argsort(-areas, kind="stable")[:_MOST]
    return np.asarray(centres[1:][order], np.float64), areas[order]
