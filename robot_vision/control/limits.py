# SPDX-License-Identifier: Apache-2.0
"""What a vehicle may be asked for: a command, and the limits that keep it within what the vehicle can do."""

from __future__ import annotations

from dataclasses import dataclass, field

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


def way_to_stop(speed: float, deceleration: float) -> float:
    """Distance (m) within which a vehicle comes to rest from a speed (m/s), braking evenly (m/s^2)."""
    return 0.5 * speed**2 / deceleration


@dataclass
class CommandClock:
    """Time between commands, by which they may differ.

    Args:
        short: step taken for the first command, and after a gap or a jump of the clock, s.
        longest: step beyond which it is a gap, s.
    """

    short: float = 0.05
    longest: float = 0.25
    _last: float | None = field(default=None, init=False, repr=False, compare=False)

    def reset(self) -> None:
        """Let the next command be the first."""
        self._last = None

    def step(self, stamp_s: float) -> float:
        """Seconds since the last command, which this one, at `stamp_s`, becomes."""
        seconds = self.short if self._last is None else stamp_s - self._last
        self._last = stamp_s
        return seconds if 0.0 <= seconds <= self.longest else self.short
