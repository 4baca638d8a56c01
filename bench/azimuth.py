# SPDX-License-Identifier: Apache-2.0
"""Scores of the way ahead seen by a camera on the road against the way it then went."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEPS_AHEAD = 5  # pictures; at 10 Hz the way of the next half second


@dataclass(frozen=True)
class AzimuthScore:
    """Azimuths against travel, in degrees.

    Attributes:
        median: of the absolute errors.
        worst: largest absolute error.
        jitter: standard deviation of the differences from picture to picture.
        true_jitter: the same of the travel itself, which no answer can undercut honestly.
        missing: share of pictures without an answer, percent.
        compared: number of answers that have a truth.
    """

    median: float
    worst: float
    jitter: float
    true_jitter: float
    missing: float
    compared: int


def azimuth(direction: Sequence[float] | Array) -> float:
    """Return the azimuth (rad, to the right) of a direction (3,) in the optical frame."""
    return math.atan2(float(direction[0]), float(direction[2]))


def travel_azimuths(poses: Array, steps: int = STEPS_AHEAD) -> Array:
    """Return the way from each pose to the one `steps` later, as the camera at the first sees it.

    Args:
        poses: (N, 4, 4) world from camera, z forward.
        steps: how far to look ahead.

    Returns:
        (N - steps,) azimuths, rad to the right.
    """
    ways = poses[steps:, :3, 3] - poses[:-steps, :3, 3]
    seen = np.einsum("nji,nj->ni", poses[:-steps, :3, :3], ways)
    return np.asarray(np.arctan2(seen[:, 0], seen[:, 2]))


def score_azimuths(answers: Array, truth: Array) -> AzimuthScore:
    """Compare azimuths with travel.

    Args:
        answers: (N,) rad, one a picture, nan where there was no answer.
        truth: (M,) rad, of the first M pictures, M <= N.
    """
    errors = np.degrees(np.abs(answers[: len(truth)] - truth))
    known = errors[~np.isnan(errors)]
    return AzimuthScore(
        median=float(np.median(known)) if known.size else math.nan,
        worst=float(known.max()) if known.size else math.nan,
        jitter=_jitter(answers),
        true_jitter=_jitter(truth),
        missing=100.0 * float(np.isnan(answers).mean()),
        compared=int(known.size),
    )


def _jitter(angles: Array) -> float:
    differences = np.degrees(np.diff(angles))
    known = differences[~np.isnan(differences)]
    return float(np.std(known)) if known.size else math.nan
