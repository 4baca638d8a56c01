# SPDX-License-Identifier: Apache-2.0
"""Reads camera calibrations in the forms people have them: ROS yaml, KITTI text, bare numbers."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from robot_vision.bags.errors import BagError
from robot_vision.geometry import Camera

Calibration = Camera | str | os.PathLike[str] | Sequence[float]


def read_calibration(calibration: Calibration, width: int, height: int) -> Camera:
    """Read a calibration for pictures of `width` x `height` pixels.

    Args:
        calibration: a `Camera`; a file, either the yaml that camera_calibration writes or a KITTI
            `calib.txt`; or the numbers fx, fy, cx, cy and up to 8 distortion coefficients of plumb_bob (5)
            or rational_polynomial (8), in pixels, as a sequence or as text with commas.
        width: of the pictures, px.
        height: of the pictures, px.

    In a KITTI file the FIRST projection (`P0`) is taken: P0 belongs to the left grey camera, which took
    `image_l` (`image_0`). The second one has the same focal length and centre but a fourth column of -fx
    times the baseline: it maps points given in the frame of the left camera into the right picture, so it
    would put the camera half a metre aside.

    Raises:
        BagError: file missing or not understood, or made for pictures of another size.
    """
    try:
        camera = _camera(calibration, width, height)
    except BagError:
        raise
    except ValueError as error:  # CameraError: what stands there is no camera
        raise BagError(f"calibration {_name(calibration)}: {error}") from error
    if (camera.width, camera.height) != (width, height):
        raise BagError(
            f"calibration {_name(calibration)} is for {camera.width} x {camera.height} pixels, "
            f"but the pictures have {width} x {height}"
        )
    return camera


def _camera(calibration: Calibration, width: int, height: int) -> Camera:
    if isinstance(calibration, Camera):
        return calibration
    if isinstance(calibration, str | os.PathLike):
        path = Path(calibration)
        if path.is_file():
            return _from_file(path, width, height)
        numbers = _numbers(str(calibration).replace(",", " "))
        if numbers is None:
            raise BagError(f"there is no calibration file {path}")
        return _from_numbers(numbers, width, height)
    return _from_numbers([float(number) for number in calibration], width, height)


def _from_file(path: Path, width: int, height: int) -> Camera:
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise BagError(f"calibration {path} cannot be read: {error}") from error
    if "camera_matrix" in text:
        return _from_yaml(path, text)
    for line in text.splitlines():
        label, _, rest = line.rpartition(":")
        numbers = _numbers(rest)
        if numbers is not None and len(numbers) == 12 and label.strip() in ("", "P0"):
            return _from_projection(path, numbers, width, height)
    raise BagError(f"calibration {path} is neither a yaml of camera_calibration nor a KITTI calib.txt")


def _from_projection(path: Path, numbers: Sequence[float], width: int, height: int) -> Camera:
    projection = np.reshape(numbers, (3, 4))
    if abs(projection[0, 1]) > 1e-9 or not np.allclose(projection[2], (0, 0, 1, 0)):
        raise BagError(f"calibration {path}: the first projection is not that of a rectified camera")
    return Camera(
        fx=float(projection[0, 0]),
        fy=float(projection[1, 1]),
        cx=float(projection[0, 2]),
        cy=float(projection[1, 2]),
        width=width,
        height=height,
    )


def _from_yaml(path: Path, text: str) -> Camera:
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        found: Any = YAML(typ="safe").load(text)
        matrix = _matrix(found, "camera_matrix", 9)
        info = SimpleNamespace(
            width=_size(found, "image_width"),
            height=_size(found, "image_height"),
            distortion_model=str(found.get("distortion_model", "plumb_bob")),
            k=matrix,
            d=_matrix(found, "distortion_coefficients", None) if "distortion_coefficients" in found else [],
            r=_matrix(found, "rectification_matrix", 9)
            if "rectification_matrix" in found
            else np.eye(3).ravel().tolist(),
            p=_matrix(found, "projection_matrix", 12)
            if "projection_matrix" in found
            else np.c_[np.reshape(matrix, (3, 3)), np.zeros(3)].ravel().tolist(),
        )
    except YAMLError as error:
        raise BagError(f"calibration {path} is not valid yaml: {str(error).splitlines()[0]}") from error
    except KeyError as error:
        raise BagError(f"calibration {path} lacks {error.args[0]}") from error
    except (TypeError, AttributeError) as error:
        raise BagError(f"calibration {path} is not in the form camera_calibration writes: {error}") from error
    return Camera.from_camera_info(info)


def _size(found: Any, key: str) -> int:
    if not isinstance(found[key], int):
        raise ValueError(f"{key} must be a whole number of pixels, not {found[key]!r}")
    return int(found[key])


def _matrix(found: Any, key: str, count: int | None) -> list[float]:
    try:
        data = [float(number) for number in found[key]["data"]]
    except (TypeError, ValueError, KeyError) as error:
        if key not in found:
            raise
        raise ValueError(f"{key} must hold its numbers under data, not {found[key]!r}") from error
    if count is not None and len(data) != count:
        raise ValueError(f"{key} has {len(data)} numbers, not {count}")
    return data


def _from_numbers(numbers: Sequence[float], width: int, height: int) -> Camera:
    if not 4 <= len(numbers) <= 12:
        raise BagError(f"a calibration is fx, fy, cx, cy and up to 8 more numbers, not {len(numbers)} in all")
    fx, fy, cx, cy = numbers[:4]
    distortion = tuple(numbers[4:])
    return Camera(
        fx=fx,
        fy=fy,
        cx=cx,
        cy=cy,
        width=width,
        height=height,
        distortion=distortion,
        distortion_model="rational_polynomial" if len(distortion) > 5 else "plumb_bob",
    )


def _numbers(text: str) -> list[float] | None:
    try:
        return [float(word) for word in text.split()]
    except ValueError:
        return None


def _name(calibration: Calibration) -> str:
    return str(calibration) if isinstance(calibration, str | os.PathLike) else "as given"
