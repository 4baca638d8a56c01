# SPDX-License-Identifier: Apache-2.0
"""Turns the bytes of a picture message into an array: the one place that knows encodings."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[Any]
Buffer = bytes | bytearray | memoryview | NDArray[np.uint8]

# encoding: (channels as stored, bytes per channel, how to get to grey or BGR; None: it is so already)
_PLAIN: dict[str, tuple[int, int, int | None]] = {
    "mono8": (1, 1, None),
    "8UC1": (1, 1, None),
    "mono16": (1, 2, None),
    "16UC1": (1, 2, None),
    "bgr8": (3, 1, None),
    "8UC3": (3, 1, None),
    "rgb8": (3, 1, cv2.COLOR_RGB2BGR),
    "bgra8": (4, 1, cv2.COLOR_BGRA2BGR),
    "8UC4": (4, 1, cv2.COLOR_BGRA2BGR),
    "rgba8": (4, 1, cv2.COLOR_RGBA2BGR),
    "bgr16": (3, 2, None),
    "rgb16": (3, 2, cv2.COLOR_RGB2BGR),
    # OpenCV names a Bayer pattern by its second row, ROS by its first
    "bayer_rggb8": (1, 1, cv2.COLOR_BayerBG2BGR),
    "bayer_bggr8": (1, 1, cv2.COLOR_BayerRG2BGR),
    "bayer_gbrg8": (1, 1, cv2.COLOR_BayerGR2BGR),
    "bayer_grbg8": (1, 1, cv2.COLOR_BayerGB2BGR),
    "bayer_rggb16": (1, 2, cv2.COLOR_BayerBG2BGR),
    "bayer_bggr16": (1, 2, cv2.COLOR_BayerRG2BGR),
    "bayer_gbrg16": (1, 2, cv2.COLOR_BayerGR2BGR),
    "bayer_grbg16": (1, 2, cv2.COLOR_BayerGB2BGR),
    "uyvy": (2, 1, cv2.COLOR_YUV2BGR_UYVY),
    "yuv422": (2, 1, cv2.COLOR_YUV2BGR_UYVY),
    "yuyv": (2, 1, cv2.COLOR_YUV2BGR_YUYV),
    "yuv422_yuy2": (2, 1, cv2.COLOR_YUV2BGR_YUYV),
}
ENCODINGS: tuple[str, ...] = tuple(_PLAIN)
_DECODE = cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION


class PictureError(ValueError):
    """A picture cannot be decoded; the text tells why."""


def picture_from_buffer(
    encoding: str, width: int, height: int, step: int, data: Buffer, is_bigendian: bool = False
) -> Picture:
    """Turn the fields of a sensor_msgs/Image into an array.

    Args:
        encoding: one of `ENCODINGS`, as sensor_msgs names them.
        width: pixels in a row.
        height: rows.
        step: bytes from one row to the next; it may be larger than a row.
        data: the pixels, at least (height - 1) * step bytes and one row.
        is_bigendian: byte order of encodings with two bytes a channel.

    Returns:
        (height, width) uint8 or uint16 for grey encodings, (height, width, 3) uint8 BGR for all others
        (16-bit colour keeps its upper 8 bits). Where nothing has to be converted it is a read-only view
        of `data`, without a copy.

    Raises:
        PictureError: unknown encoding, zero size, step too small, too few bytes.
    """
    if encoding not in _PLAIN:
        raise PictureError(f"encoding {encoding!r} is not known; known are {', '.join(ENCODINGS)}")
    if width <= 0 or height <= 0:
        raise PictureError(f"the picture has no size ({width} x {height})")
    channels, depth, conversion = _PLAIN[encoding]
    row = width * channels * depth
    if step < row:
        raise PictureError(f"step {step} is too small for {width} pixels of {encoding} ({row} bytes)")
    flat = np.frombuffer(data, np.uint8)
    needed = (height - 1) * step + row
    if flat.size < needed:
        kind = "is empty" if flat.size == 0 else f"has {flat.size} bytes"
        shape = f"{width} x {height} {encoding} with step {step}"
        raise PictureError(f"the picture {kind}; {shape} needs {needed}")
    if conversion is not None and channels == 2 and width % 2:
        raise PictureError(f"{encoding} pictures have an even width, not {width}")
    if conversion is not None and "bayer" in encoding and (width < 2 or height < 2):
        raise PictureError(f"{encoding} needs at least 2 x 2 pixels, not {width} x {height}")
    rows = np.lib.stride_tricks.as_strided(flat[:needed], (height, row), (step, 1), writeable=False)
    if depth == 2:
        rows = np.ascontiguousarray(rows).view(">u2" if is_bigendian else "<u2")
        if not rows.dtype.isnative:
            rows = rows.astype(np.uint16)
    picture = rows if channels == 1 else rows.reshape(height, width, channels)
    if depth == 2 and (channels > 1 or conversion is not None):
        picture = np.right_shift(picture, 8).astype(np.uint8)
    if conversion is None:
        return picture
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(picture), conversion))


def picture_from_compressed(data: Buffer) -> Picture:
    """Decode a JPEG, PNG or any other picture file in memory.

    Args:
        data: the bytes of a sensor_msgs/CompressedImage.

    Returns:
        (H, W) uint8 or uint16 for grey pictures, (H, W, 3) uint8 BGR for colour. A turn asked for by EXIF is
        not made: the calibration belongs to the pixels as they are.

    Raises:
        PictureError: empty, cut off, or no picture at all.
    """
    picture = _decoded(data, _DECODE | cv2.IMREAD_ANYCOLOR)
    if picture.ndim == 3 and picture.dtype == np.uint16:
        return np.right_shift(picture, 8).astype(np.uint8)
    return picture


def gray_from_compressed(data: Buffer) -> NDArray[np.uint8]:
    """Decode a picture file in memory to (H, W) uint8 grey; for JPEG a third faster than by way of colour.

    Raises:
        PictureError: empty, cut off, or no picture at all.
    """
    return np.asarray(_decoded(data, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION), np.uint8)


def to_gray(picture: Picture) -> NDArray[np.uint8]:
    """Turn a picture of this module into (H, W) uint8; 16 bits keep their upper 8.

    Raises:
        PictureError: not a grey or BGR picture.
    """
    if picture.ndim == 3 and picture.shape[2] == 3 and picture.dtype == np.uint8:
        return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8)
    if picture.ndim == 2 and picture.dtype == np.uint16:
        return np.right_shift(picture, 8).astype(np.uint8)
    if picture.ndim == 2 and picture.dtype == np.uint8:
        return picture
    raise PictureError(f"an array of shape {picture.shape}, {picture.dtype}, is no grey or BGR picture")


def _decoded(data: Buffer, flags: int) -> Picture:
    raw = bytes(data) if not isinstance(data, bytes) else data
    if not raw:
        raise PictureError("the compressed picture is empty")
    # libjpeg fills what is missing with grey and says nothing. The end marker of the picture itself (a
    # thumbnail may have one, too) stands behind the last start of a scan.
    if raw.startswith(b"\xff\xd8") and raw.rfind(b"\xff\xd9") < max(raw.rfind(b"\xff\xda"), 0):
        raise PictureError(f"the JPEG picture is cut off after {len(raw)} bytes")
    try:
        picture = cv2.imdecode(np.frombuffer(raw, np.uint8), flags)
    except cv2.error as error:
        raise PictureError(f"the compressed picture cannot be decoded: {error.err}") from error
    if picture is None:
        raise PictureError(f"the {len(raw)} bytes are no picture that can be decoded (JPEG, PNG, ...)")
    return np.asarray(picture)
