# SPDX-License-Identifier: Apache-2.0
"""Textures with mip levels, so that a surface seen from afar shows its mean and not a shimmer."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation.errors import SimulationError

Colour = tuple[float, float, float]

_FARTHEST = 64
"""Texels beyond which it does not matter how far the border of a cut-out is."""


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture of a material.

    Attributes:
        texels: float32 (rows, columns, 3), linear blue, green, red; above 1 for things that shine. Row 0
            lies at the start of the quad's second edge, column 0 at the start of its first edge.
        size: metres (along the first edge, along the second edge) that the picture covers.
        repeat: whether it goes on beyond its borders as tiles (its sides are then powers of two); otherwise
            the border texel goes on.
        alpha: float32 (rows, columns) for cut-outs such as leaves: 1 where there is material, 0 where one
            sees past it; the border runs where it is 1/2, linear between texels. None: material everywhere.
            What colour stands where alpha is 0 does not matter.
    """

    texels: NDArray[np.float32]
    size: tuple[float, float] = (1.0, 1.0)
    repeat: bool = True
    alpha: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        if self.texels.ndim != 3 or self.texels.shape[2] != 3 or 0 in self.texels.shape:
            raise SimulationError(f"texture: texels must be (rows, columns, 3), not {self.texels.shape}")
        if self.repeat and any(side & (side - 1) for side in self.texels.shape[:2]):
            raise SimulationError(
                f"texture: sides that repeat must be powers of two, not {self.texels.shape[:2]}"
            )
        if self.alpha is not None and self.alpha.shape != self.texels.shape[:2]:
            raise SimulationError(
                f"texture: alpha must be {self.texels.shape[:2]} like the texels, not {self.alpha.shape}"
            )
        if min(self.size) <= 0:
            raise SimulationError(f"texture: size must be positive metres, not {self.size}")

    @classmethod
    def plain(cls, colour: Colour) -> Texture:
        """One colour (linear blue, green, red) everywhere."""
        return cls(np.asarray(colour, np.float32).reshape(1, 1, 3))

    @cached_property
    def levels(self) -> tuple[NDArray[np.float32], ...]:
        """Mip levels, finest first; texel i of level l covers texels 2i and 2i + 1 of level l - 1.

        In cut-outs the colour is the mean of the material, and goes on beyond its border.
        """
        if self.alpha is None:
            return _halvings(self.texels)
        weight = np.maximum(self.alpha, 0)[..., None]
        shares = _halvings(weight)
        sums = _halvings(self.texels * weight)
        coarse = sums[-1] / np.maximum(shares[-1], 1e-6)
        levels = [np.ascontiguousarray(coarse, np.float32)]
        for total, share in zip(reversed(sums[:-1]), reversed(shares[:-1]), strict=True):
            rows, columns = total.shape[:2]
            wider = levels[-1].repeat(2, axis=0)[:rows] if rows > 1 else levels[-1]
            wider = wider.repeat(2, axis=1)[:, :columns] if columns > 1 else wider
            faint = np.float32(0.02) * (1 - share) + np.float32(1e-9)  # decides where there is no material
            levels.append(np.ascontiguousarray((total + faint * wider) / (share + faint), np.float32))
        return tuple(reversed(levels))

    @cached_property
    def alpha_levels(self) -> tuple[NDArray[np.float32], ...]:
        """Mip levels of alpha, float32 (rows, columns) each; none for a texture without cut-outs."""
        if self.alpha is None:
            return ()
        return tuple(np.ascontiguousarray(level[..., 0]) for level in _halvings(self.alpha[..., None]))

    @cached_property
    def clearance(self) -> NDArray[np.float32]:
        """How far (rows, columns) one may go from a texel of a cut-out and find the same, in texels.

        Positive where there is material all around, negative where there is none, 0 where it is mixed: for
        a value of n, all texels at most |n| - 1 rows and columns away are alike.
        """
        if self.alpha is None:
            return np.zeros((0, 0), np.float32)
        around = _FARTHEST if self.repeat else 0
        wide = np.pad(self.alpha, around, mode="wrap")
        rows, columns = self.alpha.shape
        clear = np.zeros(self.alpha.shape, np.float32)
        for sign, alike in ((1, wide >= 1), (-1, wide <= 0)):
            mask = np.pad(alike.astype(np.uint8), 1, mode="edge")
            distance = cv2.distanceTransform(mask, cv2.DIST_C, 3) if not mask.all() else _FARTHEST * mask
            inner = distance[1 + around : 1 + around + rows, 1 + around : 1 + around + columns]
            clear += np.float32(sign) * np.minimum(inner, np.float32(_FARTHEST))
        return clear


def _halvings(picture: NDArray[np.float32]) -> tuple[NDArray[np.float32], ...]:
    """A picture (rows, columns, channels) and its means over 2 x 2, 4 x 4, ... texels down to one."""
    levels = [np.ascontiguousarray(picture, np.float32)]
    while max(levels[-1].shape[:2]) > 1:
        fine = levels[-1]
        odd = [n % 2 if n > 1 else 0 for n in fine.shape[:2]]
        fine = np.pad(fine, ((0, odd[0]), (0, odd[1]), (0, 0)), mode="edge")
        if fine.shape[0] > 1:
            fine = np.float32(0.5) * (fine[0::2] + fine[1::2])
        if fine.shape[1] > 1:
            fine = np.float32(0.5) * (fine[:, 0::2] + fine[:, 1::2])
        levels.append(np.ascontiguousarray(fine, np.float32))
    return tuple(levels)
