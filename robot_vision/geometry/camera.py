# SPDX-License-Identifier: Apache-2.0
"""A pixel means a direction only through a camera: this type holds one and translates both ways."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_vision.geometry import camera_info as ros
from robot_vision.geometry.arrays import FloatArray, as_rows
from robot_vision.geometry.camera_checks import (
    check_principal_point,
    checked_angle,
    checked_focal_length,
    checked_number,
    checked_projection,
    checked_rotation,
    checked_size,
)
from robot_vision.geometry.distortion import Distortion, checked_coefficients, distortion_of
from robot_vision.geometry.errors import CameraError
from robot_vision.geometry.rotation import BODY_FROM_OPTICAL, rotation_from_rpy

_OUTSIDE_OF_ANY_PICTURE = -16.0  # px: further out than any interpolation kernel reaches


@dataclass(frozen=True)
class Camera:
    """A pinhole with its lens, its picture and its place on the robot.

    There is one optical frame: the one after `rectification`, which for a single camera is the camera's own.
    Rays, points, pitch and roll all refer to it, so that a raw camera and its `rectified()` see the same ray
    for the same thing. Pixel centres lie at whole numbers.

    Attributes:
        fx, fy: focal lengths (px) of the raw picture.
        cx, cy: principal point (px) of the raw picture, (column, row).
        width, height: size of the picture (px).
        distortion: coefficients in the order of CameraInfo `d`; () for none.
        height_m: height of the camera over the ground (m), None when unknown.
        pitch: of the camera body (rad), > 0 looks down.
        roll: of the camera body (rad), > 0 lifts the left side.
        x_m: how far the camera sits ahead of base_link (m).
        distortion_model: plumb_bob, rational_polynomial, equidistant or fisheye.
        focal_known: False when fx and fy are only a guess.
        rectification: rotation (3, 3) from the raw to the rectified frame, CameraInfo `r`; None for none.
        projection: (3, 4) of the rectified picture, CameraInfo `p`; None when it is the raw camera's own.
        pan: of the head that carries the camera (rad), about base_link's z, > 0 to the left; 0 without a head.
        tilt: of that head (rad), on top of `pitch`, > 0 looks down.

    Raises:
        CameraError: naming the field and the reason, for values no camera can have.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int
    distortion: Sequence[float] = ()
    height_m: float | None = None
    pitch: float = 0.0
    roll: float = 0.0
    x_m: float = 0.0
    distortion_model: str = "plumb_bob"
    focal_known: bool = True
    rectification: Sequence[Sequence[float]] | FloatArray | None = None
    projection: Sequence[Sequence[float]] | FloatArray | None = None
    pan: float = 0.0
    tilt: float = 0.0

    def __post_init__(self) -> None:
        """Check every field and bring it to plain floats and tuples, so that cameras compare and hash."""
        for name in ("width", "height"):
            self._set(name, checked_size(name, getattr(self, name)))
        for name in ("fx", "fy"):
            self._set(name, checked_focal_length(name, getattr(self, name)))
        for name in ("cx", "cy", "x_m"):
            self._set(name, checked_number(name, getattr(self, name)))
        for name in ("pitch", "roll", "pan", "tilt"):
            self._set(name, checked_angle(name, getattr(self, name)))
        check_principal_point("cx", self.cx, self.fx, "width", self.width)
        check_principal_point("cy", self.cy, self.fy, "height", self.height)
        if self.height_m is not None:
            self._set("height_m", checked_number("height_m", self.height_m))
            if self.height_m <= 0.0:
                raise CameraError("height_m", f"must be above the ground (> 0 m), got {self.height_m:g} m")
        self._set("distortion", checked_coefficients(self.distortion_model, self.distortion))
        self._set("rectification", checked_rotation(self.rectification))
        self._set("projection", checked_projection(self.projection, self.matrix))

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, value)

    @classmethod
    def uncalibrated(cls, width: int, height: int) -> Camera:
        """A camera of which only the picture is known.

        The principal point is the middle of the picture; the focal length is the longer side (53° across), a
        guess that `focal_known=False` tells everybody to improve.
        """
        width, height = checked_size("width", width), checked_size("height", height)
        focal = float(max(width, height))
        return cls(focal, focal, (width - 1) / 2.0, (height - 1) / 2.0, width, height, focal_known=False)

    @classmethod
    def from_camera_info(
        cls,
        info: Any,
        height_m: float | None = None,
        pitch: float = 0.0,
        roll: float = 0.0,
        x_m: float = 0.0,
    ) -> Camera:
        """Read any object with the attributes of sensor_msgs/CameraInfo (rclpy, rosbags or the like).

        K, D, R, P and the size are those of the full-resolution picture; `roi` and `binning_x`, `binning_y`
        then tell which part of it is sent, and the answer is the camera of the pictures that are sent.

        Raises:
            CameraError: naming the field and the reason; `k` when the camera was never calibrated.
        """
        raw = ros.read(info)
        camera = cls(
            *raw.pinhole,
            width=raw.width,
            height=raw.height,
            distortion=raw.distortion,
            height_m=height_m,
            pitch=pitch,
            roll=roll,
            x_m=x_m,
            distortion_model=raw.distortion_model,
            rectification=raw.rectification,
            projection=raw.projection,
        )
        if raw.roi is not None:
            camera = camera.cropped(*raw.roi)
        columns, rows = raw.binning
        if (columns, rows) == (1, 1):
            return camera
        width, height = camera.width // columns, camera.height // rows
        if width == 0 or height == 0:
            size = f"{camera.width}x{camera.height}"
            raise CameraError("binning_x, binning_y", f"{columns}x{rows} leaves nothing of {size}")
        return camera.cropped(0, 0, width * columns, height * rows).resized(width, height)

    def camera_info(self) -> dict[str, Any]:
        """Give width, height, distortion_model and d, k, r, p (lists of float) of sensor_msgs/CameraInfo."""
        nothing_bent = [0.0] * (8 if self.distortion_model == "rational_polynomial" else 5)
        return {
            "width": self.width,
            "height": self.height,
            "distortion_model": self.distortion_model,
            "d": list(self.distortion) or nothing_bent,
            "k": self.matrix.ravel().tolist(),
            "r": self._rotation.ravel().tolist(),
            "p": self._rectified_projection.ravel().tolist(),
        }

    @property
    def matrix(self) -> FloatArray:
        """K (3, 3) of the raw picture, px."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def is_rectified(self) -> bool:
        """Whether raw and rectified pixels are the same."""
        same_matrix = bool(np.array_equal(self._rectified_projection[:, :3], self.matrix))
        return self._lens is None and self.rectification is None and same_matrix

    @property
    def optical_to_base(self) -> FloatArray:
        """Rotation (3, 3) from the optical frame to base_link: Rz(pan) Ry(pitch + tilt) Rx(roll) B."""
        rotation: FloatArray = (
            rotation_from_rpy(self.roll, self.pitch + self.tilt, self.pan) @ BODY_FROM_OPTICAL
        )
        return rotation

    @property
    def head_turn(self) -> FloatArray:
        """Rotation (3, 3) from the optical frame to where that frame lies while the head looks straight ahead."""
        if self.pan == 0.0 and self.tilt == 0.0:
            return np.eye(3)
        ahead = rotation_from_rpy(self.roll, self.pitch, 0.0) @ BODY_FROM_OPTICAL
        turn: FloatArray = ahead.T @ self.optical_to_base
        return turn

    def rectified(self) -> Camera:
        """The camera of the rectified picture: undistorted, unrotated, the matrix of P, or K without a P."""
        p = self._rectified_projection
        fx, fy, cx, cy = (float(p[0, 0]), float(p[1, 1]), float(p[0, 2]), float(p[1, 2]))
        return replace(
            self,
            fx=fx,
            fy=fy,
            cx=cx,
            cy=cy,
            distortion=(),
            distortion_model="plumb_bob",
            rectification=None,
            projection=self.projection,
        )

    def rays(self, pixels: ArrayLike) -> FloatArray:
        """Give the unit rays (N, 3), optical frame, of raw pixels (N, 2); NaN outside the lens's field."""
        uv = as_rows(pixels, 2, "pixels")
        normalised = (uv - (self.cx, self.cy)) / (self.fx, self.fy)
        if self._lens is not None:
            normalised = self._lens.undistort(normalised)
        rays = np.column_stack([normalised, np.ones(len(normalised))])
        if self.rectification is not None:
            rays = rays @ self._rotation.T
        unit: FloatArray = rays / np.linalg.norm(rays, axis=1, keepdims=True)
        return unit

    def pixels(self, points: ArrayLike) -> FloatArray:
        """Project points or directions (N, 3) in the optical frame to raw pixels (N, 2).

        NaN for what is behind the camera or outside the field of the lens; the picture itself is no limit.
        """
        xyz = as_rows(points, 3, "points")
        if self.rectification is not None:
            xyz = xyz @ np.linalg.inv(self._rotation).T
        normalised = _in_front(xyz)
        if self._lens is not None:
            normalised = self._lens.distort(normalised)
        raw: FloatArray = normalised * (self.fx, self.fy) + (self.cx, self.cy)
        return raw

    def rectified_pixels(self, pixels: ArrayLike) -> FloatArray:
        """Give the pixels (N, 2) of the rectified picture that show what raw pixels (N, 2) show, or NaN."""
        if self.is_rectified:
            return np.array(as_rows(pixels, 2, "pixels"))
        return self.rectified().pixels(self.rays(pixels))

    def rectification_maps(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Give (map_x, map_y), float32 (height, width), for cv2.remap from the raw picture to the rectified.

        Where the lens shows nothing the maps point outside the picture, so that remap fills in its border.
        """
        rows, columns = np.indices((self.height, self.width)).reshape(2, -1)
        target = np.column_stack([columns, rows])
        raw = self.pixels(self.rectified().rays(target))
        raw[np.isnan(raw).any(axis=1)] = _OUTSIDE_OF_ANY_PICTURE
        map_x, map_y = raw.T.reshape(2, self.height, self.width).astype(np.float32)
        return map_x, map_y

    def resized(self, width: int, height: int) -> Camera:
        """The camera of the picture resized (as cv2.resize does, edge on edge) to this size."""
        width, height = checked_size("width", width), checked_size("height", height)
        scale = np.diag([width / self.width, height / self.height, 1.0])
        scale[:2, 2] = 0.5 * (scale[0, 0] - 1.0), 0.5 * (scale[1, 1] - 1.0)
        return self._with_picture(scale, width, height)

    def cropped(self, left: int, top: int, width: int, height: int) -> Camera:
        """The camera of a window of the picture whose first pixel is (left, top).

        As with a CameraInfo `roi`, the rectified picture moves by the same window.

        Raises:
            CameraError: naming `window` when it does not lie in the picture.
        """
        width, height = checked_size("width", width), checked_size("height", height)
        if left < 0 or top < 0 or left + width > self.width or top + height > self.height:
            raise CameraError(
                "window",
                f"{width}x{height} at ({left}, {top}) is not inside the picture {self.width}x{self.height}",
            )
        shift = np.eye(3)
        shift[:2, 2] = -left, -top
        return self._with_picture(shift, width, height)

    def _with_picture(self, change: FloatArray, width: int, height: int) -> Camera:
        k = change @ self.matrix
        return replace(
            self,
            fx=float(k[0, 0]),
            fy=float(k[1, 1]),
            cx=float(k[0, 2]),
            cy=float(k[1, 2]),
            width=width,
            height=height,
            projection=None if self.projection is None else change @ self._rectified_projection,
        )

    @property
    def _lens(self) -> Distortion | None:
        return distortion_of(self.distortion_model, tuple(self.distortion))

    @property
    def _rotation(self) -> FloatArray:
        return np.eye(3) if self.rectification is None else np.array(self.rectification)

    @property
    def _rectified_projection(self) -> FloatArray:
        if self.projection is None:
            return np.column_stack([self.matrix, np.zeros(3)])
        return np.array(self.projection)


def _in_front(xyz: FloatArray) -> FloatArray:
    """Normalised points (N, 2) of points (N, 3); NaN for those behind the camera."""
    with np.errstate(invalid="ignore"):
        depth = np.where(xyz[:, 2] > 0.0, xyz[:, 2], np.nan)
    normalised: FloatArray = xyz[:, :2] / depth[:, None]
    return normalised
