# SPDX-License-Identifier: Apache-2.0
"""From where the robot is in its lane to what the wheels shall do."""

from robot_vision.control.corridor import CorridorSteering
from robot_vision.control.limits import Steering
from robot_vision.control.pursuit import PathPursuit

__all__ = ["CorridorSteering", "PathPursuit", "Steering"]
