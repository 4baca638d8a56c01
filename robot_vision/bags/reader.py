# SPDX-License-Identifier: Apache-2.0
"""Reads mcap bags message by message, whole or damaged, in bounded memory."""

from __future__ import annotations

import heapq
import logging
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, NamedTuple

from robot_vision.bags.errors import BagError
from robot_vision.bags.index import Block, CorruptBlockError, Index, block_records, corrupt_text, read_index
from robot_vision.bags.qos import OfferedQoS

_LOG = logging.getLogger(__name__)
_ZSTD = b"\x28\xb5\x2f\xfd"  # a message that rosbag2 packed by itself begins like this, CDR begins with 0


class BagMessage(NamedTuple):
    """One message as it stands in the bag."""

    topic: str
    type_name: str
    log_time_ns: int
    cdr: bytes


@dataclass(frozen=True)
class TopicInfo:
    """What a bag says about one topic."""

    name: str
    type_name: str
    count: int
    qos: OfferedQoS | None


class BagReader:
    """Reads one bag: an mcap file, or the folder `ros2 bag` made around a single one.

    Chunks may be uncompressed, lz4 or zstd. A file that was cut off is read to its last whole chunk and a
    damaged chunk is left out; each gets one warning, in the log and in `warnings`.

    Attributes:
        path: the mcap file.
        topics: by name, in order of name.
        start_ns, end_ns: log times of the first and last message, nanoseconds; 0 if there is none.
        message_count: how many messages the file announces.
        warnings: what could not be read, one sentence each; damaged chunks join while reading.

    Raises:
        BagError: missing, empty, or no mcap file.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = _bag_file(Path(path))
        self._index: Index = read_index(self.path)
        self.warnings: list[str] = []
        self.start_ns = self._index.start_ns
        self.end_ns = self._index.end_ns
        self._names: dict[int, tuple[str, str]] = {}
        for number, channel in self._index.channels.items():
            schema = self._index.schemas.get(channel.schema_id)
            self._names[number] = (channel.topic, schema.name if schema is not None else "")
        self.topics = self._topics()
        self.message_count = sum(info.count for info in self.topics.values())
        for text in self._index.warnings:
            self._warn(text)
        for number in sorted(set(self._index.counts) - set(self._names)):
            count = self._index.counts[number]
            self._warn(f"{self.path}: the name of a topic is lost, its {count} messages are left out")

    @property
    def warning(self) -> str | None:
        """All warnings so far in one line, or None."""
        return " | ".join(self.warnings) or None

    @property
    def duration_s(self) -> float:
        """Seconds from the first to the last message."""
        return (self.end_ns - self.start_ns) / 1e9

    def messages(
        self, topics: Iterable[str] | None = None, start_ns: int | None = None, end_ns: int | None = None
    ) -> Iterator[BagMessage]:
        """Yield messages in order of log time (equal times: in the order they were written).

        Args:
            topics: only these; None for all. A name with and one without a leading slash are the same.
            start_ns: first log time to yield.
            end_ns: last log time to yield.

        Yields:
            one message after the other; memory holds the chunks that overlap in time, usually one.
        """
        wanted = self._channels_of(topics)
        first = self.start_ns if start_ns is None else start_ns
        last = self.end_ns if end_ns is None else end_ns
        waiting = sorted(
            (
                (block.start_ns, block.offset, number, block)
                for number, block in enumerate(self._index.blocks)
                if block.start_ns <= last
                and block.end_ns >= first
                and (block.channels is None or not wanted.isdisjoint(block.channels))
            ),
            reverse=True,
        )
        # log time, offset of the block, place in it, channel, data
        loaded: list[tuple[int, int, int, int, bytes]] = []
        try:
            with open(self.path, "rb") as stream:
                while waiting or loaded:
                    while waiting and (not loaded or waiting[-1][0] <= loaded[0][0]):
                        _, _, number, block = waiting.pop()
                        for entry in self._load(stream, number, block, wanted):
                            if first <= entry[0] <= last:
                                heapq.heappush(loaded, entry)
                    if loaded:
                        log_time, _, _, channel, data = heapq.heappop(loaded)
                        topic, type_name = self._names[channel]
                        yield BagMessage(topic, type_name, log_time, data)
        except OSError as error:
            raise BagError(f"cannot read {self.path}: {error.strerror}") from error

    def __iter__(self) -> Iterator[BagMessage]:
        return self.messages()

    def _load(
        self, stream: IO[bytes], number: int, block: Block, wanted: set[int]
    ) -> Iterator[tuple[int, int, int, int, bytes]]:
        from mcap.records import Message

        try:
            records = block_records(stream, block)
        except CorruptBlockError as error:
            self._warn(corrupt_text(self.path, number, block, error))
            return
        for place, record in enumerate(records):
            if not isinstance(record, Message) or record.channel_id not in wanted:
                continue
            data = _unpacked(record.data)
            if data is None:
                topic = self._names[record.channel_id][0]
                self._warn(f"{self.path}: a message of {topic} at {record.log_time} ns is packed and damaged")
                continue
            yield record.log_time, block.offset, place, record.channel_id, data

    def _channels_of(self, topics: Iterable[str] | None) -> set[int]:
        if topics is None:
            return set(self._names)
        names = {topic.lstrip("/") for topic in topics}
        return {number for number, (topic, _) in self._names.items() if topic.lstrip("/") in names}

    def _topics(self) -> dict[str, TopicInfo]:
        found: dict[str, TopicInfo] = {}
        for number, (topic, type_name) in sorted(self._names.items(), key=lambda item: (item[1][0], item[0])):
            count = self._index.counts.get(number, 0)
            if topic in found:
                count += found[topic].count
            qos = OfferedQoS.from_yaml(self._index.channels[number].metadata.get("offered_qos_profiles", ""))
            found[topic] = TopicInfo(topic, type_name, count, qos)
        return found

    def _warn(self, text: str) -> None:
        if text not in self.warnings:
            self.warnings.append(text)
            _LOG.warning(text)


def _bag_file(path: Path) -> Path:
    """Return the mcap file meant by a file or a folder."""
    if not path.exists():
        raise BagError(f"there is no bag {path}")
    if not path.is_dir():
        return path
    files = sorted(path.glob("*.mcap"))
    if not files:
        raise BagError(f"there is no mcap file in the folder {path}")
    if len(files) > 1:
        raise BagError(f"the folder {path} holds {len(files)} mcap files: name one, such as {files[0]}")
    return files[0]


def _unpacked(data: bytes) -> bytes | None:
    """Undo rosbag2's compression of single messages; None if it cannot be undone."""
    if not data.startswith(_ZSTD):
        return data
    import zstandard

    try:
        return zstandard.decompress(data)
    except zstandard.ZstdError:
        return None
