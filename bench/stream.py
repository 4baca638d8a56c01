# SPDX-License-Identifier: Apache-2.0
"""Makes a bag of raw pictures as a camera would send them, to measure latency with."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.sources import CORRIDOR, MissingSetError, forth_and_back, kitti_straight, read_picture, york_urban
from robot_vision.bags import BagReader, BagWriter, decode, messages
from robot_vision.bags.calibration import read_calibration
from robot_vision.bags.make import OPTICAL_FRAME, START_NS
from robot_vision.geometry import Camera
from robot_vision.simulation import standard_camera

WIDTH, HEIGHT = 640, 480
RATE_HZ = 30.0
KITTI_HEIGHT_M = 1.65  # of the camera over the road (Geiger et al. 2013)

Pixels = NDArray[np.uint8]
Stream = Iterator[tuple[Camera, Pixels]]


def write_stream(path: Path, count: int) -> str:
    """Write a bag of raw 640x480 bgr8 pictures at 30 Hz, and have it on the disk before this returns.

    Half of them is a real road, forth and back, half are real pictures of a town, each held for a fifth of a
    second; where these are not on the machine all come from the recorded corridor.

    Args:
        path: the bag.
        count: of pictures.

    Returns:
        in words what they show.
    """
    try:
        parts = [_road(count // 2), _town(count - count // 2)]
        shown = "KITTI road forth and back, then York Urban, each still for 6 pictures"
    except MissingSetError as missing:
        parts, shown = [_corridor(count)], f"the recorded corridor forth and back ({missing})"
    with BagWriter(path) as bag:
        number = 0
        for part in parts:
            for camera, pixels in part:
                stamp = START_NS + round(number * 1e9 / RATE_HZ)
                info = messages.camera_info(stamp, OPTICAL_FRAME, camera)
                bag.write("/camera_info", "sensor_msgs/msg/CameraInfo", stamp, info)
                bag.write(
                    "/image", "sensor_msgs/msg/Image", stamp, messages.image(stamp, OPTICAL_FRAME, pixels)
                )
                number += 1
    with open(path, "rb") as file:
        os.fsync(file)
    return shown


def _road(count: int) -> Stream:
    """The road within the largest window of 4:3 around the principal point."""
    folder = kitti_straight()
    files = sorted((folder / "image_l").glob("*.png"))
    return _road_pictures(folder, files, count)


def _road_pictures(folder: Path, files: list[Path], count: int) -> Stream:
    pictures = [read_picture(file, cv2.IMREAD_COLOR) for file in files]
    height, width = pictures[0].shape[:2]
    whole = read_calibration(folder / "calib.txt", width, height)
    window = round(height * WIDTH / HEIGHT)
    left = min(max(0, round(whole.cx - window / 2)), width - window)
    camera = replace(whole.cropped(left, 0, window, height).resized(WIDTH, HEIGHT), height_m=KITTI_HEIGHT_M)
    for place in forth_and_back(len(pictures), count):
        yield camera, _resized(pictures[place][:, left : left + window])


def _town(count: int) -> Stream:
    camera, pictures = york_urban()
    return _town_pictures(camera, [picture.path for picture in pictures], count)


def _town_pictures(camera: Camera, files: list[Path], count: int) -> Stream:
    held = max(1, -(-count // len(files)))
    for number in range(count):
        if number % held == 0:
            pixels = _resized(read_picture(files[number // held], cv2.IMREAD_COLOR))
        yield camera.resized(WIDTH, HEIGHT), pixels


def _corridor(count: int) -> Stream:
    compressed = list(BagReader(CORRIDOR).messages(["image/compressed"]))
    for place in forth_and_back(len(compressed), count):
        message = compressed[place]
        pixels = messages.picture(decode(message.cdr, message.type_name))
        yield standard_camera(), _resized(np.asarray(pixels, np.uint8))


def _resized(pixels: Pixels) -> Pixels:
    if pixels.shape[:2] == (HEIGHT, WIDTH):
        return np.ascontiguousarray(pixels)
    return np.asarray(cv2.resize(pixels, (WIDTH, HEIGHT), interpolation=cv2.INTER_LINEAR), np.uint8)
