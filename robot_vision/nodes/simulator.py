# SPDX-License-Identifier: Apache-2.0
"""Drives a vehicle through a simulated world as `steering` says, and shows the graph what its camera sees.

With `head.on` the camera sits on a head that turns to where `look_at` says, and says how it stands on `joint_states`;
in lockstep each picture then waits for its `look_at` too, where somebody says it. Where none comes in time none is
waited for any more until one is heard: who advertises it may have nothing to say.

Lockstep: the world stands still from a picture until the `steering` with the stamp of that picture has come.
What belongs to a picture (odometry up to it, /clock, calibration, truth) is sent before it, and its receipt by
every reliable subscriber is waited for, so that the same seed gives the same drive on a slow machine as on
a fast one. When no steering comes within `lockstep_timeout`, the vehicle goes on with its last command; it
stops when that is older than `timeout` of simulated time.

Otherwise simulated time runs with real time, or slower where pictures cannot be made fast enough. None is made while
nobody listens to them; who comes later than others sees other noise.
"""

from __future__ import annotations

import json
import time
from typing import ClassVar

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import PointStamped, TwistStamped
from rclpy.duration import Duration
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from robot_vision.bags import encode, messages
from robot_vision.bags.messages import stamp_ns
from robot_vision.nodes.bag_player import message_type
from robot_vision.ros.diagnostics import TOPIC as DIAGNOSTICS
from robot_vision.ros.diagnostics import Level
from robot_vision.ros.head import point_from_message
from robot_vision.ros.node import VisionNode
from robot_vision.ros.qos import ANSWER, EVERY, NEWEST
from robot_vision.ros.readiness import AwaitedNodes
from robot_vision.ros.run import run_node
from robot_vision.ros.simulator_settings import SIMULATOR_SETTINGS, drive_asked_for
from robot_vision.simulation import sensed
from robot_vision.simulation.live import STANDING, OdometryAt
from robot_vision.simulation.record import START_NS
from robot_vision.simulation.sensed import PictureFormat
from robot_vision.simulation.truth import Said, TruthTeller

# as in bag_player: a history of one makes Fast DDS ask for a receipt at once
LOCKSTEP_DEPTH, DEPTH = 1, 20
ACK_TIMEOUT = Duration(seconds=5)
POLL_S = 0.05  # the graph tells nobody when endpoints match
SETTLED = 10  # looks without a change: our side of a match says nothing about the other side
TOUCHED = 3
"""Exit code of a drive that has touched something."""
SUMMARY = "summary: "
TELL_EVERY_NS = 1_000_000_000
BEHIND_S = 0.5  # how far simulated time may fall behind real time before it is said


