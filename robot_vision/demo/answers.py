# SPDX-License-Identifier: Apache-2.0
"""Gathers from a recorded bag what the graph answered to each picture, and what the truth was."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.bags import BagError, BagReader, decode
from robot_vision.bags.clouds import points
from robot_vision.bags.messages import picture, stamp_ns, yaw_of
from robot_vision.geometry import Camera

Array = NDArray[np.float64]
PICTURE_TOPICS = ("image", "image/compressed")
UNKNOWN = 1e5  # variances at or above this mean "not known"


@dataclass
class Answer:
    """What the graph said about one picture; None or empty where it said nothing.

    Attributes:
        lines: (N, 4) endpoints in px of the rectified picture.
        directions: (M, 3) unit directions of the vanishing points, optical frame.
        roles: (M,) 1 primary, 2 vertical, 3 horizontal, 0 other.
        yaw, yaw_sd: of the robot in the lane, rad.
        offset, offset_sd: to the left of the centre line, m.
        speed, turn_rate: the steering command, m/s and rad/s.
    """

    lines: Array = field(default_factory=lambda: np.zeros((0, 4)))
    directions: Array = field(default_factory=lambda: np.zeros((0, 3)))
    roles: NDArray[np.uint32] = field(default_factory=lambda: np.zeros(0, np.uint32))
    yaw: float = math.nan
    yaw_sd: float = math.nan
    offset: float = math.nan
    offset_sd: float = math.nan
    speed: float = math.nan
    turn_rate: float = math.nan


@dataclass(frozen=True)
class Truth:
    """Where the robot really was in the lane: yaw (rad), offset to the left (m)."""

    yaw: float
    offset: float


@dataclass(frozen=True)
class Replay:
    """A bag with pictures and answers.

    Attributes:
        path: the bag.
        picture_topic: where its pictures are.
        camera: of the pictures, rectified; None if the bag has no calibration.
        answers: by picture stamp (ns), in order of time; one for every picture.
        truth: by stamp (ns); empty for a real drive.
    """

    path: Path
    picture_topic: str
    camera: Camera | None
    raw_camera: Camera | None
    answers: dict[int, Answer]
    truth: dict[int, Truth]

    @property
    def stamps(self) -> list[int]:
        """Stamps of the pictures in order of time."""
        return list(self.answers)

    @property
    def rate_hz(self) -> float:
        """Pictures a second."""
        steps = np.diff(np.array(self.stamps, np.float64))
        return 1e9 / float(np.median(steps)) if len(steps) else 1.0

    def seconds(self, stamp: int) -> float:
        """Seconds from the first picture to this one."""
        return (stamp - self.stamps[0]) / 1e9

    def pictures(self, only: int | None = None) -> Iterator[tuple[int, NDArray[np.uint8]]]:
        """Yield stamp and rectified BGR picture in order of time; `only`: just the one of this stamp."""
        maps = None
        if self.raw_camera is not None and not self.raw_camera.is_rectified:
            maps = self.raw_camera.rectification_maps()
        for message in BagReader(self.path).messages([self.picture_topic]):
            decoded = decode(message.cdr, message.type_name)
            stamp = stamp_ns(decoded)
            if only is not None and stamp != only:
                continue
            pixels = _bgr(np.asarray(picture(decoded)))
            if maps is not None:
                pixels = np.asarray(cv2.remap(pixels, *maps, cv2.INTER_LINEAR), np.uint8)
            yield stamp, pixels


def _bgr(pixels: NDArray[Any]) -> NDArray[np.uint8]:
    """(H, W, 3) uint8 of a picture, grey or BGR; one of more than 8 bit is scaled to its maximum."""
    if pixels.dtype != np.uint8:
        pixels = (pixels * (255.0 / max(float(pixels.max()), 1.0))).astype(np.uint8)
    return np.asarray(cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR) if pixels.ndim == 2 else pixels, np.uint8)


def picture_topic_of(reader: BagReader) -> str:
    """Return the topic that holds the pictures of a bag.

    Raises:
        BagError: it has none.
    """
    for topic in reader.topics:
        if topic.lstrip("/") in PICTURE_TOPICS:
            return topic
    raise BagError(f"{reader.path} holds no pictures: there is neither `image` nor `image/compressed` in it")


def read_replay(path: Path, answer_path: Path | None = None) -> Replay:
    """Read a bag with pictures and answers.

    Args:
        path: the bag with the pictures and, for a simulated drive, `truth/heading`.
        answer_path: the bag with the answers, if that is another one.

    Raises:
        BagError: a bag that cannot be read, or without pictures.
    """
    reader = BagReader(path)
    topic = picture_topic_of(reader)
    raw_camera: Camera | None = None
    stamps: list[int] = []
    truth: dict[int, Truth] = {}
    for message in reader.messages([topic, "camera_info", "truth/heading"]):
        name = message.topic.lstrip("/")
        decoded = decode(message.cdr, message.type_name)
        if message.topic == topic:
            stamps.append(stamp_ns(decoded))
        elif name == "camera_info":
            raw_camera = raw_camera or Camera.from_camera_info(decoded)
        else:
            pose = decoded.pose.pose
            truth[stamp_ns(decoded)] = Truth(yaw_of(pose.orientation), float(pose.position.y))
    answers = {stamp: Answer() for stamp in sorted(stamps)}
    for message in BagReader(answer_path or path).messages(_GATHER):
        decoded = decode(message.cdr, message.type_name)
        answer = answers.get(stamp_ns(decoded))
        if answer is not None:
            _GATHER[message.topic.lstrip("/")](answer, decoded)
    camera = raw_camera.rectified() if raw_camera is not None else None
    return Replay(path, topic, camera, raw_camera, answers, truth)


def _take_lines(answer: Answer, message: Any) -> None:
    cloud = points(message)
    answer.lines = np.stack([cloud[name].astype(np.float64) for name in ("x1", "y1", "x2", "y2")], axis=-1)


def _take_vanishing_points(answer: Answer, message: Any) -> None:
    cloud = points(message)
    answer.directions = np.stack([cloud[name].astype(np.float64) for name in ("x", "y", "z")], axis=-1)
    answer.roles = cloud["role"].astype(np.uint32)


def _take_heading(answer: Answer, message: Any) -> None:
    pose = message.pose.pose
    variance = np.asarray(message.pose.covariance, np.float64).reshape(6, 6).diagonal()
    if variance[5] < UNKNOWN:
        answer.yaw, answer.yaw_sd = yaw_of(pose.orientation), math.sqrt(variance[5])
    if variance[1] < UNKNOWN:
        answer.offset, answer.offset_sd = float(pose.position.y), math.sqrt(variance[1])


def _take_steering(answer: Answer, message: Any) -> None:
    answer.speed, answer.turn_rate = float(message.twist.linear.x), float(message.twist.angular.z)


_GATHER = {
    "lines": _take_lines,
    "vanishing_points": _take_vanishing_points,
    "heading": _take_heading,
    "steering": _take_steering,
}


def labels_of(
    lines: Array, directions: Array, camera: Camera, within: float = math.radians(2.0)
) -> NDArray[np.intp]:
    """Say to which vanishing point each line points.

    Args:
        lines: (N, 4) endpoints, px of the rectified picture.
        directions: (M, 3) unit directions of the vanishing points, optical frame.
        camera: the rectified camera.
        within: largest angle between a line and the direction from its middle to the vanishing point, rad.

    Returns:
        (N,) index of the nearest vanishing point, -1 for clutter.
    """
    labels = np.full(len(lines), -1)
    if not len(lines) or not len(directions):
        return labels
    along = lines[:, 2:] - lines[:, :2]
    middle = np.column_stack([(lines[:, :2] + lines[:, 2:]) / 2, np.ones(len(lines))])
    homogeneous = directions @ camera.matrix.T  # (M, 3) image points, also at infinity
    towards = homogeneous[None, :, :2] - homogeneous[None, :, 2:] * middle[:, None, :2]  # (N, M, 2)
    cross = np.abs(along[:, None, 0] * towards[..., 1] - along[:, None, 1] * towards[..., 0])
    dot = np.abs(np.einsum("ni,nmi->nm", along, towards))
    angle = np.arctan2(cross, dot)
    nearest = np.argmin(angle, axis=1)
    fits = angle[np.arange(len(lines)), nearest] <= within
    labels[fits] = nearest[fits]
    return labels
