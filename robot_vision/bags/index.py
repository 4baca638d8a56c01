# SPDX-License-Identifier: Apache-2.0
"""Finds out where in an mcap file the messages lie: by its index, or by a walk through a file without one."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from robot_vision.bags.errors import BagError

if TYPE_CHECKING:
    from mcap.records import Channel, Chunk, McapRecord, Message, Schema, Statistics

MAGIC = b"\x89MCAP0\r\n"
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _CHUNK_INDEX, _STATISTICS = 0x03, 0x04, 0x05, 0x06, 0x08, 0x0B
_FOOTER, _DATA_END = 0x02, 0x0F
_HEAD = struct.Struct("<BQ")  # opcode and length of a record
_FOOTER_SIZE = _HEAD.size + 20 + len(MAGIC)
_BLOCK_SIZE = 1 << 20  # loose messages are read in blocks of about this many bytes


@dataclass(frozen=True)
class Block:
    """A stretch of the file that is read at once: a chunk, or a run of loose messages."""

    offset: int
    length: int
    start_ns: int
    end_ns: int
    is_chunk: bool
    channels: frozenset[int] | None  # None: not known


@dataclass
class Index:
    """Where the messages of a file lie; `warnings` says what could not be read."""

    path: Path
    blocks: list[Block] = field(default_factory=list)
    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    start_ns: int = 0
    end_ns: int = 0
    warnings: list[str] = field(default_factory=list)


def read_index(path: Path) -> Index:
    """Find the messages of an mcap file.

    Raises:
        BagError: missing, empty, or no mcap file.
    """
    try:
        with open(path, "rb") as stream:
            size = os.fstat(stream.fileno()).st_size
            _check_magic(path, stream, size)
            index = _from_summary(path, stream, size)
            return index if index is not None else _by_walking(path, stream, size)
    except OSError as error:
        raise BagError(f"cannot read {path}: {error.strerror}") from error


def block_records(stream: IO[bytes], block: Block) -> list[McapRecord]:
    """Read the records of one block and check its CRC.

    Raises:
        CorruptBlockError: it is not what it should be; the text tells how.
    """
    from mcap.records import Chunk, Message

    stream.seek(block.offset)
    data = stream.read(block.length)
    if len(data) != block.length:
        raise CorruptBlockError("it is cut off")
    if not block.is_chunk:
        return [_parse(Message, body) for opcode, body in _records(data) if opcode == _MESSAGE]
    opcode, length = _HEAD.unpack_from(data)
    if opcode != _CHUNK or length != block.length - _HEAD.size:
        raise CorruptBlockError("there is no chunk where the index says")
    chunk: Chunk = _parse(Chunk, memoryview(data)[_HEAD.size :])
    return _chunk_records(chunk)


class CorruptBlockError(ValueError):
    """A stretch of the file is damaged; the text tells how."""


def _check_magic(path: Path, stream: IO[bytes], size: int) -> None:
    if size == 0:
        raise BagError(f"{path} is empty: there is no bag in it")
    start = stream.read(16)
    if start.startswith(MAGIC):
        return
    if start.startswith(b"SQLite format 3"):
        raise BagError(f"{path} is a sqlite3 bag: convert it to mcap with `ros2 bag convert`")
    if start.startswith(b"\x28\xb5\x2f\xfd"):
        raise BagError(f"{path} is packed as a whole: unpack it with `zstd -d {path.name}` first")
    if start.startswith(b"#ROSBAG"):
        raise BagError(f"{path} is a ROS 1 bag: convert it with `rosbags-convert` first")
    raise BagError(f"{path} is not an mcap bag: it does not begin like one")


def _records(data: bytes | memoryview) -> Iterator[tuple[int, memoryview]]:
    """Yield opcode and body of the records in `data`."""
    view = memoryview(data)
    position = 0
    while position < len(view):
        if position + _HEAD.size > len(view):
            raise CorruptBlockError("a record is cut off")
        opcode, length = _HEAD.unpack_from(view, position)
        position += _HEAD.size
        if length > len(view) - position:
            raise CorruptBlockError("a record is longer than the stretch it stands in")
        yield opcode, view[position : position + length]
        position += length


def _parse(kind: Any, body: bytes | memoryview) -> Any:
    """Parse the body of one record with mcap's own class for it."""
    from mcap.data_stream import ReadDataStream
    from mcap.exceptions import McapError
    from mcap.records import Message

    stream = ReadDataStream(BytesIO(body))
    try:
        return kind.read(stream, len(body)) if kind is Message else kind.read(stream)
    except (struct.error, UnicodeDecodeError, McapError) as error:
        raise CorruptBlockError(f"a {kind.__name__} record makes no sense") from error


