# SPDX-License-Identifier: Apache-2.0
"""Where a pan-tilt head looked when a picture was taken, from its joints that are told at a rhythm of their own."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass


@dataclass(frozen=True)
class HeadAngles:
    """Angles of the joints at one moment.

    Attributes:
        stamp_s: of the moment, s.
        pan: rad, left positive.
        tilt: rad, down positive.
    """

    stamp_s: float
    pan: float
    tilt: float


class HeadHistory:
    """Keeps what the joints of a head said, and tells how it stood at the time of a picture.

    Args:
        longest: a picture farther than this from the nearest word of the joints is not told of, s. So long a head is
            taken to turn on as it did.
        most: moments kept.
    """

    def __init__(self, longest: float = 0.1, most: int = 500) -> None:
        self._longest = longest
        self._moments: deque[HeadAngles] = deque(maxlen=most)

    @property
    def newest_s(self) -> float | None:
        """Stamp of the newest word, s; None before the first."""
        return self._moments[-1].stamp_s if self._moments else None

    def add(self, angles: HeadAngles) -> None:
        """Take in a moment; a stamp that goes back forgets all before."""
        if self._moments and angles.stamp_s <= self._moments[-1].stamp_s:
            self._moments.clear()
        self._moments.append(angles)

    def clear(self) -> None:
        """Forget all."""
        self._moments.clear()

    def at(self, stamp_s: float) -> HeadAngles | None:
        """How the head stood: between two moments by proportion, beyond them by the same; None when too far off."""
        moments = self._moments
        if not moments or min(abs(m.stamp_s - stamp_s) for m in moments) > self._longest:
            return None
        later = next((k for k, m in enumerate(moments) if m.stamp_s >= stamp_s), len(moments) - 1)
        after, before = moments[later], moments[max(later - 1, 0)]
        apart = after.stamp_s - before.stamp_s
        if not 0.0 < apart <= 2.0 * self._longest:
            nearest = min((before, after), key=lambda m: abs(m.stamp_s - stamp_s))
            return HeadAngles(stamp_s, nearest.pan, nearest.tilt)
        share = (stamp_s - before.stamp_s) / apart
        return HeadAngles(
            stamp_s,
            before.pan + share * (after.pan - before.pan),
            before.tilt + share * (after.tilt - before.tilt),
        )
