# SPDX-License-Identifier: Apache-2.0
"""A road as one picture and those before it tell it: a value that travels from the filter to everything that steers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_vision.perception.lane import LaneHeading
from robot_vision.perception.road.curve import Alignment, RoadCurve

Array = NDArray[np.float64]

#: Order of the state: offset (m), yaw (rad), width (m), roll and pitch (rad), half the width of painted lines (m), then
#: the curvature at each knot (1/m).
OFFSET, YAW, WIDTH, ROLL, PITCH, PAINT, BENDS = range(7)


@dataclass(frozen=True)
class RoadEstimate:
    """The robot on a road, and how the road goes on.

    Attributes:
        state: (6 + K,) offset to the left of the middle (m), yaw relative to it (rad), width between the borders (m),
            roll and pitch of the camera's body (rad), half the width of painted lines (m), curvature at the knots
            (1/m, positive to the left).
        covariance: (6 + K, 6 + K) of it.
        alignment: the knots.
        reach: how far ahead the road was seen, m.
        members: (N,) segments of the picture that lie on the road's borders or its middle.
        members_along: (N,) where on the road they lie, m ahead.
    """

    state: Array
    covariance: Array
    alignment: Alignment
    reach: float
    members: NDArray[np.intp]
    members_along: Array

    @property
    def offset(self) -> float:
        """Of the robot to the left of the road's middle, m."""
        return float(self.state[OFFSET])

    @property
    def yaw(self) -> float:
        """Of the robot relative to the road beside it, counter-clockwise positive, rad."""
        return float(self.state[YAW])

    @property
    def width(self) -> float:
        """Between the borders, m."""
        return float(self.state[WIDTH])

    @property
    def curvature(self) -> float:
        """Of the road's middle beside the robot, 1/m, positive to the left."""
        return float(self.state[BENDS])

    @property
    def lane(self) -> LaneHeading:
        """Heading, offset and width as a lane has them."""
        return LaneHeading(
            self.yaw,
            float(self.covariance[YAW, YAW]),
            self.offset,
            float(self.covariance[OFFSET, OFFSET]),
            self.width,
        )

    @property
    def curve(self) -> RoadCurve:
        """The road's middle in its own frame, which begins beside the robot and leads along the road there."""
        return RoadCurve(self.alignment, self.state[BENDS:])

    def path(self, along: ArrayLike) -> Array:
        """The road's middle in base_link at distances (N,) along it from beside the robot: (N, 2), m."""
        away = self.curve.points(along) - [0.0, self.offset]
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        return np.stack([cos * away[:, 0] + sin * away[:, 1], cos * away[:, 1] - sin * away[:, 0]], axis=1)

    def bearings(self, along: ArrayLike) -> tuple[Array, Array]:
        """Direction (N,) of the road at distances (N,) m as seen from the robot (rad, left positive), and variances."""
        curve = self.curve
        slopes = np.zeros((np.size(along), len(self.state)))
        slopes[:, YAW] = -1.0
        slopes[:, BENDS:] = curve.turning(along)
        variance = np.einsum("ni,ij,nj->n", slopes, self.covariance, slopes)
        return np.asarray(curve.heading(along) - self.yaw), variance
