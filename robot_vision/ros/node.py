# SPDX-License-Identifier: Apache-2.0
"""What every node of the graph has in common, so that a node file holds only what it hears, calls and says.

Readiness. A node is ready when it is warmed up, somebody publishes each input it requires, and everybody in
the graph who hears one of its awaited outputs is connected to it. Those who only watch (bag_player,
bag_recorder) do not count as somebody; where nobody else turns up within `ready_patience`, it is ready alone.
"""

from __future__ import annotations

import copy
import time
import traceback
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

from builtin_interfaces.msg import Time as Stamp
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType, JumpThreshold, TimeJump
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from rclpy.validate_topic_name import validate_topic_name

from robot_vision.ros.diagnostics import NUMBER, Diagnostics, Level
from robot_vision.ros.parameters import ParameterError, Setting, changed, declare

COMPLAINT_PAUSE_S = 5.0
HOUSEKEEPING_S = 0.1
#: Somebody known to listen is waited for this many times longer than somebody who may not exist.
_LATECOMERS = 5.0
#: Those who hear a topic without being a link of the chain from picture to steering.
WATCHERS = frozenset({"bag_player", "bag_recorder"})
PATIENCE = Setting(
    "ready_patience",
    3.0,
    "how long the node waits for somebody to hear its outputs before it says that it is ready, s",
    0.0,
    3600.0,
    live=False,
)


