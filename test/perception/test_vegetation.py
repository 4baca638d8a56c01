# SPDX-License-Identifier: Apache-2.0
"""Plants are told from soil in colour and in the infrared, and bare soil gives nothing."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from drawn_fields import Sown, drawn

from robot_vision.perception.vegetation import VegetationMask, VegetationWeight, vegetation_index


def soil(shape: tuple[int, int] = (120, 160), seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(0.0, 6.0, (*shape, 3))
    return np.clip(np.array([88, 112, 134]) + noise, 0, 255).astype(np.uint8)


def with_plant(radius: int = 20) -> np.ndarray:
    picture = soil()
    cv2.circle(picture, (80, 60), radius, (60, 150, 80), -1)
    return picture


def test_the_index_is_excess_green_over_the_sum() -> None:
    picture = np.full((4, 4, 3), (40, 100, 30), np.uint8)
    assert vegetation_index(picture) == pytest.approx((2 * 100 - 40 - 30) / (170 + 30))


def test_a_plant_is_masked_and_nothing_else() -> None:
    mask = VegetationMask().of(with_plant())
    assert mask.sum() == pytest.approx(np.pi * 20**2, rel=0.1)
    assert mask[60, 80]
    assert not mask[:30].any()


@pytest.mark.parametrize("seed", range(3))
def test_bare_soil_gives_nothing(seed: int) -> None:
    assert not VegetationMask().of(soil(seed=seed)).any()


@pytest.mark.parametrize("level", [0, 3, 255])
def test_night_and_glare_give_nothing(level: int) -> None:
    noise = np.random.default_rng(1).normal(0.0, 1.5, (120, 160, 3))
    assert not VegetationMask().of(np.clip(level + noise, 0, 255).astype(np.uint8)).any()


def test_small_plants_are_filtered_and_large_ones_dilated() -> None:
    picture = with_plant()
    cv2.circle(picture, (20, 20), 3, (60, 150, 80), -1)
    assert VegetationMask().of(picture)[20, 20]
    assert not VegetationMask(least_area=60).of(picture)[20, 20]
    wide = VegetationMask(dilation=4).of(picture)
    assert wide[60, 80 - 23]
    assert not VegetationMask().of(picture)[60, 80 - 23]


def test_the_infrared_finds_the_same_plant() -> None:
    bright = np.full((120, 160), 70, np.uint8)
    cv2.circle(bright, (80, 60), 20, 190, -1)
    mask = VegetationMask().of(bright)
    assert mask.sum() == pytest.approx(np.pi * 20**2, rel=0.1)
    with pytest.raises(ValueError, match="infrared"):
        VegetationMask(index="green").of(bright)


def test_weights_are_local_and_capped() -> None:
    weight = VegetationWeight(cap=3.0).of(drawn(Sown())).weight
    assert weight.dtype == np.float32
    assert weight.min() >= -1.0
    assert weight.max() <= 3.0
    uneven = drawn(Sown()).astype(np.float64) * np.linspace(0.4, 1.0, 480)[:, None, None]
    dimmed = VegetationWeight(cap=3.0).of(uneven.astype(np.uint8)).weight
    assert np.corrcoef(weight.ravel(), dimmed.ravel())[0, 1] > 0.8


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: VegetationMask(index="blue"), "index"),  # type: ignore[arg-type]
        (lambda: VegetationMask(lower=2.0), "lower"),
        (lambda: VegetationMask(floor=-1.0), "floor"),
        (lambda: VegetationWeight(blur=-1.0), "blur"),
        (lambda: VegetationWeight(cap=0.0), "cap"),
        (lambda: VegetationMask().of(np.zeros((4, 4, 2), np.uint8)), "picture"),
        (lambda: VegetationMask().of(np.zeros((4, 4, 3), np.float32)), "picture"),
    ],
)
def test_nonsense_is_refused_by_name(make, words: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ValueError, match=words):
        make()
