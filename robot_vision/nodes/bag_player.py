# SPDX-License-Identifier: Apache-2.0
"""Replays a bag into the graph, at its own pace or in lockstep with the nodes that listen.

How a replay in lockstep gives the same bytes each time: what stands in the bag before a picture is sent
before it, in the order of the bag, and its receipt by every reliable subscriber is waited for; then the
picture goes out; what is later than the picture waits until each topic named in `lockstep` has said
something with the stamp of the picture. Nodes that join by exact stamp therefore find all that belongs to a
picture, and nothing later exists while they think. (Two messages that lie in a node at the same moment may
still be taken in either order: who hears both `odom` and the picture joins them by stamp. `/clock` stands
still at the time of the picture until it is answered.)

A topic `/image` of the bag is published as `image`, so that namespaces and remaps of this node work.
"""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Iterator
from functools import partial
from importlib import import_module
from typing import Any, ClassVar

from rclpy.duration import Duration
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from robot_vision.bags import BagError, BagReader, encode, messages
from robot_vision.bags.playback import Playback
from robot_vision.bags.replay import PICTURE_TYPES, Lockstep, Replay, ReplayItem, replay_items
from robot_vision.bags.schema import has_header
from robot_vision.ros.diagnostics import Level
from robot_vision.ros.node import VisionNode
from robot_vision.ros.parameters import Setting
from robot_vision.ros.readiness import AwaitedNodes
from robot_vision.ros.run import run_node

PICTURE_DEPTH = 5
DEPTH = 200
# Fast DDS asks for a receipt at once only when its history is full, else every 3 s: in lockstep, where each
# receipt is waited for, a history of one keeps that under a millisecond
LOCKSTEP_DEPTH = 1
ACK_TIMEOUT = Duration(seconds=5)
POLL_S = 0.05  # the graph tells nobody when endpoints match
SETTLED = 10  # looks without a change: our side of a match says nothing about the other side
NOT_PLAYED = frozenset({"clock", "rosout", "parameter_events"})  # these belong to the graph that runs now


def message_type(type_name: str) -> Any:
    """Return the class of an installed message type, None if it is not installed."""
    package, _, name = type_name.partition("/msg/")
    try:
        return getattr(import_module(f"{package}.msg"), name, None)
    except (ImportError, ValueError):
        return None


