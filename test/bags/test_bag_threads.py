# SPDX-License-Identifier: Apache-2.0
"""Reading ahead and writing behind lose nothing, hold no more than they may, and pass troubles on."""

from __future__ import annotations

import errno
import queue
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from robot_vision.bags import BagError, BagMessage, BagReader, BagWriter, OfferedQoS
from robot_vision.bags.playback import Playback
from robot_vision.bags.read_ahead import ReadAhead
from robot_vision.bags.recording import Recording
from robot_vision.bags.replay import Lockstep, Replay, ReplayItem

TWIST = "geometry_msgs/msg/TwistStamped"


def items(count: int, size: int = 100) -> list[ReplayItem]:
    return [ReplayItem(BagMessage("/t", TWIST, n, bytes(size)), n, False) for n in range(count)]


def test_reading_ahead_keeps_order() -> None:
    with ReadAhead(items(500), limit=1000) as ahead:
        assert list(ahead) == items(500)


def test_reading_ahead_holds_no_more_than_it_may_and_stops_when_told() -> None:
    read: list[int] = []
    filled = threading.Event()

    def source() -> Iterator[ReplayItem]:
        for item in items(1000):
            read.append(item.stamp_ns)
            if len(read) == 11:  # ten are held, the eleventh is in the hand
                filled.set()
            yield item

    with ReadAhead(source(), limit=1000):
        assert filled.wait(10)
    assert len(read) == 11


def test_reading_ahead_passes_the_error_on_after_what_was_good() -> None:
    def source() -> Iterator[ReplayItem]:
        yield from items(3)
        raise BagError("broken here")

    got: list[ReplayItem] = []
    with pytest.raises(BagError, match="broken here"), ReadAhead(source()) as ahead:
        for item in ahead:
            got.append(item)
    assert got == items(3)