def _chunk_records(chunk: Chunk) -> list[McapRecord]:
    from mcap.exceptions import McapError
    from mcap.records import Channel, Message, Schema
    from mcap.stream_reader import CRCValidationError, get_chunk_data_stream

    try:
        stream, length = get_chunk_data_stream(chunk, validate_crc=True)
    except CRCValidationError as error:
        raise CorruptBlockError("its checksum does not fit") from error
    except McapError as error:  # a compression nobody knows
        raise CorruptBlockError(str(error)) from error
    except (RuntimeError, ValueError, MemoryError, _zstd_error()) as error:
        raise CorruptBlockError("it cannot be decompressed") from error
    if length != chunk.uncompressed_size:
        raise CorruptBlockError("its length does not fit")
    kinds = {_SCHEMA: Schema, _CHANNEL: Channel, _MESSAGE: Message}
    data = stream.read(length)
    return [_parse(kinds[opcode], body) for opcode, body in _records(data) if opcode in kinds]


def _zstd_error() -> type[Exception]:
    import zstandard

    return zstandard.ZstdError


def _from_summary(path: Path, stream: IO[bytes], size: int) -> Index | None:
    """Read the index at the end of a finished file; None if there is none, or none that can be trusted."""
    from mcap.records import Channel, ChunkIndex, Schema, Statistics

    if size < len(MAGIC) + _FOOTER_SIZE:
        return None
    stream.seek(size - _FOOTER_SIZE)
    tail = stream.read(_FOOTER_SIZE)
    if not tail.endswith(MAGIC) or _HEAD.unpack_from(tail) != (_FOOTER, 20):
        return None
    summary_start, _, crc = struct.unpack_from("<QQI", tail, _HEAD.size)
    if not len(MAGIC) <= summary_start < size - _FOOTER_SIZE:
        return None
    stream.seek(summary_start)
    summary = stream.read(size - _FOOTER_SIZE - summary_start)
    if crc and zlib.crc32(tail[: _HEAD.size + 16], zlib.crc32(summary)) != crc:
        return None
    index = Index(path)
    statistics: Statistics | None = None
    try:
        for opcode, body in _records(summary):
            if opcode == _SCHEMA:
                schema = _parse(Schema, body)
                index.schemas[schema.id] = schema
            elif opcode == _CHANNEL:
                channel = _parse(Channel, body)
                index.channels[channel.id] = channel
            elif opcode == _CHUNK_INDEX:
                chunk: ChunkIndex = _parse(ChunkIndex, body)
                index.blocks.append(
                    Block(
                        chunk.chunk_start_offset,
                        chunk.chunk_length,
                        chunk.message_start_time,
                        chunk.message_end_time,
                        True,
                        frozenset(chunk.message_index_offsets) or None,
                    )
                )
            elif opcode == _STATISTICS:
                statistics = _parse(Statistics, body)
    except CorruptBlockError:
        return None
    if statistics is None or (statistics.message_count and not (index.blocks and index.channels)):
        return None
    index.counts = dict(statistics.channel_message_counts)
    index.start_ns, index.end_ns = statistics.message_start_time, statistics.message_end_time
    return index


