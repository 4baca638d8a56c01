# SPDX-License-Identifier: Apache-2.0
"""How a joint of a pan-tilt head stood when a picture was taken, from words that come at a rhythm of their own."""

from __future__ import annotations

from bisect import bisect_left, insort
from typing import NamedTuple


class _Word(NamedTuple):
    """What a joint said: stamp (s) and angle (rad)."""

    stamp_s: float
    angle: float


class JointHistory:
    """Keeps what one joint said, and tells how it stood at the time of a picture.

    Args:
        longest: a picture farther than this from the nearest word is not told of, s. So long a joint is taken to turn
            on as it did.
        most: words kept.
    """

    def __init__(self, longest: float = 0.1, most: int = 500) -> None:
        self._longest = longest
        self._most = most
        self._words: list[_Word] = []

    @property
    def newest_s(self) -> float | None:
        """Stamp of the newest word, s; None before the first."""
        return self._words[-1].stamp_s if self._words else None

    def add(self, stamp_s: float, angle: float) -> None:
        """Take in a word.

        One that comes again takes the place of the one before; one a little late is put where it belongs; a stamp
        that goes back by more forgets all before.
        """
        words = self._words
        if words and stamp_s < words[-1].stamp_s - self._longest:
            words.clear()
        place = bisect_left(words, (stamp_s,))
        if place < len(words) and words[place].stamp_s == stamp_s:
            words[place] = _Word(stamp_s, angle)
        else:
            insort(words, _Word(stamp_s, angle))
        del words[: -self._most]

    def clear(self) -> None:
        """Forget all."""
        self._words.clear()

    def at(self, stamp_s: float) -> float | None:
        """The angle then: between two words by proportion, beyond them by the same; None when too far off, rad."""
        words = self._words
        if not words:
            return None
        later = min(bisect_left(words, (stamp_s,)), len(words) - 1)
        after, before = words[later], words[max(later - 1, 0)]
        nearest = min((before, after), key=lambda word: abs(word.stamp_s - stamp_s))
        if abs(nearest.stamp_s - stamp_s) > self._longest:
            return None
        apart = after.stamp_s - before.stamp_s
        if not 0.0 < apart <= 2.0 * self._longest:
            return nearest.angle
        return before.angle + (stamp_s - before.stamp_s) / apart * (after.angle - before.angle)
