# SPDX-License-Identifier: Apache-2.0
"""What is written comes back, whole or damaged."""

from __future__ import annotations

import errno
import logging
import os
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import NonSeekingReader, make_reader

from robot_vision.bags import BagError, BagMessage, BagReader, BagWriter, OfferedQoS, decode, encode, messages
from robot_vision.bags.index import read_index

TWIST = "geometry_msgs/msg/TwistStamped"
IMAGE = "sensor_msgs/msg/Image"
CHUNK = 4096


def write_twists(path: Path, count: int = 60, compression: str = "none", **options: object) -> list[bytes]:
    written = []
    with BagWriter(path, compression, CHUNK, **options) as bag:  # type: ignore[arg-type]
        for i in range(count):
            message = encode(messages.twist_stamped(i * 1000, f"frame {i}" * 30, i, -i))
            bag.write("/steering", TWIST, i * 1000, message)
            written.append(message)
    return written


def cdrs(path: Path) -> list[bytes]:
    return [message.cdr for message in BagReader(path)]


@pytest.mark.parametrize("compression", ["none", "lz4", "zstd"])
def test_messages_come_back_byte_for_byte(tmp_path: Path, compression: str) -> None:
    path = tmp_path / "a.mcap"
    written = write_twists(path, compression=compression)
    bag = BagReader(path)
    assert [message.cdr for message in bag] == written
    assert bag.topics["/steering"].count == bag.message_count == 60
    assert (bag.start_ns, bag.end_ns) == (0, 59000)
    assert bag.warning is None
    assert not list(tmp_path.glob("*.partial"))