def _by_walking(path: Path, stream: IO[bytes], size: int) -> Index:
    """Walk through a file without an index (cut off, or written without chunks), one block in memory."""
    index = Index(path)
    walk = _Walk(index, stream)
    position = len(MAGIC)
    finished = False
    while position + _HEAD.size <= size:
        stream.seek(position)
        opcode, length = _HEAD.unpack(stream.read(_HEAD.size))
        end = position + _HEAD.size + length
        if opcode == 0 or end > size:
            break
        if opcode in (_DATA_END, _FOOTER):
            finished = True
            break
        walk.record(opcode, position, end)
        position = end
    walk.close()
    if index.blocks:
        index.start_ns = min(block.start_ns for block in index.blocks)
        index.end_ns = max(block.end_ns for block in index.blocks)
    index.blocks = [block for block in index.blocks if block.length]
    if not finished:
        count = sum(index.counts.values())
        seconds = (index.end_ns - index.start_ns) / 1e9
        lost = f"the last {size - position} bytes are lost" if size > position else "what came after is lost"
        kept = f"{count} messages, {seconds:.1f} s"
        index.warnings.append(f"{path} is cut off: it was read to its last whole chunk ({kept}), {lost}")
    return index


class _Walk:
    """Gathers what a walk through a file meets."""

    def __init__(self, index: Index, stream: IO[bytes]) -> None:
        self.index = index
        self.stream = stream
        self.loose: list[tuple[int, int, int, int]] = []  # offset, end, log time, channel

    def record(self, opcode: int, offset: int, end: int) -> None:
        from mcap.records import Channel, Schema

        if opcode == _MESSAGE:
            header = self.stream.read(14)
            if len(header) == 14:
                channel, _, log_time = struct.unpack("<HIQ", header)
                self._count(channel)
                self.loose.append((offset, end, log_time, channel))
                if end - self.loose[0][0] >= _BLOCK_SIZE:
                    self.close()
            return
        self.close()
        if opcode == _CHUNK:
            self._chunk(offset, end)
        elif opcode in (_SCHEMA, _CHANNEL):
            kind = Schema if opcode == _SCHEMA else Channel
            try:
                self._learn(_parse(kind, self.stream.read(end - offset - _HEAD.size)))
            except CorruptBlockError as error:
                self.index.warnings.append(f"{self.index.path}: at byte {offset}: {error}")

    def close(self) -> None:
        """End the current run of loose messages."""
        if not self.loose:
            return
        times = [entry[2] for entry in self.loose]
        start, end = self.loose[0][0], self.loose[-1][1]
        channels = frozenset(entry[3] for entry in self.loose)
        self.index.blocks.append(Block(start, end - start, min(times), max(times), False, channels))
        self.loose = []

    def _chunk(self, offset: int, end: int) -> None:
        from mcap.records import Message

        block = Block(offset, end - offset, 0, 0, True, None)
        try:
            records = block_records(self.stream, block)
        except CorruptBlockError as error:
            self.index.warnings.append(corrupt_text(self.index.path, len(self.index.blocks), block, error))
            return
        messages: list[Message] = []
        for record in records:
            if isinstance(record, Message):
                messages.append(record)
                self._count(record.channel_id)
            else:
                self._learn(record)
        if messages:
            times = [message.log_time for message in messages]
            channels = frozenset(message.channel_id for message in messages)
            self.index.blocks.append(Block(offset, end - offset, min(times), max(times), True, channels))

    def _count(self, channel: int) -> None:
        self.index.counts[channel] = self.index.counts.get(channel, 0) + 1

    def _learn(self, record: Any) -> None:
        from mcap.records import Channel, Schema

        if isinstance(record, Schema):
            self.index.schemas[record.id] = record
        elif isinstance(record, Channel):
            self.index.channels[record.id] = record


def corrupt_text(path: Path, number: int, block: Block, error: CorruptBlockError) -> str:
    """Return the sentence that names a damaged block."""
    return (
        f"{path}: chunk {number + 1} (at byte {block.offset}, {block.length} bytes) is damaged: {error}; "
        "its messages are left out, all others are kept"
    )
