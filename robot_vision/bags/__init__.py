# SPDX-License-Identifier: Apache-2.0
"""Recorded drives: write, read, make and replay mcap bags without a ROS installation."""

from __future__ import annotations

from robot_vision.bags.errors import BagError
from robot_vision.bags.make import MadeBag, make_bag
from robot_vision.bags.qos import OfferedQoS
from robot_vision.bags.reader import BagMessage, BagReader, TopicInfo
from robot_vision.bags.schema import decode, encode
from robot_vision.bags.scores import HeadingScore, score_heading
from robot_vision.bags.writer import BagWriter

__all__ = [
    "BagError",
    "BagMessage",
    "BagReader",
    "BagWriter",
    "HeadingScore",
    "MadeBag",
    "OfferedQoS",
    "TopicInfo",
    "decode",
    "encode",
    "make_bag",
    "score_heading",
]
