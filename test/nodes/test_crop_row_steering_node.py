# SPDX-License-Identifier: Apache-2.0
"""The crop row node as a process: pictures of the recorded field in, heading and steering out, bad ones told."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped, TwistStamped
from nav_msgs.msg import Odometry
from node_bench import NodeBench
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2
from std_srvs.srv import SetBool

from robot_vision.bags import BagReader, decode
from robot_vision.bags.messages import stamp_ns, yaw_of
from robot_vision.geometry import Camera
from robot_vision.mapping.plants import PlantKind
from robot_vision.perception.vegetation import VegetationMask
from robot_vision.ros.messages import heading_from_message, points_from_cloud

FIELD = Path(__file__).resolve().parents[2] / "bags" / "field.mcap"
CAMERA = Camera(460.0, 460.0, 319.5, 239.5, 640, 480, height_m=1.4, pitch=math.radians(35.0))
PERIOD_NS = 100_000_000
PLACE = {"camera.height": 1.4, "camera.pitch": math.radians(35.0), "row.spacing": 0.5}


class Moment:
    """A picture of the recorded field, what the wheels said, and what is true."""

    def __init__(self, jpeg: bytes, truth: tuple[float, float], twist: tuple[float, float]) -> None:
        self.jpeg, self.truth, self.twist = jpeg, truth, twist


def moments(count: int) -> list[Moment]:
    jpegs: dict[int, bytes] = {}
    truths: dict[int, tuple[float, float]] = {}
    twists: dict[int, tuple[float, float]] = {}
    for message in BagReader(FIELD).messages(["image/compressed", "truth/heading", "odom"]):
        content = decode(message.cdr, message.type_name)
        stamp = stamp_ns(content)
        if message.topic == "/odom":
            twists[stamp] = content.twist.twist.linear.x, content.twist.twist.angular.z
        elif message.topic == "/truth/heading":
            truths[stamp] = content.pose.pose.position.y, yaw_of(content.pose.pose.orientation)
        else:
            jpegs[stamp] = bytes(content.data)
        if len(truths) > count:
            break
    stamps = sorted(jpegs)[:count]
    return [Moment(jpegs[stamp], truths[stamp], twists[stamp]) for stamp in stamps]


@pytest.fixture(scope="module")
def field() -> list[Moment]:
    return moments(12)


@contextmanager
def row_bench(domain: int, heard: Sequence[tuple[Any, str]]) -> Iterator[NodeBench]:
    """The node with pictures, calibration and odometry to hear, and somebody who hears these of its topics."""
    settings = {"transport": "compressed", "timeout": 20.0, "ready_patience": 0.1, **PLACE}
    bench = NodeBench(domain, "crop_row_steering", settings)
    try:
        for kind, topic in (
            (CompressedImage, "image/compressed"),
            (CameraInfo, "camera_info"),
            (Odometry, "odom"),
        ):
            bench.speaks(kind, topic)
        for kind, topic in heard:
            bench.hears(kind, topic)
        bench.connect()
        yield bench
    finally:
        bench.close()


@pytest.fixture(scope="module")
def bench(ros_domain: int) -> Iterator[NodeBench]:
    with row_bench(ros_domain, ((PoseWithCovarianceStamped, "heading"), (TwistStamped, "steering"))) as made:
        yield made


def see(bench: NodeBench, moment: Moment, jpeg: bytes | None = None) -> TwistStamped:
    header = bench.header("camera_optical_frame", PERIOD_NS)
    wheels = Odometry(header=header)
    wheels.twist.twist.linear.x, wheels.twist.twist.angular.z = moment.twist
    bench.say_surely("odom", wheels)
    data = np.frombuffer(moment.jpeg if jpeg is None else jpeg, np.uint8)
    bench.say("image/compressed", CompressedImage(header=header, format="jpeg", data=data.tobytes()))
    answer: TwistStamped = bench.answer("steering", header)
    return answer


FIELDS = ("x", "y", "z", "area", "id", "kind")


def test_it_knows_each_plant_and_says_which_to_spray(field: list[Moment]) -> None:
    from robot_vision.ros.domains import FreeDomain

    heard = ((TwistStamped, "steering"), (PointCloud2, "plants"), (PointCloud2, "spray"))
    with FreeDomain() as domain, row_bench(domain.id, heard) as bench:
        bench.say_surely("camera_info", CameraInfo(**CAMERA.camera_info()))
        ids = []
        for moment in field:
            header = see(bench, moment).header
            plants = points_from_cloud(bench.answer("plants", header), FIELDS)
            spray = bench.answer("spray", header)
            jets = points_from_cloud(spray, (*FIELDS, "lane", "time_to_nozzle"))
            ids.append(set(plants["id"].tolist()))
            assert len(ids[-1]) == len(plants)
            assert set(jets["id"].tolist()) <= ids[-1]
            assert (jets["kind"] == PlantKind.WEED).all()
        assert spray.header.frame_id == "base_link"
        assert len(plants) > 20
        assert len(ids[-1] & ids[-2]) > 0.8 * len(ids[-2])
        assert len(jets) > 3
        nozzles = -0.48 + 0.04 * (jets["lane"] + 0.5)
        for number in set(jets["id"].tolist()):
            own = jets["id"] == number
            assert np.abs(jets["y"] - nozzles)[own].min() <= 0.02 + 1e-6  # one is over the weed
            assert (np.diff(np.sort(jets["lane"][own].astype(int))) == 1).all()  # the others beside it
        assert bench.set_parameter("spray.lanes", 0).successful is False
        assert bench.set_parameter("sensitivity", "low").successful
        # pictures go on, odometry does not: nobody knows where the weeds are when the boom comes
        for moment in field[:8]:
            header = bench.header("camera_optical_frame", PERIOD_NS)
            data = np.frombuffer(moment.jpeg, np.uint8)
            bench.say("image/compressed", CompressedImage(header=header, format="jpeg", data=data.tobytes()))
            spray = bench.answer("spray", header)
        assert len(points_from_cloud(spray, FIELDS)) == 0
        bench.until(lambda: "odometry" in bench.state("spray"), "diagnostics say why nothing is sprayed")


def heading_of(bench: NodeBench, steering: TwistStamped) -> PoseWithCovarianceStamped | None:
    said = [m for m in bench.said("heading") if m.header.stamp == steering.header.stamp]
    return said[0] if said else None


def is_still(message: TwistStamped) -> bool:
    return message.twist.linear.x == 0.0 and message.twist.angular.z == 0.0


def start_anew(bench: NodeBench) -> None:
    """Let stamps go back, so that the row and the speed are forgotten."""
    bench.next_stamp(-900_000_000_000)
    bench.next_stamp(800_000_000_000)


def test_without_calibration_it_stands_and_says_what_is_missing(
    bench: NodeBench, field: list[Moment]
) -> None:
    assert is_still(see(bench, field[0]))
    bench.log_line("/camera_info", "calibration")


def test_it_says_where_it_stands_in_the_row_and_drives(bench: NodeBench, field: list[Moment]) -> None:
    bench.say_surely("camera_info", CameraInfo(**CAMERA.camera_info()))
    for moment in field:
        steering = see(bench, moment)
    assert steering.header.frame_id == "base_link"
    assert steering.twist.linear.x > 0.3
    said = heading_of(bench, steering)
    assert said is not None
    assert said.header.frame_id == "row"
    lane = heading_from_message(said)
    assert lane.offset == pytest.approx(field[-1].truth[0], abs=0.025)
    assert lane.yaw == pytest.approx(field[-1].truth[1], abs=math.radians(1.0))
    assert 0.0 < lane.offset_variance < 0.03**2
    bench.until(lambda: bench.state("level") == "0", "diagnostics say that all is well")


def test_no_picture_of_rows_no_steering_and_the_next_good_one_steers(
    bench: NodeBench, field: list[Moment]
) -> None:
    import cv2

    black = cv2.imencode(".jpg", np.zeros((480, 640, 3), np.uint8))[1].tobytes()
    steering = see(bench, field[0], black)
    assert is_still(steering)
    assert heading_of(bench, steering) is None
    bench.until(lambda: "dark" in bench.state("message"), "diagnostics say that it is dark")
    start_anew(bench)
    see(bench, field[0])
    assert see(bench, field[1]).twist.linear.x > 0.0


@pytest.mark.parametrize(
    ("jpeg", "words"), [(b"", "empty"), (b"no picture", "decoded"), (b"\xff\xd8\xff\xda123", "cut off")]
)
def test_a_broken_picture_gets_a_line_and_stops(
    bench: NodeBench, field: list[Moment], jpeg: bytes, words: str
) -> None:
    assert is_still(see(bench, field[0], jpeg))
    bench.log_line("/image/compressed", words)


def test_a_picture_of_another_size_is_refused(bench: NodeBench, field: list[Moment]) -> None:
    import cv2

    small = cv2.imencode(".jpg", np.zeros((240, 320, 3), np.uint8))[1].tobytes()
    assert is_still(see(bench, field[0], small))
    bench.log_line("/image/compressed", "320 x 240")


def test_a_grey_picture_has_no_green(bench: NodeBench, field: list[Moment]) -> None:
    import cv2

    grey = cv2.imencode(".jpg", np.full((480, 640), 120, np.uint8))[1].tobytes()
    bench.say_surely("camera_info", CameraInfo(**CAMERA.camera_info()))
    assert bench.set_parameter("vegetation", "green").successful
    assert is_still(see(bench, field[0], grey))
    bench.log_line("/image/compressed", "infrared")
    assert bench.set_parameter("vegetation", "auto").successful


def test_the_service_stops_and_releases_it(bench: NodeBench, field: list[Moment]) -> None:
    start_anew(bench)
    see(bench, field[0])
    assert see(bench, field[1]).twist.linear.x > 0.0
    before = len(bench.said("steering"))
    assert bench.call(SetBool, "enable", SetBool.Request(data=False)).success
    bench.until(lambda: len(bench.said("steering")) > before, "it is told to stand")
    assert is_still(bench.said("steering")[-1])
    assert bench.call(SetBool, "enable", SetBool.Request(data=True)).success
    assert see(bench, field[2]).twist.linear.x > 0.0


def test_parameters_change_live_and_nonsense_is_refused(bench: NodeBench, field: list[Moment]) -> None:
    for name, value in (("sensitivity", "high"), ("speed", 0.4), ("view", 6.0), ("sensitivity", "medium")):
        assert bench.set_parameter(name, value).successful, name
    for name, value, words in (
        ("sensitivity", "wild", "low, medium, high"),
        ("row.spacing", -1.0, "row.spacing"),
        ("transport", "raw", "transport"),
    ):
        refused = bench.set_parameter(name, value)
        assert not refused.successful
        assert words in refused.reason
    start_anew(bench)
    for moment in field:
        steering = see(bench, moment)
    assert 0.2 < steering.twist.linear.x <= 0.4
    assert bench.set_parameter("row.spacing", 0.62).successful
    wrong = see(bench, field[0])
    assert is_still(wrong)
    assert bench.set_parameter("row.spacing", 0.5).successful


def test_raw_pictures_without_odometry_an_overlay_and_silence(field: list[Moment]) -> None:
    import cv2

    from robot_vision.ros.domains import FreeDomain

    with FreeDomain() as domain:
        bench = NodeBench(domain.id, "crop_row_steering", {"ready_patience": 0.1, "timeout": 0.5, **PLACE})
        try:
            bench.speaks(Image, "image")
            bench.speaks(CameraInfo, "camera_info")
            bench.hears(TwistStamped, "steering")
            bench.hears(PoseWithCovarianceStamped, "heading")
            bench.hears(Image, "rows/overlay")
            bench.connect()
            half = replace(CAMERA.resized(320, 240), height_m=1.4)
            bench.say_surely("camera_info", CameraInfo(**half.camera_info()))
            for moment in field[:2]:
                shown = cv2.imdecode(np.frombuffer(moment.jpeg, np.uint8), cv2.IMREAD_COLOR)
                small = cv2.resize(shown, (320, 240), interpolation=cv2.INTER_AREA)
                header = bench.header("camera", PERIOD_NS)
                bench.say("image", raw(header, small))
                steering = bench.answer("steering", header)
                said = bench.answer("heading", header)
                assert not is_still(steering)
                assert heading_from_message(said).offset == pytest.approx(moment.truth[0], abs=0.04)
                overlay = bench.answer("rows/overlay", header)
                assert (np.frombuffer(overlay.data, np.uint8).reshape(240, 320, 3) != small).any()
            # a camera behind a filter for the near infrared, in which plants are bright, begins anew
            start_anew(bench)
            header = bench.header("camera", PERIOD_NS)
            bright = np.where(VegetationMask().of(small), 190, 100).astype(np.uint8)
            bench.say("image", raw(header, bright))
            assert not is_still(bench.answer("steering", header))
            said = bench.answer("heading", header)
            assert heading_from_message(said).offset == pytest.approx(moment.truth[0], abs=0.04)
            bench.until(lambda: is_still(bench.said("steering")[-1]), "it stands when pictures stop")
            bench.until(lambda: "no picture" in bench.state("message"), "diagnostics say so")
        finally:
            bench.close()


def raw(header: Any, picture: np.ndarray) -> Image:
    from robot_vision.ros.images import image_message

    return image_message(header, picture)
