# SPDX-License-Identifier: Apache-2.0
"""Finds what is only dark on the floor: all colours dimmed alike, floor all around it, no part standing up."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping.ground_view import GroundView
from robot_vision.mapping.plane_motion import Parallax

Pixels = NDArray[np.uint8]
Mask = NDArray[np.bool_]
Scores = NDArray[np.float32]

_LINEAR = ((np.arange(256) / 255.0) ** 2.2).astype(np.float32)
"""Light behind the grey levels of an ordinary camera: a shadow takes a share of the light, not of the levels."""

_TELLING = 0.12
"""Mean of `Parallax.telling` in a patch below which parallax tells nothing of it."""


@dataclass
class ShadowFinder:
    """Tells shadows from dark objects by colour in one picture, and by parallax once there are two.

    Args:
        darkest, lightest: share of the floor's light that is left in a shadow: less is a dark thing, more is floor.
        tint: greatest difference of that share between colours, as part of it; skylight makes shadows blue.
        warmth: by how much red may exceed blue, likewise: shadows do not turn floors red.
        longest: length on the floor of a patch as a multiple of its width beyond which it stands up, as long as
            parallax does not tell.
        lying: share of what floor shows by parallax that a patch must show to be floor.
        surely: likewise of the upper rim of a patch that hangs together with what stands and has not the look of a
            shadow.
        doubt: score below which a pixel may be in shadow: of floor that looks much like what it is in the light, shadow
            makes floor that is doubted.
        stands: log ratio of parallax from which on a pixel stands above the floor.
        surrounded: share of the upper rim of a patch at which floor must go on.
        memory: share of the old colour of the floor that a picture leaves.
    """

    darkest: float = 0.13
    lightest: float = 0.75
    tint: float = 0.50
    warmth: float = 0.04
    longest: float = 2.0
    lying: float = 0.1
    surely: float = 0.42
    doubt: float = 0.2
    stands: float = 0.3
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
        light = _LINEAR.take(np.compress(floor.ravel(), bgr.reshape(-1, 3), axis=0))
        if not len(light):
            return
        lit = np.quantile(light, 0.6, axis=0).astype(np.float32)
        share = np.float32(self.memory)
        if self._floor is None or float(lit.sum()) > 1.5 * float(self._floor.sum()):
            self._floor = lit
        else:
            self._floor = share * self._floor + (1 - share) * lit

    def dim(self, bgr: Pixels) -> Mask:
        """Which pixels (H, W) have the colour of floor in shadow; none before the floor's colour is known."""
        if self._floor is None:
            return np.zeros(bgr.shape[:2], bool)
        left = cv2.LUT(bgr, (_LINEAR[:, None] / np.maximum(self._floor, 1e-3))[None])
        blue, green, red = (np.asarray(part, np.float32) for part in cv2.split(left))
        mean = (blue + green + red) / np.float32(3.0)
        spread = np.maximum(np.maximum(blue, green), red) - np.minimum(np.minimum(blue, green), red)
        dim = (mean > self.darkest) & (mean < self.lightest) & (spread < self.tint * mean)
        return np.asarray(dim & (red - blue < self.warmth * mean))

    def find(self, dim: Mask, score: Scores, view: GroundView, parallax: Parallax | None) -> Mask:
        """Which pixels (H, W) that do not look like floor, or hardly do, are floor in shadow.

        Args:
            dim: (H, W) what of the part of the picture that shows ground has the colour of floor in shadow.
            score: (H, W) positive for floor.
            view: of the ground in the working picture.
            parallax: of the same part, None without an earlier picture.
        """
        shadow = np.zeros(score.shape, bool)
        dim = dim & (score < self.doubt)
        stands = shadow if parallax is None else dim & (parallax.raised > self.stands)
        dim &= ~stands
        count, found, table, _ = cv2.connectedComponentsWithStats(dim.astype(np.uint8), connectivity=4)
        patches, stats = np.asarray(found, np.int32), np.asarray(table, np.int32)
        if count < 2:
            return shadow
        # What reaches up to the horizon stands: no shadow on the floor does.
        flat = stats[:, cv2.CC_STAT_TOP] > 2
        flat &= self._long_enough(stats, view)
        # Floor goes on behind a shadow; behind what stands at the foot of a wall there is the wall.
        over = np.zeros_like(patches)
        over[:-2] = patches[2:]
        above = (over > 0) & (patches == 0)
        edge, floor = (np.bincount(over[m], minlength=count) for m in (above, above & (score > 0.0)))
        flat &= floor > self.surrounded * edge
        if parallax is not None:
            lies = self._lies(patches, count, parallax)
            beside = np.asarray(cv2.dilate(stands.astype(np.uint8), np.ones((3, 3), np.uint8)), np.bool_)
            joined = np.bincount(patches[beside], minlength=count) > 0
            # What hangs together with a thing that stands, as its skirting does, must look like shadow both ways,
            # or surely lie up to their upper rim, as the long shadow of a kerb does: what stands rises with its height.
            up_high = self._lies(np.where(_upper_rim(patches), patches, 0), count, parallax) > self.surely
            told = (lies > self.lying) & (flat | ~joined | up_high)
            flat = np.where(np.isnan(lies), flat & ~joined, told)
        flat[0] = False
        return np.asarray(flat[patches])

    def _long_enough(self, stats: NDArray[np.int32], view: GroundView) -> Mask:
        """Which patches (N,) are no longer on the floor than a shadow of their width may be: what stands up is."""
        left, width = stats[:, cv2.CC_STAT_LEFT], stats[:, cv2.CC_STAT_WIDTH]
        top = stats[:, cv2.CC_STAT_TOP] + view.top
        bottom = top + stats[:, cv2.CC_STAT_HEIGHT]
        middle = left + width / 2.0
        near, _ = view.ground(middle, bottom.astype(np.float64))
        far, _ = view.ground(middle, top.astype(np.float64))
        across = width * near / (view.camera.fx * view.scale)
        return np.asarray(far - near < self.longest * across)

    @staticmethod
    def _lies(patches: NDArray[np.int32], count: int, parallax: Parallax) -> NDArray[np.float64]:
        """Share (N,) of what floor of their texture shows that patches show; nan where there is nothing to see."""
        inside = patches > 0
        number = patches[inside]
        telling, raised = (
            np.bincount(number, part[inside], minlength=count) for part in (parallax.telling, parallax.raised)
        )
        size = np.maximum(np.bincount(number, minlength=count), 1)
        return np.where(telling / size > _TELLING, -raised / np.maximum(telling, 1e-6), np.nan)


def _upper_rim(patches: NDArray[np.int32]) -> Mask:
    """The upper two rows of patches (H, W), column by column."""
    rim = patches > 0
    rim[2:] &= patches[:-2] != patches[2:]
    return rim
