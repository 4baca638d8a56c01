# SPDX-License-Identifier: Apache-2.0
"""Segments of a picture as chords on the ground: what a road's edges, paint and verges look like from above."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera, rotation_from_rpy
from robot_vision.geometry.rotation import BODY_FROM_OPTICAL
from robot_vision.perception.segments import LineSegments

Array = NDArray[np.float64]

#: How well the end of a segment is placed across it, px.
_END_SIGMA = 0.5
#: Step for derivatives by the lean of the camera, rad.
_LEAN_STEP = 1e-4


@dataclass(frozen=True)
class Chords:
    """The ends of N segments that lie on the ground, for one lean of the camera.

    Attributes:
        points: (N, 2, 2) both ends in base_link, m.
        placed: (N, 2, 2) how each end moves on the ground with one standard deviation across the segment, m.
        leaning: (N, 2, 2, 2) how it moves with roll and pitch (last axis), m/rad.
        lengths: (N,) of the segments in the picture, px.
        bright_left: (N,) whether the side of the chord that lies to the robot's left is the brighter one.
        index: (N,) of the segments among those of the picture.
    """

    points: Array
    placed: Array
    leaning: Array
    lengths: Array
    bright_left: NDArray[np.bool_]
    index: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.index)


class ChordReader:
    """Reads the segments of one picture on the ground.

    Args:
        lines: of the picture.
        camera: rectified, with its height; roll and pitch are given for each reading.
        farthest: what lies farther ahead than this is cut off, m.
    """

    def __init__(self, lines: LineSegments, camera: Camera, farthest: float) -> None:
        assert camera.height_m is not None
        self._height, self._ahead = camera.height_m, camera.x_m
        self._lengths = lines.lengths
        self._farthest = farthest
        ends = self._cut(camera, lines.endpoints.reshape(-1, 2, 2))
        way = ends[:, 1] - ends[:, 0]
        across = np.stack([-way[:, 1], way[:, 0]], axis=1) / np.maximum(lines.lengths, 1e-9)[:, None]
        moved = ends + across[:, None, :] * (_END_SIGMA + lines.sigma)[:, None, None]
        self._rays, self._moved = _rays(camera, ends), _rays(camera, moved)

    def _cut(self, camera: Camera, ends: Array) -> Array:
        """Move the farther ends (N, 2, 2) px nearer where they lie beyond `farthest`, for the camera as mounted."""
        turned = (
            _rays(camera, ends) @ (rotation_from_rpy(camera.roll, camera.pitch, 0.0) @ BODY_FROM_OPTICAL).T
        )
        # Both the forward part of a ray and its fall are linear along a segment, and so is what tells the far side.
        beyond = turned[..., 0] * self._height + turned[..., 2] * (self._farthest - self._ahead)
        cut = np.array(ends)
        for end, other in ((0, 1), (1, 0)):
            far = (beyond[:, end] > 0.0) & (beyond[:, other] < 0.0)
            share = beyond[far, end] / (beyond[far, end] - beyond[far, other])
            cut[far, end] += share[:, None] * (ends[far, other] - ends[far, end])
        return cut

    def read(self, roll: float, pitch: float) -> Chords:
        """The chords seen by a camera body with this roll and pitch, rad."""
        points = self._on_ground(self._rays, roll, pitch)
        with np.errstate(invalid="ignore"):
            near = np.all(np.abs(points[..., 0]) < 1.5 * self._farthest, axis=1)
        index = np.flatnonzero(near)
        rays, points = self._rays[index], points[index]
        leaning = np.stack(
            [
                self._on_ground(rays, roll + _LEAN_STEP, pitch) - points,
                self._on_ground(rays, roll, pitch + _LEAN_STEP) - points,
            ],
            axis=-1,
        )
        placed = self._on_ground(self._moved[index], roll, pitch) - points
        good = np.isfinite(placed).all(axis=(1, 2)) & np.isfinite(leaning).all(axis=(1, 2, 3))
        index = index[good]
        points = points[good]
        # Seen from the first end of a segment the brighter side lies on the left, in the picture and on the ground.
        bright_left = points[:, 1, 0] > points[:, 0, 0]
        return Chords(
            points, placed[good], leaning[good] / _LEAN_STEP, self._lengths[index], bright_left, index
        )

    def _on_ground(self, rays: Array, roll: float, pitch: float) -> Array:
        """Ground points (…, 2) under rays (…, 3), (20.2) and (20.3) for any lean; NaN at or above the horizon."""
        turned = rays @ (rotation_from_rpy(roll, pitch, 0.0) @ BODY_FROM_OPTICAL).T
        fall = -turned[..., 2]
        with np.errstate(invalid="ignore", divide="ignore"):
            reach = self._height / np.where(fall > 1e-6, fall, np.nan)
        points = turned[..., :2] * reach[..., None]
        points[..., 0] += self._ahead
        return np.asarray(points)


def _rays(camera: Camera, pixels: Array) -> Array:
    """Rays (…, 3) of pixels (…, 2) of a rectified picture, each as long as its depth is 1.

    They are told in the optical frame as it lies while the head looks straight ahead, wherever it looks.
    """
    rays = np.concatenate(
        [(pixels - (camera.cx, camera.cy)) / (camera.fx, camera.fy), np.ones((*pixels.shape[:-1], 1))],
        axis=-1,
    )
    return rays if camera.pan == 0.0 == camera.tilt else np.asarray(rays @ camera.head_turn.T)
