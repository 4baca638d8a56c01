# SPDX-License-Identifier: Apache-2.0
"""CameraInfo says "not given" by zeros and hides the true picture behind roi and binning: read here, once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from robot_vision.geometry.arrays import FloatArray
from robot_vision.geometry.camera_checks import check_no_skew
from robot_vision.geometry.errors import CameraError


@dataclass(frozen=True)
class RawCameraInfo:
    """What a CameraInfo says, with "not given" as None instead of zeros.

    Attributes:
        pinhole: fx, fy, cx, cy (px) of the full-resolution picture.
        width, height: of the full-resolution picture (px).
        distortion_model, distortion: as given; no coefficients of no named model are plumb_bob with none.
        rectification: (3, 3) or None.
        projection: (3, 4) or None.
        roi: left, top, width, height (px at full resolution) or None for the whole picture.
        binning: columns and rows that make one pixel of the picture sent.
    """

    pinhole: tuple[float, float, float, float]
    width: int
    height: int
    distortion_model: str
    distortion: tuple[float, ...]
    rectification: FloatArray | None
    projection: FloatArray | None
    roi: tuple[int, int, int, int] | None
    binning: tuple[int, int]


def read(info: Any) -> RawCameraInfo:
    """Read any object with the attribute names of sensor_msgs/CameraInfo.

    Raises:
        CameraError: naming the field, for a camera not calibrated or a matrix of the wrong size or form.
    """
    k = _matrix(info, "k", (3, 3))
    if k is None:
        raise CameraError(
            "k",
            "is all zero, so the camera is not calibrated; "
            "calibrate it or use Camera.uncalibrated(width, height)",
        )
    check_no_skew("k", k)
    model = str(info.distortion_model)
    distortion = () if info.d is None else tuple(info.d)
    if not model and not any(distortion):
        model, distortion = "plumb_bob", ()
    width, height = int(info.width), int(info.height)
    return RawCameraInfo(
        pinhole=(float(k[0, 0]), float(k[1, 1]), float(k[0, 2]), float(k[1, 2])),
        width=width,
        height=height,
        distortion_model=model,
        distortion=distortion,
        rectification=_matrix(info, "r", (3, 3)),
        projection=_matrix(info, "p", (3, 4)),
        roi=_roi(getattr(info, "roi", None), width, height),
        binning=(max(int(getattr(info, "binning_x", 0)), 1), max(int(getattr(info, "binning_y", 0)), 1)),
    )


def _matrix(info: Any, field: str, shape: tuple[int, int]) -> FloatArray | None:
    values = np.asarray(getattr(info, field), dtype=np.float64).ravel()
    if values.size != shape[0] * shape[1]:
        raise CameraError(field, f"must hold {shape[0] * shape[1]} numbers, got {values.size}")
    if not np.isfinite(values).all():
        raise CameraError(field, f"must hold finite numbers, got {values.tolist()}")
    return values.reshape(shape) if values.any() else None


def _roi(roi: Any, width: int, height: int) -> tuple[int, int, int, int] | None:
    """Left, top, width, height of the window; a width or height of zero means all from the offset on."""
    if roi is None:
        return None
    left, top = int(roi.x_offset), int(roi.y_offset)
    window = (left, top, int(roi.width) or width - left, int(roi.height) or height - top)
    if window == (0, 0, width, height):
        return None
    if window[2] <= 0 or window[3] <= 0 or left + window[2] > width or top + window[3] > height:
        raise CameraError(
            "roi", f"{roi.width}x{roi.height} at ({left}, {top}) is not inside the picture {width}x{height}"
        )
    return window
