# SPDX-License-Identifier: Apache-2.0
"""Where a camera on a pan-tilt head should look next: where it would learn most of the way."""

from robot_vision.perception.gaze.planner import Gaze, GazePlanner

__all__ = ["Gaze", "GazePlanner"]
