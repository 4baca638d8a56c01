# SPDX-License-Identifier: Apache-2.0
"""The steering keeps its limits whatever it hears, and a robot that obeys it comes to the middle."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robot_vision.control import CorridorSteering, Steering
from robot_vision.control.limits import approach, speed_to_stop_within
from robot_vision.perception import LaneHeading

PICTURES_PER_SECOND = 15
STEP = 1 / PICTURES_PER_SECOND
SURE = math.radians(0.3) ** 2
#: The step taken where the time since the last picture says nothing, and the longest believed.
FIRST_STEP, LONGEST_STEP = 0.05, 0.25


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


def any_finite(least: float = -1e300) -> st.SearchStrategy[float]:
    return st.one_of(numbers(least, 1e300), numbers(max(least, -4.0), 4.0))


lanes = st.builds(
    LaneHeading,
    yaw=any_finite(),
    yaw_variance=st.one_of(any_finite(0.0), numbers(0.0, 0.03)),
    offset=any_finite(),
    offset_variance=st.one_of(any_finite(0.0), numbers(0.0, 0.1), st.just(math.inf)),
    width=any_finite(0.0),
)
heard = st.tuples(
    st.one_of(st.none(), lanes, lanes, lanes),
    numbers(-0.5, 3.0),
    st.one_of(st.none(), any_finite()),
)
steerings = st.builds(
    CorridorSteering,
    speed=numbers(0.05, 3.0),
    lookahead=numbers(0.2, 5.0),
    most_turn_rate=numbers(0.1, 3.0),
    most_acceleration=numbers(0.1, 3.0),
    most_turn_acceleration=numbers(0.2, 10.0),
    stop_distance=numbers(0.1, 2.0),
)


@given(steerings, st.lists(heard, max_size=25))
def test_no_limit_is_broken_whatever_is_heard(steering, pictures):
    last, stamp = Steering(0.0, 0.0), 100.0
    for lane, seconds, clearance in pictures:
        stamp += seconds
        command = steering.update(lane, stamp, clearance)
        believed = seconds if 0.0 <= seconds <= LONGEST_STEP else FIRST_STEP
        believed = max(believed, FIRST_STEP)  # a stop forgets when the last picture was
        assert 0.0 <= command.speed <= steering.speed
        assert abs(command.turn_rate) <= steering.most_turn_rate
        assert command.speed - last.speed <= steering.most_acceleration * believed + 1e-9
        if clearance is None and command.speed > 0.0:
            assert last.speed - command.speed <= steering.most_acceleration * believed + 1e-9
        stopped = (command.speed, command.turn_rate) == (0.0, 0.0)
        change = abs(command.turn_rate - last.turn_rate)
        assert stopped or change <= steering.most_turn_acceleration * believed + 1e-9
        last = command


@given(st.lists(heard, max_size=10))
def test_the_same_pictures_give_the_same_commands(pictures):
    first, second = CorridorSteering(), CorridorSteering()
    stamp = 0.0
    for lane, seconds, clearance in pictures:
        stamp += seconds
        assert first.update(lane, stamp, clearance) == second.update(lane, stamp, clearance)


def test_who_hears_of_an_obstacle_at_the_braking_way_brakes_within_the_limit() -> None:
    steering = CorridorSteering(speed=3.0, most_acceleration=0.5, stop_distance=1.0)
    assert steering.braking_way == pytest.approx(10.0)
    speed = steady(steering, LaneHeading(0.0, 1e-6, 0.0, 1e-6, 2.0)).speed
    assert speed == pytest.approx(3.0, abs=0.02)
    assert steering.update(LaneHeading(0.0, 1e-6, 0.0, 1e-6, 2.0), 1e3, steering.braking_way).speed > 2.9


def steady(steering: CorridorSteering, lane: LaneHeading, clearance: float | None = None) -> Steering:
    """The command once the limits of acceleration no longer matter."""
    for k in range(100):
        command = steering.update(lane, k * STEP, clearance)
    return command


def lane(yaw: float = 0.0, offset: float = 0.0, offset_variance: float = 1e-4) -> LaneHeading:
    return LaneHeading(yaw, SURE, offset, offset_variance, 2.0)


def test_straight_ahead_in_the_middle_nothing_has_to_be_done():
    command = steady(CorridorSteering(), lane())
    assert command.turn_rate == 0.0
    assert command.speed == pytest.approx(0.5, rel=0.05)
    assert command.reason == ""


@settings(max_examples=40)
@given(numbers(0.01, 0.8), numbers(0.01, 1.0))
def test_left_steers_right_and_right_steers_left(yaw, offset):
    assert steady(CorridorSteering(), lane(yaw=yaw)).turn_rate < 0.0
    assert steady(CorridorSteering(), lane(yaw=-yaw)).turn_rate > 0.0
    assert steady(CorridorSteering(), lane(offset=offset)).turn_rate < 0.0
    assert steady(CorridorSteering(), lane(offset=-offset)).turn_rate > 0.0


@settings(max_examples=40)
@given(numbers(-0.8, 0.8), numbers(-1.0, 1.0))
def test_the_two_sides_are_treated_alike(yaw, offset):
    one = steady(CorridorSteering(), lane(yaw, offset))
    other = steady(CorridorSteering(), lane(-yaw, -offset))
    assert one.speed == pytest.approx(other.speed)
    assert one.turn_rate == pytest.approx(-other.turn_rate)


def test_curvature_is_that_of_pure_pursuit():
    # Coulter 1992: the arc to the point aimed at has curvature 2 sin(bearing) / distance.
    steering = CorridorSteering(lookahead=1.2)
    command = steady(steering, lane(yaw=0.1, offset=0.3))
    bearing = -0.1 - math.atan2(0.3, 1.2)
    assert command.turn_rate / command.speed == pytest.approx(2 * math.sin(bearing) / math.hypot(1.2, 0.3))


def test_an_offset_that_is_not_known_is_not_used():
    blind = steady(CorridorSteering(), lane(yaw=0.1, offset=5.0, offset_variance=math.inf))
    assert blind == steady(CorridorSteering(), lane(yaw=0.1))
    vague = steady(CorridorSteering(offset_trusted=0.3), lane(yaw=0.1, offset=5.0, offset_variance=0.31**2))
    assert vague == blind


def test_large_angles_and_doubtful_ones_are_taken_slowly():
    free = steady(CorridorSteering(), lane()).speed
    assert steady(CorridorSteering(), lane(yaw=0.5)).speed < 0.9 * free
    doubtful = LaneHeading(0.0, math.radians(9.0) ** 2)
    assert steady(CorridorSteering(), doubtful).speed == pytest.approx(0.5 * (1 - 0.45))


@pytest.mark.parametrize(
    ("heading", "reason"),
    [
        (None, "no heading"),
        (LaneHeading(0.0, math.radians(11.0) ** 2), "uncertain"),
        (LaneHeading(0.0, math.inf), "uncertain"),
        (LaneHeading(0.0, math.nan), "uncertain"),
        (LaneHeading(math.nan, SURE), "uncertain"),
        (LaneHeading(math.inf, SURE), "uncertain"),
    ],
)
def test_stops_at_once_and_says_why(heading, reason):
    steering = CorridorSteering()
    assert steady(steering, lane(yaw=0.2)).speed > 0.3
    stopped = steering.update(heading, 100 * STEP)
    assert (stopped.speed, stopped.turn_rate) == (0.0, 0.0)
    assert reason in stopped.reason
    again = steering.update(lane(), 101 * STEP)
    assert again.speed <= 0.5 * FIRST_STEP + 1e-12  # it sets out anew, gently


@pytest.mark.parametrize("offset", [math.nan, math.inf, -math.inf])
def test_an_offset_that_is_no_number_is_not_used(offset):
    assert steady(CorridorSteering(), lane(yaw=0.1, offset=offset)) == steady(
        CorridorSteering(), lane(yaw=0.1, offset_variance=math.inf)
    )


@pytest.mark.parametrize("variance", [-1e-12, -1.0, -math.inf, math.nan])
def test_a_variance_that_is_none_is_not_trusted(variance):
    stopped = steady(CorridorSteering(), LaneHeading(0.1, variance))
    assert (stopped.speed, stopped.turn_rate) == (0.0, 0.0)
    assert "uncertain" in stopped.reason
    vague = lane(yaw=0.1, offset=0.4, offset_variance=variance)
    assert steady(CorridorSteering(), vague) == steady(CorridorSteering(), lane(yaw=0.1))


any_float = st.one_of(st.floats(), numbers(-4.0, 4.0), st.sampled_from([math.nan, math.inf, -math.inf, 0.0]))


@given(
    steerings,
    st.lists(
        st.tuples(st.builds(LaneHeading, *[any_float] * 5), any_float, st.one_of(st.none(), any_float)),
        max_size=10,
    ),
)
def test_any_floats_give_a_finite_command_within_the_limits(steering, pictures):
    for heading, stamp, clearance in pictures:
        command = steering.update(heading, stamp, clearance)
        assert 0.0 <= command.speed <= steering.speed
        assert abs(command.turn_rate) <= steering.most_turn_rate
    # Nothing of it stays: the next good picture drives.
    assert steady(steering, lane()).speed > 0.0


def test_a_clearance_that_is_no_number_counts_as_none():
    unknown = steady(CorridorSteering(), lane(), math.nan)
    assert unknown.speed == 0.0 and "not a number" in unknown.reason
    assert steady(CorridorSteering(), lane(), math.inf) == steady(CorridorSteering(), lane())
    assert steady(CorridorSteering(), lane(), -math.inf).speed == 0.0


@dataclass(frozen=True)
class Drive:
    """A robot in a straight lane that does what it is told, picture by picture."""

    along: np.ndarray
    offset: np.ndarray
    yaw: np.ndarray
    speed: np.ndarray


def drive(
    steering: CorridorSteering, offset: float, yaw: float, seconds: float, wall: float | None = None
) -> Drive:
    along, track, fine = 0.0, [], 10
    for k in range(round(seconds * PICTURES_PER_SECOND)):
        clearance = None if wall is None else wall - along
        command = steering.update(LaneHeading(yaw, SURE, offset, 1e-4, 2.0), k * STEP, clearance)
        for _ in range(fine):
            yaw += command.turn_rate * STEP / fine
            along += command.speed * math.cos(yaw) * STEP / fine
            offset += command.speed * math.sin(yaw) * STEP / fine
        track.append((along, offset, yaw, command.speed))
    return Drive(*np.array(track).T)


def drive_late(offset: float, yaw: float, length: float, at_speed: bool, noise: float) -> Drive:
    """A differential drive at 1 m/s that answers late: wheels with a lag of 0.15 s, headings one picture old.

    Args:
        offset, yaw: at the start, m and rad.
        length: of the corridor, m.
        at_speed: whether it comes to the start at full speed, or sets out from there.
        noise: share of 0.3 degrees and 10 mm by which headings are off (standard deviation).
    """
    steering, random, lag, fine = CorridorSteering(speed=1.0), np.random.default_rng(0), 0.15, 20
    speed = steady(steering, lane()).speed if at_speed else 0.0
    late, along, turn_rate, track = (yaw, offset), 0.0, 0.0, []
    kept = math.exp(-STEP / fine / lag)
    for k in range(100, 100 + round(2 * length * PICTURES_PER_SECOND)):
        off_yaw, off_offset = noise * random.normal(0.0, (math.radians(0.3), 0.01))
        heading, late = LaneHeading(late[0] + off_yaw, SURE, late[1] + off_offset, 1e-4, 2.0), (yaw, offset)
        command = steering.update(heading, k * STEP)
        for _ in range(fine):
            speed = command.speed + kept * (speed - command.speed)
            turn_rate = command.turn_rate + kept * (turn_rate - command.turn_rate)
            yaw += turn_rate * STEP / fine
            along += speed * math.cos(yaw) * STEP / fine
            offset += speed * math.sin(yaw) * STEP / fine
        track.append((along, offset, yaw, speed))
        if along > length:
            break
    return Drive(*np.array(track).T)


@pytest.mark.parametrize("noise", [0.0, 1.0])
@pytest.mark.parametrize("at_speed", [False, True])
@pytest.mark.parametrize("yaw_deg", [10.0, -10.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_robot_that_answers_late_keeps_to_the_middle_at_a_metre_a_second(side, yaw_deg, at_speed, noise):
    way = drive_late(0.4 * side, side * math.radians(yaw_deg), 30.0, at_speed, noise)
    assert way.along[-1] > 30.0
    late = way.along > 5.0
    assert np.sqrt(np.mean(way.offset[late] ** 2)) < 0.03
    assert (side * way.offset).min() > -0.2 * 0.4
    assert way.speed[late].min() > 0.9


@pytest.mark.parametrize("yaw_deg", [10.0, 0.0, -10.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_comes_to_the_middle_and_stays(side, yaw_deg):
    way = drive(CorridorSteering(), 0.4 * side, side * math.radians(yaw_deg), 25.0)
    away = side * way.offset
    assert away.max() < 0.4 + 0.15  # looking outwards at first it goes out a little
    assert away.min() > -0.2 * 0.4  # no overshoot beyond a fifth
    late = way.along > 6.0
    assert late.any()
    assert np.abs(way.offset[late]).max() < 0.02
    assert np.abs(np.degrees(way.yaw[late])).max() < 1.0
    assert way.speed[late].min() > 0.45


@settings(max_examples=40)
@given(numbers(-0.8, 0.8), numbers(-0.7, 0.7), numbers(0.2, 1.0))
def test_comes_to_the_middle_from_wherever_it_starts(offset, yaw, speed):
    way = drive(CorridorSteering(speed=speed, lookahead=max(0.8, 2.0 * speed)), offset, yaw, 60.0)
    assert abs(way.offset[-1]) < 0.02
    assert abs(way.yaw[-1]) < math.radians(1.0)


@settings(max_examples=40)
@given(numbers(0.7, 8.0), numbers(0.2, 1.5), numbers(0.2, 2.0), numbers(0.2, 1.0))
def test_stops_before_what_stands_in_the_way(wall, speed, acceleration, left):
    steering = CorridorSteering(speed=speed, most_acceleration=acceleration, stop_distance=left)
    way = drive(steering, 0.0, 0.0, 60.0, wall=wall)
    # In the last step a speed from the braking curve may reach beyond it: 2 a dt^2 at most.
    assert wall - way.along.max() > min(left, wall) - 2 * acceleration * STEP**2
    assert way.speed[-1] < 0.02
    assert wall - way.along[-1] < max(left, 0.0) + 0.05 or wall <= left


def test_braking_is_as_hard_as_asked():
    way = drive(CorridorSteering(speed=1.0, most_acceleration=0.5), 0.0, 0.0, 30.0, wall=8.0)
    # The yaw is known a little less than surely, so the top speed is a little less than 1 m/s.
    assert way.speed.max() > 0.95
    # The last crawl, a few a dt, ends in fewer steps than the even braking would take.
    assert np.diff(way.speed)[way.speed[:-1] > 0.2].min() > -0.5 * STEP * 1.2


def test_something_in_the_way_is_said():
    steering = CorridorSteering()
    assert "0.7 m ahead" in steady(steering, lane(), 0.7).reason
    assert steady(steering, lane(), 50.0).reason == ""


@pytest.mark.parametrize("start", [5.0, -5.0, 0.0])
def test_a_clock_that_jumps_gives_one_short_step(start):
    steering = CorridorSteering()
    speed = steady(steering, lane(yaw=0.6)).speed
    after = steering.update(lane(), 100 * STEP + start if start else 99 * STEP)
    assert after.speed - speed <= 0.5 * FIRST_STEP + 1e-12


def test_reset_stands_still():
    steering = CorridorSteering()
    steady(steering, lane())
    steering.reset()
    assert steering.update(lane(), 1e6).speed <= 0.5 * FIRST_STEP + 1e-12


@pytest.mark.parametrize(
    "setting",
    [
        "speed",
        "lookahead",
        "most_turn_rate",
        "most_acceleration",
        "most_turn_acceleration",
        "stop_distance",
        "yaw_trusted",
        "offset_trusted",
    ],
)
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_settings_without_meaning_are_named(setting, value):
    with pytest.raises(ValueError, match=f"^{setting} must be a positive number"):
        replace(CorridorSteering(), **{setting: value})


@given(any_finite(), any_finite(), numbers(0.0, 1e6))
def test_approach_goes_as_far_as_it_may(value, target, most):
    there = approach(value, target, most)
    assert abs(there - value) <= most * (1 + 1e-9) + 1e-9 * abs(value)
    assert abs(target - there) <= abs(target - value)


@given(numbers(0.0, 100.0), numbers(0.05, 5.0))
def test_braking_curve_is_the_parabola(distance, deceleration):
    speed = speed_to_stop_within(distance, deceleration)
    assert speed**2 / (2 * deceleration) == pytest.approx(distance)
    assert speed_to_stop_within(-distance, deceleration) == 0.0


@pytest.mark.parametrize("curvature", [0.03, -0.2])
def test_on_the_centre_line_of_a_bend_it_turns_with_the_bend(curvature: float) -> None:
    law = CorridorSteering(speed=1.0)
    for step in range(60):
        command = law.update(LaneHeading(0.0, SURE, 0.0, SURE, 2.0, curvature), step * STEP)
    assert command.turn_rate == pytest.approx(command.speed * curvature, rel=0.03)


@pytest.mark.parametrize("curvature", [math.nan, math.inf, -1e300])
def test_a_curvature_beyond_sense_keeps_the_limits(curvature: float) -> None:
    law = CorridorSteering()
    for step in range(10):
        command = law.update(LaneHeading(0.0, SURE, 0.0, SURE, 2.0, curvature), step * STEP)
        assert math.isfinite(command.turn_rate)
        assert abs(command.turn_rate) <= law.most_turn_rate
