# SPDX-License-Identifier: Apache-2.0
"""Where the pictures of a new bag come from: files, a folder or a video, one after the other."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.bags.errors import BagError

PICTURE_SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".bmp", ".pgm", ".ppm", ".tif", ".tiff", ".webp"})
VIDEO_SUFFIXES = frozenset(
    {".mp4", ".avi", ".mkv", ".mov", ".m4v", ".webm", ".mjpeg", ".mpg", ".mpeg", ".wmv"}
)
Source = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]


@dataclass(frozen=True)
class SourcePicture:
    """One picture and its place in the source; without `pixels` it could not be read, `trouble` says why."""

    number: int
    name: str
    pixels: NDArray[Any] | None
    file: bytes | None = None
    trouble: str = ""


class PictureSource(Protocol):
    """A sequence of pictures."""

    count: int | None  # None: not known before the end
    rate_hz: float | None  # None: the source has no rate of its own

    def __iter__(self) -> Iterator[SourcePicture]:
        """Yield the pictures in order, unreadable ones as well."""
        ...


def open_pictures(source: Source) -> PictureSource:
    """Open a folder, a picture, a list of pictures or a video.

    Raises:
        BagError: nothing there, or nothing that could be a picture.
    """
    if not isinstance(source, str | os.PathLike):
        files = [Path(item) for item in source]
        if not files:
            raise BagError("the list of pictures is empty")
        return PictureFiles(files)
    path = Path(source)
    if not path.exists():
        raise BagError(f"there is no {path}")
    if path.is_dir():
        return PictureFiles(pictures_in(path))
    if path.suffix.lower() in PICTURE_SUFFIXES:
        return PictureFiles([path])
    return Video(path)


def pictures_in(folder: Path) -> list[Path]:
    """List the pictures of a folder in natural order: `2.png` comes before `10.png`.

    Raises:
        BagError: there is none.
    """
    files = [item for item in folder.iterdir() if item.suffix.lower() in PICTURE_SUFFIXES and item.is_file()]
    if not files:
        raise BagError(f"there is no picture in the folder {folder}")
    return sorted(files, key=lambda item: natural_key(item.name))


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Return a sort key under which numbers in a name count as numbers."""
    parts = re.split(r"(\d+)", name)
    return tuple((1, int(part), part) if part.isdigit() else (0, 0, part.lower()) for part in parts)


class PictureFiles:
    """Picture files; a grey file gives a grey picture."""

    rate_hz: float | None = None

    def __init__(self, files: Sequence[Path]) -> None:
        self.files = list(files)
        self.count: int | None = len(self.files)

    def __iter__(self) -> Iterator[SourcePicture]:
        from robot_vision.perception.picture import PictureError, picture_from_compressed

        for number, path in enumerate(self.files):
            try:
                data = path.read_bytes()
                yield SourcePicture(number, str(path), picture_from_compressed(data), data)
            except OSError as error:
                yield SourcePicture(number, str(path), None, trouble=error.strerror or str(error))
            except PictureError as error:
                yield SourcePicture(number, str(path), None, trouble=str(error))


class Video:
    """A video file, read through OpenCV."""

    def __init__(self, path: Path) -> None:
        self.path = path
        if path.suffix.lower() not in VIDEO_SUFFIXES:
            known = ", ".join(sorted(PICTURE_SUFFIXES | VIDEO_SUFFIXES))
            raise BagError(f"{path} is neither a picture nor a video (known endings: {known})")
        capture = cv2.VideoCapture(str(path))
        try:
            if not capture.isOpened():
                raise BagError(f"{path} cannot be opened as a video")
            rate, count = capture.get(cv2.CAP_PROP_FPS), capture.get(cv2.CAP_PROP_FRAME_COUNT)
        finally:
            capture.release()
        self.rate_hz: float | None = float(rate) if np.isfinite(rate) and 0 < rate <= 1000 else None
        self.count: int | None = int(count) if np.isfinite(count) and 0 < count < 1e9 else None

    def __iter__(self) -> Iterator[SourcePicture]:
        capture = cv2.VideoCapture(str(self.path))
        try:
            number = 0
            while True:
                there, pixels = capture.read()
                if not there:
                    break
                yield SourcePicture(number, f"{self.path} frame {number}", np.asarray(pixels))
                number += 1
        finally:
            capture.release()
        if number == 0:
            raise BagError(f"{self.path} holds no picture that can be decoded")
