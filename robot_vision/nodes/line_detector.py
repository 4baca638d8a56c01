# SPDX-License-Identifier: Apache-2.0
"""Hears pictures, says their straight lines in pixels of the rectified picture.

Every picture is answered: one without lines, or one that cannot be read, by an empty cloud. Where somebody says on
`attention` where to look, only that part of the picture is searched.
"""

from __future__ import annotations

import time
from typing import Any

from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2, RegionOfInterest

from robot_vision.perception import LineDetector, LineSegments
from robot_vision.perception.picture import PictureError
from robot_vision.perception.region import Region
from robot_vision.ros import calibration, qos
from robot_vision.ros.attention import HeldRegion
from robot_vision.ros.calibration import Calibration
from robot_vision.ros.diagnostics import Level
from robot_vision.ros.images import MESSAGES, TOPICS, Rectifier, image_message
from robot_vision.ros.messages import lines_to_message
from robot_vision.ros.node import VisionNode, stamp_ns
from robot_vision.ros.parameters import Setting
from robot_vision.ros.run import run_node

LIBRARY_SETTINGS = (
    Setting("method", "trace", "how lines are found", choices=("trace", "hough")),
    Setting("contrast", 10.0, "gradient at which a line may begin, grey levels a pixel", 0.1, 255.0),
    Setting("edge_contrast", 5.0, "gradient at which an edge is followed, grey levels a pixel", 0.1, 255.0),
    Setting("faint", 0.45, "factor on both contrasts when too few lines are found; 1: none", 0.01, 1.0),
    Setting("enough", 120, "number of lines that makes a second look unnecessary", 0, 100_000),
    Setting("min_length", 15.0, "shortest line, px", 2.0, 10_000.0),
    Setting("max_gap", 4, "longest gap bridged along a line, px", 0, 1000),
    Setting("blur", 0.8, "standard deviation of the blur before the gradient, px", 0.0, 10.0),
    Setting("largest_area", 500_000, "larger pictures are searched at this size, px", 64, 100_000_000),
)


class LineDetectorNode(VisionNode):
    """`image` or `image/compressed`, `camera_info` and `attention` to `lines` and `lines/overlay`."""

    SETTINGS = (
        Setting("transport", "raw", "how pictures come", choices=tuple(MESSAGES), live=False),
        Setting(
            "attention.age",
            0.35,
            "how long a region heard on attention holds, s of the pictures; 0: it is not obeyed",
            0.0,
            10.0,
        ),
        *LIBRARY_SETTINGS,
    )

    def __init__(self) -> None:
        super().__init__("line_detector")
        self._detector = LineDetector()
        self._calibration = Calibration()
        self._rectifier = Rectifier()
        self._held = HeldRegion()
        self._lines = self.say(PointCloud2, "lines", qos.ANSWER, awaited=True)
        self._overlay = self.say(Image, "lines/overlay", qos.ANSWER)
        self._camera_info = self.hear(CameraInfo, "camera_info", self._hear_camera_info, qos.SENSOR)
        self._attention = self.hear(RegionOfInterest, "attention", self._held.take, qos.NEWEST)
        transport = self.settings["transport"]
        self._topic = TOPICS[transport]
        self.hear(
            MESSAGES[transport], self._topic, self._hear_picture, qos.PICTURE, required=True, picture=True
        )
        self.use_settings()

    def configure(self, values: dict[str, Any]) -> None:
        """Build the detector."""
        self._detector = LineDetector(**{setting.name: values[setting.name] for setting in LIBRARY_SETTINGS})

    def warm_up(self) -> None:
        """Load the compiled kernels."""
        self._detector.warm_up()

    def on_clock_jump_back(self) -> None:
        """Look everywhere until somebody says anew where to look."""
        self._held.forget()

    def nobody_publishes(self, topic: str) -> str:
        """Name the other transport where pictures come by that."""
        for transport, name in TOPICS.items():
            if name != self._topic and self.count_publishers(self.resolve_topic_name(name)):
                return f"nobody publishes {topic}, but pictures come {transport}: set transport:={transport}"
        return super().nobody_publishes(topic)

    def _hear_camera_info(self, message: CameraInfo) -> None:
        self._calibration.take(message)

    def _hear_picture(self, message: Image | CompressedImage) -> None:
        began = time.perf_counter()
        self.follow_time(self._topic, message.header.stamp)
        self.catch_up(self._camera_info)
        self.catch_up(self._attention)
        self._rectifier.use(self._calibration.camera)
        try:
            gray = self._rectifier.gray(message)
        except PictureError as cause:
            self.complain(self._topic, str(cause))
            self._lines.publish(lines_to_message(message.header, LineSegments.empty()))
            return
        height, width = gray.shape
        region = self._region(stamp_ns(message.header.stamp), width, height)
        lines = self._detector.detect(gray, region)
        self._lines.publish(lines_to_message(message.header, lines))
        self.answered(message.header.stamp, began)
        looked_at = 1.0 if region is None else region.share(width, height)
        self._tell(lines, looked_at)
        if self._overlay.get_subscription_count():
            self._draw(message, lines, region)

    def _region(self, stamp: int, width: int, height: int) -> Region | None:
        try:
            return self._held.for_picture(stamp, width, height, self.settings["attention.age"])
        except ValueError as cause:
            self.complain("attention", f"{cause}; the whole picture is searched")
            return None

    def _tell(self, lines: LineSegments, looked_at: float) -> None:
        if self._calibration.camera is None:
            cause = f"lines are those of the raw picture: {self._calibration.fault}"
            self.complain("camera_info", cause, calibration.ADVICE)
        elif not len(lines):
            self.diagnostics.report(
                Level.WARN, "no lines in the picture", "look whether it is dark, blurred or covered"
            )
        else:
            self.diagnostics.report(Level.OK, f"finds lines in {100.0 * looked_at:.0f} % of the picture")

    def _draw(self, message: Image | CompressedImage, lines: LineSegments, region: Region | None) -> None:
        from robot_vision.perception.overlay import draw_lines, draw_region

        drawn = draw_lines(self._rectifier.colour(message), lines)
        if region is not None:
            draw_region(drawn, region)
        self._overlay.publish(image_message(message.header, drawn))


def main(args: list[str] | None = None) -> None:
    """Run the node."""
    run_node(LineDetectorNode, args)


if __name__ == "__main__":
    main()
