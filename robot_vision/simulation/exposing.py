# SPDX-License-Identifier: Apache-2.0
"""From light on a sensor to pixel values, compiled: one pass where numpy would make seven."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation.shading import Singles, compiled


@compiled
def expose(
    light: Singles,
    noise: Singles,
    photon_variance: float,
    dark_variance: float,
    curve: NDArray[np.uint8],
    picture: NDArray[np.uint8],
) -> None:
    """Add noise to light and look up what a pixel then says.

    Args:
        light: (N,) share of full scale.
        noise: (N,) normal deviates.
        photon_variance: of the noise at full scale; it grows with the light.
        dark_variance: of the noise without light.
        curve: (K,) pixel value for light from 0 to 1 in even steps.
        picture: (N,) written.
    """
    top = np.float32(len(curve) - 1)
    photon, dark, zero = np.float32(photon_variance), np.float32(dark_variance), np.float32(0)
    for n in range(light.shape[0]):
        share = light[n] + math.sqrt(photon * max(light[n], zero) + dark) * noise[n]
        picture[n] = curve[int(min(max(share * top, zero), top))]
