# SPDX-License-Identifier: Apache-2.0
"""The command `robot-vision calibrate`: from a recorded drive to calibration files and a report a person can judge."""

from __future__ import annotations

from robot_vision.calibrate.run import Asked, run_calibration

__all__ = ["Asked", "run_calibration"]
