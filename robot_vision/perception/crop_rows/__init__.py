# SPDX-License-Identifier: Apache-2.0
"""Crop rows: found in one picture, placed on the ground, followed from picture to picture."""

from robot_vision.perception.crop_rows.detector import CropRowDetector
from robot_vision.perception.crop_rows.pattern import RowPattern

__all__ = ["CropRowDetector", "RowPattern"]
