# SPDX-License-Identifier: Apache-2.0
"""Worlds with a known truth: they stand in for the camera and the vehicle nobody has at hand."""

from __future__ import annotations

from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.record import WORLDS, Recording, record, record_world
from robot_vision.simulation.renderer import Renderer, optical_pose
from robot_vision.simulation.world import standard_camera

__all__ = [
    "WORLDS",
    "Recording",
    "Renderer",
    "SimulationError",
    "optical_pose",
    "record",
    "record_world",
    "standard_camera",
]
