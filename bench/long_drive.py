# SPDX-License-Identifier: Apache-2.0
"""A drive of kilometres: whether the mapper takes the same time and memory for a picture at its end as at its start."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.report import Cell, Row, at_least, at_most
from robot_vision.geometry import Camera
from robot_vision.mapping import PlanViewMapper, Pose
from robot_vision.perception import LineSegments

PERIOD_S = 1.0 / 15.0
SETTLED = 0.1
"""Share of the drive after which time and memory are those of a mapper that has begun."""


@dataclass(frozen=True)
class Look:
    """A picture of a drive with what belongs to it."""

    picture: NDArray[np.uint8]
    lines: LineSegments
    points: Any
    pose: Pose


def long_drive(looks: Sequence[Look], camera: Camera, pictures: int) -> list[Row]:
    """Drive the stretch of these looks over and over, each time where the last one ended.

    Args:
        looks: of a straight stretch along the x axis of odom.
        camera: of the pictures.
        pictures: in all.
    """
    mapper, spent = PlanViewMapper(), np.empty(pictures)
    stretch = looks[-1].pose.x - looks[0].pose.x
    begun, mapped = 0.0, 0
    for number in range(pictures):
        lap, place = divmod(number, len(looks))
        look = looks[place]
        pose = look.pose._replace(x=look.pose.x + lap * stretch)
        began = time.process_time()
        estimate = mapper.update(look.picture, look.lines, look.points, camera, PERIOD_S * number, pose)
        mapped += estimate.mapped
        spent[number] = time.process_time() - began
        if number == int(SETTLED * pictures):
            begun = _resident_mb()
    tenth = pictures // 10
    first, last = (1e3 * float(np.median(part)) for part in (spent[:tenth], spent[-tenth:]))
    way = stretch * pictures / len(looks)
    return [
        Row(f"{pictures} pictures, {way:.0f} m: a picture in the first tenth", "ms", [Cell(first)], 2),
        Row("pictures that went into the map", "%", [Cell(100.0 * mapped / pictures, at_least(90.0))]),
        Row("a picture in the last tenth", "ms", [Cell(last, at_most(1.1 * first))], 2),
        Row("memory grown by after the first tenth", "MB", [Cell(_resident_mb() - begun, at_most(5.0))]),
        Row("memory of the map at the end", "MB", [Cell(mapper.map.nbytes / 1e6, at_most(16.0))]),
    ]


def _resident_mb() -> float:
    """Memory that this process holds."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
