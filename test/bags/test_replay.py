# SPDX-License-Identifier: Apache-2.0
"""The order and the times of a replay, by a clock that the test turns."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_vision.bags import BagError, BagMessage, encode, messages
from robot_vision.bags.replay import Lockstep, Replay, ReplayItem, replay_items

MS = 1_000_000


class FakeClock:
    def __init__(self) -> None:
        self.now = 5_000 * MS

    def __call__(self) -> int:
        return self.now


def item(log_ms: int, *, picture: bool = False, stamp_ms: int | None = None) -> ReplayItem:
    message = BagMessage("/image" if picture else "/odom", "", log_ms * MS, b"")
    return ReplayItem(message, (log_ms if stamp_ms is None else stamp_ms) * MS, picture)


def test_due_times_are_absolute_and_scale_with_the_rate() -> None:
    clock = FakeClock()
    replay = Replay(clock, rate=2.0)
    replay.begin(1000 * MS)
    assert replay.wait_ns(item(1000)) == 0
    assert replay.wait_ns(item(1100)) == 50 * MS
    clock.now += 70 * MS  # late by 20 ms: the next one is not late because of that
    assert replay.wait_ns(item(1100)) == 0
    assert replay.wait_ns(item(1200)) == 30 * MS
    assert replay.position_ns == 1140 * MS


def test_a_change_of_rate_keeps_the_place() -> None:
    clock = FakeClock()
    replay = Replay(clock)
    replay.begin(0)
    clock.now += 100 * MS
    replay.rate = 0.5
    assert replay.position_ns == 100 * MS
    assert replay.wait_ns(item(200)) == 200 * MS


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), 1e9])
def test_rates_that_cannot_be_are_refused(rate: float) -> None:
    with pytest.raises(BagError, match="rate"):
        Replay(FakeClock(), rate)


def test_pause_holds_and_resume_goes_on_at_the_same_place() -> None:
    clock = FakeClock()
    replay = Replay(clock)
    replay.begin(0)
    clock.now += 40 * MS
    assert replay.pause() and not replay.pause()
    clock.now += 10_000 * MS
    assert replay.wait_ns(item(100)) is None and replay.position_ns == 40 * MS
    assert replay.resume() and not replay.resume()
    assert replay.wait_ns(item(100)) == 60 * MS


def test_a_step_ends_with_the_next_picture() -> None:
    clock = FakeClock()
    replay = Replay(clock)
    replay.begin(0)
    assert not replay.step()
    replay.pause()
    assert replay.step()
    for queued in (item(10), item(20), item(30, picture=True)):
        assert replay.wait_ns(queued) == 0
        replay.sent(queued)
    assert replay.wait_ns(item(40)) is None and replay.position_ns == 30 * MS
    replay.step()
    replay.step()
    for queued in (item(50, picture=True), item(60, picture=True)):
        assert replay.wait_ns(queued) == 0
        replay.sent(queued)
    assert replay.wait_ns(item(70)) is None
    replay.resume()
    assert replay.wait_ns(item(70)) == 10 * MS


def test_in_a_bag_without_pictures_a_step_is_one_message() -> None:
    replay = Replay(FakeClock(), step_on_pictures=False)
    replay.begin(0)
    replay.pause()
    replay.step()
    replay.sent(item(0))
    assert replay.wait_ns(item(1)) is None


def lockstep(*topics: str) -> tuple[FakeClock, Lockstep, Replay]:
    clock = FakeClock()
    books = Lockstep(topics or ("/steering",), 100 * MS)
    return clock, books, Replay(clock, lockstep=books)


def test_in_lockstep_what_is_later_than_the_picture_waits_for_its_answer() -> None:
    clock, books, replay = lockstep()
    replay.begin(0)
    assert replay.wait_ns(item(900)) == 0  # no rate: what comes before a picture goes at once
    replay.sent(item(1000, picture=True))
    clock.now += 30 * MS
    assert replay.wait_ns(item(1001)) == 70 * MS
    assert not books.answer("/steering", 999 * MS) and not books.answer("/heading", 1000 * MS)
    assert replay.wait_ns(item(1001)) == 70 * MS
    assert books.answer("/steering", 1000 * MS)
    assert replay.wait_ns(item(1001)) == 0
    assert (books.answered, books.timed_out) == (1, 0)


def test_what_belongs_to_the_picture_does_not_wait() -> None:
    _, _, replay = lockstep()
    replay.sent(item(1000, picture=True, stamp_ms=990))
    assert replay.wait_ns(item(1002, stamp_ms=990)) == 0
    assert replay.wait_ns(item(1002, stamp_ms=991)) == 100 * MS


def test_several_outputs_must_all_answer() -> None:
    _, books, replay = lockstep("/a", "/b")
    replay.sent(item(1, picture=True))
    replay.sent(item(1, picture=True))  # a second camera at the same instant
    assert not books.answer("/b", 1 * MS) and books.missing == ("/a",)
    assert replay.wait_ns(item(2)) > 0  # type: ignore[operator]
    assert books.answer("/a", 1 * MS)
    assert replay.wait_ns(item(2)) == 0


def test_an_answer_that_does_not_come_is_counted_and_a_late_one_changes_nothing() -> None:
    clock, books, replay = lockstep()
    replay.sent(item(1, picture=True))
    clock.now += 100 * MS
    assert replay.wait_ns(item(2, picture=True)) == 0
    assert (books.answered, books.timed_out, books.missing) == (0, 1, ("/steering",))
    replay.sent(item(2, picture=True))
    assert not books.answer("/steering", 1 * MS)
    assert replay.wait_ns(item(3)) == 100 * MS


def test_pause_works_in_lockstep() -> None:
    _, books, replay = lockstep()
    replay.pause()
    assert replay.wait_ns(item(1, picture=True)) is None
    replay.step()
    assert replay.wait_ns(item(1, picture=True)) == 0
    replay.sent(item(1, picture=True))
    books.answer("/steering", 1 * MS)
    assert replay.wait_ns(item(2, picture=True)) is None


@pytest.mark.parametrize(("topics", "timeout"), [((), 1), (("/a",), 0)])
def test_lockstep_without_topics_or_time_is_refused(topics: tuple[str, ...], timeout: int) -> None:
    with pytest.raises(BagError):
        Lockstep(topics, timeout)


@given(st.lists(st.tuples(st.integers(0, 8), st.booleans()), max_size=30))
def test_pictures_come_last_among_what_was_logged_at_the_same_time(entries: list[tuple[int, bool]]) -> None:
    bag = [
        BagMessage(
            "/i" if picture else "/o", f"sensor_msgs/msg/{'Image' if picture else 'Imu'}", time, bytes([n])
        )
        for n, (time, picture) in enumerate(sorted(entries, key=lambda entry: entry[0]))
    ]
    out = [entry.message for entry in replay_items(bag)]
    assert out == sorted(bag, key=lambda message: (message.log_time_ns, message.topic == "/i", message.cdr))


def test_stamps_come_from_the_header_where_there_is_one() -> None:
    twist = encode(messages.twist_stamped(7, "f", 0, 0))
    bag = [
        BagMessage("/a", "geometry_msgs/msg/TwistStamped", 9, twist),
        BagMessage("/a", "geometry_msgs/msg/TwistStamped", 10, b"broken"),
        BagMessage("/b", "rosgraph_msgs/msg/Clock", 11, encode(messages.clock(3))),
    ]
    assert [entry.stamp_ns for entry in replay_items(bag)] == [7, 10, 11]
