# SPDX-License-Identifier: Apache-2.0
"""Reads a bag a little ahead of its replay, so that the disk never makes a picture late."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterable, Iterator
from types import TracebackType

from robot_vision.bags.replay import ReplayItem

READ_AHEAD_BYTES = 32 << 20


class ReadAhead:
    """Iterates over the items of a source that a thread reads in advance; use it as a context manager.

    An error of the source is raised where the item would have come.

    Args:
        source: items in order of replay.
        limit: bytes of messages held at most (but always at least one item).
    """

    def __init__(self, source: Iterable[ReplayItem], limit: int = READ_AHEAD_BYTES) -> None:
        self._source = source
        self._limit = limit
        self._items: deque[ReplayItem] = deque()
        self._bytes = 0
        self._changed = threading.Condition()
        self._ended = False
        self._stopped = False
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._read, name="bag read-ahead", daemon=True)
        self._thread.start()

    def __iter__(self) -> Iterator[ReplayItem]:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._items or self._ended)
                if not self._items:
                    break
                item = self._items.popleft()
                self._bytes -= len(item.message.cdr)
                self._changed.notify_all()
            yield item
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """Stop reading; what was read in advance is thrown away."""
        with self._changed:
            self._stopped = True
            self._items.clear()
            self._changed.notify_all()
        self._thread.join()

    def __enter__(self) -> ReadAhead:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _read(self) -> None:
        try:
            for item in self._source:
                with self._changed:
                    self._changed.wait_for(
                        lambda: self._stopped or not self._items or self._bytes < self._limit
                    )
                    if self._stopped:
                        return
                    self._items.append(item)
                    self._bytes += len(item.message.cdr)
                    self._changed.notify_all()
        except BaseException as error:  # it belongs to whoever iterates, in the other thread
            self._error = error
        finally:
            with self._changed:
                self._ended = True
                self._changed.notify_all()
