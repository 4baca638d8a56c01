# SPDX-License-Identifier: Apache-2.0
"""Where a pixel touches the floor: a camera that knows its height and attitude measures the ground alone.

(20.1)-(20.3) are the case of an optical axis parallel to the ground: with y measured downwards from the
vanishing line, Z = H f / y and X = H x / y. Here the same is done for any pitch and roll by the homogeneous
transform of the camera's pose.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from robot_vision.geometry.arrays import FloatArray, as_rows
from robot_vision.geometry.camera import Camera
from robot_vision.geometry.errors import GroundPlaneError
from robot_vision.geometry.rotation import attitude_from_up, up_from_attitude


@dataclass(frozen=True)
class GroundPlane:
    """The plane z = 0 of base_link as `camera` sees it.

    Pixels are those of the camera given: raw ones of a raw camera; for rectified ones give
    `camera.rectified()`.
    """

    camera: Camera

    @classmethod
    def from_up(cls, camera: Camera, up: ArrayLike) -> GroundPlane:
        """The ground under a camera whose attitude is told by the vertical `up` (3,) in the optical frame."""
        roll, pitch = attitude_from_up(up)
        return cls(replace(camera, roll=roll, pitch=pitch))

    @property
    def up(self) -> FloatArray:
        """The vertical, a unit vector (3,) in the optical frame."""
        return up_from_attitude(self.camera.roll, self.camera.pitch)

    @property
    def base_from_optical(self) -> FloatArray:
        """Homogeneous transform (4, 4) from the optical frame to base_link, metres.

        Raises:
            GroundPlaneError: when the height of the camera is not known.
        """
        transform = np.eye(4)
        transform[:3, :3] = self.camera.optical_to_base
        transform[:3, 3] = self.camera.x_m, 0.0, self._height_m
        return transform

    @property
    def horizon(self) -> FloatArray:
        """The vanishing line of the ground (a, b, c): a u + b v + c = 0 in rectified pixels.

        a u + b v + c is the distance (px) of a pixel from it, positive above the horizon. A camera that looks
        straight down has its horizon at infinity: (0, 0, -1). Height is not needed.
        """
        line = np.asarray(np.linalg.solve(self.camera.rectified().matrix.T, self.up), dtype=np.float64)
        slope = float(np.hypot(line[0], line[1]))
        if slope * self.camera.width < 1e-12 * abs(line[2]):
            return np.array([0.0, 0.0, float(np.sign(line[2]))])
        return np.asarray(line / slope)

    def check_metric(self) -> None:
        """Look whether this camera can measure the ground.

        Raises:
            GroundPlaneError: when the height or the focal length of the camera is not known.
        """
        self._metric_transform()

    def from_pixels(self, pixels: ArrayLike) -> FloatArray:
        """Give the ground points (N, 2), metres in base_link, under pixels (N, 2) (20.1)-(20.3).

        NaN at or above the horizon and outside the field of the lens.

        Raises:
            GroundPlaneError: when the height or the focal length of the camera is not known.
        """
        transform = self._metric_transform()
        rays = self.camera.rays(pixels) @ transform[:3, :3].T
        fall = -rays[:, 2]
        with np.errstate(invalid="ignore"):
            reach = transform[2, 3] / np.where(fall > np.finfo(float).eps, fall, np.nan)
        points: FloatArray = transform[:2, 3] + rays[:, :2] * reach[:, None]
        return points

    def to_pixels(self, points: ArrayLike) -> FloatArray:
        """Give the pixels (N, 2) of ground points (N, 2), metres in base_link; NaN where unseen.

        Raises:
            GroundPlaneError: when the height or the focal length of the camera is not known.
        """
        transform = self._metric_transform()
        xy = as_rows(points, 2, "points")
        homogeneous = np.column_stack([xy, np.zeros(len(xy)), np.ones(len(xy))])
        return self.camera.pixels((homogeneous @ np.linalg.inv(transform).T)[:, :3])

    @property
    def _height_m(self) -> float:
        if self.camera.height_m is None:
            raise GroundPlaneError(
                "the height of the camera is not known; give Camera(height_m=...), parameter camera.height"
            )
        return self.camera.height_m

    def _metric_transform(self) -> FloatArray:
        if not self.camera.focal_known:
            raise GroundPlaneError(
                "the focal length of the camera is only a guess, so distances would be too; "
                "calibrate the camera"
            )
        return self.base_from_optical
