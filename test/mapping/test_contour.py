# SPDX-License-Identifier: Apache-2.0
"""The contour is the cheapest of all there are."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from robot_vision.mapping.contour import contour


@pytest.mark.parametrize("seed", range(5))
def test_no_other_contour_costs_less(seed: int) -> None:
    random = np.random.default_rng(seed)
    cost, bend = random.random((6, 4)), random.random((4, 4)).astype(np.float32)
    broken = np.array([False, False, True, False, False])

    def price(states: tuple[int, ...]) -> float:
        bends = [bend[after, before] for before, after in zip(states[:-1], states[1:], strict=True)]
        return float(cost[np.arange(6), states].sum() + np.sum(bends, where=~broken))

    assert tuple(contour(cost, bend, broken)) == min(product(range(4), repeat=6), key=price)
