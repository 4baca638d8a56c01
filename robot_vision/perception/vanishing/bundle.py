# SPDX-License-Identifier: Apache-2.0
"""The lines of one picture prepared for voting: in the camera's coordinates, with the error that each may have."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.perception.segments import LineSegments

Array = NDArray[np.float64]

#: Standard deviation of an end of a line across it, px, and of a line's direction however long it is, rad: edges
#: of real walls and kerbs are not straighter than that. Both measured on pictures with known vanishing points.
END_SIGMA = 0.6
DIRECTION_SIGMA = np.deg2rad(0.35)
#: A vanishing point this near the middle of a line, in half lengths, lies within it, whatever the ends may be off by.
WITHIN = 0.8
#: A line that does not tell its contrast still counts, grey levels a pixel.
#: Sizes of the picture beyond which no lens, rectified, shows anything: a line from there was never seen.
_FARTHEST = 10.0
_LEAST_CONTRAST = 0.1


@dataclass(frozen=True)
class Bundle:
    """N lines, longest first, in normalised picture coordinates ((u - cx) / fx, (v - cy) / fy).

    Attributes:
        lines: (N, 3) homogeneous lines (a, b, c), a^2 + b^2 = 1.
        middles: (N, 2) midpoints.
        halves: (N,) half lengths.
        sigma: (N,) standard deviation of the direction, rad.
        weight: (N,) root of length times contrast, mean 1: long clear edges are seldom clutter.
        source: (N,) index of the line in the segments given.
    """

    lines: Array
    middles: Array
    halves: Array
    sigma: Array
    weight: Array
    source: NDArray[np.intp]

    @classmethod
    def of(cls, segments: LineSegments, camera: Camera, most: int) -> Bundle:
        """Prepare the `most` longest lines, without those that are not finite, have no length or lie far outside."""
        lengths = segments.lengths
        with np.errstate(invalid="ignore"):
            reach = np.abs(segments.endpoints).max(axis=1, initial=0.0)
        seen = reach < _FARTHEST * max(camera.width, camera.height)
        usable = np.flatnonzero(seen & np.isfinite(lengths) & (lengths > 1.0))
        source = usable[np.argsort(-lengths[usable], kind="stable")[:most]]
        ends = segments.endpoints[source]
        lengths = lengths[source]
        scale = np.array([camera.fx, camera.fy])
        centre = np.array([camera.cx, camera.cy])
        first, last = (ends[:, :2] - centre) / scale, (ends[:, 2:] - centre) / scale
        middles = 0.5 * (first + last)
        tangent = last - first
        halves = 0.5 * np.hypot(tangent[:, 0], tangent[:, 1])
        tangent = tangent / (2.0 * halves)[:, None] if len(source) else tangent
        offset = tangent[:, 0] * middles[:, 1] - tangent[:, 1] * middles[:, 0]
        contrast = np.maximum(np.nan_to_num(segments.strength[source]), _LEAST_CONTRAST)
        root = np.sqrt(lengths * contrast)
        return cls(
            lines=np.column_stack([tangent[:, 1], -tangent[:, 0], offset]),
            middles=middles,
            halves=halves,
            sigma=np.hypot(END_SIGMA / np.maximum(lengths, 1.0), DIRECTION_SIGMA),
            weight=root / root.mean() if len(source) else root,
            source=source,
        )

    def __len__(self) -> int:
        return len(self.lines)

    def __getitem__(self, chosen: NDArray[np.bool_] | NDArray[np.intp] | slice) -> Bundle:
        return Bundle(
            self.lines[chosen],
            self.middles[chosen],
            self.halves[chosen],
            self.sigma[chosen],
            self.weight[chosen],
            self.source[chosen],
        )

    @property
    def arrays(self) -> tuple[Array, Array, Array, Array, Array]:
        """Lines, middles, halves, sigma and weight, as the compiled kernels take them."""
        return self.lines, self.middles, self.halves, self.sigma, self.weight

    def at_focal_ratio(self, ratio: float) -> Bundle:
        """The same lines as a camera sees them whose focal length is `ratio` times the one assumed."""
        lines = self.lines.copy()
        lines[:, 2] /= ratio
        return replace(self, lines=lines, middles=self.middles / ratio, halves=self.halves / ratio)

    def reach(self, directions: Array) -> Array:
        """Length of the lever by which a direction turns each line about its midpoint: (K, 3) -> (K, N).

        It is the distance from the midpoint to the vanishing point times the direction's depth, so that it stays
        finite at infinity. A line that contains a vanishing point does not lead to it: its lever is 0.
        """
        depth = np.abs(directions[:, 2:])
        across = directions[:, :1] - directions[:, 2:] * self.middles[:, 0]
        down = directions[:, 1:2] - directions[:, 2:] * self.middles[:, 1]
        lever = np.hypot(across, down)
        return np.asarray(np.where(lever > WITHIN * depth * self.halves, lever, 0.0))

    def residuals(self, directions: Array) -> Array:
        """Angle between each line and the way from its midpoint to each vanishing point, in standard deviations.

        (K, 3) unit directions -> (K, N); the sine stands for the angle, infinity for a line without a lever.
        """
        lever = self.reach(directions)
        none = lever == 0.0
        angles = (directions @ self.lines.T) / (np.where(none, 1.0, lever) * self.sigma)
        return np.asarray(np.where(none, np.inf, angles))