class Simulator(VisionNode):
    """`steering` to what a camera and wheels say, and what is true.

    Raises:
        ParameterError: the parameters ask for what cannot be.
    """

    SETTINGS: ClassVar = SIMULATOR_SETTINGS

    def __init__(self) -> None:
        super().__init__("simulator")
        given = self.settings
        self._drive = drive_asked_for(given)
        world = self._drive.world
        self._teller = TruthTeller(world, world.camera)
        self._lockstep: bool = given["lockstep"]
        self._outputs: dict[str, Publisher] = {}
        self._format = PictureFormat(given["transport"] == "compressed", given["quality"])
        self._advertise()
        self._states = self.create_publisher(DiagnosticArray, DIAGNOSTICS, QoSProfile(depth=10))
        self._steering = self.hear(TwistStamped, "steering", self._hear_steering, EVERY)
        head = self._drive.head is not None
        self._looks = self.hear(PointStamped, "look_at", self._hear_look_at, NEWEST) if head else None
        self._look_at_comes = True
        self._awaited_nodes = AwaitedNodes(self, given["wait_for_nodes"])
        self._known: dict[str, int] = {}
        self._settled = 0
        self._begun = self._ended = False
        self._over = ""
        self._awaited_ns: int | None = None
        self._awaited_topics: set[str] = set()
        self._pictures = self._unanswered = 0
        self._told_ns = -TELL_EVERY_NS
        self._began_at = 0.0
        self._deadline = time.monotonic() + given["wait_timeout"]
        self._look_timer = self.create_timer(POLL_S, self._look, clock=self.steady_clock)
        period = given["lockstep_timeout"] if self._lockstep else 1 / given["rate"]
        self._timer = self.create_timer(period, self._time_is_over, clock=self.steady_clock)
        self._timer.cancel()
        self.use_settings()

    def warm_up(self) -> None:
        """Compile the renderer, and say where the camera sits: other nodes want it as parameters."""
        camera = self._drive.world.camera
        self._drive.warm_up()
        place = f"camera.height {camera.height_m:g} m, camera.pitch {camera.pitch:.4f} rad"
        self.get_logger().info(f"world {self.settings['world']}: {place}, camera.roll {camera.roll:.4f} rad")

    def stop(self) -> None:
        """Say how the drive went, if it was cut short."""
        if self._begun and not self._ended:
            self._summarise()

    def _advertise(self) -> None:
        kinds = {
            "/clock": "rosgraph_msgs/msg/Clock",
            "odom": "nav_msgs/msg/Odometry",
            "camera_info": "sensor_msgs/msg/CameraInfo",
            self._format.topic: self._format.type_name,
            **({"joint_states": "sensor_msgs/msg/JointState"} if self._drive.head is not None else {}),
        }
        state, now = self._drive.state, START_NS
        lasting = {said.topic: said.type_name for said in self._teller.lasting(now)}
        truth = {said.topic: said.type_name for said in self._teller.at(now, state)}
        for topic, kind in {**kinds, **truth, **lasting}.items():
            last = topic in lasting
            qos = QoSProfile(
                depth=LOCKSTEP_DEPTH if self._lockstep or last else DEPTH,
                reliability=ReliabilityPolicy.RELIABLE,
                durability=DurabilityPolicy.TRANSIENT_LOCAL if last else DurabilityPolicy.VOLATILE,
            )
            qos = ANSWER if topic == self._format.topic and not self._lockstep else qos
            self._outputs[topic] = self.create_publisher(message_type(kind), topic, qos)

    def _missing(self) -> list[str]:
        """Return what must still happen before the first picture, in plain words."""
        missing = self._awaited_nodes.missing()
        counts = {topic: output.get_subscription_count() for topic, output in self._outputs.items()}
        for topic, output in self._outputs.items():
            if counts[topic] < self.count_subscribers(output.topic_name):
                missing.append(f"a subscriber of {output.topic_name} is not connected yet")
        if not self._awaited_nodes and not counts[self._format.topic]:
            missing.append(f"nobody listens to {self._format.topic}")
        if self._steering.get_publisher_count() == 0:
            missing.append("nobody publishes steering")
        self._settled = self._settled + 1 if counts == self._known else 0
        self._known = counts
        if self._settled < SETTLED:
            missing.append("subscribers still come and go")
        return missing

    def _look(self) -> None:
        """Begin as soon as everybody is there, or time is over."""
        missing = self._missing()
        if missing and time.monotonic() < self._deadline:
            self.diagnostics.report(Level.OK, f"waits: {missing[0]}")
            return
        if missing:
            waited = f"starting after {self.settings['wait_timeout']:g} s all the same"
            self.get_logger().warning(f"{waited}: {'; '.join(missing)}")
        self._look_timer.cancel()
        self._begun = True
        self._began_at = time.monotonic()
        for said in self._teller.lasting(START_NS):
            self._say(said)
        self._show([STANDING])
        for output in self._outputs.values():
            output.wait_for_all_acked(ACK_TIMEOUT)  # a subscriber may have been matched on this side only
        self._timer.reset()

    def _hear_steering(self, message: TwistStamped) -> None:
        self.diagnostics.heard += 1
        if not self._begun or self._ended:
            return
        stamp = stamp_ns(message)
        if stamp == 0:  # of a person's hand, not of a picture
            stamp = START_NS + self._drive.time_ns
        self._drive.steer(message.twist.linear.x, message.twist.angular.z, stamp - START_NS)
        self._answered("steering", stamp)

    def _hear_look_at(self, message: PointStamped) -> None:
        if self._drive.head is not None and self._begun and not self._ended:
            self._look_at_comes = True
            try:
                self._drive.head.look_at(point_from_message(message))
            finally:  # one that cannot be looked at is an answer, too
                self._answered("look_at", stamp_ns(message))

    def _answered(self, topic: str, stamp: int) -> None:
        if self._lockstep and stamp == self._awaited_ns:
            self._awaited_topics.discard(topic)
            if not self._awaited_topics:
                self._go_on()

    def _time_is_over(self) -> None:
        """In lockstep: no steering, or nowhere to look, came in time. Else: the next picture is due."""
        if self._lockstep:
            picture = f"the picture at {self._drive.time_ns / 1e9:.2f} s"
            within = f"came within {self.settings['lockstep_timeout']:g} s"
            if self._awaited_topics == {"look_at"}:
                self._look_at_comes = False
                advice = "look at /diagnostics of who says it: camera.height may be missing"
                self.complain("look_at", f"none to {picture} {within}; no other one is waited for", advice)
            else:
                self._unanswered += 1
                will = "drives on with the last command" if self._drive.obeys else "stands"
                self.complain("steering", f"no steering to {picture} {within}; the vehicle {will}")
        self._go_on()

    def _go_on(self) -> None:
        self._awaited_ns = None
        contacts = self._drive.score.contacts
        readings = self._drive.advance()
        if self._drive.score.contacts > contacts:
            self._tell()
            self.get_logger().error(f"touched {self._drive.score.touched} after {self._drive.way:.2f} m")
        self._report()
        self._over = self._why_over()
        if self._over:
            self._end()
            return
        self._show(readings)
        if self._lockstep:
            self._timer.reset()

    def _why_over(self) -> str:
        """What ends the drive here, in a word for the summary; empty while it goes on."""
        drive, given = self._drive, self.settings
        if given["end_with_lane"] and drive.at_the_end:
            return "lane"
        if given["seconds"] and drive.time_ns >= given["seconds"] * 1e9:
            return "time"
        if given["stand_limit"] and drive.stood_s >= given["stand_limit"]:
            return "stands"
        return ""

    def _show(self, readings: list[OdometryAt]) -> None:
        """Send one moment: the odometry up to it, the time, calibration and truth, and last the picture."""
        for reading in readings:
            self._say_clock(reading.time_ns)
            self._say(sensed.odometry(START_NS + reading.time_ns, reading.reading))
        now = START_NS + self._drive.time_ns
        if not readings or readings[-1].time_ns != self._drive.time_ns:
            self._say_clock(self._drive.time_ns)
        self._say(sensed.camera_info(now, self._drive.world.camera))
        if self._drive.head is not None:
            self._say(sensed.head_joints(now, self._drive.camera))
        for said in self._teller.at(now, self._drive.state):
            self._say(said)
        self._awaited_ns, self._awaited_topics = now, {"steering"}
        if self._looks is not None and self._look_at_comes and self._looks.get_publisher_count():
            self._awaited_topics.add("look_at")
        output = self._outputs[self._format.topic]
        if output.get_subscription_count():
            began = time.perf_counter()
            picture = self._format.say(now, self._drive.picture())
            self.diagnostics.processing_ms = 1e3 * (time.perf_counter() - began)
            output.publish(encode(picture.message))
        self._pictures += 1
        self.diagnostics.answered += 1

    def _say_clock(self, time_ns: int) -> None:
        self._outputs["/clock"].publish(encode(messages.clock(START_NS + time_ns)))

    def _say(self, said: Said) -> None:
        output = self._outputs[said.topic]
        output.publish(encode(said.message))
        if self._lockstep:
            output.wait_for_all_acked(ACK_TIMEOUT)

    def _report(self) -> None:
        """Say how the drive goes, once a simulated second."""
        drive = self._drive
        if drive.in_contact:
            self.diagnostics.report(Level.ERROR, f"touches {drive.score.touched}", "steer away from it")
        elif not drive.obeys:
            self.diagnostics.report(
                Level.WARN, "stands: no steering young enough", "look what says steering on /diagnostics"
            )
        elif self._behind_s() > BEHIND_S:
            self.diagnostics.report(
                Level.WARN, f"simulated time is {self._behind_s():.1f} s behind", "give a smaller rate"
            )
        else:
            self.diagnostics.report(Level.OK, "drives")
        if drive.time_ns - self._told_ns >= TELL_EVERY_NS:
            self._tell()

    def _behind_s(self) -> float:
        if self._lockstep:
            return 0.0
        return time.monotonic() - self._began_at - self._drive.time_ns / 1e9

    def _tell(self) -> None:
        """Publish the state of the drive as diagnostic values."""
        self._told_ns = self._drive.time_ns
        touches = self._drive.in_contact
        state = DiagnosticStatus(
            level=bytes([Level.ERROR if touches else Level.OK]),
            name=f"{self.get_fully_qualified_name()}: drive",
            message=f"touches {self._drive.score.touched}" if touches else "free",
            hardware_id="robot_vision",
            values=[KeyValue(key=key, value=str(value)) for key, value in self._state().items()],
        )
        array = DiagnosticArray(status=[state])
        array.header.stamp = self.get_clock().now().to_msg()
        self._states.publish(array)

    def _state(self) -> dict[str, float | int | str | None]:
        """What is known of the drive so far, ready for JSON."""
        counts = {"pictures": self._pictures, "without_steering": self._unanswered}
        return {**counts, "ended": self._over, **self._drive.summary()}

    def _end(self) -> None:
        self._ended = True
        self._timer.cancel()
        self._tell()
        for output in (*self._outputs.values(), self._states):
            output.wait_for_all_acked(ACK_TIMEOUT)
        self._summarise()
        self.exit_code = TOUCHED if self._drive.score.contacts else 0

    def _summarise(self) -> None:
        # scripts read this line
        self.get_logger().info(f"{SUMMARY}{json.dumps(self._state())}")


def main(args: list[str] | None = None) -> None:
    """Run the node until the drive ends or it is interrupted."""
    run_node(Simulator, args)


if __name__ == "__main__":
    main()
