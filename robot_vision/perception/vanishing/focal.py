# SPDX-License-Identifier: Apache-2.0
"""The focal length of a camera that nobody calibrated, from what is built at right angles in front of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry.sphere import EqualAreaCells
from robot_vision.perception.vanishing.bundle import Bundle
from robot_vision.perception.vanishing.frames import different_frames, orthogonal_frames
from robot_vision.perception.vanishing.support import TOLERANCE
from robot_vision.perception.vanishing.votes import proposals

Array = NDArray[np.float64]

#: Focal lengths tried, as ratios to the one assumed (the longer side of the picture, 53 degrees across it): from
#: 87 degrees (0.55) to 26 degrees (2.2) across.
RATIOS = np.exp(np.linspace(np.log(0.55), np.log(2.2), 9))
#: Spread of focal lengths of ordinary cameras about the one assumed, as standard deviation of the logarithm.
PRIOR_SIGMA = 0.35
#: Support that one squared standard deviation of the prior outweighs, in mean lines.
_PRIOR_PRICE = 6.0
#: Lines share their errors, and no scene is quite rectangular: factor on the standard deviation, from real towns.
SHARED_ERROR = 4.5
_FRAMES_A_RATIO = 2


@dataclass(frozen=True)
class FocalLength:
    """A focal length found.

    Attributes:
        ratio: to the focal length assumed.
        sigma: standard deviation of its logarithm; `PRIOR_SIGMA` when the picture does not tell.
        frame: (3, 3) orthogonal vanishing points in rows at that focal length.
    """

    ratio: float
    sigma: float
    frame: Array


def find_focal_length(
    bundle: Bundle, cells: EqualAreaCells, voters: int, candidates: int
) -> FocalLength | None:
    """Search focal length and orthogonal frame together; None when there is nothing to go by.

    Args:
        bundle: lines in the coordinates of the focal length assumed.
        cells: the division of the sphere.
        voters: number of lines whose pairs vote at each focal length tried.
        candidates: proposals examined at each focal length tried.
    """
    found: list[tuple[float, FocalLength]] = []
    for ratio in RATIOS:
        scaled = bundle.at_focal_ratio(float(ratio))
        proposed = proposals(scaled, cells, voters, candidates)
        if len(proposed):
            frames, score = orthogonal_frames(scaled, proposed)
            best = different_frames(frames, score, _FRAMES_A_RATIO)
            found += [_refit(bundle, frames[k], float(ratio)) for k in best]
    return max(found, key=lambda outcome: outcome[0])[1] if found else None


def _price(ratio: float) -> float:
    return float(_PRIOR_PRICE * (np.log(ratio) / PRIOR_SIGMA) ** 2)


def _refit(bundle: Bundle, frame: Array, ratio: float, rounds: int = 12) -> tuple[float, FocalLength]:
    """Turn the frame and stretch the focal length together; with the score of both."""
    from robot_vision.perception.vanishing import focal_kernels

    turned = np.array(frame, dtype=np.float64)
    # Two prices of a squared deviation, in the currency of squared residuals: support falls by their square over T^2.
    stiffness = 2.0 * _PRIOR_PRICE / PRIOR_SIGMA**2 / TOLERANCE**2
    ratio, information, support = focal_kernels.turn_frame_and_stretch(
        *bundle.arrays, turned, ratio, stiffness, TOLERANCE, rounds
    )
    sigma = min(SHARED_ERROR / float(np.sqrt(information)), PRIOR_SIGMA)
    return float(support) - _price(ratio), FocalLength(float(ratio), sigma, turned)
