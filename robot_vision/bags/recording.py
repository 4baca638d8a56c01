# SPDX-License-Identifier: Apache-2.0
"""Takes messages at any moment and writes them from a thread of its own, so that the disk stalls nobody."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Literal, NamedTuple

from robot_vision.bags.qos import OfferedQoS
from robot_vision.bags.writer import BagWriter

QUEUE_BYTES = 128 << 20  # four seconds of 640 x 480 bgr8 at 30 Hz
FLUSH_S = 2.0


_END: Literal["end"] = "end"


class _Entry(NamedTuple):
    topic: str
    type_name: str
    stamp_ns: int
    cdr: bytes | None  # None: the topic is announced
    qos: OfferedQoS | None


class Recording:
    """Writes messages to a bag in the background.

    What does not fit into the queue because the disk is too slow is dropped and counted. At least every
    `flush_s` the current chunk is closed, so that a kill costs no more than that.

    Args:
        bag: where to; it is finished by `close`.
        queue_bytes: how much may wait for the disk.
        flush_s: seconds.
        clock: tells seconds for `flush_s`.

    Attributes:
        received, dropped: how many messages came, and how many of them are not in the bag.
        trouble: why the bag cannot be written any more, or "".
    """

    def __init__(
        self,
        bag: BagWriter,
        queue_bytes: int = QUEUE_BYTES,
        flush_s: float = FLUSH_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._clock = clock
        self._bag = bag
        self._queue_bytes = queue_bytes
        self._flush_s = flush_s
        self._entries: deque[_Entry] = deque()
        self._bytes = 0
        self._changed = threading.Condition()
        self._closing = False
        self.received = 0
        self.dropped = 0
        self.trouble = ""
        self._thread = threading.Thread(target=self._write, name="bag writer", daemon=True)
        self._thread.start()

    def add_topic(self, topic: str, type_name: str, qos: OfferedQoS) -> None:
        """Announce a topic with what its publisher offers."""
        with self._changed:
            self._entries.append(_Entry(topic, type_name, 0, None, qos))
            self._changed.notify_all()

    def put(self, topic: str, type_name: str, stamp_ns: int, cdr: bytes) -> bool:
        """Take one message; returns False if it had to be dropped."""
        with self._changed:
            self.received += 1
            if self.trouble or self._closing or self._bytes + len(cdr) > self._queue_bytes:
                self.dropped += 1
                return False
            self._entries.append(_Entry(topic, type_name, stamp_ns, cdr, None))
            self._bytes += len(cdr)
            self._changed.notify_all()
            return True

    def close(self) -> None:
        """Write what still waits and finish the bag; does nothing the second time."""
        with self._changed:
            self._closing = True
            self._changed.notify_all()
        self._thread.join()

    def _write(self) -> None:
        flushed = self._clock()
        try:
            while (entry := self._next()) is not _END:
                if isinstance(entry, _Entry):
                    self._write_one(entry)
                if self._clock() - flushed >= self._flush_s:
                    self._bag.flush()
                    flushed = self._clock()
            self._bag.finish()
        except Exception as error:  # whatever ends the writing must be known to who goes on recording
            with self._changed:
                self.trouble = str(error) or type(error).__name__
                self._entries.clear()
                self.dropped = self.received - self._bag.saved_count

    def _write_one(self, entry: _Entry) -> None:
        if entry.cdr is None:
            self._bag.add_topic(entry.topic, entry.type_name, entry.qos)
            return
        self._bag.write(entry.topic, entry.type_name, entry.stamp_ns, entry.cdr)
        with self._changed:
            self._bytes -= len(entry.cdr)

    def _next(self) -> _Entry | Literal["end"] | None:
        """Return what is to be written next; `_END` when all is written, None if nothing came for a while."""
        with self._changed:
            self._changed.wait_for(lambda: self._entries or self._closing, self._flush_s)
            if self._entries:
                return self._entries.popleft()
            return _END if self._closing else None
