# SPDX-License-Identifier: Apache-2.0
"""Whether a picture shows anything: night, and a sun that shines into the lens, are told before rows are sought."""

from __future__ import annotations

import numpy as np

from robot_vision.perception.vegetation import Picture

#: Mean grey level below which noise is all there is; level at which a pixel is saturated; share of such pixels.
_DARK, _WHITE, _MOST_WHITE = 18.0, 252, 0.25
#: Every so many pixels are looked at.
_STEP = 4


def fault_of(picture: Picture) -> str:
    """Say in plain words why a picture, uint8 (H, W, 3) or (H, W), shows nothing; empty when it does."""
    sampled = np.asarray(picture)[::_STEP, ::_STEP]
    brightest = sampled.max(axis=2) if sampled.ndim == 3 else sampled
    if float(brightest.mean()) < _DARK:
        return "the picture is dark"
    if float((sampled >= _WHITE).mean()) > _MOST_WHITE:
        return "the picture is overexposed"
    return ""
