# SPDX-License-Identifier: Apache-2.0
"""Where to look in the next picture: around what tells, and everywhere when something is odd."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from corridor_lines import CAMERA, Corridor, seen_lines
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_vision.geometry import Camera
from robot_vision.perception import LineSegments, Role
from robot_vision.perception.attention import Attention
from robot_vision.perception.region import Region
from robot_vision.perception.way import Kind, WayEstimate, WayEstimator

RATE = 15
HALL = Corridor(doors=2.2, lamps=(-0.5, 0.5))


def seen_in(lines: LineSegments, region: Region | None) -> LineSegments:
    """What of the lines lies in a region, where it is at least 15 px long."""
    if region is None:
        return lines
    start, way = lines.endpoints[:, :2], lines.endpoints[:, 2:] - lines.endpoints[:, :2]
    low, high = np.array([region.left, region.top]), np.array([region.right - 1, region.bottom - 1])
    safe = np.where(np.abs(way) < 1e-9, 1e-9, way)
    enter, leave = np.sort(np.stack([(low - start) / safe, (high - start) / safe]), axis=0)
    first, last = np.maximum(enter.max(axis=1), 0.0)[:, None], np.minimum(leave.min(axis=1), 1.0)[:, None]
    long = (last - first)[:, 0] * lines.lengths >= 15.0
    ends = np.concatenate([start + first * way, start + last * way], axis=1)
    return LineSegments.from_endpoints(ends[long])


class Robot:
    """One that looks where it was told, as the nodes do."""

    def __init__(self, **how: float) -> None:
        self.way = WayEstimator(kind=Kind.CORRIDOR, attention=Attention(**how))  # type: ignore[arg-type]
        self.random = np.random.default_rng(3)
        self.picture = 0

    @property
    def attention(self) -> Attention:
        assert self.way.attention is not None
        return self.way.attention

    def look(self, yaw: float = 0.05, camera: Camera = CAMERA, hall: Corridor = HALL) -> WayEstimate:
        seen = seen_lines(hall, 0.2, yaw, self.random, camera)
        self.picture += 1
        return self.way.update(
            seen_in(seen, self.attention.asked), replace(CAMERA), self.picture / RATE, turn_rate=0.0
        )

    def settled(self) -> WayEstimate:
        """After a few pictures, with a region asked for."""
        for _ in range(4):
            answer = self.look()
        assert answer.attention is not None
        return answer


def test_the_region_holds_the_way_ahead_and_the_floor() -> None:
    answer = Robot().settled()
    region = answer.attention
    assert region is not None
    points = answer.vanishing_points
    primary = points.of(Role.PRIMARY)
    assert primary is not None
    column, row = points.pixels[primary]
    assert region.left + 30 < column < region.right - 30
    assert region.top < row
    assert region.bottom == CAMERA.height
    assert region.share(CAMERA.width, CAMERA.height) < 0.75


def test_it_looks_everywhere_at_first_and_every_so_often() -> None:
    robot = Robot(every=5)
    assert robot.attention.asked is None
    everywhere = [robot.look().attention is None for _ in range(20)]
    # the look at the whole picture asked for by one answer is followed by `every` - 1 at a region
    assert everywhere[:15] == [False] * 4 + [True] + [False] * 4 + [True] + [False] * 4 + [True]
    assert robot.attention.reason == "whole picture due"


def test_a_whole_look_changes_nothing_about_the_answer() -> None:
    """With attention the heading is that without, about as well."""
    robot = Robot()
    yaws = []
    for _ in range(30):
        answer = robot.look(0.05)
        assert answer.lane is not None
        yaws.append(answer.lane.yaw)
    assert np.sqrt(np.mean((np.array(yaws) - 0.05) ** 2)) < math.radians(0.15)


@pytest.mark.parametrize("roll", [math.radians(6.0), math.radians(-6.0)])
def test_a_knocked_camera_is_a_surprise(roll: float) -> None:
    robot = Robot()
    robot.settled()
    answers = [robot.look(camera=replace(CAMERA, roll=roll, pitch=CAMERA.pitch + 0.05)) for _ in range(2)]
    assert any(answer.attention is None for answer in answers)


def test_lines_that_are_gone_are_a_surprise() -> None:
    robot = Robot()
    robot.settled()
    answer = robot.way.update(LineSegments.empty(), CAMERA, (robot.picture + 1) / RATE)
    assert answer.attention is None
    assert robot.attention.reason


def test_few_lines_and_little_support_are_surprises() -> None:
    robot = Robot()
    answer = robot.settled()
    lines = seen_in(seen_lines(HALL, 0.2, 0.05, robot.random), answer.attention)
    update = robot.attention.update
    points = replace(answer.vanishing_points, labels=np.zeros(3, np.intp))
    assert update(lines[:3], points, answer.attitude, (robot.picture + 1) / RATE) is None
    assert robot.attention.reason == "few lines"
    robot = Robot()
    answer = robot.settled()
    weak = replace(answer.vanishing_points, weight=answer.vanishing_points.weight * 0.1)
    lines = lines[np.arange(len(weak.labels)) % len(lines)]
    # one such picture is let pass, a second is not
    assert robot.attention.update(lines, weak, answer.attitude, (robot.picture + 1) / RATE) is not None
    assert robot.attention.update(lines, weak, answer.attitude, (robot.picture + 2) / RATE) is None
    assert robot.attention.reason == "little support"


def test_one_picture_with_little_support_between_good_ones_is_let_pass() -> None:
    robot = Robot()
    answer = robot.settled()
    lines = seen_in(seen_lines(HALL, 0.2, 0.05, robot.random), answer.attention)
    points = answer.vanishing_points
    lines = lines[np.arange(len(points.labels)) % len(lines)]
    for picture in range(1, 7):
        seen = replace(points, weight=points.weight * 0.1) if picture % 2 else points
        stamp = (robot.picture + picture) / RATE
        assert robot.attention.update(lines, seen, answer.attitude, stamp) is not None


def test_a_late_picture_of_the_region_is_not_taken_for_a_whole_one() -> None:
    """Live, everywhere may be heard only after the next picture was searched in part."""
    robot = Robot(every=6)
    robot.settled()
    while robot.attention.asked is not None:
        last = robot.attention.asked
        robot.look()
    for late in (True, False):
        seen = seen_lines(HALL, 0.2, 0.05, robot.random)
        robot.picture += 1
        answer = robot.way.update(seen_in(seen, last) if late else seen, CAMERA, robot.picture / RATE)
        assert (answer.attention is None) == late, robot.attention.reason


def test_a_vanishing_point_that_leaves_the_picture_takes_no_region_along() -> None:
    robot = Robot()
    robot.settled()
    seen: set[str] = set()
    for step in range(45):
        answer = robot.look(yaw=0.05 + 0.02 * step)
        seen.add(robot.attention.reason)
        if answer.attention is not None:
            answer.attention.require_inside(CAMERA.width, CAMERA.height)
    assert robot.attention.asked is None
    assert seen & {"the way ahead lies outside the picture", "no way ahead is seen"}


def test_a_gap_in_time_another_camera_and_a_clock_set_back_are_surprises() -> None:
    robot = Robot()
    robot.settled()
    robot.picture += RATE
    assert robot.look().attention is None
    robot = Robot()
    answer = robot.settled()
    lines = LineSegments.from_endpoints(
        np.tile([300.0, 300.0, 400.0, 400.0], (len(answer.vanishing_points.labels), 1))
    )
    later = (robot.picture + 1) / RATE
    for points, stamp in (
        (answer.vanishing_points, later + 3.0),
        (replace(answer.vanishing_points, camera=replace(CAMERA, fx=470.0)), later),
        (answer.vanishing_points, later - 2.0),
    ):
        robot = Robot()
        robot.settled()
        assert robot.attention.update(lines, points, answer.attitude, stamp) is None
        assert robot.attention.reason in {"pictures are far apart", "another camera", "another way ahead"}


@pytest.mark.parametrize("late", [2])
def test_a_word_that_comes_late_does_not_pass_a_part_off_as_the_whole(late: int) -> None:
    """Where each region is searched `late` pictures after the one it was asked for, it stays as large."""

    def shares(late: int) -> list[float]:
        robot = Robot()
        asked: list[Region | None] = [None] * (late + 1)
        for picture in range(120):
            lines = seen_in(seen_lines(HALL, 0.2, 0.05, robot.random), asked[-1 - late])
            asked.append(robot.way.update(lines, CAMERA, picture / RATE, turn_rate=0.0).attention)
        return [region.share(CAMERA.width, CAMERA.height) for region in asked if region is not None]

    usual, lagging = shares(0), shares(late)
    assert len(lagging) > 80
    assert min(lagging) > 0.9 * min(usual)


@pytest.mark.parametrize(("swing", "reason"), [(0.002, ""), (0.2, "the head turns")])
def test_a_head_may_tremble_and_is_looked_after_when_it_turns(swing: float, reason: str) -> None:
    robot = Robot()
    for picture in range(12):
        camera = replace(CAMERA, pan=0.1 + swing * (-1) ** picture)
        lines = seen_in(seen_lines(HALL, 0.2, 0.05, robot.random, camera), robot.attention.asked)
        answer = robot.way.update(lines, camera, picture / RATE, turn_rate=0.0)
        assert answer.lane is not None
        if picture > 1:
            assert robot.attention.reason == reason


def test_a_camera_upside_down_is_given_no_region() -> None:
    """The floor, and what tells, is above then."""
    robot, camera = Robot(), replace(CAMERA, roll=math.pi)
    for picture in range(4):
        lines = seen_lines(HALL, 0.2, 0.05, robot.random, camera)
        answer = robot.way.update(lines, camera, picture / RATE, turn_rate=0.0)
        assert answer.vanishing_points.of(Role.PRIMARY) is not None
        assert answer.attention is None


def test_the_kind_of_way_is_not_judged_by_a_part_of_a_picture() -> None:
    """Uprights cut off by the region must not turn a corridor into a road."""
    way = WayEstimator(attention=Attention(every=1000))
    random = np.random.default_rng(5)
    assert way.attention is not None
    for picture in range(60):
        lines = seen_lines(HALL, 0.2, 0.05, random)
        part = seen_in(lines, way.attention.asked)
        if way.attention.asked is not None:
            part = part[np.abs(part.endpoints[:, 0] - part.endpoints[:, 2]) > 3.0]
        answer = way.update(part, CAMERA, picture / RATE)
        assert answer.frame == "corridor"


@settings(max_examples=20)
@given(
    yaw=st.floats(-0.6, 0.6),
    pitch=st.floats(-0.3, 0.3),
    roll=st.floats(-0.4, 0.4),
    offset=st.floats(-0.7, 0.7),
    turn=st.one_of(st.none(), st.floats(-5.0, 5.0)),
)
def test_a_region_always_lies_in_the_picture_and_is_the_same_again(
    yaw: float, pitch: float, roll: float, offset: float, turn: float | None
) -> None:
    camera = replace(CAMERA, pitch=pitch, roll=roll)

    def looks() -> list[Region | None]:
        way = WayEstimator(kind=Kind.CORRIDOR, attention=Attention())
        random = np.random.default_rng(1)
        assert way.attention is not None
        found = []
        for picture in range(4):
            lines = seen_lines(HALL, offset, yaw + 0.01 * picture, random, camera)
            lines = seen_in(lines, way.attention.asked)
            found.append(way.update(lines, camera, picture / RATE, turn_rate=turn).attention)
        return found

    first = looks()
    for region in first:
        if region is not None:
            region.require_inside(camera.width, camera.height)
    assert looks() == first


@pytest.mark.parametrize(
    "bad", [{"budget": 0.0}, {"every": 0}, {"least_support": 1.5}, {"jump": math.nan}, {"margin": -1.0}]
)
def test_settings_without_meaning_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(bad))):
        Attention(**bad)  # type: ignore[arg-type]
