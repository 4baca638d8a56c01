# SPDX-License-Identifier: Apache-2.0
"""Materials of buildings, painted from a seed, so that no picture files are needed."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation.texture import Colour, Texture

Random = np.random.Generator


def linear(red: int, green: int, blue: int) -> Colour:
    """Linear blue, green, red of a colour as it is picked on a screen (0..255)."""
    return (float((blue / 255) ** 2.2), float((green / 255) ** 2.2), float((red / 255) ** 2.2))


def grain(random: Random, shape: tuple[int, int], wavelength: tuple[float, float]) -> NDArray[np.float64]:
    """Noise (rows, columns) that repeats without a seam, mean 0, standard deviation 1.

    Args:
        random: where it comes from.
        shape: rows, columns.
        wavelength: texels below which it is smooth, along rows and along columns.
    """
    spectrum = np.fft.rfft2(random.standard_normal(shape))
    down = np.fft.fftfreq(shape[0])[:, None] * wavelength[0]
    across = np.fft.rfftfreq(shape[1])[None, :] * wavelength[1]
    spectrum *= np.exp(-(down**2) - across**2)
    spectrum[0, 0] = 0
    noise = np.fft.irfft2(spectrum, shape)
    return np.asarray(noise / noise.std())


def tinted(colour: Colour, value: NDArray[np.float64]) -> NDArray[np.float32]:
    """A colour made lighter and darker by a factor (rows, columns)."""
    return np.asarray(np.maximum(value[..., None] * np.asarray(colour), 0), np.float32)


def plaster(random: Random, colour: Colour) -> Texture:
    """Painted wall: fine roller marks and faint clouds, tile of 2.56 m."""
    shape = (1024, 1024)
    value = 1 + 0.020 * grain(random, shape, (3, 3)) + 0.020 * grain(random, shape, (160, 160))
    return Texture(tinted(colour, value), (2.56, 2.56))


def linoleum(random: Random, colour: Colour, width: float, sheet: float = 4.0) -> Texture:
    """Speckled floor covering: one weld across at every sheet's end, one along, off the middle.

    Args:
        random: where the speckles come from.
        colour: of the ground.
        width: metres across; the tile is as wide as the floor.
        sheet: metres along between welds.
    """
    shape = (512, 1024)
    value = 1 + 0.03 * grain(random, shape, (1, 1)) + 0.035 * grain(random, shape, (90, 90))
    for strength, share in ((0.55, 0.02), (1.35, 0.015)):
        speckles = grain(random, shape, (3, 2)) > np.quantile(grain(random, (256, 256), (3, 2)), 1 - share)
        value = np.where(speckles, value * strength, value)
    value[:, :2] *= 0.55
    weld = int(0.66 * shape[0])
    value[weld : weld + 2, :] *= 0.6
    return Texture(tinted(colour, value), (sheet, width))


def ceiling_tiles(random: Random, tile: float = 0.6) -> Texture:
    """Mineral fibre panels in a grid of metal bars; the pattern covers 2 x 2 panels."""
    side = 256
    value = 0.95 + 0.012 * grain(random, (2 * side, 2 * side), (2, 2))
    holes = random.random((2 * side, 2 * side)) < 0.012
    value = np.where(holes, 0.62, value)
    bar = 8
    for start in (0, side):
        value[start : start + bar, :] = value[:, start : start + bar] = 1.05
        value[start + bar : start + bar + 4, :] = value[:, start + bar : start + bar + 4] = 0.45
    return Texture(tinted(linear(228, 228, 222), value), (2 * tile, 2 * tile))


def wood(random: Random, colour: Colour, size: tuple[float, float]) -> Texture:
    """Veneer with upright grain, for one door leaf of `size` metres (width, height)."""
    shape = (512, 256)
    rings = grain(random, shape, (400, 24)) + 0.5 * grain(random, shape, (250, 6))
    value = 1 + 0.07 * np.sin(2.5 * rings) + 0.03 * grain(random, shape, (120, 2))
    return Texture(tinted(colour, value), size, repeat=False)


def outdoors(random: Random, size: tuple[float, float], brightness: float = 2.4) -> Texture:
    """What a window shows by day: sky, far trees, grass; much lighter than the room."""
    shape = (256, 256)
    height = np.linspace(0, 1, shape[0])[:, None] * np.ones(shape)
    picture = np.array(linear(190, 215, 245)) * (0.75 + 0.25 * height[..., None])
    crowns = 0.40 + 0.05 * grain(random, (1, shape[1]), (1, 40))
    leaves = 1 + 0.25 * grain(random, shape, (9, 9))
    picture = np.where((height < crowns)[..., None], tinted(linear(88, 120, 70), leaves), picture)
    picture = np.where((height < 0.17)[..., None], tinted(linear(120, 150, 85), leaves), picture)
    return Texture((brightness * picture).astype(np.float32), size, repeat=False)


def lamp_cover(size: tuple[float, float], brightness: float = 2.2) -> Texture:
    """Light panel behind a prismatic cover: two tubes shine through."""
    across = np.linspace(0, 1, 64)
    value = 0.75 + 0.25 * (np.exp(-(((across - 0.3) / 0.1) ** 2)) + np.exp(-(((across - 0.7) / 0.1) ** 2)))
    picture = tinted((1.0, 0.98, 0.94), brightness * np.repeat(value[:, None], 64, axis=1))
    return Texture(picture, size, repeat=False)


def notice(random: Random, size: tuple[float, float]) -> Texture:
    """A pinned sheet: coloured head, lines of grey writing; row 0 is its lower border."""
    rows, columns = 192, 136
    picture = np.full((rows, columns, 3), 0.86)
    head = np.array(linear(*(int(c) for c in random.integers(30, 210, 3))))
    picture[10:46, 10:-10] = head
    for line in range(60, rows - 12, 10):
        picture[line : line + 4, 12 : int(random.uniform(0.55, 0.92) * columns)] = 0.22
    return Texture(np.ascontiguousarray(picture[::-1], np.float32), size, repeat=False)


def door_sign(number: int, size: tuple[float, float]) -> Texture:
    """A light plate with a room number; row 0 is its lower border."""
    plate = np.full((64, 96), 210, np.uint8)
    cv2.putText(plate, str(number), (8, 44), cv2.FONT_HERSHEY_SIMPLEX, 1.2, 15, 4, cv2.LINE_AA)
    grey = np.repeat((plate[::-1, :, None] / 255) ** 1.5, 3, axis=2)
    return Texture(np.ascontiguousarray(grey, np.float32), size, repeat=False)
