# SPDX-License-Identifier: Apache-2.0
"""Crop rows as a ruler: seen with the right pitch all rows are parallel and equally far apart on the ground.

Every bit of green is projected to the ground under a pitch that is tried, and all of it votes for direction and
spacing at once: the lateral distances to a direction, turned into a spectrum, peak at the spacing of the rows. The peak
is highest at the true pitch, where rows that seem to converge in the picture are parallel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import BODY_FROM_OPTICAL, Camera, rotation_from_rpy
from robot_vision.perception.calibration.findings import Finding
from robot_vision.perception.calibration.robust import block_sigma, robust_mean

Array = NDArray[np.float64]

#: One pixel in so many in both directions is looked at, after a blur (px) that joins the leaves of a plant.
_EVERY, _BLUR = 4, 1.5
#: Less green than this beyond the threshold counts by how much it is, more as this.
_GREENEST = 0.15
#: Ground is looked at as far as this, heights of the camera; the rows beyond blur into each other.
_REACH = 4.0
#: Width of a lateral bin in heights, bins, and the length of the spectrum.
_BIN, _BINS, _SPECTRUM = 0.02, 512, 2048
_FEWEST = 200
#: Pictures whose heights (relative) and pitches (rad) differ by less agree, and how many of all must.
_SAME_HEIGHT, _SAME_PITCH = 0.08, np.deg2rad(4.0)
_LEAST_AGREEMENT = 0.6
#: Common error of the pitch, rad, and what the camera is lower over the leaves than over the ground, relative.
_PITCH_SIGMA = float(np.deg2rad(0.3))
_LEAVES = 0.05


@dataclass(frozen=True)
class Plants:
    """What is green in a picture.

    Attributes:
        pixels: (N, 2) rectified px.
        weight: (N,) how green.
    """

    pixels: Array
    weight: Array


@dataclass(frozen=True)
class RowsSeen:
    """Rows in one picture.

    Attributes:
        strength: how much of the green votes for them, 0 to 1.
        pitch: of the camera, rad.
        yaw: of the rows to the left of where the camera looks, rad.
        spacing: from row to row, heights of the camera over the leaves.
    """

    strength: float
    pitch: float
    yaw: float
    spacing: float


def green_of(picture: NDArray[np.uint8]) -> Plants:
    """Find the green in a picture (H, W, 3) BGR: excess green over brightness, beyond Otsu's threshold."""
    small = cv2.GaussianBlur(picture, (0, 0), _BLUR)[::_EVERY, ::_EVERY].astype(np.float64)
    blue, green, red = small[..., 0], small[..., 1], small[..., 2]
    excess = (2.0 * green - red - blue) / (blue + green + red + 30.0)
    levels = np.clip(255.0 * excess, 0.0, 255.0).astype(np.uint8)
    threshold, _ = cv2.threshold(levels, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    weight = np.clip(excess - threshold / 255.0, 0.0, _GREENEST)
    rows, columns = np.nonzero(weight > 0.0)
    return Plants(_EVERY * np.column_stack([columns, rows]).astype(np.float64), weight[rows, columns])


@dataclass(frozen=True)
class RowFinder:
    """Finds pitch and spacing from rows of plants.

    Args:
        steepest: greatest pitch looked for, rad.
        widest: greatest angle between the rows and the way the camera looks, rad.
        shortest: least spacing looked for, heights of the camera.
        longest: greatest spacing looked for, heights of the camera.
    """

    steepest: float = float(np.deg2rad(60.0))
    widest: float = float(np.deg2rad(24.0))
    shortest: float = 0.12
    longest: float = 1.2

    def find(self, plants: Plants, camera: Camera) -> RowsSeen | None:
        """Find the rows of one picture; None where hardly anything is green or nothing regular.

        Args:
            plants: of the picture.
            camera: with focal length and roll; its pitch is not asked.
        """
        if len(plants.weight) < _FEWEST:
            return None
        body = camera.rays(plants.pixels) @ (rotation_from_rpy(camera.roll, 0.0, 0.0) @ BODY_FROM_OPTICAL).T
        step = np.deg2rad(2.0)
        pitches = np.arange(0.0, self.steepest, 1.25 * step)
        yaws = np.arange(-self.widest, self.widest + step, step)
        best = max(
            (self._vote(body, plants.weight, p, yaws, self.shortest, self.longest) for p in pitches),
            key=_strength,
        )
        for step in np.deg2rad([1.0, 0.3, 0.1]):
            around = np.arange(-2.0, 2.1) * step
            span = (0.9 * best.spacing, 1.1 * best.spacing)
            tried = [
                self._vote(body, plants.weight, best.pitch + p, best.yaw + around, *span)
                for p in 1.2 * around
            ]
            best = max([best, *tried], key=_strength)
        # At the end of what was looked for there is no peak, but the flank of something else.
        within = self.shortest < 0.95 * best.spacing and best.spacing < 0.95 * self.longest
        return best if within else None

    def _vote(
        self, body: Array, weight: Array, pitch: float, yaws: Array, shortest: float, longest: float
    ) -> RowsSeen:
        """The best direction and spacing under one pitch; `body` are rays in a body that does not pitch."""
        turned = body @ rotation_from_rpy(0.0, pitch, 0.0).T
        near = -turned[:, 2] * _REACH > np.hypot(turned[:, 0], turned[:, 1])
        ground, weight = turned[near, :2] / -turned[near, 2:], weight[near]
        if len(weight) < _FEWEST:
            return RowsSeen(0.0, pitch, 0.0, shortest)
        lateral = np.cos(yaws)[:, None] * ground[:, 1] - np.sin(yaws)[:, None] * ground[:, 0]
        place = np.clip((lateral / _BIN + _BINS / 2).astype(np.intp), 0, _BINS - 1)
        place += _BINS * np.arange(len(yaws))[:, None]
        votes = np.bincount(place.ravel(), np.tile(weight, len(yaws)), _BINS * len(yaws))
        spectrum = np.abs(np.fft.rfft(votes.reshape(len(yaws), _BINS), _SPECTRUM)) / weight.sum()
        period = _SPECTRUM * _BIN / np.maximum(np.arange(spectrum.shape[1]), 1e-9)
        spectrum[:, (period < shortest) | (period > longest)] = 0.0
        yaw, peak = np.unravel_index(int(np.argmax(spectrum)), spectrum.shape)
        refined = _SPECTRUM * _BIN / (peak + _summit(spectrum[yaw], int(peak)))
        return RowsSeen(float(spectrum[yaw, peak]), float(pitch), float(yaws[yaw]), float(refined))


def pitch_and_height_from_rows(
    plants: Sequence[Plants | None], camera: Camera, spacing: float, finder: RowFinder
) -> tuple[Finding, Finding]:
    """What the rows of a field tell of the mounting.

    Args:
        plants: of each picture; None for pictures not looked at.
        camera: with focal length and roll.
        spacing: from row to row, m.
        finder: of the rows of one picture.

    Returns:
        pitch (rad) and height (m).
    """
    count = len(plants)
    looked_at = sum(each is not None for each in plants)
    pitch, height = np.full(count, np.nan), np.full(count, np.nan)
    for k, each in enumerate(plants):
        seen = None if each is None else finder.find(each, camera)
        if seen is not None:
            pitch[k], height[k] = seen.pitch, spacing / seen.spacing
    told = np.isfinite(height)
    if not told.any():
        reason = f"no rows of plants are seen in the {looked_at} pictures looked at"
        return Finding.missing(reason, count), Finding.missing(reason, count)
    agree = np.abs(height / np.median(height[told]) - 1.0) < _SAME_HEIGHT
    agree &= np.abs(pitch - np.median(pitch[told])) < _SAME_PITCH
    share = float(np.count_nonzero(agree)) / looked_at
    pitch, height = np.where(agree, pitch, np.nan), np.where(agree, height, np.nan)
    if share < _LEAST_AGREEMENT:
        reason = f"the pictures contradict each other: {100 * share:.0f} % agree on the rows"
        return Finding.missing(reason, count), Finding.missing(reason, count)
    rows = f"from rows {spacing:g} m apart"
    return (
        _mean_of(pitch, agree, _PITCH_SIGMA, rows),
        _mean_of(height, agree, _LEAVES * float(np.nanmedian(height)), f"{rows}, over their leaves"),
    )


def _mean_of(own: Array, agree: NDArray[np.bool_], common: float, reason: str) -> Finding:
    value, weights = robust_mean(own[agree])
    sigma = float(np.hypot(block_sigma(own[agree], weights, common), common))
    return Finding(value, sigma, int(agree.sum()), reason, own)


def _strength(seen: RowsSeen) -> float:
    return seen.strength


def _summit(spectrum: Array, peak: int) -> float:
    """Where between its neighbours the summit of a peak lies, by a parabola; 0 at the edge of what is looked at."""
    if not 0 < peak < len(spectrum) - 1:
        return 0.0
    before, here, after = spectrum[peak - 1 : peak + 2]
    bend = before - 2.0 * here + after
    if before == 0.0 or after == 0.0 or bend >= 0.0:
        return 0.0
    return float(0.5 * (before - after) / bend)
