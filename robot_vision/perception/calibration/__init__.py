# SPDX-License-Identifier: Apache-2.0
"""Calibration: what the pictures of a drive tell of the camera that took them."""

from robot_vision.perception.calibration.calibrator import CameraCalibrator
from robot_vision.perception.calibration.findings import (
    CalibrationError,
    CameraCalibration,
    Finding,
    KnownLengths,
)
from robot_vision.perception.calibration.rows import Plants, green_of

__all__ = [
    "CalibrationError",
    "CameraCalibration",
    "CameraCalibrator",
    "Finding",
    "KnownLengths",
    "Plants",
    "green_of",
]
