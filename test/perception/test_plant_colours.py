# SPDX-License-Identifier: Apache-2.0
"""The colours of the crop are learned, several if it has them; leaves of another are found, mere borders are not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from robot_vision.perception.crop_rows.plant_colours import CropColour

SOIL, WEED = (88, 112, 134), (84, 136, 112)
CROP = (52, 104, 72), (70, 130, 80)
MIDDLE = np.s_[40:80, 60:260]


def _field(
    light: float = 1.0, seed: int = 0
) -> tuple[NDArray[np.uint8], NDArray[np.bool_], NDArray[np.bool_]]:
    """A picture of a row of two greens with a weed in it, its leaves, and the middle of the row."""
    picture = np.full((120, 320, 3), SOIL, np.float64)
    mask = np.zeros((120, 320), np.uint8)
    for n, x in enumerate(range(40, 300, 60)):
        cv2.circle(picture, (x, 60), 34, CROP[n % 2], -1, cv2.LINE_AA)
        cv2.circle(mask, (x, 60), 34, 1, -1)
    cv2.circle(picture, (160, 100), 7, WEED, -1, cv2.LINE_AA)
    cv2.circle(mask, (160, 100), 7, 1, -1)
    noise = np.random.default_rng(seed).normal(0.0, 1.5, picture.shape)
    middle = np.zeros(mask.shape, np.bool_)
    middle[MIDDLE] = mask[MIDDLE] > 0
    return np.clip(light * picture + noise, 0, 255).astype(np.uint8), mask > 0, middle


@pytest.mark.parametrize("light", [0.7, 1.0, 1.4])
def test_a_weed_is_found_among_leaves_of_two_greens_in_any_light(light: float) -> None:
    colour = CropColour()
    picture, mask, middle = _field()
    colour.learn(colour.of(picture)[middle])
    picture, mask, _ = _field(light, 1)
    foreign = colour.foreign(colour.of(picture), mask)
    assert foreign[96:105, 156:165].mean() > 0.9
    foreign[88:113, 148:173] = False
    assert np.count_nonzero(foreign) < 0.005 * np.count_nonzero(mask)


def test_before_the_crop_is_known_nothing_is_foreign() -> None:
    colour = CropColour()
    picture, mask, middle = _field()
    numbers = colour.of(picture)
    assert not colour.foreign(numbers, mask).any()
    colour.learn(numbers[middle][:50])
    assert not colour.foreign(numbers, mask).any()
    colour.learn(numbers[middle])
    assert colour.foreign(numbers, mask).any()
    colour.reset()
    assert not colour.foreign(numbers, mask).any()


@pytest.mark.parametrize("wrong", [{"blur": -1.0}, {"usual": 1.0}, {"core": 0}])
def test_settings_without_meaning_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        CropColour(**wrong)  # type: ignore[arg-type]
