# SPDX-License-Identifier: Apache-2.0
"""A head turns the camera: heading, path and attitude stay those of the robot, whatever the camera looks at."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from corridor_lines import CAMERA, Corridor, seen_lines
from winding_road import CAMERA as ROAD_CAMERA
from winding_road import Bends, seen_road

from robot_vision.geometry import Camera, attitude_from_up, rotation_from_rpy
from robot_vision.perception.attitude import Attitude
from robot_vision.perception.heading import HeadingEstimate, HeadingEstimator
from robot_vision.perception.road.estimate import PITCH, ROLL
from robot_vision.perception.road.tracker import RoadTracker

RATE = 15
LEAN = (math.radians(2.0), math.radians(-1.5))


def leaning(camera: Camera, roll: float, pitch: float) -> Camera:
    """A camera that sees what `camera` sees on a body with this roll and pitch, told as its own angles."""
    turned = rotation_from_rpy(roll, pitch, 0.0) @ camera.optical_to_base
    yaw = math.atan2(turned[1, 2], turned[0, 2])
    level = rotation_from_rpy(0.0, 0.0, -yaw) @ turned
    own_roll, own_pitch = attitude_from_up(level[2])
    return replace(camera, roll=own_roll, pitch=own_pitch, pan=yaw, tilt=0.0)


def pans(swing: float, pictures: int) -> list[float]:
    return [swing * math.sin(2.0 * math.pi * k / 30.0) for k in range(pictures)]


def in_corridor(yaw: float, looks: list[float], told: bool = True) -> list[HeadingEstimate]:
    """Answers while the robot stands leaning in a corridor and its head turns."""
    random, estimator, answers = np.random.default_rng(3), HeadingEstimator(), []
    for k, pan in enumerate(looks):
        camera = replace(CAMERA, pan=pan, tilt=0.3 * pan)
        lines = seen_lines(Corridor(), 0.2, yaw, random, leaning(camera, *LEAN))
        answers.append(estimator.update(lines, camera if told else CAMERA, k / RATE))
    return answers


@pytest.mark.parametrize("yaw", [0.0, 0.15, -0.12])
def test_heading_offset_and_attitude_hold_while_the_camera_pans(yaw: float) -> None:
    answers = in_corridor(yaw, pans(math.radians(35.0), 60))
    # Only where both floor lines are in view is the offset known; the heading is known throughout.
    seen = [answer for answer in answers[5:] if answer.lane is not None and answer.attitude is not None]
    assert len(seen) >= 50
    errors = np.array([answer.lane.yaw - yaw for answer in seen if answer.lane])
    assert math.degrees(np.sqrt(np.mean(errors**2))) < 0.3
    assert math.degrees(np.abs(errors).max()) < 1.0
    offsets = [answer.lane.offset - 0.2 for answer in seen if answer.lane and answer.lane.offset_known]
    assert len(offsets) >= 20 and np.median(np.abs(offsets)) < 0.05
    true = np.array(attitude_from_up((rotation_from_rpy(*LEAN, 0.0) @ CAMERA.optical_to_base)[2]))
    attitudes = [answer.attitude for answer in seen if answer.attitude is not None]
    misses = np.array([(attitude.roll, attitude.pitch) for attitude in attitudes]) - true
    # Looking aside at one wall, its lines tell less of the roll, and the covariance says so.
    assert np.degrees(np.sqrt(np.mean(misses**2, axis=0))).max() < 0.5
    sure = [
        miss @ np.linalg.solve(a.covariance, miss) / 2.0 for miss, a in zip(misses, attitudes, strict=True)
    ]
    assert np.mean(sure) < 2.0


def test_a_pan_nobody_tells_of_would_be_taken_for_a_turn() -> None:
    """Which is why the node wants `joint_states`: the same pictures, the head kept secret."""
    answers = in_corridor(0.0, [math.radians(20.0)] * 20, told=False)
    lane = answers[-1].lane
    assert lane is not None and math.degrees(lane.yaw) == pytest.approx(20.0, abs=1.5)


@pytest.mark.parametrize("swing", [0.0, 20.0])
def test_a_road_is_followed_while_the_camera_pans(swing: float) -> None:
    """As well as with a camera that looks ahead."""
    bends, random, tracker = Bends(), np.random.default_rng(5), RoadTracker()
    errors, leans = [], []
    course, before = bends.sharpest * bends.wavelength / (2.0 * np.pi), None

    def heading(along: float) -> float:
        return course * (1.0 - math.cos(2.0 * np.pi * along / bends.wavelength))

    for k, pan in enumerate(pans(math.radians(swing), 75)):
        along = 5.0 + 6.0 * k / RATE
        camera = replace(ROAD_CAMERA, pan=pan)
        turn_rate = None if before is None else (heading(along) - before) * RATE
        before = heading(along)
        lines = seen_road(bends, along, -0.6, 0.0, random, leaning(camera, *LEAN))
        road = tracker.update(lines, camera, k / RATE, 6.0, turn_rate)
        if road is not None and k >= 25:
            ahead = float(road.bearings([10.0])[0][0]) - (heading(along + 10.0) - heading(along))
            errors.append([road.yaw, ahead, road.curvature - bends.curvature(along)])
            leans.append(road.state[[ROLL, PITCH]])
    assert len(errors) >= 45
    yaw, far, curvature = np.sqrt(np.mean(np.square(errors), axis=0))
    assert math.degrees(yaw) < 0.5
    assert math.degrees(far) < 1.0
    assert curvature < 0.1 * 2.0 * bends.sharpest
    true = attitude_from_up((rotation_from_rpy(*LEAN, 0.0) @ ROAD_CAMERA.optical_to_base)[2])
    assert np.degrees(np.sqrt(np.mean((np.array(leans) - true) ** 2, axis=0))).max() < 0.5


def test_an_attitude_told_in_angles_is_the_same_wherever_the_head_looks() -> None:
    camera = replace(CAMERA, pan=0.7, tilt=-0.2)
    attitude = Attitude.from_angles(0.03, 0.11, np.diag([1e-4, 4e-4]), camera)
    assert attitude_from_up(camera.head_turn @ attitude.up) == pytest.approx((0.03, 0.11), abs=1e-12)
    draws = np.random.default_rng(0).multivariate_normal([0.03, 0.11], attitude.covariance, 4000)
    ups = [Attitude.from_angles(r, p, attitude.covariance, camera).up for r, p in draws]
    spread = np.trace(np.cov(np.array(ups).T))
    assert spread == pytest.approx(np.trace(attitude.up_covariance), rel=0.1)
