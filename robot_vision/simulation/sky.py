# SPDX-License-Identifier: Apache-2.0
"""Light that changes while a robot drives: clouds that pass before the sun."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_WAVES = 5


class Clouds:
    """Dims pictures as passing clouds do, smoothly, over seconds to a minute.

    Args:
        share: greatest share of the light they take away, 0 to 0.9; 0: a clear sky.
        seed: the same seed gives the same clouds.
    """

    def __init__(self, share: float, seed: int = 0) -> None:
        random = np.random.default_rng((seed, 7))
        self._share = share
        self._rates = 2 * np.pi * random.uniform(0.01, 0.08, _WAVES)
        self._phases = random.uniform(0, 2 * np.pi, _WAVES)

    def brightness(self, time: float) -> float:
        """Share of the light that is left at a time in seconds."""
        wave = float(np.sin(self._rates * time + self._phases).sum()) / np.sqrt(_WAVES / 2)
        return 1.0 - self._share * (0.5 + 0.5 * float(np.tanh(1.5 * wave)))

    def dim(self, light: NDArray[np.float32], time: float) -> None:
        """Dim a picture (H, W, 3) of linear light in place."""
        if self._share > 0:
            light *= np.float32(self.brightness(time))