def test_the_same_input_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_twists(tmp_path / name, compression="zstd")
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_other_readers_find_profile_schema_checksums_and_quality_of_service(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with BagWriter(path) as bag:
        bag.add_topic("/map", "nav_msgs/msg/OccupancyGrid", OfferedQoS(durability="transient_local", depth=1))
        bag.write("/steering", TWIST, 5, messages.twist_stamped(5, "base_link", 1, 0))
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary is not None
        schema = {item.name: item for item in summary.schemas.values()}[TWIST]
        assert schema.encoding == "ros2msg"
        for part in (
            "std_msgs/Header header",
            "MSG: geometry_msgs/Twist\n",
            "MSG: builtin_interfaces/Time\n",
        ):
            assert part in schema.data.decode()
        channel = {item.topic: item for item in summary.channels.values()}["/steering"]
        assert channel.metadata["topic_type_hash"].startswith("RIHS01_")
    assert BagReader(path).topics["/map"].qos == OfferedQoS("reliable", "transient_local", 1)
    from rosbags.highlevel import AnyReader

    with AnyReader([path]) as other:
        assert [connection.topic for connection in other.connections] == ["/map", "/steering"]
        (_, stamp, raw) = next(iter(other.messages()))
        assert stamp == 5 and decode(raw, TWIST).twist.linear.x == 1.0


def test_chunks_carry_checksums(tmp_path: Path) -> None:
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader

    write_twists(tmp_path / "a.mcap")
    with (tmp_path / "a.mcap").open("rb") as stream:
        chunks = [
            record for record in StreamReader(stream, emit_chunks=True).records if isinstance(record, Chunk)
        ]
    assert len(chunks) > 3
    assert all(chunk.uncompressed_crc == zlib.crc32(chunk.data) for chunk in chunks)


@settings(max_examples=40, deadline=None)
@given(times=st.lists(st.integers(0, 50), min_size=1, max_size=80), chunk=st.integers(1, 3000))
def test_messages_are_in_log_time_order_and_equal_times_in_order_of_writing(
    tmp_path_factory: pytest.TempPathFactory, times: list[int], chunk: int
) -> None:
    path = tmp_path_factory.mktemp("order") / "a.mcap"
    with BagWriter(path, chunk_size=chunk) as bag:
        for number, log_time in enumerate(times):
            bag.write("/t", "std_msgs/msg/UInt8MultiArray", log_time, number.to_bytes(4, "little") * 20)
    got = [(message.log_time_ns, int.from_bytes(message.cdr[:4], "little")) for message in BagReader(path)]
    assert got == sorted((log_time, number) for number, log_time in enumerate(times))


def test_topics_and_times_select(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with BagWriter(path, chunk_size=200) as bag:
        for i in range(20):
            bag.write(f"/t{i % 2}", TWIST, i, messages.twist_stamped(i, "f", i, 0))
    bag_in = BagReader(path)
    assert [m.log_time_ns for m in bag_in.messages(["t1"], start_ns=5, end_ns=9)] == [5, 7, 9]
    assert list(bag_in.messages(["/nothing"])) == []


@pytest.mark.parametrize("compression", ["none", "lz4", "zstd"])
@pytest.mark.parametrize("part", [0.3, 0.6, 0.9])
def test_a_cut_off_bag_is_read_to_its_last_whole_chunk(
    tmp_path: Path, compression: str, part: float, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "whole.mcap"
    written = write_twists(path, 200, compression)
    ends = [block.offset + block.length for block in read_index(path).blocks]
    counts = []
    for block in read_index(path).blocks:
        counts.append(sum(1 for m in BagReader(path) if block.start_ns <= m.log_time_ns <= block.end_ns))
    size = int(ends[-1] * part)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[:size])
    expected = sum(count for end, count in zip(ends, counts, strict=True) if end <= size)
    with caplog.at_level(logging.WARNING):
        bag = BagReader(cut)
        got = [message.cdr for message in bag]
    assert got == written[:expected] and expected > 0
    assert bag.topics["/steering"].count == expected
    assert len(caplog.records) == len(bag.warnings) == 1
    assert "cut.mcap is cut off" in bag.warnings[0] and f"{expected} messages" in bag.warnings[0]


def test_every_cut_of_a_bag_gives_a_prefix_or_plain_words(tmp_path: Path) -> None:
    path, cut = tmp_path / "whole.mcap", tmp_path / "cut.mcap"
    written = write_twists(path, 20)
    data = path.read_bytes()
    for size in range(0, len(data), 37):
        cut.write_bytes(data[:size])
        try:
            got = cdrs(cut)
        except BagError as error:
            assert size < 8 and "cut.mcap" in str(error)
        else:
            assert got == written[: len(got)]


@settings(max_examples=150, deadline=None)
@given(data=st.data(), compression=st.sampled_from(["none", "lz4", "zstd"]))
def test_no_flipped_byte_brings_the_reader_down_or_a_wrong_message_in(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, compression: str
) -> None:
    path = tmp_path_factory.mktemp("flip") / "a.mcap"
    written = set(write_twists(path, 30, compression))
    raw = bytearray(path.read_bytes())
    place = data.draw(st.integers(8, len(raw) - 1))
    raw[place] ^= 1 << data.draw(st.integers(0, 7))
    path.write_bytes(raw)
    bag = BagReader(path)
    assert set(message.cdr for message in bag) <= written


@pytest.mark.parametrize("compression", ["none", "lz4", "zstd"])
def test_a_damaged_chunk_is_named_and_all_others_are_kept(tmp_path: Path, compression: str) -> None:
    path = tmp_path / "a.mcap"
    written = write_twists(path, 100, compression)
    block = read_index(path).blocks[1]
    lost = {m.cdr for m in BagReader(path) if block.start_ns <= m.log_time_ns <= block.end_ns}
    raw = bytearray(path.read_bytes())
    raw[block.offset + block.length // 2] ^= 0xFF
    path.write_bytes(raw)
    bag = BagReader(path)
    assert [message.cdr for message in bag] == [cdr for cdr in written if cdr not in lost]
    assert len(bag.warnings) == 1 and "a.mcap: chunk 2" in bag.warnings[0]


def test_a_bag_without_chunks_is_read(tmp_path: Path) -> None:
    from mcap.writer import Writer

    path = tmp_path / "fastwrite.mcap"
    writer = Writer(str(path), use_chunking=False)
    writer.start("ros2")
    channel = writer.register_channel("/t", "cdr", writer.register_schema(TWIST, "ros2msg", b"x"))
    for i in range(50):
        writer.add_message(channel, i, bytes([0, 1, 0, 0, i]) * 10000, i)
    writer.finish()
    bag = BagReader(path)
    assert [m.log_time_ns for m in bag] == list(range(50)) and bag.warning is None
    assert bag.topics["/t"].count == 50 and bag.topics["/t"].type_name == TWIST


def test_messages_that_rosbag2_packed_one_by_one_are_unpacked(tmp_path: Path) -> None:
    import zstandard

    with BagWriter(tmp_path / "a.mcap") as bag:
        bag.write("/t", TWIST, 1, zstandard.compress(b"\0\1\0\0hello"))
    assert cdrs(tmp_path / "a.mcap") == [b"\0\1\0\0hello"]


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "there is no bag"),
        (b"", "is empty"),
        (b"no bag at all", "is not an mcap bag"),
        (b"SQLite format 3\0" + bytes(100), "ros2 bag convert"),
        (b"#ROSBAG V2.0\n", "ROS 1 bag"),
        (b"\x28\xb5\x2f\xfd1234", "zstd -d"),
    ],
)
def test_what_is_no_bag_is_said_in_plain_words(tmp_path: Path, content: bytes | None, words: str) -> None:
    path = tmp_path / "x.mcap"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(BagError, match=words) as caught:
        BagReader(path)
    assert "x.mcap" in str(caught.value)


def test_the_folder_that_ros2_bag_makes_is_read(tmp_path: Path) -> None:
    written = write_twists(tmp_path / "bag_0.mcap")
    assert cdrs(tmp_path) == written
    write_twists(tmp_path / "bag_1.mcap")
    with pytest.raises(BagError, match="2 mcap files"):
        BagReader(tmp_path)


