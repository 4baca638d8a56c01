# SPDX-License-Identifier: Apache-2.0
"""How fast the robot drove and turned between two pictures, from odometry that comes at a rhythm of its own."""

from __future__ import annotations

from collections import deque


class RateHistory:
    """Keeps rates (of turn, or speeds) with their stamps and tells their mean over the time between two pictures.

    Args:
        longest: odometry older than this before a picture says nothing about it, s.
        most: rates kept.
    """

    def __init__(self, longest: float = 0.5, most: int = 1000) -> None:
        self._longest = longest
        self._rates: deque[tuple[float, float]] = deque(maxlen=most)

    def add(self, stamp_s: float, rate: float) -> None:
        """Take in a rate, in any unit; a stamp that goes back forgets all before."""
        if self._rates and stamp_s < self._rates[-1][0]:
            self._rates.clear()
        self._rates.append((stamp_s, rate))

    def clear(self) -> None:
        """Forget all."""
        self._rates.clear()

    def mean(self, since_s: float, until_s: float) -> float | None:
        """Mean rate from one picture to the next; None when odometry is missing or too old.

        Each rate holds from the stamp before it to its own, the last one until the picture.
        """
        total = covered = 0.0
        before = since_s
        newest = None
        for stamp, rate in self._rates:
            if stamp > until_s:
                break
            newest = (stamp, rate)
            if stamp > before:
                total += rate * (stamp - before)
                covered += stamp - before
                before = stamp
        if newest is None or until_s - newest[0] > self._longest:
            return None
        total += newest[1] * (until_s - before)
        covered += until_s - before
        return total / covered if covered > 0.0 else newest[1]


class MotionHistory:
    """Keeps speeds and turn rates with their stamps, as two `RateHistory`."""

    def __init__(self) -> None:
        self._speeds = RateHistory()
        self._turn_rates = RateHistory()

    def add(self, stamp_s: float, speed: float, turn_rate: float) -> None:
        """Take in a speed (m/s) and a turn rate (rad/s, counter-clockwise)."""
        self._speeds.add(stamp_s, speed)
        self._turn_rates.add(stamp_s, turn_rate)

    def clear(self) -> None:
        """Forget all."""
        self._speeds.clear()
        self._turn_rates.clear()

    def mean(self, since_s: float, until_s: float) -> tuple[float | None, float | None]:
        """Mean speed and turn rate from one picture to the next; None when odometry is missing or too old."""
        return self._speeds.mean(since_s, until_s), self._turn_rates.mean(since_s, until_s)
