# SPDX-License-Identifier: Apache-2.0
"""From a grey picture to straight line segments: the one door to line detection."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.perception.region import Region
from robot_vision.perception.segments import LineSegments

Gray = NDArray[np.uint8]
Method = Literal["trace", "hough"]
#: Pictures smaller than this in either direction hold no line worth the name.
SMALLEST = 8
#: Width of the gradient's kernel and of the frame in which no edge is looked for, px, besides the blur's.
_FRAME = 3


class _Finder(Protocol):
    """A way of finding lines in pictures of one size."""

    def find(self, gray: Gray, look: int | None = None) -> tuple[LineSegments, int]: ...


@dataclass
class LineDetector:
    """Finds straight edges, each placed to a fraction of a pixel by the edge points that support it.

    `trace` follows edges along a running fit; `hough` takes Canny edges through the probabilistic Hough transform
    and refits every line to the gradient around it. `trace` finds twice as many of the lines a person draws, places
    them better and costs less, so it is the default. All settings mean the same to both.

    Args:
        method: `trace` or `hough`.
        contrast: gradient at which a line may begin, grey levels a pixel.
        edge_contrast: gradient at which an edge may be followed, grey levels a pixel.
        faint: factor on both contrasts for a second look when fewer than `enough` lines were found; 1 means none.
        enough: number of lines that makes the second look unnecessary.
        min_length: shortest line, px of the picture searched.
        max_gap: longest gap bridged along a line, px of the picture searched.
        blur: standard deviation of the Gaussian blur before the gradient, px.
        largest_area: pictures with more pixels than this are searched at a smaller scale. A line keeps the coordinates
            of the picture it was given for.

    Raises:
        ValueError: for settings without meaning, naming the setting.
    """

    method: Method = "trace"
    contrast: float = 10.0
    edge_contrast: float = 5.0
    faint: float = 0.45
    enough: int = 120
    min_length: float = 15.0
    max_gap: int = 4
    blur: float = 0.8
    largest_area: int = 500_000
    _finder: _Finder | None = field(default=None, init=False, repr=False, compare=False)
    _shape: tuple[int, ...] = field(default=(), init=False, repr=False, compare=False)
    _look: int | None = field(default=None, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.method not in ("trace", "hough"):
            raise ValueError(f"method must be 'trace' or 'hough', not {self.method!r}")
        for name in ("contrast", "edge_contrast", "min_length"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a positive number, not {value}")
        if self.edge_contrast > self.contrast:
            raise ValueError(f"edge_contrast {self.edge_contrast} must not exceed contrast {self.contrast}")
        if not 0.0 < self.faint <= 1.0:
            raise ValueError(f"faint must lie in (0, 1], not {self.faint}")
        if not 0.0 <= self.blur <= 10.0:
            raise ValueError(f"blur must lie in [0, 10] px, not {self.blur}")
        if self.max_gap < 0 or self.enough < 0 or self.largest_area < SMALLEST**2:
            raise ValueError("max_gap and enough must not be negative, largest_area must be at least 64 px")

    def detect(self, gray: Gray, region: Region | None = None) -> LineSegments:
        """Line segments of a picture, or of a part of it.

        In a region lines are looked for as the last whole picture of this size asked for it: at the contrast that
        showed enough lines there. A line that leaves the region ends at its border; the border itself shows none.

        Args:
            gray: uint8 (H, W); of any size, an empty one included.
            region: where to look; None: everywhere.

        Returns:
            Segments in pixels of the picture given, none where there is nothing straight.

        Raises:
            ValueError: when the array is no grey 8-bit picture, or the region does not lie in it.
        """
        gray = np.asarray(gray)
        if gray.ndim != 2 or gray.dtype != np.uint8:
            raise ValueError(f"expected a grey picture, uint8 (H, W), not {gray.dtype} {gray.shape}")
        height, width = gray.shape
        if region is not None:
            region.require_inside(width, height)
        if min(gray.shape) < SMALLEST:
            return LineSegments.empty()
        scale = min(1.0, math.sqrt(self.largest_area / gray.size))
        if scale > 0.87:
            scale = 1.0
        shape = (_scaled(height, scale), _scaled(width, scale))
        finder = self._finder_for(shape)
        if region is None:
            lines, self._look = finder.find(_resized(gray, shape))
            return _at_size(lines, gray.shape, shape)
        # Seen with a frame around it, edges in the region lie where they lie in the whole picture.
        frame = math.ceil((_FRAME + math.ceil(3.0 * self.blur)) / scale)
        seen = region.widened(frame, width, height)
        part = gray[seen.top : seen.bottom, seen.left : seen.right]
        if min(part.shape) < SMALLEST:
            return LineSegments.empty()
        part_shape = (min(shape[0], _scaled(seen.height, scale)), min(shape[1], _scaled(seen.width, scale)))
        lines, _ = finder.find(_resized(part, part_shape), self._look)
        found = _at_size(lines, part.shape, part_shape)
        return LineSegments(found.endpoints + [seen.left, seen.top] * 2, found.strength, found.sigma)

    def warm_up(self) -> None:
        """Load or compile the kernels, so that the first picture is not kept waiting."""
        picture = np.full((48, 64), 40, np.uint8)
        picture[:, 32:] = 200
        LineDetector(method=self.method, min_length=10.0).detect(picture)

    def _finder_for(self, shape: tuple[int, ...]) -> _Finder:
        if self._finder is None or self._shape != shape:
            self._finder = self._make_finder(shape)
            self._shape = shape
            self._look = None
        return self._finder

    def _make_finder(self, shape: tuple[int, ...]) -> _Finder:
        levels = [(self.contrast, self.edge_contrast)]
        if self.faint < 1.0:
            levels.append((self.contrast * self.faint, self.edge_contrast * self.faint))
        if self.method == "hough":
            from robot_vision.perception.hough import HoughFinder

            return HoughFinder(
                blur=self.blur,
                levels=levels,
                enough=self.enough,
                min_length=self.min_length,
                max_gap=self.max_gap,
            )
        from robot_vision.perception.tracing import TraceFinder

        return TraceFinder(
            shape=(shape[0], shape[1]),
            blur=self.blur,
            levels=levels,
            enough=self.enough,
            min_length=self.min_length,
            max_gap=self.max_gap,
        )


def _scaled(side: int, scale: float) -> int:
    return max(SMALLEST, round(side * scale))


def _resized(gray: Gray, shape: tuple[int, int]) -> Gray:
    """The picture at another size (H, W); itself where that is its own."""
    if gray.shape == shape:
        return gray
    small = cv2.resize(gray, (shape[1], shape[0]), interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.uint8)


def _at_size(lines: LineSegments, to: tuple[int, ...], found_at: tuple[int, int]) -> LineSegments:
    """Lines of a picture found at another size (H, W)."""
    if found_at == to:
        return lines
    # Pixel centres lie at integers: the corner of the picture is at -0.5 at both sizes.
    factor = np.array([to[1] / found_at[1], to[0] / found_at[0]] * 2)
    return LineSegments(
        (lines.endpoints + 0.5) * factor - 0.5, lines.strength / factor[0], lines.sigma * factor[0]
    )
