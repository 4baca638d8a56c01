# SPDX-License-Identifier: Apache-2.0
"""Names of the chain from picture to steering, and what a recorded bag holds of a topic."""

from __future__ import annotations

from pathlib import Path

from robot_vision.bags import BagReader

LINES, VANISHING, STEERING = "line_detector", "vp_estimator", "corridor_steering"
MAPPER = "plan_view_mapper"
#: Pictures are in the bag replayed already.
PICTURES = ("lines/overlay", "image", "image/compressed")


def said(bag: Path, topic: str) -> list[bytes]:
    """Return what a bag holds of a topic, as bytes (CDR)."""
    return [message.cdr for message in BagReader(bag).messages([topic])]
