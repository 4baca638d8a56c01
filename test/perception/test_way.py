# SPDX-License-Identifier: Apache-2.0
"""Which kind of way it is: corridors between walls, roads without, and what is said when neither is there."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from corridor_lines import CAMERA as INDOORS
from corridor_lines import Corridor, seen_lines
from winding_road import CAMERA, WIDTH_M, Bends, seen_road

from robot_vision.bags import BagReader, decode
from robot_vision.bags.messages import stamp_ns
from robot_vision.geometry import rpy_from_rotation
from robot_vision.geometry.rotation import quaternion_to_rotation
from robot_vision.perception import LineDetector, LineSegments
from robot_vision.perception.odometry import RateHistory
from robot_vision.perception.way import Kind, WayEstimate, WayEstimator
from robot_vision.simulation.body import BodyState
from robot_vision.simulation.lane import PolyLane
from robot_vision.simulation.record import build_world
from robot_vision.simulation.renderer import Renderer
from robot_vision.simulation.road import RoadSettings, winding
from robot_vision.simulation.sensors import CameraSensor

ROAD_BAG = Path(__file__).resolve().parents[2] / "bags" / "road.mcap"
RATE = 15


def on_a_road(estimator: WayEstimator, pictures: int, first: int = 0) -> list[WayEstimate]:
    random = np.random.default_rng(first)
    found = []
    for picture in range(first, first + pictures):
        along = 5.0 + 5.0 * picture / RATE
        lines = seen_road(Bends(), along, -0.6, 0.02, random)
        found.append(estimator.update(lines, CAMERA, picture / RATE, 5.0, 5.0 * Bends().curvature(along)))
    return found


def in_a_corridor(
    estimator: WayEstimator, pictures: int, first: int = 0, width: float = 2.0
) -> list[WayEstimate]:
    random, corridor = np.random.default_rng(first), Corridor(width=width, doors=1.3)
    return [
        estimator.update(seen_lines(corridor, 0.2, 0.05, random), INDOORS, picture / RATE)
        for picture in range(first, first + pictures)
    ]


def test_what_has_walls_is_a_corridor_and_what_has_none_a_road() -> None:
    estimator = WayEstimator()
    assert {answer.frame for answer in in_a_corridor(estimator, 6)} == {"corridor"}
    assert on_a_road(WayEstimator(), 8)[-1].frame == "road"


def test_the_kind_changes_only_once_it_is_sure() -> None:
    """Inside, and then out of doors, and in again."""
    estimator = WayEstimator()
    in_a_corridor(estimator, 6)
    frames = [answer.frame for answer in on_a_road(estimator, 45, first=6)]
    first = frames.index("road")
    assert RATE <= first < 2.5 * RATE, frames
    assert set(frames[first:]) == {"road"}
    frames = [answer.frame for answer in in_a_corridor(estimator, 30, first=51)]
    assert "corridor" not in frames[:RATE]
    assert frames[-1] == "corridor"


def test_a_road_as_wide_as_the_corridor_before_it_is_a_road() -> None:
    estimator = WayEstimator()
    assert in_a_corridor(estimator, 8, width=WIDTH_M)[-1].frame == "corridor"
    frames = [answer.frame for answer in on_a_road(estimator, 75, first=8)]
    assert frames[-1] == "road", frames


def test_the_end_of_a_corridor_is_no_road() -> None:
    """Before the end of a simulated one few uprights are left, for longer than the kind takes to change."""
    world = build_world("corridor", 4, {"length": 23.0})
    renderer, sensor, detector = Renderer(world.scene, world.camera), CameraSensor(4), LineDetector()
    estimator = WayEstimator()
    for picture, along in enumerate(np.arange(16.3, 20.1, 0.2)):
        state = BodyState(along, 0.1, 0.0, 1.0, 0.0, 0.0, 0.0)
        seen = sensor.capture(renderer.render(state.camera_pose(world.camera)))
        lines = detector.detect(cv2.cvtColor(seen, cv2.COLOR_BGR2GRAY))
        answer = estimator.update(lines, world.camera, 0.2 * picture, 1.0, 0.0)
        assert answer.frame == "corridor"
        if picture >= 3:
            assert answer.lane is not None and answer.lane.offset == pytest.approx(0.1, abs=0.03)


def test_told_what_to_look_for_it_looks_for_nothing_else() -> None:
    assert {answer.frame for answer in on_a_road(WayEstimator(kind=Kind.CORRIDOR), 8)} == {"corridor"}
    inside = in_a_corridor(WayEstimator(kind=Kind.ROAD), 8)
    assert {answer.frame for answer in inside} == {"road"}


def test_no_road_is_said_in_words_and_nothing_steers() -> None:
    answer = WayEstimator(kind=Kind.ROAD).update(LineSegments.empty(), CAMERA, 0.0)
    assert answer.lane is None and answer.path is None
    assert "no two borders" in answer.reason
    unknown = WayEstimator(kind=Kind.ROAD).update(LineSegments.empty(), replace(CAMERA, height_m=None), 0.0)
    assert unknown.lane is None and "height" in unknown.reason


def test_a_road_that_is_lost_is_not_replaced_by_whatever_lines_meet() -> None:
    estimator = WayEstimator()
    assert on_a_road(estimator, 10)[-1].frame == "road"
    random = np.random.default_rng(3)
    walls = seen_lines(Corridor(doors=50.0), 0.0, 0.0, random, CAMERA)
    answer = estimator.update(walls, CAMERA, 11.0 / RATE, 5.0, 0.0)
    assert answer.frame == "road"


def test_the_path_is_straight_in_a_corridor_and_bends_on_a_road() -> None:
    random = np.random.default_rng(1)
    estimator, straight = WayEstimator(kind=Kind.CORRIDOR), None
    for picture in range(8):
        walls = seen_lines(Corridor(), 0.2, 0.05, random, along=0.05 * picture)
        straight = estimator.update(walls, INDOORS, picture / RATE).path
    bent = on_a_road(WayEstimator(), 20)[-1].path
    assert straight is not None and bent is not None
    for path, most in ((straight, 1e-9), (bent, None)):
        ways = np.diff(path, axis=0)
        turned = float(np.ptp(np.unwrap(np.arctan2(ways[:, 1], ways[:, 0]))))
        assert (turned < most) if most else turned > 0.05


def test_the_recorded_road_is_known_with_its_bends() -> None:
    """Heading within half a degree and curvature within a tenth of its range, in all pictures that have an answer."""
    lane = PolyLane(winding(RoadSettings(), seed=1), RoadSettings().width)
    detector, estimator = LineDetector(), WayEstimator()
    speeds, turns = RateHistory(), RateHistory()
    truth, errors, last = {}, [], None
    for message in BagReader(ROAD_BAG).messages(["odom", "truth/odom", "image/compressed"]):
        topic = message.topic.lstrip("/")
        said = decode(message.cdr, message.type_name)
        now = 1e-9 * stamp_ns(said)
        if topic == "odom":
            speeds.add(now, said.twist.twist.linear.x)
            turns.add(now, said.twist.twist.angular.z)
        elif topic == "truth/odom":
            place, q = said.pose.pose.position, said.pose.pose.orientation
            yaw = rpy_from_rotation(quaternion_to_rotation((q.x, q.y, q.z, q.w)))[2]
            truth[stamp_ns(said)] = lane.locate(place.x, place.y, yaw)
        else:
            gray = cv2.imdecode(np.frombuffer(said.data, np.uint8), cv2.IMREAD_GRAYSCALE)
            since, last = (now if last is None else last), now
            told = speeds.mean(since, now), turns.mean(since, now)
            answer = estimator.update(detector.detect(gray), CAMERA, now, *told)
            if answer.road is not None:
                errors.append((stamp_ns(said), answer.road))
    assert len(errors) >= 175
    pairs = [(road, truth[stamp]) for stamp, road in errors]
    yaw_rms = math.degrees(np.sqrt(np.mean([(road.yaw - pose.yaw) ** 2 for road, pose in pairs])))
    bend_rms = np.sqrt(np.mean([(road.curvature - pose.curvature) ** 2 for road, pose in pairs]))
    offset_rms = np.sqrt(np.mean([(road.offset - pose.offset) ** 2 for road, pose in pairs]))
    spread = np.ptp([pose.curvature for pose in truth.values()])
    assert yaw_rms <= 0.5
    assert bend_rms <= 0.1 * spread
    assert offset_rms <= 0.05


def test_settings_reach_both_kinds() -> None:
    estimator = WayEstimator()
    estimator.set_widths(1.5, 8.0)
    estimator.set_lean(0.05)
    assert (estimator.road.narrowest, estimator.corridor.lane_filter.widest) == (1.5, 8.0)
    assert estimator.road.lean == estimator.corridor.lean == 0.05


def test_a_stamp_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="stamp"):
        WayEstimator(kind=Kind.ROAD).update(LineSegments.empty(), CAMERA, math.nan)
