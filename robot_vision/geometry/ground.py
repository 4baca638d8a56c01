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
from robot_vision.geometry.errors import AboveHorizonError, GroundPlaneError
from robot_vision.geometry.rotation import attitude_from_up, rotation_from_rpy, up_from_attitude
from robot_vision.geometry.vanishing_line import vanishing_line

#: Step of the derivative of rays to pixels, px: lenses are smooth over far more.
_STEP = 0.01


@dataclass(frozen=True)
class GroundPoints:
    """Points measured on the ground.

    Attributes:
        points: (N, 2) metres in base_link; NaN outside the field of the lens.
        covariance: (N, 2, 2) m².
    """

    points: FloatArray
    covariance: FloatArray


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
        return vanishing_line(self.camera, self.up)

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

    def measure(
        self,
        pixels: ArrayLike,
        pixel_sigma: ArrayLike = 0.5,
        attitude_covariance: ArrayLike | None = None,
        height_sigma: float = 0.0,
    ) -> GroundPoints:
        """Give the ground points under pixels (N, 2) with their covariance, to first order.

        A pixel of error of the horizon is 1 / f rad of pitch, and costs ΔZ / Z = Z / (H f): near the horizon,
        where that is no longer small, the covariance says little more than that the point is far away.

        Args:
            pixels: (N, 2) px, of the camera given.
            pixel_sigma: standard deviation of a pixel in each direction, px; one for all or (N,).
            attitude_covariance: (2, 2) of (roll, pitch), rad², which is how sure the horizon is; None: exact.
            height_sigma: standard deviation of the camera's height, m.

        Raises:
            AboveHorizonError: pixels at or above the horizon, by number.
            GroundPlaneError: when the height or the focal length of the camera is not known, or a standard
                deviation or covariance is none.
        """
        points = self.from_pixels(pixels)
        uv = as_rows(pixels, 2, "pixels")
        rays = self.camera.rays(uv) @ self.camera.optical_to_base.T
        self._refuse_sky(rays)
        attitude = _checked_attitude(attitude_covariance)
        sigma = np.broadcast_to(np.asarray(pixel_sigma, dtype=np.float64), (len(uv),))
        if not ((sigma >= 0.0).all() and height_sigma >= 0.0):
            raise GroundPlaneError("standard deviations of pixels and height must not be negative")
        slopes = _ground_slopes(rays, self._height_m)
        by_pixel = slopes @ self._ray_slopes(uv)
        by_attitude = slopes @ self._attitude_slopes(rays)
        by_height = (points - (self.camera.x_m, 0.0)) / self._height_m
        covariance = np.einsum("nij,nkj,n->nik", by_pixel, by_pixel, sigma**2)
        covariance += by_attitude @ attitude @ np.swapaxes(by_attitude, 1, 2)
        covariance += height_sigma**2 * by_height[:, :, None] * by_height[:, None, :]
        return GroundPoints(points, covariance)

    def to_pixels(self, points: ArrayLike) -> FloatArray:
        """Give the pixels (N, 2) of ground points (N, 2), metres in base_link; NaN where unseen.

        Raises:
            GroundPlaneError: when the height or the focal length of the camera is not known.
        """
        transform = self._metric_transform()
        xy = as_rows(points, 2, "points")
        homogeneous = np.column_stack([xy, np.zeros(len(xy)), np.ones(len(xy))])
        return self.camera.pixels((homogeneous @ np.linalg.inv(transform).T)[:, :3])

    def _refuse_sky(self, rays: FloatArray) -> None:
        """Refuse rays (N, 3), base_link, that do not fall."""
        with np.errstate(invalid="ignore"):
            rising = np.flatnonzero(rays[:, 2] >= -np.finfo(float).eps)
        if len(rising):
            raise AboveHorizonError(rising.tolist())

    def _ray_slopes(self, uv: FloatArray) -> FloatArray:
        """Derivatives (N, 3, 2) of the rays in base_link to their pixels, by differences."""
        here = self.camera.rays(uv)
        columns = []
        for step in _STEP * np.eye(2):
            sides = [self.camera.rays(uv + step), self.camera.rays(uv - step)]
            seen = [np.isfinite(side).all(axis=1, keepdims=True) for side in sides]
            # At the rim of the lens's field only one side is there.
            ahead, behind = (np.where(there, side, here) for there, side in zip(seen, sides, strict=True))
            columns.append((ahead - behind) / (_STEP * np.maximum(seen[0].astype(int) + seen[1], 1)))
        slopes: FloatArray = self.camera.optical_to_base @ np.stack(columns, axis=2)
        return slopes

    def _attitude_slopes(self, rays: FloatArray) -> FloatArray:
        """Derivatives (N, 3, 2) of rays in base_link to roll and pitch: R = Ry(pitch) Rx(roll) B."""
        roll_axis = rotation_from_rpy(0.0, self.camera.pitch, 0.0)[:, 0]
        return np.stack([np.cross(roll_axis, rays), np.cross((0.0, 1.0, 0.0), rays)], axis=2)

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


def _ground_slopes(rays: FloatArray, height_m: float) -> FloatArray:
    """Derivatives (N, 2, 3) of the ground points H (x, y) / -z to falling rays (x, y, z) in base_link."""
    fall = -rays[:, 2]
    slopes = np.zeros((len(rays), 2, 3))
    slopes[:, 0, 0] = slopes[:, 1, 1] = height_m / fall
    slopes[:, :, 2] = rays[:, :2] * (height_m / fall**2)[:, None]
    return slopes


def _checked_attitude(covariance: ArrayLike | None) -> FloatArray:
    if covariance is None:
        return np.zeros((2, 2))
    matrix = np.asarray(covariance, dtype=np.float64)
    if matrix.shape != (2, 2) or not np.isfinite(matrix).all() or np.linalg.eigvalsh(matrix)[0] < 0.0:
        raise GroundPlaneError(
            f"attitude_covariance must be a covariance (2, 2) of roll and pitch, got {matrix.tolist()}"
        )
    return matrix
