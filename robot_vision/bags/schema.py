# SPDX-License-Identifier: Apache-2.0
"""What ROS 2 message types look like on disk, known without a ROS installation."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

from robot_vision.bags.errors import BagError

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore


@lru_cache(maxsize=1)
def typestore() -> Typestore:
    """Return the message types of ROS 2 Jazzy (loaded once, on first use)."""
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY)


def is_known(type_name: str) -> bool:
    """Tell whether messages of this type can be decoded."""
    return type_name in typestore().fielddefs


def message_class(type_name: str) -> Any:
    """Return the class of messages of `type_name`, such as `sensor_msgs/msg/Image`.

    Raises:
        BagError: the type is none of ROS 2 Jazzy's.
    """
    if not is_known(type_name):
        raise BagError(f"message type {type_name!r} is not one of ROS 2 Jazzy's common interfaces")
    return typestore().types[type_name]


@lru_cache(maxsize=256)
def definition(type_name: str) -> str:
    """Return the text of a type with all the types it contains (schema encoding `ros2msg`); "" if unknown."""
    if not is_known(type_name):
        return ""
    return typestore().generate_msgdef(type_name, ros_version=2)[0]


@lru_cache(maxsize=256)
def type_hash(type_name: str) -> str:
    """Return the REP-2011 hash of a type (`RIHS01_...`); "" if the type is unknown."""
    return typestore().hash_rihs01(type_name) if is_known(type_name) else ""


@lru_cache(maxsize=256)
def has_header(type_name: str) -> bool:
    """Tell whether messages of this type begin with a std_msgs/Header, so that a stamp stands first."""
    if not is_known(type_name):
        return False
    fields = typestore().fielddefs[type_name][1]
    return bool(fields) and fields[0][1][1] == "std_msgs/msg/Header"


def encode(message: Any) -> bytes:
    """Serialise a message to little-endian CDR, encapsulation header included.

    Raises:
        BagError: a field does not fit its type; the text names the message type.
    """
    type_name = getattr(message, "__msgtype__", None)
    if type_name is None:
        raise BagError(f"{type(message).__name__} is not a message: build it with robot_vision.bags.messages")
    try:
        return bytes(typestore().serialize_cdr(message, type_name, little_endian=True))
    except (TypeError, AttributeError, ValueError, AssertionError, KeyError) as error:
        raise BagError(f"a {type_name} cannot be serialised: {error}") from error


def decode(cdr: bytes, type_name: str) -> Any:
    """Deserialise one message.

    Raises:
        BagError: the type is unknown, or the bytes are not a message of that type.
    """
    import struct

    from rosbags.serde import SerdeError

    message_class(type_name)
    try:
        return typestore().deserialize_cdr(cdr, type_name)
    except (SerdeError, struct.error, ValueError, IndexError, AssertionError) as error:
        raise BagError(f"{len(cdr)} bytes are not a {type_name}: {error}") from error
