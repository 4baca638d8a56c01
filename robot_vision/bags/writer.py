# SPDX-License-Identifier: Apache-2.0
"""Writes mcap bags that `ros2 bag`, Foxglove and this project open, and that survive an interruption."""

from __future__ import annotations

import os
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, NoReturn

from robot_vision.bags.errors import BagError
from robot_vision.bags.qos import OfferedQoS
from robot_vision.bags.schema import definition, encode, type_hash

if TYPE_CHECKING:
    from mcap.writer import Writer

Compression = Literal["none", "lz4", "zstd"]
COMPRESSIONS: tuple[Compression, ...] = ("none", "lz4", "zstd")
PARTIAL_SUFFIX = ".partial"
CHUNK_SIZE = 1 << 20  # bytes: at most this much and one message is lost when the power goes


class _File:
    """A file without a buffer of its own: what is written is with the system, whole chunk by whole chunk."""

    def __init__(self, path: Path, *, exclusive: bool) -> None:
        self._raw = open(path, "xb" if exclusive else "wb", buffering=0)  # noqa: SIM115  (closed by close)
        self._size = 0

    def write(self, data: bytes | memoryview) -> int:
        rest = memoryview(data)
        while rest:
            count = self._raw.write(rest)
            rest = rest[count:]
        self._size += len(data)
        return len(data)

    def tell(self) -> int:
        return self._size

    def flush(self) -> None:
        """Nothing waits here."""

    def close(self) -> None:
        self._raw.close()


