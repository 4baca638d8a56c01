# SPDX-License-Identifier: Apache-2.0
"""From the lines of successive pictures to where the robot heads: one object, one verb."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.geometry.sphere import normalised, tangent_basis
from robot_vision.perception.attitude import Attitude, estimate_attitude
from robot_vision.perception.lane import LaneFilter, LaneHeading
from robot_vision.perception.segments import LineSegments
from robot_vision.perception.vanishing import Role, VanishingPointEstimator, VanishingPoints
from robot_vision.perception.vanishing.floor import led_by_the_floor
from robot_vision.perception.vanishing.pavement import PavementSpacings
from robot_vision.perception.vanishing.tracker import VanishingPointTracker

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HeadingEstimate:
    """What one picture adds to the knowledge of the way.

    Attributes:
        vanishing_points: the ones believed, primary first; their covariance holds what is not known of the focal
            length.
        lane: the robot in its lane; None while no direction leads.
        attitude: lean of the camera; None while the picture says nothing of it.
        reason: in plain words why there is no lane, or no offset in it; empty when nothing is missing.
    """

    vanishing_points: VanishingPoints
    lane: LaneHeading | None
    attitude: Attitude | None
    reason: str


@dataclass
class HeadingEstimator:
    """Follows vanishing points, attitude and lane through successive pictures.

    Args:
        estimator: of the vanishing points of one picture.
        tracker: of vanishing points over time.
        pavement: takes the spacings of flagstones as a further source of the vanishing points.
        lane_filter: of offset and width.
        lean: standard deviation of the body's roll and pitch about the camera's mounting, rad.

    Raises:
        ValueError: for a lean that is no positive number.
    """

    estimator: VanishingPointEstimator = field(default_factory=VanishingPointEstimator)
    tracker: VanishingPointTracker = field(default_factory=VanishingPointTracker)
    pavement: PavementSpacings = field(default_factory=PavementSpacings)
    lane_filter: LaneFilter = field(default_factory=LaneFilter)
    lean: float = float(np.deg2rad(2.0))

    def __post_init__(self) -> None:
        if not (np.isfinite(self.lean) and self.lean > 0.0):
            raise ValueError(f"lean must be a positive number, not {self.lean}")

    def reset(self) -> None:
        """Forget everything earlier pictures told."""
        self.tracker.reset()
        self.lane_filter.reset()

    def update(
        self, lines: LineSegments, camera: Camera, stamp_s: float, turn_rate: float | None = None
    ) -> HeadingEstimate:
        """Take in the lines of the next picture.

        Args:
            lines: segments in rectified pixels.
            camera: with its place on the robot; the offset needs `height_m`.
            stamp_s: time of the picture, s.
            turn_rate: of the robot, rad/s counter-clockwise, None when unknown.
        """
        camera = camera.rectified()
        ahead = self.tracker.predict(stamp_s, camera, turn_rate)
        seen = self.estimator.estimate(lines, camera, ahead)
        led = self.pavement.fuse(led_by_the_floor(seen, lines), lines)
        points = _with_doubt_of_focal_length(self.tracker.update(led))
        if not len(points):
            few = (
                f"only {len(lines)} lines" if len(lines) < _FEW_LINES else f"none of {len(lines)} lines agree"
            )
            return HeadingEstimate(points, None, None, f"no vanishing point: {few}")
        attitude = estimate_attitude(points, self.lean, seen)
        primary = points.of(Role.PRIMARY)
        if primary is None:
            return HeadingEstimate(
                points, None, attitude, "no vanishing point lies in the direction of motion"
            )
        if points.weight[primary] <= 0.0:
            # The track goes on, but a robot that drives by where the way should be drives blind.
            return HeadingEstimate(points, None, attitude, "the way ahead is not seen in this picture")
        yaw, variance = _yaw(points, attitude, primary)
        if camera.height_m is None:
            lane = LaneHeading(yaw, variance)
            return HeadingEstimate(points, lane, attitude, "no offset: the height of the camera is not known")
        found = self.lane_filter.update(lines, points, attitude, primary, stamp_s)
        if found is None:
            lane = LaneHeading(yaw, variance)
            return HeadingEstimate(
                points, lane, attitude, "no offset: the lines between floor and walls are not seen"
            )
        camera_offset, offset_variance, width = found
        # The camera stands camera.x ahead of the robot's centre and swings out with the yaw.
        offset = camera_offset - camera.x_m * float(np.sin(yaw))
        offset_variance += (camera.x_m * float(np.cos(yaw))) ** 2 * variance
        # A focal length wrong by a share e makes lateral distances wrong by e sin^2 of the angle between the lens's
        # axis and the way ahead: straight ahead x / y does not depend on it.
        aside = 1.0 - float(points.directions[primary][2]) ** 2
        offset_variance += (points.focal_sigma * aside * camera_offset) ** 2
        return HeadingEstimate(
            points, LaneHeading(yaw, variance, offset, offset_variance, width), attitude, ""
        )


_FEW_LINES = 10


def _with_doubt_of_focal_length(points: VanishingPoints) -> VanishingPoints:
    """The same vanishing points, less sure by what their focal length may be wrong.

    The pixel is what was seen: with a focal length longer by a share e the direction (x, y, z) moves by -e (x, y, 0),
    as far as that lies across it; at an angle a from the lens's axis that is e sin(2 a) / 2.
    """
    if points.focal_sigma == 0.0 or not len(points):
        return points
    pulled = points.directions * [-1.0, -1.0, 0.0]
    moved = points.focal_sigma * np.einsum("mij,mj->mi", tangent_basis(points.directions), pulled)
    return replace(points, covariance=points.covariance + moved[:, :, None] * moved[:, None, :])


def _yaw(points: VanishingPoints, attitude: Attitude, primary: int) -> tuple[float, float]:
    """Yaw of the robot relative to the primary direction and its variance, rad and rad^2."""
    up = attitude.up
    nose = points.camera.optical_to_base[0]
    forward = normalised(nose - float(nose @ up) * up)
    left = np.cross(up, forward)
    direction = points.directions[primary]
    if float(direction @ forward) < 0.0:
        direction = -direction
    azimuth = float(np.arctan2(direction @ left, direction @ forward))
    sideways = normalised(np.cross(up, direction))
    components = tangent_basis(points.directions[primary]) @ sideways
    return -azimuth, float(components @ points.covariance[primary] @ components)
