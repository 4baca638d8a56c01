# SPDX-License-Identifier: Apache-2.0
"""Finds what is only dark on the floor: all colours dimmed alike, floor all around it, no part standing up."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping.plane_motion import Parallax

Pixels = NDArray[np.uint8]
Mask = NDArray[np.bool_]
Scores = NDArray[np.float32]

_LINEAR = ((np.arange(256) / 255.0) ** 2.2).astype(np.float32)
"""Light behind the grey levels of an ordinary camera: a shadow takes a share of the light, not of the levels."""


@dataclass
class ShadowFinder:
    """Tells shadows from dark objects by colour in one picture, and by parallax once there are two.

    Args:
        darkest, lightest: share of the floor's light that is left in a shadow: less is a dark thing, more is floor.
        tint: greatest difference of that share between colours, as part of it; skylight makes shadows blue.
        warmth: by how much red may exceed blue, likewise: shadows do not turn floors red.
        standing: log ratio of parallax (`Parallax.raised`) in the mean of a patch that makes it a thing.
        surrounded: share of the upper rim of a patch at which floor must go on.
        memory: share of the old colour of the floor that a picture leaves.
    """

    darkest: float = 0.13
    lightest: float = 0.75
    tint: float = 0.50
    warmth: float = 0.04
    standing: float = 0.18
    surrounded: float = 0.5
    memory: float = 0.9
    _floor: NDArray[np.float32] | None = field(default=None, init=False, repr=False)

    def reset(self) -> None:
        """Forget the colour of the floor."""
        self._floor = None

    def learn(self, bgr: Pixels, floor: Mask) -> None:
        """Take in the colour of floor in the light: the lighter half of what is floor.

        Args:
            bgr: (H, W, 3) the part of the picture that may show floor.
            floor: (H, W) what of it is floor for certain.
        """
        light = _LINEAR[bgr[floor]]
        if not len(light):
            return
        lit = np.quantile(light, 0.6, axis=0).astype(np.float32)
        share = np.float32(self.memory)
        if self._floor is None or float(lit.sum()) > 1.5 * float(self._floor.sum()):
            self._floor = lit
        else:
            self._floor = share * self._floor + (1 - share) * lit

    def find(self, bgr: Pixels, score: Scores, parallax: Parallax | None) -> Mask:
        """Which pixels (H, W) that do not look like floor are floor in shadow.

        Args:
            bgr: (H, W, 3) the part of the picture that shows ground.
            score: (H, W) positive for floor.
            parallax: of the same part, None without an earlier picture.
        """
        shadow = np.zeros(score.shape, bool)
        if self._floor is None:
            return shadow
        left = _LINEAR[bgr] / np.maximum(self._floor, 1e-3)
        blue, green, red = left[..., 0], left[..., 1], left[..., 2]
        mean = (blue + green + red) / np.float32(3.0)
        spread = np.maximum(np.maximum(blue, green), red) - np.minimum(np.minimum(blue, green), red)
        dim = (mean > self.darkest) & (mean < self.lightest) & (spread < self.tint * mean)
        dim &= red - blue < self.warmth * mean
        dim &= score < 0.0
        count, patches, stats, _ = cv2.connectedComponentsWithStats(dim.astype(np.uint8), connectivity=4)
        if count < 2:
            return shadow
        size = stats[:, cv2.CC_STAT_AREA].astype(np.float64)
        # What reaches up to the horizon stands: no shadow on the floor does.
        flat = stats[:, cv2.CC_STAT_TOP] > 2
        # A thing that is taller in the picture than wide stands too; shadows are foreshortened.
        flat &= stats[:, cv2.CC_STAT_HEIGHT] < 1.2 * stats[:, cv2.CC_STAT_WIDTH] + 4
        # Floor goes on behind a shadow; behind what stands at the foot of a wall there is the wall.
        above = np.zeros(score.shape, bool)
        above[:-2] = patches[2:] > 0
        above &= patches == 0
        over = np.zeros_like(patches)
        over[:-2] = patches[2:]
        edge, floor = (np.bincount(over[m], minlength=count) for m in (above, above & (score > 0.0)))
        flat &= floor > self.surrounded * edge
        if parallax is not None:
            raised = np.bincount(patches.ravel(), parallax.raised.ravel(), minlength=count) / size
            flat &= raised < self.standing
        flat[0] = False
        return np.asarray(flat[patches])