class BagPlayer(VisionNode):
    """Publishes what a bag holds; services `~/pause`, `~/resume`, `~/step` (std_srvs/Trigger).

    Raises:
        BagError: the bag cannot be replayed as the parameters ask.
    """

    SETTINGS: ClassVar = (
        Setting("bag", "", "the bag to replay: an mcap file", live=False),
        Setting("rate", 1.0, "seconds of the bag in a second; without meaning in lockstep", 0.001, 1000.0),
        Setting("start", 0.0, "what to leave out at the beginning, s", 0.0, 1e9, live=False),
        Setting("duration", 0.0, "how much of the bag to replay, s; 0: to its end", 0.0, 1e9, live=False),
        Setting("loop", False, "start again at the end", live=False),
        Setting("paused", False, "begin held: ~/resume or ~/step lets it go", live=False),
        Setting("topics", [""], "topics to replay; empty: all that the bag holds", live=False),
        Setting("exclude", [""], "topics not to replay", live=False),
        Setting("publish_clock", True, "publish the time of the bag on /clock", live=False),
        Setting("restamp", False, "header stamps become the time of sending; no /clock then", live=False),
        Setting("exit_at_end", True, "end with the end of the bag", live=False),
        Setting(
            "lockstep",
            "",
            "topics, with commas between, that must answer each picture; empty: off",
            live=False,
        ),
        Setting("lockstep_timeout", 5.0, "how long an answer is waited for, s", 0.001, 1e6, live=False),
        Setting("wait_for_nodes", [""], "nodes whose diagnostics must say that they are ready", live=False),
        Setting("wait_timeout", 10.0, "how long to wait for those who listen, s", 0.0, 1e6, live=False),
    )

    def __init__(self) -> None:
        super().__init__("bag_player")
        settings = self.settings
        if not settings["bag"]:
            raise BagError("the parameter bag must name the bag to replay")
        self._bag = BagReader(settings["bag"])
        if settings["start"] > self._bag.duration_s:
            raise BagError(
                f"start lies at {settings['start']:g} s, but {self._bag.path} ends at {self._bag.duration_s:.1f} s"
            )
        self._restamp = settings["restamp"]
        self._awaited_nodes = AwaitedNodes(self, settings["wait_for_nodes"])
        self._outputs = self._advertise(_names(settings["topics"]), _names(settings["exclude"]))
        self._pictures = [name for name in self._outputs if self._bag.topics[name].type_name in PICTURE_TYPES]
        with_clock = settings["publish_clock"] and not self._restamp
        self._clock_out = self.create_publisher(Clock, "/clock", 10) if with_clock else None
        self._clock_ns: int | None = None
        self._greeted = False
        self._lockstep: Lockstep | None = None
        self._answers: dict[str, Any] = {}
        self._playback = self._make_playback()
        self.use_settings()
        if settings["paused"]:
            self._playback.pause()
        self._thread = threading.Thread(target=self._play, name="playback", daemon=True)
        self._begun = False
        self._deadline = time.monotonic() + settings["wait_timeout"]
        self._known: dict[str, int] = {}
        self._settled = 0
        for name in ("pause", "resume", "step"):
            self.create_service(Trigger, f"~/{name}", partial(self._obey, name))
        self._look_timer = self.create_timer(POLL_S, self._look, clock=self.steady_clock)

    def configure(self, values: dict[str, Any]) -> None:
        """Take over the rate, the one setting that may change during a replay."""
        self._playback.set_rate(values["rate"])

    def stop(self) -> None:
        """End the replay and its thread."""
        self._playback.stop()
        if self._thread.is_alive():
            self._thread.join()

    def _advertise(self, only: frozenset[str], exclude: frozenset[str]) -> dict[str, Publisher]:
        """Create a publisher for each topic that is to be replayed and whose type is installed."""
        publishers = {}
        answers = frozenset(self._lockstep_topics())
        held = {name.lstrip("/") for name in self._bag.topics}
        for name in sorted(only - held):
            self.get_logger().warning(f"{self._bag.path} holds no topic {name}")
        for name, info in self._bag.topics.items():
            plain = name.lstrip("/")
            if plain in NOT_PLAYED | exclude or (only and plain not in only):
                continue
            if self.resolve_topic_name(plain) in answers:
                # an answer from the bag would let the next picture go before anybody has looked at this one
                self.get_logger().warning(f"{name} is left out: lockstep waits for others to say it")
                continue
            kind = message_type(info.type_name)
            if kind is None:
                self.get_logger().warning(f"{name} is left out: its type {info.type_name} is not installed")
                continue
            latched = info.qos is not None and info.qos.durability == "transient_local"
            qos = QoSProfile(
                depth=self._depth(info.type_name),
                reliability=ReliabilityPolicy.RELIABLE,
                durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
            )
            publishers[name] = self.create_publisher(kind, plain, qos)
        if not publishers:
            raise BagError(f"{self._bag.path} holds nothing to replay")
        return publishers

    def _depth(self, type_name: str) -> int:
        if self.settings["lockstep"]:
            return LOCKSTEP_DEPTH
        return PICTURE_DEPTH if type_name in PICTURE_TYPES else DEPTH

    def _make_playback(self) -> Playback:
        settings = self.settings
        topics = self._lockstep_topics()
        if topics and self._restamp:
            raise BagError("restamp and lockstep exclude each other: lockstep compares the stamps of the bag")
        if topics:
            self._lockstep = Lockstep(topics, round(settings["lockstep_timeout"] * 1e9))
        step_on_pictures = bool(self._pictures)
        replay = Replay(
            time.monotonic_ns, settings["rate"], self._lockstep, step_on_pictures=step_on_pictures
        )
        return Playback(replay, self._lap, self._send, loop=settings["loop"])

    def _lockstep_topics(self) -> list[str]:
        names = self.settings["lockstep"].split(",")
        return [self.resolved("lockstep", name.strip()) for name in names if name.strip()]

    def _lap(self) -> Iterator[ReplayItem]:
        start = self._bag.start_ns + round(self.settings["start"] * 1e9)
        duration = round(self.settings["duration"] * 1e9)
        end = start + duration if duration else None
        return replay_items(self._bag.messages(self._outputs, start, end), frozenset(self._pictures))

    def _missing(self) -> list[str]:
        """Return what must still happen before the first message may go out, in plain words."""
        missing = self._awaited_nodes.missing()
        counts = {name: publisher.get_subscription_count() for name, publisher in self._outputs.items()}
        for name, publisher in self._outputs.items():
            if counts[name] < self.count_subscribers(publisher.topic_name):
                missing.append(f"a subscriber of {publisher.topic_name} is not connected yet")
        if not self._awaited_nodes and not any(counts[name] for name in self._pictures or counts):
            missing.append(f"nobody listens to {' or '.join(self._pictures or counts)}")
        for topic in sorted(self._lockstep.topics if self._lockstep else ()):
            if topic not in self._answers and not self._listen(topic):
                missing.append(f"nobody publishes {topic}, which lockstep waits for")
        self._settled = self._settled + 1 if counts == self._known else 0
        self._known = counts
        if self._settled < SETTLED:
            missing.append("subscribers still come and go")
        return missing

    def _listen(self, topic: str) -> bool:
        """Subscribe to an output that lockstep waits for, once its type is known."""
        offers = self.get_publishers_info_by_topic(topic)
        kind = message_type(offers[0].topic_type) if offers else None
        if kind is None:
            return False
        if not has_header(offers[0].topic_type):
            self.get_logger().error(
                f"lockstep cannot wait for {topic}: a {offers[0].topic_type} carries no stamp"
            )
            return False
        reliable = all(offer.qos_profile.reliability == ReliabilityPolicy.RELIABLE for offer in offers)
        qos = QoSProfile(
            depth=10, reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT
        )
        hear = partial(self._hear_answer, topic)
        self._answers[topic] = self.create_subscription(kind, topic, hear, qos, raw=True)
        return True

    def _hear_answer(self, topic: str, cdr: bytes) -> None:
        try:
            self._playback.answer(topic, messages.header_stamp_ns(cdr))
        except BagError as error:
            self.complain(topic, str(error))

    def _look(self) -> None:
        """Start as soon as everybody is there, or time is over; then look for late outputs of lockstep."""
        missing = self._missing()
        if self._begun:
            if not missing:
                self._look_timer.cancel()
            return
        if missing and time.monotonic() < self._deadline:
            self.diagnostics.report(Level.OK, f"waits: {missing[0]}")
            return
        if missing:
            waited = f"starting after {self.settings['wait_timeout']:g} s all the same"
            self.get_logger().warning(f"{waited}: {'; '.join(missing)}")
        extent = f"{self._bag.duration_s:.1f} s, {self._bag.message_count} messages"
        self.get_logger().info(f"replaying {self._bag.path}: {extent}")
        self._warn_of_rivals()
        if self._bag.warnings:
            self.diagnostics.report(Level.WARN, f"replays what can be read: {'; '.join(self._bag.warnings)}")
        else:
            self.diagnostics.report(Level.OK, f"replays {self._bag.path}")
        self._begun = True
        self._thread.start()

    def _warn_of_rivals(self) -> None:
        """Say which topics of the bag others publish too: who hears them cannot tell old from new."""
        rivals = [
            name
            for name, publisher in self._outputs.items()
            if self.count_publishers(publisher.topic_name) > 1
        ]
        if rivals:
            self.get_logger().warning(
                f"others publish {', '.join(rivals)} too: leave them out with exclude, or stop the others"
            )

    def _play(self) -> None:
        try:
            finished = self._playback.run()
        except Exception as error:  # whatever ends the replay must end the node, and be said
            told = str(error) if isinstance(error, BagError) else traceback.format_exc()
            self.get_logger().error(told)
            self.exit_code = 1
        else:
            if finished:
                self._say_the_end()
            if finished and self.settings["exit_at_end"]:
                self.exit_code = 0

    def _say_the_end(self) -> None:
        for publisher in self._outputs.values():
            if not publisher.wait_for_all_acked(ACK_TIMEOUT):
                self.get_logger().warning(f"not everybody has received all of {publisher.topic_name}")
        text = f"end of {self._bag.path}: {self._playback.sent} messages, {self._playback.pictures} pictures"
        if self._lockstep is not None:
            text += (
                f", {self._lockstep.answered} answered, {self._lockstep.timed_out} without an answer in time"
            )
        self.get_logger().info(text)

    def _send(self, item: ReplayItem) -> None:
        publisher = self._outputs[item.message.topic]
        self._tell_time(item.message.log_time_ns)
        cdr = item.message.cdr
        if self._restamp and has_header(item.message.type_name):
            cdr = messages.with_header_stamp(cdr, time.time_ns())
        publisher.publish(cdr)
        if self._lockstep is not None and not (item.is_picture and self._greeted):
            publisher.wait_for_all_acked(ACK_TIMEOUT)
        if not self._greeted and (item.is_picture or not self._pictures):
            self._greet(item)
        self.diagnostics.answered += item.is_picture

    def _greet(self, item: ReplayItem) -> None:
        """Wait until the first messages have arrived, and let the time of the bag go on from there.

        A subscriber that this side has matched may not know of us yet; what is sent in between would be gone
        by the time it does.
        """
        for publisher in self._outputs.values():
            publisher.wait_for_all_acked(ACK_TIMEOUT)
        self._greeted = True
        self._playback.go_on_from(item.message.log_time_ns)

    def _tell_time(self, log_time_ns: int) -> None:
        if self._clock_out is None or log_time_ns == self._clock_ns:
            return
        self._clock_ns = log_time_ns
        self._clock_out.publish(encode(messages.clock(log_time_ns)))

    def _obey(self, name: str, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = getattr(self._playback, name)()
        refusals = {"pause": "it is held already", "resume": "it is not held", "step": "pause it first"}
        response.message = "" if response.success else refusals[name]
        return response


def _names(values: list[str]) -> frozenset[str]:
    return frozenset(value.lstrip("/") for value in values if value)


def main(args: list[str] | None = None) -> None:
    """Run the node until its bag ends or it is interrupted."""
    run_node(BagPlayer, args)


if __name__ == "__main__":
    main()