def test_a_recording_writes_everything(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    recording = Recording(BagWriter(path, in_place=True))
    recording.add_topic("/t", TWIST, OfferedQoS(durability="transient_local"))
    for n in range(1000):
        assert recording.put("/t", TWIST, n, n.to_bytes(4, "little") * 50)
    recording.close()
    recording.close()
    bag = BagReader(path)
    assert [m.log_time_ns for m in bag] == list(range(1000)) and bag.warning is None
    assert bag.topics["/t"].qos == OfferedQoS(durability="transient_local")
    assert (recording.received, recording.dropped, recording.trouble) == (1000, 0, "")
    assert not recording.put("/t", TWIST, 1, b"late") and recording.dropped == 1


class SlowDisk(BagWriter):
    def __init__(self, path: Path) -> None:
        super().__init__(path, in_place=True)
        self.go = threading.Event()
        self.busy = threading.Event()

    def write(self, topic: str, type_name: str, stamp_ns: int, message: object) -> None:
        self.busy.set()
        assert self.go.wait(10)
        super().write(topic, type_name, stamp_ns, message)


def test_what_a_slow_disk_cannot_take_is_counted_and_the_rest_is_written(tmp_path: Path) -> None:
    disk = SlowDisk(tmp_path / "a.mcap")
    recording = Recording(disk, queue_bytes=1000)
    taken = [recording.put("/t", TWIST, n, bytes(100)) for n in range(15)]
    assert disk.busy.wait(10)
    assert taken == [True] * 10 + [False] * 5 and recording.dropped == 5
    disk.go.set()
    recording.close()
    assert BagReader(disk.path).message_count == 10


def test_a_full_disk_ends_the_recording_with_the_reason(tmp_path: Path) -> None:
    class FullDisk(BagWriter):
        def write(self, topic: str, type_name: str, stamp_ns: int, message: object) -> None:
            raise BagError("cannot write a.mcap: No space left on device")

    recording = Recording(FullDisk(tmp_path / "a.mcap", in_place=True))
    recording.put("/t", TWIST, 1, b"1234")
    recording.close()
    assert "No space left" in recording.trouble and recording.dropped == 1


def test_what_a_full_disk_lost_with_the_open_chunk_counts_as_dropped(tmp_path: Path) -> None:
    class FullDisk(BagWriter):
        def write(self, topic: str, type_name: str, stamp_ns: int, message: object) -> None:
            if stamp_ns == 45:
                self._fail(OSError(errno.ENOSPC, "No space left on device"))
            super().write(topic, type_name, stamp_ns, message)

    path = tmp_path / "a.mcap"
    recording = Recording(FullDisk(path, chunk_size=1000, in_place=True))
    for number in range(50):
        recording.put("/t", TWIST, number, bytes(100))
    recording.close()
    found = len(list(BagReader(path)))
    assert 0 < found < 45
    assert (recording.received, recording.dropped) == (50, 50 - found)


def test_a_slow_trickle_reaches_the_disk_before_the_end(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    flushed = threading.Event()

    class Watched(BagWriter):
        def flush(self) -> None:
            super().flush()
            if self.message_count == 3:
                flushed.set()

    seconds = iter(range(10**9))
    recording = Recording(Watched(path, in_place=True), flush_s=0.5, clock=lambda: float(next(seconds)))
    for n in range(3):
        recording.put("/t", TWIST, n, b"1234")
    assert flushed.wait(10)
    assert BagReader(path).message_count == 3  # as it would be found after a kill
    recording.close()


def playback(
    bag: list[ReplayItem], replay: Replay, *, loop: bool = False
) -> tuple[Playback, queue.Queue[ReplayItem], threading.Thread]:
    out: queue.Queue[ReplayItem] = queue.Queue()
    player = Playback(replay, lambda: bag, out.put, loop=loop)
    thread = threading.Thread(target=player.run, daemon=True)
    return player, out, thread


def pictures(count: int) -> list[ReplayItem]:
    return [item._replace(is_picture=True) for item in items(count)]


def test_a_playback_sends_everything_in_order() -> None:
    player, out, thread = playback(items(50), Replay(time.monotonic_ns, 1000.0))
    thread.start()
    assert [out.get(timeout=10) for _ in range(50)] == items(50)
    thread.join(10)
    assert not thread.is_alive() and (player.sent, player.pictures) == (50, 0)


def test_a_held_playback_obeys_steps_and_stops() -> None:
    player, out, thread = playback(pictures(50), Replay(time.monotonic_ns, 1000.0))
    assert player.pause()
    thread.start()
    for n in range(3):
        assert player.step()
        assert out.get(timeout=10).stamp_ns == n
    player.stop()
    thread.join(10)
    assert not thread.is_alive() and player.sent == 3 and out.empty()


def test_lockstep_lets_out_one_picture_for_each_answer_also_in_the_next_lap() -> None:
    lockstep = Lockstep(["/steering"], 3600 * 10**9)
    player, out, thread = playback(pictures(3), Replay(time.monotonic_ns, lockstep=lockstep), loop=True)
    thread.start()
    for stamp in [0, 1, 2, 0, 1, 2, 0]:
        assert out.get(timeout=10).stamp_ns == stamp
        assert out.empty() and lockstep.awaited_ns == stamp
        assert player.answer("/steering", stamp)
    player.stop()
    thread.join(10)
    assert not thread.is_alive() and lockstep.answered == 7


def test_the_end_waits_for_the_last_answer() -> None:
    lockstep = Lockstep(["/steering"], 3600 * 10**9)
    player, out, thread = playback(pictures(1), Replay(time.monotonic_ns, lockstep=lockstep))
    thread.start()
    assert out.get(timeout=10).stamp_ns == 0
    assert thread.is_alive()
    assert player.answer("/steering", 0)
    thread.join(10)
    assert not thread.is_alive()


@pytest.mark.parametrize("loop", [False, True])
def test_nothing_to_replay_is_said(loop: bool) -> None:
    player, out, _ = playback([], Replay(time.monotonic_ns), loop=loop)
    with pytest.raises(BagError, match="no message"):
        player.run()
    assert out.empty()
