# SPDX-License-Identifier: Apache-2.0
"""Hears pictures of a field, says where the robot stands in its row, and steers along it until the rows end.

Every picture is answered on `steering`, by standing still where no row is known; `heading` is said while one is,
through gaps as well, as long as odometry carries it. Plants are followed while somebody hears `plants` or `spray`,
after the steering is said, so that it never waits for them.
"""

from __future__ import annotations

import time
from typing import Any

from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2
from std_msgs.msg import Header

from robot_vision.control import CorridorSteering, Steering
from robot_vision.mapping.plant_map import PlantMap
from robot_vision.mapping.plants import Plants
from robot_vision.perception.crop_rows.ground_fit import GroundFit
from robot_vision.perception.crop_rows.plant_blobs import PlantSegmenter
from robot_vision.perception.crop_rows.row_filter import Motion
from robot_vision.perception.crop_rows.sensitivity import PRESETS
from robot_vision.perception.crop_rows.tracker import RowEstimate, RowTracker
from robot_vision.perception.odometry import MotionHistory
from robot_vision.perception.vegetation import INDICES, LeafMask, Picture, VegetationMask
from robot_vision.planning.sprayer import Fate, Spray, SprayPlanner
from robot_vision.ros import calibration, messages, plant_messages, qos
from robot_vision.ros.calibration import Calibration
from robot_vision.ros.diagnostics import Level
from robot_vision.ros.images import MESSAGES, TOPICS, Rectifier, image_message
from robot_vision.ros.node import stamp_ns
from robot_vision.ros.parameters import CAMERA_PLACE, Setting, camera_place
from robot_vision.ros.run import run_node
from robot_vision.ros.steering import STEERING_SETTINGS, SteeringNode

LAW_SETTINGS = (
    Setting("speed", 1.0, "speed along the rows, m/s", 0.01, 20.0),
    Setting("lookahead", 1.6, "distance of the point aimed at, m; shorter is brisker", 0.05, 50.0),
    Setting("most_turn_rate", 1.0, "limit of the turn rate, rad/s", 0.01, 20.0),
    Setting("most_acceleration", 1.0, "limit of the acceleration and of braking, m/s^2", 0.01, 20.0),
    Setting("most_turn_acceleration", 3.0, "limit of the change of the turn rate, rad/s^2", 0.01, 100.0),
    Setting("stop_distance", 0.1, "where to stand before the end of the rows, m", 0.01, 50.0),
    Setting("yaw_trusted", 0.1, "standard deviation of the yaw beyond which to stop, rad", 0.001, 3.2),
)
SPRAY_SETTINGS = (
    Setting("plants.view", 3.2, "ground on which plants are followed, m ahead of the camera", 1.0, 10.0),
    Setting("plants.step", 0.0, "distance between plants in a row, m; 0: found from the plants", 0.0, 5.0),
    Setting("spray.lanes", 24, "number of nozzles, side by side about the middle", 1, 255),
    Setting("spray.lane_width", 0.04, "width that each nozzle sprays, m", 0.005, 2.0),
    Setting("spray.boom_x", -0.3, "how far the nozzles sit ahead of base_link, m", -10.0, 10.0),
    Setting("spray.latency", 0.1, "from the command to the jet on the ground, s", 0.0, 5.0),
    Setting("spray.safety", 0.02, "distance kept from the leaves of the crop, m", 0.0, 1.0),
    Setting("spray.margin", 0.01, "sprayed before and behind a weed, m", 0.0, 1.0),
)
OFFSET_TRUSTED_SPACINGS = 0.25  # who does not know in which row he is does not drive
SPRAY_ADVICE = "look whether odometry comes, and whether the robot moves"
#: The end of the rows is told so long before the robot must brake for it, s.
TOLD_BEFORE_S = 0.5
UNSEEN_ADVICE = "look at rows/overlay: are plants found, and do the rows drawn lie on them?"


