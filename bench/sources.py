# SPDX-License-Identifier: Apache-2.0
"""Finds the sets of real pictures, which are not part of the project, and reads their truth."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera

ROOT = Path(__file__).resolve().parents[1]
VARIABLE = "ROBOT_VISION_DATA"
CORRIDOR = ROOT / "bags" / "corridor.mcap"


class MissingSetError(FileNotFoundError):
    """A set of real pictures is not on this machine; the text names it and where it was looked for."""


def data_set(name: str, needed: str) -> Path:
    """Return the folder of a set of real pictures.

    Args:
        name: of the folder, such as `york_urban`.
        needed: a file or folder in it without which it is of no use.

    Raises:
        MissingSetError: it is not there.
    """
    folder = Path(os.environ.get(VARIABLE) or ROOT.parent / "shared" / "data") / name
    if not (folder / needed).exists():
        raise MissingSetError(
            f"the pictures {name} are not here: no {folder / needed} ({VARIABLE} names the folder)"
        )
    return folder


@dataclass(frozen=True)
class YorkPicture:
    """A picture of the York Urban database.

    Attributes:
        name: of the picture.
        path: of its file.
        directions: (3, 3) true vanishing points, unit rows in the optical frame.
        orthogonal: (3, 3) the same made orthogonal.
    """

    name: str
    path: Path
    directions: NDArray[np.float64]
    orthogonal: NDArray[np.float64]

    def gray(self) -> NDArray[np.uint8]:
        """Read it, uint8 (H, W)."""
        return read_picture(self.path, cv2.IMREAD_GRAYSCALE)


def york_urban() -> tuple[Camera, list[YorkPicture]]:
    """Return the camera and the pictures of York Urban, in order of name.

    Raises:
        MissingSetError: they are not there.
    """
    folder = data_set("york_urban", "ground_truth.json")
    truth = json.loads((folder / "ground_truth.json").read_text(encoding="utf-8"))
    pictures = [
        YorkPicture(
            name,
            folder / "images" / f"{name}.jpg",
            _unit_rows(entry["vps"]),
            _unit_rows(entry["vps_orthogonal"]),
        )
        for name, entry in sorted(truth["images"].items())
    ]
    return Camera(**truth["camera"]), pictures


@dataclass(frozen=True)
class CropPicture:
    """A picture of the Crop Row Benchmark Dataset.

    Attributes:
        path: of its file.
        rows: (N, 2) for the last N image rows: column of the middle crop row, px from the middle of the picture, and
            distance of the rows, px.
    """

    path: Path
    rows: NDArray[np.float64]

    def colour(self) -> NDArray[np.uint8]:
        """Read it, uint8 (H, W, 3) BGR."""
        return read_picture(self.path, cv2.IMREAD_COLOR)


def crop_rows() -> list[CropPicture]:
    """Return the pictures of crop rows, in order of name.

    Raises:
        MissingSetError: they are not there.
    """
    folder = data_set("crbd", "ground_truth")
    truths = sorted((folder / "ground_truth").glob("*.crp"))
    return [CropPicture(folder / "images" / f"{path.stem}.jpg", np.loadtxt(path)) for path in truths]


def kitti_straight() -> Path:
    """Return the folder of the straight road of KITTI: `image_l`, `calib.txt`, `poses.txt`.

    Raises:
        MissingSetError: it is not there.
    """
    return data_set("kitti_straight", "poses.txt")


def read_picture(path: Path, mode: int) -> NDArray[np.uint8]:
    """Read a picture file in one of OpenCV's `IMREAD_` modes.

    Raises:
        MissingSetError: the file is not there or no picture.
    """
    pixels = cv2.imread(str(path), mode)
    if pixels is None:
        raise MissingSetError(f"{path} cannot be read as a picture")
    return np.asarray(pixels, np.uint8)


def forth_and_back(count: int, wanted: int) -> Iterator[int]:
    """Yield `wanted` indices of a sequence, forth and back, so that neighbours stay neighbours."""
    period = max(1, 2 * (count - 1))
    for step in range(wanted):
        place = step % period
        yield place if place < count else period - place


def _unit_rows(rows: Any) -> NDArray[np.float64]:
    directions = np.asarray(rows, np.float64)
    return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))
