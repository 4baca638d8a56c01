# SPDX-License-Identifier: Apache-2.0
"""The focal length of a camera that nobody calibrated, from what is built at right angles in front of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry.sphere import EqualAreaCells, cross
from robot_vision.perception.vanishing.bundle import Bundle
from robot_vision.perception.vanishing.frames import orthogonal_frames
from robot_vision.perception.vanishing.refit import rotation_about
from robot_vision.perception.vanishing.support import TOLERANCE, assignment
from robot_vision.perception.vanishing.votes import proposals

Array = NDArray[np.float64]

#: Focal lengths tried, as ratios to the one assumed (the longer side of the picture, 53 degrees across it): from
#: 87 degrees (0.55) to 26 degrees (2.2) across.
RATIOS = np.exp(np.linspace(np.log(0.55), np.log(2.2), 9))
#: Spread of focal lengths of ordinary cameras about the one assumed, as standard deviation of the logarithm.
PRIOR_SIGMA = 0.35
#: Support that one squared standard deviation of the prior outweighs, in mean lines.
_PRIOR_PRICE = 4.0
#: Lines share their errors, and no scene is quite rectangular: factor on the standard deviation, from real towns.
_SHARED_ERROR = 3.0
_FRAMES_A_RATIO = 2
_FRAMES_REFITTED = 5


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
    starts: list[tuple[float, float, Array]] = []
    for ratio in RATIOS:
        scaled = bundle.at_focal_ratio(float(ratio))
        proposed = proposals(scaled, cells, voters, candidates)
        if not len(proposed):
            continue
        frames, score = orthogonal_frames(scaled, proposed)
        for k in np.argsort(-score, kind="stable")[:_FRAMES_A_RATIO]:
            starts.append((float(score[k]) - _price(ratio), float(ratio), frames[k]))
    if not starts:
        return None
    starts.sort(key=lambda start: -start[0])
    refitted = [_refit(bundle, frame, ratio) for _, ratio, frame in starts[:_FRAMES_REFITTED]]
    best = max(refitted, key=lambda outcome: outcome[0])
    return best[1]


def _price(ratio: float) -> float:
    return float(_PRIOR_PRICE * (np.log(ratio) / PRIOR_SIGMA) ** 2)


def _refit(bundle: Bundle, frame: Array, ratio: float, rounds: int = 12) -> tuple[float, FocalLength]:
    """Gauss-Newton on the rotation of the frame and the logarithm of the focal length together."""
    prior = 2.0 * _PRIOR_PRICE / PRIOR_SIGMA**2 / TOLERANCE**2
    for turn in range(rounds + 1):
        scaled = bundle.at_focal_ratio(ratio)
        residuals = scaled.residuals(frame)
        nearest, support = assignment(residuals, TOLERANCE * (2.0 if turn < 2 else 1.0))
        each = np.arange(len(bundle))
        residual, own = residuals[nearest, each], frame[nearest]
        scale = 1.0 / (scaled.reach(frame)[nearest, each] * scaled.sigma)
        # Of the line (a, b, c / ratio) only the last part moves with the focal length.
        by_focal = -scale * scaled.lines[:, 2] * own[:, 2]
        jacobian = np.column_stack([scale[:, None] * cross(own, scaled.lines), by_focal])
        weighted = (bundle.weight * support)[:, None] * jacobian
        information = jacobian.T @ weighted + np.diag([1e-6, 1e-6, 1e-6, prior])
        if turn == rounds:
            break
        pull = weighted.T @ residual + np.array([0.0, 0.0, 0.0, prior * np.log(ratio)])
        step = -np.linalg.solve(information, pull)
        angle = float(np.linalg.norm(step[:3]))
        frame = frame @ rotation_about(step[:3] * min(1.0, 0.1 / max(angle, 1e-12))).T
        ratio *= float(np.exp(np.clip(step[3], -0.15, 0.15)))
        if turn > 2 and angle < 1e-5 and abs(step[3]) < 1e-5:
            break
    score = float(bundle.weight @ support) - _price(ratio)
    sigma = _SHARED_ERROR * float(np.sqrt(np.linalg.inv(information)[3, 3]))
    return score, FocalLength(ratio, min(sigma, PRIOR_SIGMA), frame)