class CropRowSteeringNode(SteeringNode):
    """Pictures, `camera_info` and `odom` to `heading`, `steering`, `plants`, `spray` and `rows/overlay`."""

    SETTINGS = (
        Setting("transport", "raw", "how pictures come", choices=tuple(MESSAGES), live=False),
        *CAMERA_PLACE,
        Setting("row.spacing", 0.5, "distance between rows, m", 0.05, 10.0),
        Setting("row.gap", 4.0, "longest gap in the rows; longer open ground is their end, m", 0.5, 20.0),
        Setting(
            "row.end_within", 4.0, "an end farther ahead is not told, unless to brake for it, m", 0.5, 50.0
        ),
        Setting("row.bend", 0.0003, "how fast the curvature may change, 1/m per square root of m", 1e-6, 0.1),
        Setting("sensitivity", "medium", "how readily plants and rows are believed", choices=tuple(PRESETS)),
        Setting("vegetation", "auto", "what tells plants; auto takes grey as infrared", choices=INDICES),
        Setting("lean", 0.02, "usual roll and pitch of the body about its mounting, rad", 0.001, 0.5),
        Setting("view", 8.0, "ground that counts, m ahead of the camera", 1.0, 50.0),
        *LAW_SETTINGS,
        *SPRAY_SETTINGS,
        *STEERING_SETTINGS,
    )
    STEERS_BY = "picture"
    ADVICE = "look whether the camera still sends pictures"

    def __init__(self) -> None:
        super().__init__("crop_row_steering")
        self._tracker = RowTracker(self.settings["row.spacing"])
        self._law = CorridorSteering()
        self._plant_map, self._sprayer = PlantMap(), SprayPlanner()
        self._moved = Motion(0.0)
        self._tended: tuple[Plants, Spray] | None = None
        self._calibration = Calibration(camera_place(self.settings))
        self._rectifier = Rectifier()
        self._motion = MotionHistory()
        self._last_s: float | None = None
        self._heading = self.say(PoseWithCovarianceStamped, "heading", qos.ANSWER)
        self._plants = self.say(PointCloud2, "plants", qos.ANSWER)
        self._spray = self.say(PointCloud2, "spray", qos.ANSWER)
        self._overlay = self.say(Image, "rows/overlay", qos.ANSWER)
        self._camera_info = self.hear(CameraInfo, "camera_info", self._hear_camera_info, qos.SENSOR)
        self._odom = self.hear(Odometry, "odom", self._hear_odom, qos.ODOMETRY)
        transport = self.settings["transport"]
        self._topic = TOPICS[transport]
        self.hear(
            MESSAGES[transport], self._topic, self._hear_picture, qos.PICTURE, required=True, picture=True
        )
        self.use_settings()

    def configure(self, values: dict[str, Any]) -> None:
        """Set what plants, rows and the vehicle are like; the row that is followed stays known."""
        preset = PRESETS[values["sensitivity"]]
        mask = VegetationMask(index=values["vegetation"], floor=preset.floor)
        fit = GroundFit(lean=values["lean"], far=values["view"])
        law = {setting.name: values[setting.name] for setting in LAW_SETTINGS}
        law["offset_trusted"] = OFFSET_TRUSTED_SPACINGS * values["row.spacing"]
        CorridorSteering(**law)  # refuses what makes no sense
        tracker = self._tracker
        self._calibration.move(camera_place(values))
        if values["row.spacing"] != tracker.spacing:
            tracker.reset()
            self._plant_map.reset()
        tracker.spacing, tracker.mask, tracker.fit = values["row.spacing"], mask, fit
        tracker.coherence, tracker.cover = preset.coherence, preset.cover
        tracker.extent.gap = values["row.gap"]
        tracker.row_filter.bend = values["row.bend"]
        for name, value in law.items():
            setattr(self._law, name, value)
        heard_of = self._law.braking_way + TOLD_BEFORE_S * self._law.speed
        tracker.end_within = max(values["row.end_within"], heard_of)
        self._configure_plants(values, preset.sure, preset.floor)
        super().configure(values)

    def _configure_plants(self, values: dict[str, Any], sure: float, floor: float) -> None:
        segmenter = PlantSegmenter(far=values["plants.view"])
        given = {
            name.removeprefix("spray."): value for name, value in values.items() if name.startswith("spray.")
        }
        given["width"] = given.pop("lane_width")
        SprayPlanner(**given)  # refuses what makes no sense
        plant_map = self._plant_map
        plant_map.mask = LeafMask(index=values["vegetation"], floor=floor)
        plant_map.segmenter, plant_map.sure = segmenter, sure
        plant_map.judge.step = values["plants.step"]
        for name, value in given.items():
            setattr(self._sprayer, name, value)

    def warm_up(self) -> None:
        """Load the compiled kernels and what the filter stands on."""
        self._tracker.warm_up()
        self._plant_map.segmenter.warm_up()

    def on_clock_jump_back(self) -> None:
        """Forget the row and the last command."""
        self._tracker.reset()
        self._plant_map.reset()
        self._sprayer.reset()
        self._law.reset()
        self._motion.clear()
        self._last_s = None

    def reset_steering(self) -> None:
        """Begin from standing."""
        self._law.reset()

    def nobody_publishes(self, topic: str) -> str:
        """Name the other transport where pictures come by that."""
        for transport, name in TOPICS.items():
            if name != self._topic and self.count_publishers(self.resolve_topic_name(name)):
                return f"nobody publishes {topic}, but pictures come {transport}: set transport:={transport}"
        return super().nobody_publishes(topic)

    def _hear_camera_info(self, message: CameraInfo) -> None:
        self._calibration.take(message)

    def _hear_odom(self, message: Odometry) -> None:
        speed, rate = message.twist.twist.linear.x, message.twist.twist.angular.z
        messages.check_finite({"twist.linear.x": speed, "twist.angular.z": rate})
        self._motion.add(1e-9 * stamp_ns(message.header.stamp), speed, rate)

    def _hear_picture(self, message: Image | CompressedImage) -> None:
        began = time.perf_counter()
        self.follow_time(self._topic, message.header.stamp)
        self.catch_up(self._camera_info)
        self.catch_up(self._odom)
        self._header = message.header
        if self._enabled:
            self._watch.reset()
        try:
            picture = self._picture(message)
            estimate = self._look(picture, message)
        except ValueError as cause:
            topic = "camera_info" if isinstance(cause, CalibrationMissingError) else self._topic
            self.complain(topic, str(cause), getattr(cause, "advice", ""))
            if self._enabled:
                self.stand_still()
            return
        if estimate.lane is not None:
            self._heading.publish(messages.heading_to_message(message.header, estimate.lane, "row"))
        self._steer(estimate, stamp_ns(message.header.stamp))
        self.answered(message.header.stamp, began)
        self._tend(picture, message.header, estimate)
        if self._overlay.get_subscription_count():
            self._draw(message, estimate)

    def _picture(self, message: Image | CompressedImage) -> Picture:
        camera = self._calibration.camera
        if camera is None:
            raise CalibrationMissingError(
                f"plants have no place without a calibration: {self._calibration.fault}", calibration.ADVICE
            )
        if camera.height_m is None:
            raise CalibrationMissingError(
                "plants have no place without the height of the camera", "set the parameter camera.height"
            )
        self._rectifier.use(camera)
        return self._rectifier.field(message)

    def _look(self, picture: Picture, message: Image | CompressedImage) -> RowEstimate:
        camera = self._calibration.camera
        assert camera is not None
        now_s = 1e-9 * stamp_ns(message.header.stamp)
        before_s, self._last_s = self._last_s, now_s
        self._moved = Motion(0.0)
        if before_s is not None:
            self._moved = Motion(now_s - before_s, *self._motion.mean(before_s, now_s))
        return self._tracker.update(picture, camera, self._moved)

    def _tend(self, picture: Picture, header: Header, estimate: RowEstimate) -> None:
        """Follow the plants and say what to spray, for those who listen."""
        camera, heard = self._calibration.camera, self._spray.get_subscription_count() > 0
        if camera is None or not (heard or self._plants.get_subscription_count()):
            self._plant_map.reset()
            self._tended = None
            return
        plants = self._plant_map.update(picture, camera, estimate, self._tracker.spacing, self._moved)
        self._plants.publish(plant_messages.plants_to_message(header, plants))
        blind = "" if estimate.lane is not None else f"no row is known: {estimate.reason}"
        spray = self._sprayer.plan(plants, self._moved.speed, blind, self._plant_map.leaves)
        self._spray.publish(plant_messages.spray_to_message(header, spray))
        self._tended = plants, spray
        counts = {fate: int(self._sprayer.counts[fate]) for fate in Fate}
        self.diagnostics.details = {
            "spray": f"nothing is sprayed: {spray.reason}" if spray.reason else f"{len(spray)} jets planned",
            "weeds sprayed": str(counts[Fate.SPRAYED]),
            "weeds spared, too near the crop": str(counts[Fate.SPARED]),
            "plants spared, unsure": str(counts[Fate.UNSURE]),
            "crop passed": str(counts[Fate.CROP]),
        }
        if heard and spray.reason and estimate.lane is not None:
            self.diagnostics.report(Level.WARN, f"nothing is sprayed: {spray.reason}", SPRAY_ADVICE)

    def _steer(self, estimate: RowEstimate, now_ns: int) -> None:
        if not self._enabled:
            return
        old = self.refusal_of_age(now_ns)
        if estimate.lane is None or old:
            self.stand_still()
            reason = old or estimate.reason
            self.diagnostics.report(Level.WARN, f"stands still: {reason}", UNSEEN_ADVICE)
            return
        steering = self._law.update(estimate.lane, 1e-9 * now_ns, estimate.end)
        self.obey(steering.speed, steering.turn_rate)
        self._tell(estimate, steering)

    def _tell(self, estimate: RowEstimate, steering: Steering) -> None:
        if estimate.end is not None and steering.reason:
            self.diagnostics.report(Level.WARN, f"the rows end {max(estimate.end, 0.0):.1f} m ahead")
        elif steering.reason:
            self.diagnostics.report(Level.WARN, steering.reason)
        elif not estimate.seen:
            self.diagnostics.report(Level.WARN, f"goes on by odometry: {estimate.reason}", UNSEEN_ADVICE)
        elif estimate.reason:
            self.diagnostics.report(Level.WARN, f"doubts its row: {estimate.reason}", UNSEEN_ADVICE)
        else:
            self.diagnostics.report(Level.OK, "follows its row")

    def _draw(self, message: Image | CompressedImage, estimate: RowEstimate) -> None:
        from robot_vision.perception.crop_rows.overlay import draw_rows
        from robot_vision.planning.spray_overlay import draw_spray

        camera = self._calibration.camera
        if camera is not None:
            drawn = draw_rows(self._rectifier.colour(message), camera.rectified(), estimate)
            if self._tended is not None:
                draw_spray(drawn, camera.rectified(), self._plant_map.lean_seen, *self._tended, self._sprayer)
            self._overlay.publish(image_message(message.header, drawn))


class CalibrationMissingError(ValueError):
    """Nothing can be measured; the text says what is missing.

    Attributes:
        advice: what to try.
    """

    def __init__(self, cause: str, advice: str) -> None:
        super().__init__(cause)
        self.advice = advice


def main(args: list[str] | None = None) -> None:
    """Run the node."""
    run_node(CropRowSteeringNode, args)


if __name__ == "__main__":
    main()
