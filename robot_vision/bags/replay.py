# SPDX-License-Identifier: Apache-2.0
"""Decides which message of a bag goes out when (pace, pause, step, lockstep), with the clock it is given."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from robot_vision.bags.errors import BagError
from robot_vision.bags.messages import header_stamp_ns
from robot_vision.bags.reader import BagMessage
from robot_vision.bags.schema import has_header

PICTURE_TYPES = frozenset({"sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"})
Clock = Callable[[], int]  # monotonic nanoseconds


class ReplayItem(NamedTuple):
    """A message on its way out; `stamp_ns` is its header stamp, or the log time if it has no header."""

    message: BagMessage
    stamp_ns: int
    is_picture: bool


def replay_items(
    messages: Iterable[BagMessage], picture_topics: frozenset[str] | None = None
) -> Iterator[ReplayItem]:
    """Put messages in the order of replay.

    Messages of one log time go out with the pictures last: who receives a picture can have all that belongs
    to it. Apart from that the order of the bag is kept.

    Args:
        messages: in order of log time.
        picture_topics: topics that count as pictures; None: all Image and CompressedImage topics.
    """
    pictures: list[ReplayItem] = []
    log_time = 0
    for message in messages:
        if pictures and message.log_time_ns != log_time:
            yield from pictures
            pictures = []
        log_time = message.log_time_ns
        item = _item(message, picture_topics)
        if item.is_picture:
            pictures.append(item)
        else:
            yield item
    yield from pictures


def _item(message: BagMessage, picture_topics: frozenset[str] | None) -> ReplayItem:
    stamp = message.log_time_ns
    if has_header(message.type_name):
        try:
            stamp = header_stamp_ns(message.cdr)
        except BagError:  # a broken message is its receiver's business; here its log time serves
            stamp = message.log_time_ns
    named = picture_topics is None or message.topic in picture_topics
    return ReplayItem(message, stamp, named and message.type_name in PICTURE_TYPES)


class Lockstep:
    """Keeps the books of lockstep: which stamp is awaited on which topics, and since when.

    Args:
        topics: the outputs that must answer each picture.
        timeout_ns: after this the next picture goes out all the same.

    Attributes:
        answered: pictures that were answered on all topics.
        timed_out: pictures that were not.
    """

    def __init__(self, topics: Iterable[str], timeout_ns: int) -> None:
        self.topics = frozenset(topics)
        if not self.topics:
            raise BagError("lockstep needs the name of at least one output topic")
        if timeout_ns <= 0:
            raise BagError("the timeout of lockstep must be longer than 0 s")
        self.timeout_ns = timeout_ns
        self.answered = 0
        self.timed_out = 0
        self.awaited_ns: int | None = None
        self._missing: set[str] = set()
        self._since_ns = 0

    def sent(self, stamp_ns: int, now_ns: int) -> None:
        """A picture with this stamp has gone out."""
        if self.awaited_ns == stamp_ns:
            return  # the second camera of the same instant
        self.awaited_ns = stamp_ns
        self._missing = set(self.topics)
        self._since_ns = now_ns

    def answer(self, topic: str, stamp_ns: int) -> bool:
        """An output has arrived; returns True if it completes the answer that is awaited."""
        if stamp_ns != self.awaited_ns:
            return False  # late, or about something else
        self._missing.discard(topic)
        if self._missing:
            return False
        self.awaited_ns = None
        self.answered += 1
        return True

    def wait_ns(self, now_ns: int) -> int:
        """Return how long the answer may still take, 0 if none is awaited; gives up when time is over."""
        if self.awaited_ns is None:
            return 0
        left = self._since_ns + self.timeout_ns - now_ns
        if left > 0:
            return left
        self.awaited_ns = None
        self.timed_out += 1
        return 0

    @property
    def missing(self) -> tuple[str, ...]:
        """Topics that have not answered the last picture, also after its time was over."""
        return tuple(sorted(self._missing))


class Replay:
    """Tells for the next message how long it has to wait.

    Without lockstep a message is due when the bag's time, running at `rate`, reaches its log time; the times
    are absolute, so that delays do not add up. With lockstep there is no rate: all messages up to and with a
    picture go out at once, and what is later than the picture waits for its answer. (A message logged after
    the picture but stamped no later belongs to it and does not wait.) So every node that hears has finished
    with one instant before anything of the next one exists.

    Args:
        clock: monotonic nanoseconds.
        rate: bag seconds per second.
        lockstep: its books, or None.
        step_on_pictures: a step ends with a picture; False (a bag without pictures): with any message.
    """

    def __init__(
        self,
        clock: Clock,
        rate: float = 1.0,
        lockstep: Lockstep | None = None,
        *,
        step_on_pictures: bool = True,
    ) -> None:
        self._clock = clock
        self._rate = _checked_rate(rate)
        self.lockstep = lockstep
        self.paused = False
        self._step_on_pictures = step_on_pictures
        self._steps = 0
        self._anchor_bag_ns = 0
        self._anchor_ns = clock()

    def begin(self, log_time_ns: int) -> None:
        """Start (or start again, in a loop) with the bag's time at `log_time_ns`."""
        self._anchor_bag_ns = log_time_ns
        self._anchor_ns = self._clock()

    def now_ns(self) -> int:
        """Return the time of the clock it was given."""
        return self._clock()

    @property
    def position_ns(self) -> int:
        """The bag's time now, nanoseconds."""
        if self.paused:
            return self._anchor_bag_ns
        return self._anchor_bag_ns + round((self._clock() - self._anchor_ns) * self._rate)

    @property
    def rate(self) -> float:
        """Bag seconds per second."""
        return self._rate

    @rate.setter
    def rate(self, rate: float) -> None:
        rate = _checked_rate(rate)
        self._anchor_bag_ns, self._anchor_ns = self.position_ns, self._clock()
        self._rate = rate

    def pause(self) -> bool:
        """Hold; returns False if it was held already."""
        if self.paused:
            return False
        self._anchor_bag_ns = self.position_ns
        self.paused = True
        return True

    def resume(self) -> bool:
        """Go on where it was held; returns False if it was not held."""
        if not self.paused:
            return False
        self.paused = False
        self._steps = 0
        self._anchor_ns = self._clock()
        return True

    def step(self) -> bool:
        """While held: let everything through up to and with the next picture; returns False if not held."""
        if self.paused:
            self._steps += 1
        return self.paused

    def wait_ns(self, item: ReplayItem) -> int | None:
        """Return nanoseconds until `item` may go: 0 now, None until something happens (resume, step)."""
        if self.paused and not self._steps:
            return None
        now = self._clock()
        if self.lockstep is not None:
            awaited = self.lockstep.awaited_ns
            if awaited is not None and item.stamp_ns <= awaited:
                return 0
            return self.lockstep.wait_ns(now)
        if self.paused:
            return 0
        due = self._anchor_ns + round((item.message.log_time_ns - self._anchor_bag_ns) / self._rate)
        return max(0, due - now)

    def sent(self, item: ReplayItem) -> None:
        """Tell that `item` has gone out."""
        if self.lockstep is not None and item.is_picture:
            self.lockstep.sent(item.stamp_ns, self._clock())
        if self.paused:
            self._anchor_bag_ns = max(self._anchor_bag_ns, item.message.log_time_ns)
            if self._steps and (item.is_picture or not self._step_on_pictures):
                self._steps -= 1


def _checked_rate(rate: float) -> float:
    if not 0 < rate <= 1000:
        raise BagError(f"a rate of {rate} cannot be replayed: it must be over 0 and at most 1000")
    return rate
