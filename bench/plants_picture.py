# SPDX-License-Identifier: Apache-2.0
"""Draws docs/plants.png: `python -m bench.plants_picture docs/plants.png`. Plants and jets to come in two fields."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.row_drives import moved, recorded_pictures
from robot_vision.mapping.plant_map import PlantMap
from robot_vision.perception.crop_rows.overlay import draw_rows
from robot_vision.perception.crop_rows.tracker import RowTracker
from robot_vision.planning.spray_overlay import draw_spray
from robot_vision.planning.sprayer import SprayPlanner

SEED, AT_S, SPACING_M = 101, 3.0, 0.5
SHOWN = ("seedlings", "cabbages")
STEP = 8
"""Between the grey levels of the file, which keeps it small."""


def draw(output: Path) -> None:
    """Drive into two fields, and draw the last picture of each."""
    pair = np.hstack([_last(crop) for crop in SHOWN])
    if not cv2.imwrite(str(output), _fewer(pair)):
        raise OSError(f"{output} cannot be written")


def _last(crop: str) -> NDArray[np.uint8]:
    world, _, pictures = recorded_pictures({"set": crop}, SEED, AT_S)
    tracker, plant_map, planner = RowTracker(SPACING_M), PlantMap(), SprayPlanner()
    for picture, _, since in pictures:
        motion = moved(since)
        rows = tracker.update(picture, world.camera, motion)
        plants = plant_map.update(picture, world.camera, rows, SPACING_M, motion)
        blind = "" if rows.lane else "no row"
        spray = planner.plan(plants, motion.speed, blind, plant_map.leaves)
    drawn = draw_rows(picture.copy(), world.camera, rows)
    return np.asarray(draw_spray(drawn, world.camera, plant_map.lean_seen, plants, spray, planner), np.uint8)


def _fewer(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The picture with steps of grey levels, which a PNG stores in less."""
    return np.asarray(picture // STEP * STEP + STEP // 2, np.uint8)


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
