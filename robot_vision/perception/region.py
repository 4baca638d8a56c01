# SPDX-License-Identifier: Apache-2.0
"""A part of a picture: the rectangle in which lines are looked for."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Region:
    """A rectangle of whole pixels of the rectified picture.

    Attributes:
        left, top: its first column and row, px.
        width, height: its size, px.

    Raises:
        ValueError: for a rectangle without pixels, or one that begins outside every picture.
    """

    left: int
    top: int
    width: int
    height: int

    def __post_init__(self) -> None:
        if self.width <= 0 or self.height <= 0:
            raise ValueError(f"a region of {self.width} x {self.height} px has no pixels")
        if self.left < 0 or self.top < 0:
            raise ValueError(f"a region must begin in the picture, not at ({self.left}, {self.top})")

    @property
    def right(self) -> int:
        """First column after it, px."""
        return self.left + self.width

    @property
    def bottom(self) -> int:
        """First row after it, px."""
        return self.top + self.height

    def require_inside(self, width: int, height: int) -> None:
        """Raise ValueError, naming both sizes, unless it lies in pictures of this size (px)."""
        if self.right > width or self.bottom > height:
            raise ValueError(
                f"the region ({self.left}, {self.top}) to ({self.right}, {self.bottom}) "
                f"does not lie in a picture of {width} x {height}"
            )

    def share(self, width: int, height: int) -> float:
        """Share of the pixels of pictures of this size (px) that lie in it."""
        return self.width * self.height / (width * height)

    def widened(self, by: int, width: int, height: int) -> Region:
        """The same with `by` more pixels on each side, as far as pictures of this size (px) go."""
        left, top = max(0, self.left - by), max(0, self.top - by)
        right, bottom = min(width, self.right + by), min(height, self.bottom + by)
        return Region(left, top, right - left, bottom - top)
