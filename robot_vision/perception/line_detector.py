# SPDX-License-Identifier: Apache-2.0
"""From a grey picture to straight line segments: the one door to line detection."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.perception.segments import LineSegments

Gray = NDArray[np.uint8]
Method = Literal["trace", "hough"]
#: Pictures smaller than this in either direction hold no line worth the name.
SMALLEST = 8


class _Finder(Protocol):
    """A way of finding lines in pictures of one size."""

    def find(self, gray: Gray) -> LineSegments: ...


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

    def detect(self, gray: Gray) -> LineSegments:
        """Line segments of a picture.

        Args:
            gray: uint8 (H, W); of any size, an empty one included.

        Returns:
            Segments in pixels of the picture given, none where there is nothing straight.

        Raises:
            ValueError: when the array is no grey 8-bit picture.
        """
        gray = np.asarray(gray)
        if gray.ndim != 2 or gray.dtype != np.uint8:
            raise ValueError(f"expected a grey picture, uint8 (H, W), not {gray.dtype} {gray.shape}")
        if min(gray.shape) < SMALLEST:
            return LineSegments.empty()
        scale = min(1.0, float(np.sqrt(self.largest_area / gray.size)))
        if scale > 0.87:
            return self._finder_for(gray.shape).find(gray)
        height, width = (max(SMALLEST, round(side * scale)) for side in gray.shape)
        small = np.asarray(cv2.resize(gray, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)
        found = self._finder_for(small.shape).find(small)
        # Pixel centres lie at integers: the corner of the picture is at -0.5 at both sizes.
        factor = np.array([gray.shape[1] / width, gray.shape[0] / height] * 2)
        return LineSegments(
            (found.endpoints + 0.5) * factor - 0.5, found.strength / factor[0], found.sigma * factor[0]
        )

    def warm_up(self) -> None:
        """Load or compile the kernels, so that the first picture is not kept waiting."""
        picture = np.full((48, 64), 40, np.uint8)
        picture[:, 32:] = 200
        LineDetector(method=self.method, min_length=10.0).detect(picture)

    def _finder_for(self, shape: tuple[int, ...]) -> _Finder:
        if self._finder is None or self._shape != shape:
            self._finder = self._make_finder(shape)
            self._shape = shape
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
