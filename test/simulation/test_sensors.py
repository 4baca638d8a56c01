# SPDX-License-Identifier: Apache-2.0
"""The camera's noise, blur and exposure are those that were asked for."""

from __future__ import annotations

import numpy as np
import pytest

from robot_vision.simulation import SimulationError
from robot_vision.simulation.sensors import CameraSensor

SHAPE = (120, 160, 3)


def linear(picture: np.ndarray) -> np.ndarray:
    """Share of full scale that pixel values stand for."""
    return (np.asarray(picture, float) / 255) ** 2.2


def test_noise_grows_with_the_light_as_photons_do() -> None:
    dim, bright = np.full(SHAPE, 0.1, np.float32), np.full(SHAPE, 0.6, np.float32)
    light = np.concatenate([dim, bright])
    sensor = CameraSensor(1, blur_px=0.0, noise=0.03, dark_noise=0.01, exposure=0.35)
    picture = linear(sensor.capture(light))
    for part, share in ((picture[:120], 0.1), (picture[120:], 0.6)):
        assert part.mean() == pytest.approx(share, rel=0.02)
        assert part.std() == pytest.approx(np.sqrt(0.03**2 * share + 0.01**2), rel=0.05)


def test_noise_is_new_in_every_picture_and_the_same_for_the_same_seed() -> None:
    light = np.full(SHAPE, 0.3, np.float32)
    one, two, other = CameraSensor(4), CameraSensor(4), CameraSensor(5)
    first, second = one.capture(light), one.capture(light)
    np.testing.assert_array_equal(two.capture(light), first)
    np.testing.assert_array_equal(two.capture(light), second)
    assert not np.array_equal(other.capture(light), first)
    correlation = np.corrcoef(first.ravel().astype(float), second.ravel().astype(float))[0, 1]
    assert abs(correlation) < 0.02


def test_without_noise_the_picture_is_the_light() -> None:
    light = np.linspace(0, 1, 256, dtype=np.float32)[None, :, None] * np.ones((64, 1, 3), np.float32)
    sensor = CameraSensor(0, blur_px=0.0, noise=0.0, dark_noise=0.0, exposure=0.5)
    picture = sensor.capture(light)
    np.testing.assert_allclose(linear(picture), light, rtol=0.02, atol=0.01)
    assert picture.min() == 0 and picture.max() >= 254


def test_blur_spreads_an_edge_by_its_deviation() -> None:
    light = np.zeros(SHAPE, np.float32)
    light[:, 80:] = 0.5
    sensor = CameraSensor(0, blur_px=1.5, noise=0.0, dark_noise=0.0, exposure=0.25)
    slope = np.diff(linear(sensor.capture(light))[60, :, 0])
    place = np.arange(len(slope)) - 79
    assert np.sqrt((slope * place**2).sum() / slope.sum()) == pytest.approx(1.5, abs=0.1)


def test_exposure_follows_the_light_step_by_step() -> None:
    sensor = CameraSensor(0, noise=0.0, dark_noise=0.0, exposure=0.25, adaptation=0.3)
    first = linear(sensor.capture(np.full(SHAPE, 0.5, np.float32))).mean()
    dark = np.full(SHAPE, 0.1, np.float32)
    means = [linear(sensor.capture(dark)).mean() for _ in range(25)]
    assert first == pytest.approx(0.25, abs=0.01)
    assert means[0] < 0.12
    assert all(b >= a for a, b in zip(means, means[1:], strict=False))
    assert means[-1] == pytest.approx(0.25, abs=0.01)


def test_a_negative_noise_is_refused() -> None:
    with pytest.raises(SimulationError, match="dark_noise"):
        CameraSensor(dark_noise=-0.1)
