# SPDX-License-Identifier: Apache-2.0
"""One look into a world: the picture its recording would have at a moment, without the noise, for people to see."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np

from robot_vision.bags.writer import PARTIAL_SUFFIX
from robot_vision.simulation.asked import Value
from robot_vision.simulation.drive import STEPS_PER_SECOND
from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.record import asked_world, drive_of
from robot_vision.simulation.renderer import Renderer
from robot_vision.simulation.sensors import CameraSensor

LARGEST = 400_000
"""Bytes: pictures for people are kept in the repository."""


def snapshot(
    world: str,
    output: str | os.PathLike[str],
    seed: int = 0,
    seconds: float = 4.0,
    parameters: Mapping[str, Value] | None = None,
) -> Path:
    """Write the picture (PNG) that a recording has after so many seconds.

    Fine textures do not compress: grey levels are joined by twos, fours or eights until the file is small.

    Args:
        world: one of WORLDS.
        output: the file to write.
        seed: of the world and the drive.
        seconds: from the start of the drive.
        parameters: as for `record`.

    Raises:
        SimulationError: as for `record`, or the file cannot be written.
    """
    made, _ = asked_world(world, seed, parameters or {})
    motion = drive_of(made, seconds, seed)
    state = motion.state(round(seconds * STEPS_PER_SECOND))
    light = Renderer(made.scene, made.camera).render(state.camera_pose(made.camera))
    picture = CameraSensor(seed, noise=0.0, dark_noise=0.0).capture(light)
    for step in (1, 2, 4, 8):
        joined = (picture // step * step + (step - 1) // 2).astype(np.uint8)
        _, data = cv2.imencode(".png", joined, [cv2.IMWRITE_PNG_COMPRESSION, 9])
        if len(data) <= LARGEST:
            break
    path = Path(output)
    if path.exists() and not path.is_file():
        raise SimulationError(f"cannot write {path}: it is there, and is no file")
    growing = path.with_name(path.name + PARTIAL_SUFFIX)
    try:
        growing.write_bytes(data.tobytes())
        os.replace(growing, path)
    except OSError as error:
        growing.unlink(missing_ok=True)
        raise SimulationError(f"cannot write {path}: {error.strerror}") from error
    return path