class BagWriter:
    """Writes one bag file; use it as a context manager.

    The bag grows as `NAME.partial` and takes its name when it is finished: nobody ever finds half a bag
    under the final name. With `in_place` (a recorder: what was recorded counts, even if the end is missing)
    it grows under its final name, which must not exist yet unless it may `overwrite`, and `BagReader` reads it to
    its last whole chunk. Only a file is ever replaced; a link stays, and what it points to is written.

    The same calls give the same bytes. Chunks carry CRCs.

    Args:
        path: the file to write, usually `*.mcap`; its folder must exist.
        compression: of the chunks. Compressed pictures gain nothing from it.
        chunk_size: bytes of messages gathered before they are written.
        in_place, overwrite: see above.

    Attributes:
        message_count: messages taken.
        saved_count: messages in chunks that are with the system: what `BagReader` finds after a kill.

    Raises:
        BagError: the file cannot be written (folder missing, no permission, disk full, exists already, is a
            folder or a device).
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        compression: Compression = "none",
        chunk_size: int = CHUNK_SIZE,
        *,
        in_place: bool = False,
        overwrite: bool = False,
    ) -> None:
        from mcap.writer import CompressionType, Writer

        if compression not in COMPRESSIONS:
            raise BagError(f"compression is one of {', '.join(COMPRESSIONS)}, not {compression!r}")
        if chunk_size < 1:
            raise BagError(f"chunk_size must be at least 1 byte, not {chunk_size}")
        self.path = Path(path)
        self.message_count = 0
        self.saved_count = 0
        self._final = Path(os.path.realpath(self.path))
        self._growing = self._final if in_place else self._final.with_name(self._final.name + PARTIAL_SUFFIX)
        self._in_place = in_place
        self._channels: dict[str, tuple[int, str]] = {}
        self._schemas: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        self._open = False
        if self.path.is_dir():
            raise BagError(f"{self.path} is a folder: give the bag a file name, such as {self.path}/bag.mcap")
        if self._final.exists() and not self._final.is_file():
            raise BagError(f"{self.path} is not a file but a device or a pipe; a bag would take its place")
        try:
            self._file = _File(self._growing, exclusive=in_place and not overwrite)
        except FileExistsError as error:
            raise BagError(f"{self.path} exists already; a recording does not overwrite another") from error
        except OSError as error:
            raise BagError(f"cannot write {self.path}: {error.strerror}") from error
        self._open = True
        kinds = {"none": CompressionType.NONE, "lz4": CompressionType.LZ4, "zstd": CompressionType.ZSTD}
        self._mcap: Writer = Writer(
            self._file,  # type: ignore[arg-type]  # it needs write, tell, flush and close only
            chunk_size=chunk_size,
            compression=kinds[compression],
        )
        try:
            self._mcap.start(profile="ros2", library="robot_vision")
            self._mcap.add_metadata("rosbag2", {"ROS_DISTRO": "jazzy"})
        except OSError as error:
            self._fail(error)

    def add_topic(self, topic: str, type_name: str, qos: OfferedQoS | None = None) -> None:
        """Announce a topic; `write` does it by itself with the default quality of service.

        Raises:
            BagError: the topic stands in the bag with another type.
        """
        known = self._channels.get(topic)
        if known is not None:
            if known[1] != type_name:
                raise BagError(f"{self.path}: topic {topic} holds {known[1]}, not {type_name}")
            return
        self._require_open()
        try:
            schema = self._schema(type_name)
            metadata = {"offered_qos_profiles": (qos or OfferedQoS()).to_yaml()}
            if type_hash(type_name):
                metadata["topic_type_hash"] = type_hash(type_name)
            channel = self._mcap.register_channel(topic, "cdr", schema, metadata)
        except OSError as error:
            self._fail(error)
        self._channels[topic] = (channel, type_name)
        self._counts[topic] = 0

    def write(self, topic: str, type_name: str, stamp_ns: int, message: Any) -> None:
        """Write one message.

        Args:
            topic: name, usually with a leading slash.
            type_name: such as `sensor_msgs/msg/Image`.
            stamp_ns: log time in nanoseconds; readers order by it.
            message: a message of `robot_vision.bags.messages`, or its CDR bytes as they are.

        Raises:
            BagError: the message does not fit its type, or the disk took no more (the unfinished file
                is then removed, or left as far as it got with `in_place`).
        """
        self._require_open()
        if isinstance(message, bytes | bytearray | memoryview):
            data = bytes(message)
        else:
            if message.__class__.__name__ != type_name.replace("/", "__"):
                raise BagError(f"{topic} is to hold {type_name}, but the message is {type(message).__name__}")
            data = encode(message)
        if not 0 <= stamp_ns < 1 << 63:
            raise BagError(f"{topic}: a stamp of {stamp_ns} ns cannot stand in a bag")
        self.add_topic(topic, type_name)
        sequence = self._counts[topic]
        size = self._file.tell()
        try:
            self._mcap.add_message(self._channels[topic][0], stamp_ns, data, stamp_ns, sequence)
        except OSError as error:
            self._fail(error)
        self._counts[topic] = sequence + 1
        self.message_count += 1
        if self._file.tell() > size:  # the chunk was full, and this message its last
            self.saved_count = self.message_count

    def flush(self) -> None:
        """Close the current chunk now, so that everything written so far survives a kill."""
        self._require_open()
        try:
            self._mcap.flush()  # type: ignore[no-untyped-call]
        except OSError as error:
            self._fail(error)
        self.saved_count = self.message_count

    def finish(self) -> None:
        """Write the index and give the bag its name; does nothing the second time."""
        if not self._open:
            return
        try:
            self._mcap.finish()  # type: ignore[no-untyped-call]
            self._file.close()
            if not self._in_place:
                os.replace(self._growing, self._final)
        except OSError as error:
            self._fail(error)
        self._open = False
        self.saved_count = self.message_count

    def abort(self) -> None:
        """Give up: the unfinished file goes away (with `in_place` it stays, as far as it got)."""
        if not self._open:
            return
        self._open = False
        self._file.close()
        if not self._in_place:
            self._growing.unlink(missing_ok=True)

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None or self._in_place:
            self.finish()
        else:
            self.abort()

    def _schema(self, type_name: str) -> int:
        schema = self._schemas.get(type_name)
        if schema is None:
            text = definition(type_name)
            encoding = "ros2msg" if text else ""
            schema = self._schemas[type_name] = self._mcap.register_schema(type_name, encoding, text.encode())
        return schema

    def _require_open(self) -> None:
        if not self._open:
            raise BagError(f"{self.path} is finished: nothing more can be written to it")

    def _fail(self, error: OSError) -> NoReturn:
        self.abort()
        kept = f"; what was written so far is kept in {self.path}" if self._in_place else ""
        raise BagError(f"cannot write {self.path}: {error.strerror}{kept}") from error
