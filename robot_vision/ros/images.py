# SPDX-License-Identifier: Apache-2.0
"""Picture messages to arrays and back, into memory that is allocated once and used again."""

from __future__ import annotations

import array
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import CompressedImage, Image
from std_msgs.msg import Header

from robot_vision.geometry import Camera
from robot_vision.perception.picture import (
    Picture,
    PictureError,
    gray_from_compressed,
    picture_from_buffer,
    picture_from_compressed,
    to_gray,
)

Gray = NDArray[np.uint8]
MESSAGES: dict[str, type] = {"raw": Image, "compressed": CompressedImage}
TOPICS = {"raw": "image", "compressed": "image/compressed"}


def picture_of(message: Image | CompressedImage) -> Picture:
    """Give the picture of a message: grey (H, W) uint8 or uint16, or BGR (H, W, 3) uint8; often a view of it.

    Raises:
        PictureError: it cannot be decoded; the text tells why.
    """
    if isinstance(message, CompressedImage):
        return picture_from_compressed(bytes(message.data))
    return picture_from_buffer(
        message.encoding,
        message.width,
        message.height,
        message.step,
        message.data,
        bool(message.is_bigendian),
    )


def image_message(header: Header, picture: NDArray[np.uint8]) -> Image:
    """Build an Image, bgr8 from (H, W, 3) or mono8 from (H, W)."""
    height, width = picture.shape[:2]
    channels = 3 if picture.ndim == 3 else 1
    return Image(
        header=header,
        height=height,
        width=width,
        encoding="bgr8" if channels == 3 else "mono8",
        is_bigendian=0,
        step=width * channels,
        data=array.array("B", np.ascontiguousarray(picture).tobytes()),
    )


class Rectifier:
    """Gives rectified grey pictures of one camera, whose calibration and size may change.

    Attributes:
        camera: raw camera of the pictures; None: they are taken as they are.
    """

    def __init__(self) -> None:
        self.camera: Camera | None = None
        self._maps: tuple[Any, Any] | None = None
        self._gray: Gray = np.empty((0, 0), np.uint8)
        self._rectified: Gray = np.empty((0, 0), np.uint8)

    def use(self, camera: Camera | None) -> None:
        """Take another calibration; the maps are kept while it stays the same."""
        if camera == self.camera:
            return
        self.camera = camera
        self._maps = None
        if camera is not None and not camera.is_rectified:
            self._maps = cv2.convertMaps(*camera.rectification_maps(), cv2.CV_16SC2)

    def gray(self, message: Image | CompressedImage) -> Gray:
        """Give the rectified grey picture (H, W) of a message; valid until the next call.

        Raises:
            PictureError: it cannot be decoded, or it is not of the size the calibration is for.
        """
        gray = self._gray_of(message)
        self._check_size(gray)
        if self._maps is None:
            return gray
        if self._rectified.shape != gray.shape:
            self._rectified = np.empty(gray.shape, np.uint8)
        cv2.remap(gray, *self._maps, cv2.INTER_LINEAR, dst=self._rectified)
        return self._rectified

    def colour(self, message: Image | CompressedImage) -> Picture:
        """Give the rectified picture of a message as BGR (H, W, 3), in memory of its own, to draw upon.

        Raises:
            PictureError: as for `gray`.
        """
        picture = picture_of(message)
        self._check_size(picture)
        if picture.ndim == 2:
            picture = np.asarray(cv2.cvtColor(to_gray(picture), cv2.COLOR_GRAY2BGR))
        if self._maps is None:
            return np.array(picture)
        return np.asarray(cv2.remap(picture, *self._maps, cv2.INTER_LINEAR))

    def field(self, message: Image | CompressedImage) -> Picture:
        """Give the rectified picture of a message as it came, BGR (H, W, 3) or grey (H, W), uint8; to be read only.

        Raises:
            PictureError: as for `gray`.
        """
        picture = picture_of(message)
        if picture.ndim == 2:
            picture = to_gray(picture)
        self._check_size(picture)
        if self._maps is None:
            return picture
        return np.asarray(cv2.remap(picture, *self._maps, cv2.INTER_LINEAR))

    def _gray_of(self, message: Image | CompressedImage) -> Gray:
        if isinstance(message, CompressedImage):
            return gray_from_compressed(bytes(message.data))
        picture = picture_of(message)
        if picture.ndim == 2:
            return np.ascontiguousarray(to_gray(picture))
        if self._gray.shape != picture.shape[:2]:
            self._gray = np.empty(picture.shape[:2], np.uint8)
        cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY, dst=self._gray)
        return self._gray

    def _check_size(self, picture: Picture) -> None:
        camera = self.camera
        height, width = picture.shape[:2]
        if camera is not None and (camera.width, camera.height) != (width, height):
            raise PictureError(
                f"the picture is {width} x {height}, but camera_info is for {camera.width} x {camera.height}"
            )