def test_failure_leaves_nothing_under_the_final_name(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), BagWriter(tmp_path / "a.mcap") as bag:
        bag.write("/t", TWIST, 1, messages.twist_stamped(1, "f", 0, 0))
        raise RuntimeError
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("in_place", [False, True])
def test_a_full_disk_gives_one_clear_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, in_place: bool
) -> None:
    from robot_vision.bags import writer

    path = tmp_path / "a.mcap"
    with pytest.raises(BagError, match=r"cannot write .*a\.mcap: No space left"):  # noqa: SIM117
        with BagWriter(path, chunk_size=100, in_place=in_place) as bag:
            bag.write("/t", TWIST, 1, messages.twist_stamped(1, "f" * 200, 0, 0))

            def full(self: object, data: bytes) -> int:
                raise OSError(errno.ENOSPC, "No space left on device")

            monkeypatch.setattr(writer._File, "write", full)
            bag.write("/t", TWIST, 2, messages.twist_stamped(2, "f" * 200, 0, 0))
    assert path.exists() == in_place
    assert not list(tmp_path.glob("*.partial"))
    if in_place:
        assert len(cdrs(path)) == 1


def test_in_place_a_killed_recording_is_found_under_its_name_and_not_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    bag = BagWriter(path, in_place=True)
    bag.write("/t", TWIST, 1, messages.twist_stamped(1, "f", 0, 0))
    bag.flush()
    bag.write("/t", TWIST, 2, messages.twist_stamped(2, "f", 0, 0))
    assert [m.log_time_ns for m in BagReader(path)] == [1]  # as a kill would leave it
    with pytest.raises(BagError, match="exists already"):
        BagWriter(path, in_place=True)
    bag.finish()
    bag.finish()
    assert [m.log_time_ns for m in BagReader(path)] == [1, 2]


REFUSED: list[tuple[str, Callable[[BagWriter], None]]] = [
    ("holds geometry", lambda bag: bag.write("/t", IMAGE, 1, b"1234")),
    ("is to hold", lambda bag: bag.write("/u", IMAGE, 1, messages.twist_stamped(1, "f", 0, 0))),
    ("cannot stand in a bag", lambda bag: bag.write("/u", TWIST, -1, b"1234")),
]


@pytest.mark.parametrize(("words", "write"), REFUSED)
def test_wrong_writes_are_refused_and_spoil_nothing(
    tmp_path: Path, words: str, write: Callable[[BagWriter], None]
) -> None:
    with BagWriter(tmp_path / "a.mcap") as bag:
        bag.write("/t", TWIST, 1, messages.twist_stamped(1, "f", 0, 0))
        with pytest.raises(BagError, match=words):
            write(bag)
    assert BagReader(tmp_path / "a.mcap").message_count == 1


def test_a_type_nobody_knows_is_recorded_by_name(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "a.mcap") as bag:
        bag.write("/t", "my_msgs/msg/Thing", 1, b"\0\1\0\0")
    assert list(BagReader(tmp_path / "a.mcap")) == [BagMessage("/t", "my_msgs/msg/Thing", 1, b"\0\1\0\0")]
    with (tmp_path / "a.mcap").open("rb") as stream:
        assert len(list(NonSeekingReader(stream, validate_crcs=True).iter_messages())) == 1


def test_folders_that_are_not_there_and_names_that_are_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="No such file"):
        BagWriter(tmp_path / "no" / "a.mcap")
    with pytest.raises(BagError, match="is a folder"):
        BagWriter(tmp_path)


def test_memory_stays_within_a_few_chunks(tmp_path: Path) -> None:
    import tracemalloc

    path = tmp_path / "a.mcap"
    picture = np.zeros((480, 640, 3), np.uint8)
    with BagWriter(path) as bag:
        for i in range(40):
            bag.write("/image", IMAGE, i, messages.image(i, "camera", picture))
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[:-2000])
    for name in (path, cut):
        tracemalloc.start()
        count = sum(1 for _ in BagReader(name))
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert count >= 39
        assert peak < 12 * picture.size  # of 40 pictures


@pytest.mark.parametrize("in_place", [False, True])
def test_what_is_no_file_keeps_its_place(tmp_path: Path, in_place: bool) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(BagError, match="not a file"):
        BagWriter(pipe, in_place=in_place, overwrite=in_place)
    assert pipe.is_fifo()


def test_a_link_stays_and_its_target_is_written(tmp_path: Path) -> None:
    target, link = tmp_path / "target.mcap", tmp_path / "link.mcap"
    link.symlink_to(target)
    written = write_twists(link)
    assert link.is_symlink() and cdrs(target) == written


def test_only_who_may_overwrite_does(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write_twists(path, 60)
    with pytest.raises(BagError, match="exists already"):
        BagWriter(path, in_place=True)
    assert len(cdrs(path)) == 60
    assert cdrs(path) != (again := write_twists(path, 3, in_place=True, overwrite=True))
    assert cdrs(path) == again