def stamp_ns(stamp: Stamp) -> int:
    """Give a builtin_interfaces/Time in ns."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


class VisionNode(Node):
    """A node with typed parameters, diagnostics, complaints in words, and readiness.

    A subclass gives its `SETTINGS`, creates what it hears and says in its constructor, and ends it with
    `self.use_settings()`, which calls `configure`.

    Args:
        name: of the node unless remapped.

    Raises:
        ParameterError: a parameter given by the user makes no sense.
    """

    SETTINGS: ClassVar[Sequence[Setting]] = ()

    def __init__(self, name: str) -> None:
        super().__init__(name)
        #: Set it to end the process with that code; `run_node` looks after every callback.
        self.exit_code: int | None = None
        self._settings = (*self.SETTINGS, PATIENCE)
        #: The values of all settings by name.
        self.settings: dict[str, Any] = declare(self, self._settings)
        self.diagnostics = Diagnostics(self)
        self._required: list[Subscription] = []
        self._awaited: list[Publisher] = []
        self._warm = False
        self._was_ready = False
        self._unheard_since: float | None = None
        self._complaints: dict[tuple[str, str], tuple[float, int]] = {}
        self._newest_stamp_ns: int | None = None
        self._clock_jumps = self.get_clock().create_jump_callback(
            JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=False),
            post_callback=self._clock_jumped_back,
        )
        self.steady_clock = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(HOUSEKEEPING_S, self._keep_house, clock=self.steady_clock)

    def configure(self, values: dict[str, Any]) -> None:
        """Build what depends on the parameters: at start, and again when one changes.

        A refusal must leave everything as it was: build first, assign last.

        Raises:
            ValueError: the values do not go together; the reason reaches whoever set them.
        """

    def warm_up(self) -> None:
        """Do whatever makes a first answer slow; called once, after the endpoints exist."""

    def on_clock_jump_back(self) -> None:
        """Forget what earlier pictures told: time has started anew."""

    def nobody_publishes(self, topic: str) -> str:
        """Say in words that a required topic has no publisher; a node that knows why may say more."""
        return f"nobody publishes {topic}"

    def stop(self) -> None:
        """End threads and close files; called once before the node is destroyed."""

    def use_settings(self) -> None:
        """Configure the node by its parameters and accept changes from now on.

        Raises:
            ParameterError: the values do not go together.
        """
        try:
            self.configure(self.settings)
        except ValueError as error:
            raise ParameterError(str(error)) from error
        self.add_on_set_parameters_callback(self._change_settings)

    def hear(
        self,
        kind: type,
        topic: str,
        callback: Callable[[Any], None],
        qos: QoSProfile,
        *,
        required: bool = False,
        picture: bool = False,
    ) -> Subscription:
        """Subscribe; what the callback raises becomes a complaint about the topic, and the node lives on.

        Args:
            kind: type of the message.
            topic: relative name.
            callback: takes the message; `ValueError` from it tells what is wrong with the message.
            qos: default, which the parameters `qos_overrides.<topic>.subscription.*` override.
            required: the node is not ready before somebody publishes it.
            picture: count what comes, and what never came.

        Raises:
            ParameterError: an override names no quality of service.
        """
        receive = self._picture_receiver(topic, callback) if picture else self._receiver(topic, callback)
        try:
            subscription = self.create_subscription(
                kind,
                topic,
                receive,
                copy.copy(qos),  # rclpy writes the overrides into it
                qos_overriding_options=QoSOverridingOptions.with_default_policies(),
                event_callbacks=SubscriptionEventCallbacks(message_lost=self._count_lost)
                if picture
                else None,
            )
        except RuntimeError as refusal:
            raise ParameterError(f"qos_overrides of {topic}: {refusal}") from refusal
        if required:
            self._required.append(subscription)
        return subscription

    def say(self, kind: type, topic: str, qos: QoSProfile, *, awaited: bool = False) -> Publisher:
        """Advertise a topic; `awaited`: the node is ready only when those who hear it are connected."""
        publisher = self.create_publisher(kind, topic, qos)
        if awaited:
            self._awaited.append(publisher)
        return publisher

    def resolved(self, setting: str, name: str) -> str:
        """Give the full name, namespace and remaps applied, of a topic that a parameter names.

        Raises:
            ParameterError: it is no name of a topic.
        """
        try:
            validate_topic_name(name)
        except InvalidTopicNameException as refusal:
            reason = str(refusal).splitlines()[0]
            raise ParameterError(f"{setting} must hold names of topics, not {name!r}: {reason}") from refusal
        return self.resolve_topic_name(name)

    def catch_up(self, subscription: Subscription) -> None:
        """Take all that waits on a topic now.

        The executor hands out one message of each topic a turn: a picture may overtake what came before it.
        """
        while True:
            with subscription.handle:
                taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if taken is None:
                return
            subscription.callback(taken[0])

    def complain(self, topic: str, cause: str, advice: str = "") -> None:
        """Say what is wrong with a topic: one log line every few seconds for each cause, and a warning."""
        name = self.resolve_topic_name(topic)
        text = f"{name}: {cause}"
        self.diagnostics.complaints += 1
        self.diagnostics.last_complaint = text
        self.diagnostics.report(Level.WARN, text, advice)
        key = (name, NUMBER.sub("#", cause))
        said_at, unsaid = self._complaints.get(key, (-COMPLAINT_PAUSE_S, 0))
        now = time.monotonic()
        if now - said_at < COMPLAINT_PAUSE_S:
            self._complaints[key] = (said_at, unsaid + 1)
            return
        self._complaints[key] = (now, 0)
        again = f" ({unsaid} more of these before)" if unsaid else ""
        self.get_logger().warning(f"{text}{again}")

    def answered(self, stamp: Stamp, began: float) -> None:
        """Count an answer to the picture with this stamp, begun at `time.perf_counter()` = `began`."""
        self.diagnostics.answered += 1
        self.diagnostics.processing_ms = 1e3 * (time.perf_counter() - began)
        self.diagnostics.latency_ms = 1e-6 * (self.get_clock().now().nanoseconds - stamp_ns(stamp))

    def follow_time(self, topic: str, stamp: Stamp) -> None:
        """Look whether time goes on from picture to picture; where it goes back, start anew.

        Raises:
            ValueError: it stands still: what is said again and again must not keep a robot moving.
        """
        now, before = stamp_ns(stamp), self._newest_stamp_ns
        if before is not None and now == before:
            raise ValueError("its stamp does not advance; does whoever publishes it set header.stamp?")
        self._newest_stamp_ns = now
        if before is not None and now < before:
            back = 1e-9 * (before - now)
            self.complain(topic, f"its stamps went back by {back:.3f} s; what was known is forgotten")
            self.on_clock_jump_back()

    def _receiver(self, topic: str, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        def receive(message: Any) -> None:
            try:
                callback(message)
            except ValueError as cause:
                self.complain(topic, str(cause))
            except Exception as cause:  # one message must not leave a moving robot without its node
                self.get_logger().error(traceback.format_exc(), throttle_duration_sec=COMPLAINT_PAUSE_S)
                self.diagnostics.report(Level.ERROR, f"{topic}: {type(cause).__name__}", "report this fault")

        return receive

    def _picture_receiver(self, topic: str, callback: Callable[[Any], None]) -> Callable[[Any, Any], None]:
        receive = self._receiver(topic, callback)
        name = self.resolve_topic_name(topic)  # counting knows no remaps
        last: int | None = None

        def receive_picture(message: Any, info: dict[str, Any]) -> None:
            nonlocal last
            number = info["publication_sequence_number"]
            if number is not None:
                # a smaller one is of a publisher that has started anew; of two, each counts for itself
                if last is not None and number > last + 1 and self.count_publishers(name) == 1:
                    self.diagnostics.skipped += number - last - 1
                last = number
            self.diagnostics.heard += 1
            receive(message)

        return receive_picture

    def _count_lost(self, event: Any) -> None:
        self.diagnostics.lost += event.total_count_change

    def _change_settings(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            after = changed(self._settings, self.settings, parameters)
            if after != self.settings:
                self.configure(after)
        except ValueError as refusal:
            return SetParametersResult(successful=False, reason=str(refusal))
        self.settings = after
        return SetParametersResult(successful=True)

    def _clock_jumped_back(self, jump: TimeJump) -> None:
        if self._newest_stamp_ns is not None and self._newest_stamp_ns <= self.get_clock().now().nanoseconds:
            return  # the first picture of the new time came before its clock and has been seen to
        self._newest_stamp_ns = None
        back = -1e-9 * jump.delta.nanoseconds
        self.complain("/clock", f"jumped back by {back:.3f} s; what was known is forgotten")
        self.on_clock_jump_back()

    def get_warm(self) -> None:
        """Warm up and say what is still waited for."""
        self.warm_up()
        self._warm = True
        # processes.py waits for this line and for that of readiness
        self.get_logger().info(f"up; {self._waits_for() or 'connected'}")
        self._keep_house()

    def _keep_house(self) -> None:
        self.diagnostics.set_ready(self._waits_for())
        if self.diagnostics.ready and not self._was_ready:
            self._was_ready = True
            self.get_logger().info("ready")
        self.diagnostics.tick()

    def _waits_for(self) -> str:
        if not self._warm:
            return "warming up"
        for subscription in self._required:
            if subscription.get_publisher_count() == 0:
                topic = subscription.topic_name
                if self.count_publishers(topic):
                    return f"the publisher of {topic} is not connected; its quality of service may not fit"
                return self.nobody_publishes(topic)
        if self._was_ready:
            return ""
        for publisher in self._awaited:
            missing = self._unheard(publisher)
            if missing:
                return missing
        return ""

    def _unheard(self, publisher: Publisher) -> str:
        """Say who is not connected to an output yet; empty when nobody is missing, or patience is at an end."""
        now = time.monotonic()
        if self._unheard_since is None:
            self._unheard_since = now
        waited = now - self._unheard_since
        patience = self.settings[PATIENCE.name]
        listeners = self.get_subscriptions_info_by_topic(publisher.topic_name)
        if publisher.get_subscription_count() < len(listeners):
            # One whose quality of service does not fit never connects: it must not hold up the others.
            if waited < _LATECOMERS * patience:
                return f"somebody who hears {publisher.topic_name} is not connected yet"
            return ""
        if any(listener.node_name not in WATCHERS for listener in listeners):
            return ""
        return f"nobody hears {publisher.topic_name} yet" if waited < patience else ""
