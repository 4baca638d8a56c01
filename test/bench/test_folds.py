# SPDX-License-Identifier: Apache-2.0
"""What is told of pictures not seen does not come from having seen them."""

from __future__ import annotations

import numpy as np

from bench.folds import held_out


def test_settings_that_only_luck_prefers_gain_nothing_on_pictures_held_out():
    scores = np.random.default_rng(1).uniform(0.0, 100.0, (40, 50, 6))
    best_on_all = scores[:, :, :3].mean(axis=2).mean(axis=1).max()
    judged = held_out(scores, np.random.default_rng(0))[:3].mean()
    assert best_on_all > 52.0
    assert abs(judged - scores[:, :, :3].mean()) < 0.6 * (best_on_all - scores[:, :, :3].mean())


def test_a_setting_better_everywhere_is_found():
    scores = np.random.default_rng(2).uniform(0.0, 50.0, (10, 50, 6))
    scores[7] += 50.0
    np.testing.assert_allclose(held_out(scores, np.random.default_rng(0)), scores[7].mean(axis=0))
