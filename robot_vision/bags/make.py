# SPDX-License-Identifier: Apache-2.0
"""Makes a bag of pictures people have: a folder or a video, with its calibration and its way."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from robot_vision.bags import messages
from robot_vision.bags.calibration import Calibration, read_calibration
from robot_vision.bags.errors import BagError
from robot_vision.bags.pictures import PictureSource, Source, SourcePicture, open_pictures
from robot_vision.bags.trajectory import Trajectory, odometry_from_camera, read_poses
from robot_vision.bags.writer import BagWriter, Compression
from robot_vision.geometry import Camera

Transport = Literal["raw", "compressed", "png"]
TRANSPORTS: tuple[Transport, ...] = ("raw", "compressed", "png")
Progress = Callable[[int, int | None], None]
OPTICAL_FRAME = "camera_optical_frame"
DEFAULT_RATE_HZ = 10.0
START_NS = 1_000_000_000  # a stamp of 0 means "no time" to ROS
_PREFIX = re.compile(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*/?", re.ASCII)
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class MadeBag:
    """What `make_bag` made: the file, its pictures (count, size in px), seconds, what was left out."""

    path: Path
    pictures: int
    width: int
    height: int
    duration_s: float
    warnings: tuple[str, ...] = ()


def make_bag(
    source: Source,
    output: str | os.PathLike[str],
    *,
    calibration: Calibration | None = None,
    poses: str | os.PathLike[str] | NDArray[np.float64] | None = None,
    rate_hz: float | None = None,
    transport: Transport = "raw",
    quality: int = 90,
    prefix: str = "",
    compression: Compression = "none",
    start_ns: int = START_NS,
    progress: Progress | None = None,
) -> MadeBag:
    """Make an mcap bag of pictures.

    The bag holds `/image` (sensor_msgs/Image) or `/image/compressed` (CompressedImage), with a calibration
    `/camera_info`, with poses `/odom` (nav_msgs/Odometry of base_link in odom). The three of one instant
    carry the same stamp and stand in the order camera_info, odom, image: who has the picture has all that
    belongs to it.

    Args:
        source: a folder (natural order of names), a picture, a list of pictures, or a video.
        output: the bag to write; an existing one is replaced when the new one is whole.
        calibration: see `read_calibration`; None: no `/camera_info`.
        poses: KITTI `poses.txt` or (N, 4, 4) world-from-camera matrices (m, z forward), one a picture;
            `odometry_from_camera` tells how they become odometry.
        rate_hz: pictures a second; None: that of the video, or 10 for files.
        transport: `raw`, `compressed` (JPEG; JPEG files go in as they are) or `png` (lossless).
        quality: of JPEG, 1 to 100.
        prefix: put before the topic names, such as `front` for `/front/image`; ROS takes letters, digits and `_`,
            and no digit at the beginning of a part.
        compression: of the bag's chunks.
        start_ns: stamp of the first picture.
        progress: called with pictures done and pictures in all (None: not known).

    Returns:
        what was made, with a warning for each picture that could not be read (its instant stays empty).

    Raises:
        BagError: one line that names the cause; no bag is left behind.
    """
    if transport not in TRANSPORTS:
        raise BagError(f"transport is one of {', '.join(TRANSPORTS)}, not {transport!r}")
    pictures = open_pictures(source)
    rate = rate_hz if rate_hz is not None else pictures.rate_hz or DEFAULT_RATE_HZ
    if not (np.isfinite(rate) and 0 < rate <= 1000):
        raise BagError(f"a rate of {rate} pictures a second makes no bag (0 to 1000 Hz)")
    _check_prefix(prefix)
    way = read_poses(poses) if isinstance(poses, str | os.PathLike) else poses
    warnings: list[str] = []
    _check_pose_count(way, pictures, warnings)
    job = _Job(Path(output), rate, start_ns, transport, quality, prefix.strip("/"), calibration, way)
    with BagWriter(output, compression) as bag:
        for item in pictures:
            trouble = job.add(bag, item)
            if trouble:
                warnings.append(trouble)
                _LOG.warning(trouble)
            if progress is not None:
                progress(item.number + 1, pictures.count)
        if job.count == 0:
            raise BagError(f"none of the pictures could be read; the first trouble was: {warnings[0]}")
    seconds = (job.last_ns - start_ns) / 1e9
    return MadeBag(bag.path, job.count, *job.size, seconds, tuple(warnings))


def _check_prefix(prefix: str) -> None:
    if prefix.strip("/") and not _PREFIX.fullmatch(prefix):
        rule = "letters, digits and _, no digit first, with single / between the parts"
        raise BagError(f"{prefix!r} cannot stand before a topic: ROS takes {rule}")


def _check_pose_count(way: NDArray[np.float64] | None, pictures: PictureSource, warnings: list[str]) -> None:
    if way is None or pictures.count is None:
        return
    if len(way) < pictures.count:
        raise BagError(f"there are {len(way)} poses for {pictures.count} pictures; each picture needs one")
    if len(way) > pictures.count:
        warnings.append(f"there are {len(way)} poses for {pictures.count} pictures; the last are not used")


@dataclass
class _Job:
    """The state of one making: size, camera and way become known with the first good picture."""

    output: Path
    rate_hz: float
    start_ns: int
    transport: Transport
    quality: int
    prefix: str
    calibration: Calibration | None
    way: NDArray[np.float64] | None
    count: int = 0
    size: tuple[int, int] = (0, 0)
    last_ns: int = 0
    camera: Camera | None = None
    trajectory: Trajectory | None = None

    def add(self, bag: BagWriter, item: SourcePicture) -> str:
        """Write one instant; returns why it was left out, or ""."""
        if item.pixels is None:
            return f"{item.name} is left out: {item.trouble}"
        height, width = item.pixels.shape[:2]
        if self.count == 0:
            self._begin(width, height)
        elif (width, height) != self.size:
            before = f"{self.size[0]} x {self.size[1]}"
            raise BagError(f"{item.name} has {width} x {height} pixels, the pictures before it {before}")
        stamp = self.start_ns + round(item.number * 1e9 / self.rate_hz)
        if self.camera is not None:
            info = messages.camera_info(stamp, OPTICAL_FRAME, self.camera)
            bag.write(self._topic("camera_info"), "sensor_msgs/msg/CameraInfo", stamp, info)
        if self.trajectory is not None:
            self._write_odometry(bag, stamp, item)
        self._write_picture(bag, stamp, item, item.pixels)
        self.count += 1
        self.last_ns = stamp
        return ""

    def _begin(self, width: int, height: int) -> None:
        self.size = (width, height)
        if self.calibration is not None:
            self.camera = read_calibration(self.calibration, width, height)
        if self.way is not None:
            self.trajectory = odometry_from_camera(self.way, self.rate_hz, self.camera)

    def _write_odometry(self, bag: BagWriter, stamp: int, item: SourcePicture) -> None:
        assert self.trajectory is not None
        way, i = self.trajectory, item.number
        if i >= len(way):
            raise BagError(f"there are {len(way)} poses, none for {item.name}; each picture needs one")
        odom = messages.odometry(stamp, way.positions[i], way.quaternions[i], way.linear[i], way.angular[i])
        bag.write(self._topic("odom"), "nav_msgs/msg/Odometry", stamp, odom)

    def _write_picture(self, bag: BagWriter, stamp: int, item: SourcePicture, pixels: NDArray[Any]) -> None:
        if self.transport == "raw":
            message = messages.image(stamp, OPTICAL_FRAME, pixels)
            bag.write(self._topic("image"), "sensor_msgs/msg/Image", stamp, message)
            return
        if self.transport == "png":
            message = messages.compressed_image(stamp, OPTICAL_FRAME, pixels, "png")
        elif item.file is not None and item.file.startswith(b"\xff\xd8"):
            message = messages.compressed_bytes(stamp, OPTICAL_FRAME, item.file, "jpeg")
        else:
            message = messages.compressed_image(stamp, OPTICAL_FRAME, pixels, "jpeg", self.quality)
        bag.write(self._topic("image/compressed"), "sensor_msgs/msg/CompressedImage", stamp, message)

    def _topic(self, name: str) -> str:
        return f"/{self.prefix}/{name}" if self.prefix else f"/{name}"
