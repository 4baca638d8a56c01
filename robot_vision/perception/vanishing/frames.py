# SPDX-License-Identifier: Apache-2.0
"""Three orthogonal vanishing points found jointly: one is proposed, one vote of all lines gives the other two."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry.sphere import cross, tangent_basis
from robot_vision.perception.vanishing.bundle import Bundle
from robot_vision.perception.vanishing.refit import refit_frame
from robot_vision.perception.vanishing.support import TOLERANCE

Array = NDArray[np.float64]

_BINS = 90
#: Half width of the widest vote about the axis, bins; a line that tells less than that does not vote.
_WIDEST = 6.0
#: Frames turned to their lines before one is chosen: a vote in cells can miss the best by a hair.
_FINALISTS = 4
#: Frames whose axes all agree within this are one and the same, cosine of 3 degrees.
_SAME = 0.9986


def best_frame(bundle: Bundle, proposed: Array) -> Array:
    """The orthogonal frame (3, 3), directions in rows, that all lines support most once it is turned to them."""
    frames, score = orthogonal_frames(bundle, proposed)
    finalists = [refit_frame(bundle, frames[k]) for k in different_frames(frames, score, _FINALISTS)]
    return max(finalists, key=lambda finalist: finalist[1])[0]


def different_frames(frames: Array, score: Array, most: int) -> list[int]:
    """Indices of up to `most` frames of highest score, none of which is another one with its axes renamed."""
    chosen: list[int] = []
    for k in np.argsort(-score, kind="stable"):
        cosines = np.abs(frames[chosen] @ frames[k].T)
        if not (cosines.max(axis=2) > _SAME).all(axis=1).any():
            chosen.append(int(k))
        if len(chosen) == most:
            break
    return chosen


def orthogonal_frames(bundle: Bundle, proposed: Array) -> tuple[Array, Array]:
    """The best orthogonal frame about each proposed direction.

    About a proposed direction v the two partners are known up to one angle. Every line that does not lead to v
    names the one partner it could lead to (the direction across v that lies in the line's plane), hence the angle,
    modulo 90 degrees since it may be either partner, with a width that follows from the line's own error.

    Args:
        bundle: N lines.
        proposed: (K, 3) unit directions.

    Returns:
        frames: (K, 3, 3) rows v, partner, partner, right-handed.
        score: (K,) support of all lines for the frame.
    """
    from robot_vision.perception.vanishing import kernels

    angles, scores = np.empty(len(proposed)), np.empty(len(proposed))
    kernels.partner_votes(*bundle.arrays, proposed, TOLERANCE, _BINS, _WIDEST, angles, scores)
    basis = tangent_basis(proposed)
    partner = np.cos(angles)[:, None] * basis[:, 0] + np.sin(angles)[:, None] * basis[:, 1]
    return np.stack([proposed, partner, cross(proposed, partner)], axis=1), scores
