# SPDX-License-Identifier: Apache-2.0
"""Records topics into a bag that stays readable whatever happens, without standing in anybody's way.

The bag grows under its final name. An interrupted recording (SIGINT, SIGTERM) is finished; a killed one is
read up to its last whole chunk, which is closed at least every two seconds. A recording never overwrites
another unless `overwrite` says so. The messages are written by a thread of their own; what a slow disk
cannot take is dropped, counted and said.

With `wait_for_nodes` it says that it is ready once all that these nodes say is connected, so that whoever waits for
that has the drive whole. That a publisher is known here does not mean that it knows of this subscriber. But a node
learns of subscriptions in the order in which they were made: once it is heard on the last one, it knows them all.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar

from rclpy.node import NodeNameNonExistentError
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from robot_vision.bags import BagError, BagWriter, OfferedQoS
from robot_vision.bags.recording import Recording
from robot_vision.bags.writer import COMPRESSIONS
from robot_vision.nodes.bag_player import message_type
from robot_vision.ros.diagnostics import Level
from robot_vision.ros.node import VisionNode
from robot_vision.ros.parameters import Setting
from robot_vision.ros.readiness import AwaitedNodes
from robot_vision.ros.run import run_node

LOOK_S = 0.1  # the graph tells nobody when a topic appears
DEPTH = 100
NOT_RECORDED = ("/rosout", "/parameter_events")  # unless they are named


@dataclass
class _Heard:
    """A topic that is recorded, and how it is subscribed."""

    type_name: str
    reliable: bool
    latched: bool
    subscription: Subscription


class BagRecorder(VisionNode):
    """Records named topics, or all.

    Raises:
        BagError: the bag cannot be written.
    """

    SETTINGS: ClassVar = (
        Setting("output", "", "the bag to write, such as drive.mcap", live=False),
        Setting("topics", [""], "topics to record; empty: all", live=False),
        Setting("exclude", [""], "topics not to record", live=False),
        Setting("compression", "none", "of the chunks of the bag", choices=COMPRESSIONS, live=False),
        Setting("overwrite", False, "replace a bag of this name", live=False),
        Setting(
            "wait_for_nodes", [""], "nodes of which nothing may be missed once this one is ready", live=False
        ),
        Setting("nice", 10, "how much the recorder gives way to others", 0, 19, live=False),
    )

    def __init__(self) -> None:
        super().__init__("bag_recorder")
        settings = self.settings
        output = Path(settings["output"])
        self._only = self._topics("topics")
        self._exclude = self._topics("exclude")
        os.nice(settings["nice"])
        if not output.name:
            raise BagError("the parameter output must name the bag to write")
        bag = BagWriter(output, settings["compression"], in_place=True, overwrite=settings["overwrite"])
        self._recording = Recording(bag)
        self._output = output
        self._heard: dict[str, _Heard] = {}
        self._left_out: set[str] = set()
        self._said_dropped = 0
        self._awaited_nodes = AwaitedNodes(self, settings["wait_for_nodes"])
        self._heard_last: AwaitedNodes | None = None
        self._look_timer = self.create_timer(LOOK_S, self._look, clock=self.steady_clock)
        self.use_settings()
        self.diagnostics.report(Level.OK, f"records into {output}")
        self.get_logger().info(f"recording {', '.join(sorted(self._only)) or 'all topics'} into {output}")

    def stop(self) -> None:
        """Finish the bag, with what has arrived but was not looked at yet."""
        for heard in self._heard.values():
            self.catch_up(heard.subscription)
        self._recording.close()
        if self._recording.trouble:
            self.get_logger().error(self._recording.trouble)
            self.exit_code = 1
        written = self._recording.received - self._recording.dropped
        self.get_logger().info(f"{self._output}: {written} messages, {self._recording.dropped} dropped")

    def _topics(self, setting: str) -> frozenset[str]:
        return frozenset(self.resolved(setting, name) for name in self.settings[setting] if name)

    def _look(self) -> None:
        """Subscribe to what is new, and anew where a publisher came that offers less; tell of troubles."""
        for name, types in self.get_topic_names_and_types():
            if self._wanted(name):
                self._follow(name, types[0])
        self.diagnostics.heard = self._recording.received
        self.diagnostics.lost = self._recording.dropped
        if self._recording.trouble:
            self.diagnostics.report(Level.ERROR, self._recording.trouble, "make room and record anew")
            self.exit_code = 1
        elif self._recording.dropped > self._said_dropped:
            self._said_dropped = self._recording.dropped
            self.complain(
                str(next(iter(self._heard), "bag")),
                f"the disk is too slow for {self._output}: {self._said_dropped} messages are not in it",
                "record fewer topics, or compressed pictures",
            )

    def _waits_for(self) -> str:
        missing = sorted(self._only - self._heard.keys() - self._left_out)
        if self._was_ready:
            return super()._waits_for()
        lacking = (
            super()._waits_for()
            or (f"nobody publishes {missing[0]}" if missing else "")
            or next(iter(self._awaited_nodes.missing()), "")
            or next(self._unconnected(), "")
        )
        if lacking:
            return lacking
        if self._heard_last is None:
            self._heard_last = AwaitedNodes(self, self._awaited_nodes.names)
        return next(iter(self._heard_last.missing()), "")

    def _unconnected(self) -> Iterator[str]:
        """Say in words which outputs of the nodes awaited are not connected yet."""
        for node in sorted(self._awaited_nodes.names):
            namespace, _, name = node.rpartition("/")
            try:
                outputs = self.get_publisher_names_and_types_by_node(name, namespace or "/")
            except NodeNameNonExistentError:
                yield f"{node} is not there"
                return
            for topic, _ in outputs:
                if not self._wanted(topic):
                    continue
                heard = self._heard.get(topic)
                if heard is None or heard.subscription.get_publisher_count() < self.count_publishers(topic):
                    yield f"{topic} of {node} is not connected"

    def _wanted(self, name: str) -> bool:
        if name in self._exclude or name in self._left_out:
            return False
        return name in self._only if self._only else name not in NOT_RECORDED

    def _follow(self, name: str, type_name: str) -> None:
        offers = self.get_publishers_info_by_topic(name)
        if not offers:
            return
        reliable = all(offer.qos_profile.reliability == ReliabilityPolicy.RELIABLE for offer in offers)
        latched = all(offer.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for offer in offers)
        known = self._heard.get(name)
        if known is not None:
            if known.reliable <= reliable and known.latched <= latched:
                return
            self.destroy_subscription(known.subscription)
        kind = message_type(type_name)
        if kind is None:
            self._left_out.add(name)
            self.get_logger().warning(f"{name} is not recorded: its type {type_name} is not installed")
            return
        qos = QoSProfile(
            depth=DEPTH,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        )
        if known is None:
            depth = offers[0].qos_profile.depth or OfferedQoS.depth  # DDS may not tell it to others
            offered = OfferedQoS(
                "reliable" if reliable else "best_effort", "transient_local" if latched else "volatile", depth
            )
            self._recording.add_topic(name, type_name, offered)
        hear = partial(self._hear, name, type_name)
        subscription = self.create_subscription(kind, name, hear, qos, raw=True)
        self._heard[name] = _Heard(type_name, reliable, latched, subscription)

    def _hear(self, name: str, type_name: str, cdr: bytes) -> None:
        self._recording.put(name, type_name, self.get_clock().now().nanoseconds, cdr)


def main(args: list[str] | None = None) -> None:
    """Run the node until it is interrupted."""
    run_node(BagRecorder, args)


if __name__ == "__main__":
    main()
