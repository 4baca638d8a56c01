# SPDX-License-Identifier: Apache-2.0
"""Writes what is known of a camera in the two forms that ROS reads: the yaml of camera_calibration, and parameters."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from robot_vision.bags.errors import BagError
from robot_vision.geometry import Camera


def write_camera_yaml(
    path: str | os.PathLike[str], camera: Camera, name: str = "camera", remarks: Sequence[str] = ()
) -> None:
    """Write the raw camera as camera_calibration and camera_info_manager have it; `read_calibration` reads it.

    Args:
        path: of the file; an old one is replaced.
        camera: with its lens.
        name: of the camera, as the driver is told.
        remarks: lines of comment that open the file.

    Raises:
        BagError: the file cannot be written.
    """
    info = camera.camera_info()
    _write(
        path,
        {
            "image_width": info["width"],
            "image_height": info["height"],
            "camera_name": name,
            "camera_matrix": _matrix(info["k"], 3),
            "distortion_model": info["distortion_model"],
            "distortion_coefficients": _matrix(info["d"], 1),
            "rectification_matrix": _matrix(info["r"], 3),
            "projection_matrix": _matrix(info["p"], 3),
        },
        remarks,
    )


def write_parameters_yaml(
    path: str | os.PathLike[str], parameters: Mapping[str, float], remarks: Sequence[str] = ()
) -> None:
    """Write parameters for all nodes, to be given as `--ros-args --params-file`; those without one pass it by.

    Args:
        path: of the file; an old one is replaced.
        parameters: value by name, at least one.
        remarks: lines of comment that open the file.

    Raises:
        BagError: the file cannot be written.
    """
    values = {name: float(value) for name, value in parameters.items()}
    _write(path, {"/**": {"ros__parameters": values}}, remarks)


def _matrix(values: Sequence[float], rows: int) -> dict[str, Any]:
    from ruamel.yaml.comments import CommentedSeq

    data = CommentedSeq(float(value) for value in np.ravel(values))
    data.fa.set_flow_style()
    return {"rows": rows, "cols": len(data) // rows, "data": data}


def _write(path: str | os.PathLike[str], content: dict[str, Any], remarks: Sequence[str]) -> None:
    from ruamel.yaml import YAML

    yaml = YAML()
    yaml.width = 120
    try:
        with Path(path).open("w", encoding="utf-8") as stream:
            stream.writelines(f"# {remark}\n" for remark in remarks)
            yaml.dump(content, stream)
    except OSError as error:
        raise BagError(f"cannot write {path}: {error.strerror}") from error
