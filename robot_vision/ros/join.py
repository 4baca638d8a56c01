# SPDX-License-Identifier: Apache-2.0
"""Brings together what belongs to one picture though it comes on several topics, in bounded memory."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Generic, TypeVar

Part = TypeVar("Part")


class ExactJoin(Generic[Part]):
    """Calls back once for each stamp for which every topic has spoken, in the order of the stamps.

    Once a stamp is complete, older ones are given up: an answer never goes back in time.

    Args:
        topics: two or more names.
        callback: takes the parts in the order of `topics`.
        memory: so many stamps may wait for the rest of their parts; the oldest goes first.
    """

    def __init__(self, topics: Sequence[Hashable], callback: Callable[..., None], memory: int = 16) -> None:
        if len(set(topics)) < 2 or len(set(topics)) != len(topics):
            raise ValueError(f"a join needs two or more different topics, not {list(topics)}")
        if memory < 1:
            raise ValueError(f"a join needs a memory of at least 1 stamp, not {memory}")
        self._topics = tuple(topics)
        self._callback = callback
        self._memory = memory
        self._waiting: dict[int, dict[Hashable, Part]] = {}
        self._done: int | None = None
        #: Stamps that were given up incomplete.
        self.dropped = 0

    def __len__(self) -> int:
        """Give the number of stamps that wait."""
        return len(self._waiting)

    def reset(self) -> None:
        """Forget what waits and which stamps are done: time starts anew."""
        self._waiting.clear()
        self._done = None

    def add(self, topic: Hashable, stamp: int, part: Part) -> None:
        """Take in a part; when it was the last one missing for its stamp, the callback is called.

        A second part of the same topic and stamp replaces the first; a stamp not after the last complete one
        is ignored.

        Raises:
            KeyError: the join does not know the topic.
        """
        if topic not in self._topics:
            raise KeyError(topic)
        if self._done is not None and stamp <= self._done:
            return
        parts = self._waiting.setdefault(stamp, {})
        parts[topic] = part
        if len(parts) == len(self._topics):
            self._finish(stamp)
            self._callback(*(parts[name] for name in self._topics))
        elif len(self._waiting) > self._memory:
            del self._waiting[min(self._waiting)]
            self.dropped += 1

    def _finish(self, stamp: int) -> None:
        self._done = stamp
        del self._waiting[stamp]
        for older in [other for other in self._waiting if other < stamp]:
            del self._waiting[older]
            self.dropped += 1
