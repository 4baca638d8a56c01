# SPDX-License-Identifier: Apache-2.0
"""The pictures of a recorded drive as lines, with the camera that the bag or a person says took them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.bags import BagError, BagReader, decode
from robot_vision.bags.calibration import read_calibration
from robot_vision.bags.messages import picture, stamp_ns
from robot_vision.bags.replay import PICTURE_TYPES
from robot_vision.geometry import Camera
from robot_vision.perception import LineDetector, LineSegments
from robot_vision.perception.calibration import Plants, green_of
from robot_vision.perception.picture import PictureError, to_gray

Gray = NDArray[np.uint8]
Progress = Callable[[int, int | None], None]


@dataclass(frozen=True)
class Drive:
    """Lines of the pictures of a drive.

    Attributes:
        bag: where they come from.
        camera: raw camera as given; `Camera.uncalibrated` when nobody says anything of it.
        lines: of each picture, rectified px.
        stamps_s: time of each picture, s.
        plants: what is green in each picture; None where that was not looked for, or all of it None.
        example: the rectified grey picture from the middle of the drive.
        example_at: which picture that is.
        warnings: what could not be used, one sentence each.
    """

    bag: Path
    camera: Camera
    lines: list[LineSegments]
    stamps_s: list[float]
    plants: list[Plants | None]
    example: Gray
    example_at: int
    warnings: tuple[str, ...]


def read_drive(
    bag: Path, calibration: str | None, most: int, progress: Progress, most_green: int = 0
) -> Drive:
    """Find the lines in the pictures of a bag, in at most `most` of them, evenly chosen.

    Args:
        bag: with pictures.
        calibration: as `read_calibration` takes it; None: the bag's own `camera_info`, if it has one.
        most: pictures to look at.
        progress: called with pictures done and in all.
        most_green: pictures in which to look for plants.

    Raises:
        BagError: the bag or the calibration cannot be used, or no picture can be read.
    """
    reader = BagReader(bag)
    topic = _picture_topic(reader)
    count = reader.topics[topic].count
    every = max(1, -(-count // most))
    every_green = every * max(1, -(-count // (every * most_green))) if most_green else count + 1
    detector = LineDetector()
    camera: Camera | None = None
    maps: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None
    lines: list[LineSegments] = []
    stamps: list[float] = []
    plants: list[Plants | None] = []
    example, example_at = np.zeros((0, 0), np.uint8), 0
    faults: list[str] = []
    for number, message in enumerate(reader.messages([topic])):
        if number % every:
            continue
        decoded = decode(message.cdr, message.type_name)
        try:
            pixels = picture(decoded)
            gray = np.ascontiguousarray(_gray(pixels))
        except PictureError as cause:
            faults.append(f"picture {number} is left out: {cause}")
            continue
        height, width = gray.shape
        if camera is None:
            camera = _camera(reader, topic, calibration, width, height)
            maps = None if camera.is_rectified else camera.rectification_maps()
        if (width, height) != (camera.width, camera.height):
            expected = f"{camera.width} x {camera.height}"
            faults.append(f"picture {number} is left out: it is {width} x {height}, not {expected}")
            continue
        gray = _rectified(gray, maps)
        lines.append(detector.detect(gray))
        green = pixels.ndim == 3 and number % every_green == 0
        plants.append(green_of(_rectified(pixels, maps)) if green else None)
        stamps.append(1e-9 * stamp_ns(decoded))
        if number <= count // 2:
            example, example_at = gray, len(lines) - 1
        progress(number + 1, count)
    if camera is None or not lines:
        raise BagError(
            f"{bag}: no picture of {topic} can be read; {faults[0] if faults else 'there is none'}"
        )
    order = np.argsort(stamps, kind="stable").tolist()
    warnings = (*reader.warnings, *faults)
    return Drive(
        bag,
        camera,
        [lines[k] for k in order],
        [stamps[k] for k in order],
        [plants[k] for k in order],
        example,
        order.index(example_at),
        warnings,
    )


def _rectified(pixels: NDArray[Any], maps: tuple[Any, Any] | None) -> NDArray[np.uint8]:
    if maps is None:
        return np.asarray(pixels, np.uint8)
    return np.asarray(cv2.remap(pixels, *maps, cv2.INTER_LINEAR), np.uint8)


def _gray(pixels: NDArray[np.generic]) -> Gray:
    if pixels.ndim == 3:
        return np.asarray(cv2.cvtColor(np.asarray(pixels, np.uint8), cv2.COLOR_BGR2GRAY), np.uint8)
    return np.asarray(to_gray(pixels), np.uint8)


def _picture_topic(reader: BagReader) -> str:
    """The topic of the one camera in a bag, whatever namespace it has; what the graph drew does not count."""
    cameras = [
        name
        for name, topic in reader.topics.items()
        if topic.type_name in PICTURE_TYPES and not name.endswith("/overlay")
    ]
    if not cameras:
        raise BagError(f"{reader.path} holds no pictures")
    if len(cameras) > 1:
        raise BagError(f"{reader.path} holds pictures of more than one topic: {', '.join(cameras)}")
    return cameras[0]


def _camera(reader: BagReader, topic: str, calibration: str | None, width: int, height: int) -> Camera:
    """The camera as a person, or else the bag, says; uncalibrated when neither does."""
    if calibration is not None:
        return read_calibration(calibration, width, height)
    namespace = topic.removesuffix("/compressed").rpartition("/")[0]
    for message in reader.messages([f"{namespace}/camera_info"]):
        info = decode(message.cdr, message.type_name)
        if not np.any(np.asarray(info.k)):
            break  # zeros: the driver was never calibrated
        try:
            return Camera.from_camera_info(info)
        except ValueError as cause:
            raise BagError(f"{reader.path}: {message.topic} is no calibration: {cause}") from cause
    return Camera.uncalibrated(width, height)
