# SPDX-License-Identifier: Apache-2.0
"""Keeps the camera of the graph as camera_info and the parameters describe it."""

from __future__ import annotations

from typing import Any

from sensor_msgs.msg import CameraInfo

from robot_vision.geometry import Camera

ADVICE = "publish camera_info with the pictures, as camera drivers do once the camera has been calibrated"


class Calibration:
    """The newest usable calibration.

    Args:
        place: where the camera sits, keyword arguments of `Camera.from_camera_info`.

    Attributes:
        camera: of the raw picture; None while there is none.
        fault: why there is none, in plain words.
    """

    def __init__(self, place: dict[str, Any] | None = None) -> None:
        self.camera: Camera | None = None
        self.fault = "no camera_info has come yet"
        self._place = place or {}
        self._info: CameraInfo | None = None
        self._key: tuple[Any, ...] = ()

    def move(self, place: dict[str, Any]) -> None:
        """Put the camera somewhere else on the robot.

        Raises:
            CameraError: no camera can be there.
        """
        if self._info is not None and self.camera is not None:
            self.camera = Camera.from_camera_info(self._info, **place)
        self._place = place

    def take(self, info: CameraInfo) -> None:
        """Take in a message; the last good calibration stays when this one is none.

        Raises:
            CameraError: naming the field and the reason.
        """
        key = _key(info)
        if key == self._key and self.camera is not None:
            return
        try:
            self.camera = Camera.from_camera_info(info, **self._place)
        except ValueError as cause:
            self.fault = str(cause)
            raise
        self._info, self._key = info, key


def _key(info: CameraInfo) -> tuple[Any, ...]:
    """Give all that a camera is made of: the same message comes with every picture."""
    roi = info.roi
    return (
        info.width,
        info.height,
        info.distortion_model,
        *(bytes(memoryview(part)) for part in (info.d, info.k, info.r, info.p)),
        info.binning_x,
        info.binning_y,
        *(roi.x_offset, roi.y_offset, roi.width, roi.height),
    )
