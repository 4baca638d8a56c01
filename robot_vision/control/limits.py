# SPDX-License-Identifier: Apache-2.0
"""What a vehicle may be asked for: a command, and the limits that keep it within what the vehicle can do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Steering:
    """A command to the vehicle.

    Attributes:
        speed: forward, m/s.
        turn_rate: counter-clockwise, rad/s.
        reason: in plain words why it is slower than it would like to be; empty on a free way.
    """

    speed: float
    turn_rate: float
    reason: str = ""


def approach(value: float, target: float, most: float) -> float:
    """`value` moved towards `target` by at most `most`."""
    return float(np.clip(target, value - most, value + most))


def speed_to_stop_within(distance: float, deceleration: float) -> float:
    """Highest speed (m/s) from which a vehicle comes to rest within a distance (m), braking evenly (m/s^2)."""
    return float(np.sqrt(2.0 * deceleration * max(0.0, distance)))
