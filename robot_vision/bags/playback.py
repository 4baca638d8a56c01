# SPDX-License-Identifier: Apache-2.0
"""Carries out a replay: waits, sends, obeys pause, resume, step, answers and stop from other threads."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable

from robot_vision.bags.errors import BagError
from robot_vision.bags.read_ahead import ReadAhead
from robot_vision.bags.replay import Replay, ReplayItem


class Playback:
    """Runs laps of a bag in the thread that calls `run`; all other methods may be called from anywhere.

    Args:
        replay: decides when.
        lap: gives the items of one lap of the bag.
        send: sends one item.
        loop: start again at the end.

    Attributes:
        sent: messages sent so far.
        pictures: pictures sent so far.
    """

    def __init__(
        self,
        replay: Replay,
        lap: Callable[[], Iterable[ReplayItem]],
        send: Callable[[ReplayItem], None],
        *,
        loop: bool = False,
    ) -> None:
        self.replay = replay
        self.sent = 0
        self.pictures = 0
        self._lap = lap
        self._send = send
        self._loop = loop
        self._changed = threading.Condition()
        self._stopped = False

    def run(self) -> bool:
        """Replay to the end; returns False if `stop` came first.

        In lockstep the end (and the next lap) waits for the answer to the last picture, too.

        Raises:
            BagError: there is nothing to replay, or the bag cannot be read on.
        """
        while True:
            if not self._run_lap():
                return False
            if not self._loop:
                return True

    def pause(self) -> bool:
        """Hold; returns False if it was held already."""
        return self._tell(self.replay.pause)

    def resume(self) -> bool:
        """Go on; returns False if it was not held."""
        return self._tell(self.replay.resume)

    def step(self) -> bool:
        """While held: send everything up to and with the next picture; returns False if not held."""
        return self._tell(self.replay.step)

    def answer(self, topic: str, stamp_ns: int) -> bool:
        """An output has arrived; returns True if it lets the next picture go."""
        lockstep = self.replay.lockstep
        return lockstep is not None and self._tell(lambda: lockstep.answer(topic, stamp_ns))

    def set_rate(self, rate: float) -> None:
        """Change the rate from here on.

        Raises:
            BagError: no rate to replay with.
        """
        with self._changed:
            self.replay.rate = rate
            self._changed.notify_all()

    def go_on_from(self, log_time_ns: int) -> None:
        """Let the time of the bag be `log_time_ns` now: sending took longer than it should count."""
        with self._changed:
            self.replay.begin(log_time_ns)

    def stop(self) -> None:
        """Let `run` return soon."""
        with self._changed:
            self._stopped = True
            self._changed.notify_all()

    def _run_lap(self) -> bool:
        begun = False
        with ReadAhead(self._lap()) as items:
            for item in items:
                if not begun:
                    with self._changed:
                        self.replay.begin(item.message.log_time_ns)
                    begun = True
                if not self._wait(item):
                    return False
                with self._changed:  # the books first: the answer may come before `send` returns
                    self.replay.sent(item)
                self._send(item)
                self.sent += 1
                self.pictures += item.is_picture
        if not begun:
            raise BagError("no message lies in the part that is to be replayed")
        return self._wait_for_answer()

    def _wait(self, item: ReplayItem) -> bool:
        with self._changed:
            while not self._stopped:
                wait_ns = self.replay.wait_ns(item)
                if wait_ns == 0:
                    return True
                self._changed.wait(None if wait_ns is None else wait_ns / 1e9)
        return False

    def _wait_for_answer(self) -> bool:
        lockstep = self.replay.lockstep
        with self._changed:
            while lockstep is not None and not self._stopped:
                wait_ns = lockstep.wait_ns(self.replay.now_ns())
                if wait_ns == 0:
                    break
                self._changed.wait(wait_ns / 1e9)
            return not self._stopped

    def _tell(self, act: Callable[[], bool]) -> bool:
        with self._changed:
            done = act()
            self._changed.notify_all()
            return done
