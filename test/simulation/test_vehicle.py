# SPDX-License-Identifier: Apache-2.0
"""Vehicles: they drive arcs, keep their limits, and are late by their lag; bodies on rough ground keep measure."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_vision.simulation import SimulationError
from robot_vision.simulation.body import BodyState, RoughGround, Sway
from robot_vision.simulation.odometry import Odometer
from robot_vision.simulation.sensors import WheelOdometry
from robot_vision.simulation.vehicle import Vehicle, VehicleSettings
from robot_vision.simulation.world import standard_camera

STEP = 1 / 600


def drive(vehicle: Vehicle, speed: float, turn_rate: float, seconds: float) -> None:
    for _ in range(round(seconds / STEP)):
        vehicle.step(speed, turn_rate, STEP)


def test_a_vehicle_without_lag_drives_the_circle_it_is_told() -> None:
    able = VehicleSettings(lag=0.0, most_acceleration=1e6, most_turn_acceleration=1e6)
    vehicle = Vehicle(able)
    drive(vehicle, 1.0, 0.5, np.pi / 0.5)  # half a circle of radius 2 m
    assert (vehicle.x, vehicle.y) == pytest.approx((0.0, 4.0), abs=0.01)
    assert vehicle.yaw == pytest.approx(np.pi, abs=1e-3)
    assert vehicle.way == pytest.approx(2 * np.pi, abs=0.01)


def test_speed_lags_as_first_order_systems_do() -> None:
    vehicle = Vehicle(VehicleSettings(lag=0.3, most_acceleration=1e6))
    drive(vehicle, 1.0, 0.0, 0.3)
    assert vehicle.speed == pytest.approx(1 - np.exp(-1), abs=1e-6)


@given(
    st.sampled_from(["differential", "ackermann"]),
    st.lists(st.tuples(st.floats(-9, 9), st.floats(-9, 9)), min_size=1, max_size=6),
)
def test_no_command_breaks_a_limit(kind: str, commands: list[tuple[float, float]]) -> None:
    vehicle = Vehicle(VehicleSettings(kind))
    able = vehicle.settings
    for command in commands:
        for _ in range(30):
            speed, turn = vehicle.speed, vehicle.turn_rate
            vehicle.step(*command, STEP)
            assert abs(vehicle.speed) <= able.most_speed
            assert abs(vehicle.speed - speed) <= able.most_acceleration * STEP + 1e-12
            if kind == "ackermann":
                tightest = np.tan(able.most_steering_angle) / able.wheelbase
                assert abs(vehicle.turn_rate) <= abs(vehicle.speed) * tightest + 1e-12
            else:
                assert abs(vehicle.turn_rate) <= able.most_turn_rate
                assert abs(vehicle.turn_rate - turn) <= able.most_turn_acceleration * STEP + 1e-12


def test_only_a_differential_vehicle_turns_on_the_spot() -> None:
    for kind, turned in (("differential", 1.0), ("ackermann", 0.0)):
        vehicle = Vehicle(VehicleSettings(kind))
        drive(vehicle, 0.0, 1.0, 1.0)
        assert vehicle.yaw == pytest.approx(turned, abs=0.2)
        assert (vehicle.x, vehicle.y) == pytest.approx((0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("speed", [0.8, -0.8])
def test_an_ackermann_vehicle_reaches_the_turn_it_is_told(speed: float) -> None:
    vehicle = Vehicle(VehicleSettings("ackermann"))
    drive(vehicle, speed, 0.4, 3.0)
    assert vehicle.turn_rate == pytest.approx(0.4, abs=1e-3)


def test_nonsense_is_refused() -> None:
    with pytest.raises(SimulationError, match="kind must be one of"):
        VehicleSettings("tank")
    with pytest.raises(SimulationError, match="wheelbase must be positive"):
        VehicleSettings(wheelbase=0.0)
    with pytest.raises(SimulationError, match="cannot drive nan"):
        Vehicle().step(float("nan"), 0.0, STEP)


def test_rough_ground_is_as_rough_as_asked() -> None:
    heights = RoughGround(0.02, seed=4).heights(np.linspace(0, 4000, 40_000))
    assert heights.std() == pytest.approx(0.02, rel=0.05)
    assert np.abs(heights.mean(axis=1)).max() < 2e-3


def test_a_body_leans_as_its_wheels_stand() -> None:
    """Each wheel of the leaning body stands on the ground, but for what four wheels cannot all do."""
    ground = RoughGround(0.01, seed=2, track=0.5, wheelbase=0.4)
    way = np.linspace(0, 30, 200)
    roll, pitch, rise = ground.lean(way)
    (left, right), (rear_left, rear_right) = ground.heights(way + 0.2), ground.heights(way - 0.2)
    for ahead, side, height in (
        (0.2, 0.25, left),
        (0.2, -0.25, right),
        (-0.2, 0.25, rear_left),
        (-0.2, -0.25, rear_right),
    ):
        stands = (
            rise + side * np.tan(roll) - ahead * np.tan(pitch)
        )  # roll > 0 lifts the left, pitch > 0 lowers the front
        twist = (left - right - rear_left + rear_right) / 4
        np.testing.assert_allclose(np.abs(stands - height), np.abs(twist), atol=1e-12)


def test_smooth_ground_moves_nobody() -> None:
    assert all((part == 0).all() for part in RoughGround(0.0).lean([0.0, 1.0, 2.0]))


@given(st.integers(0, 1000), st.floats(0.0, 0.1))
def test_sway_keeps_its_limit(seed: int, limit: float) -> None:
    angles = Sway.draw(np.random.default_rng(seed), limit).at(np.linspace(0, 60, 2000))
    assert np.abs(angles).max() <= limit
    if limit > 1e-3:
        assert angles.std() > 0.2 * limit


def test_a_body_that_rises_takes_its_camera_along() -> None:
    camera = standard_camera()
    low, high = (BodyState(1.0, 2.0, 0.3, rise=rise).camera_pose(camera) for rise in (0.0, 0.04))
    np.testing.assert_allclose(high[:3, 3] - low[:3, 3], (0, 0, 0.04), atol=1e-12)
    np.testing.assert_array_equal(high[:3, :3], low[:3, :3])


def test_perfect_wheels_tell_the_way() -> None:
    odometer = Odometer(WheelOdometry(0, 0.0, 0.0, 0.0, 0.0))
    for _ in range(30):
        reading = odometer.read(1.0, np.pi / 2, 1 / 30)
    assert (reading.x, reading.y, reading.yaw) == pytest.approx((2 / np.pi, 2 / np.pi, np.pi / 2))


def test_wheels_err_as_much_as_they_are_said_to() -> None:
    ends = []
    for seed in range(200):
        odometer = Odometer(WheelOdometry(seed, 0.02, 0.0, 0.0, 0.0))
        ends.append(odometer.read(1.0, 0.0, 10.0).x)
    assert np.std(ends) == pytest.approx(0.2, rel=0.2)
    assert np.mean(ends) == pytest.approx(10.0, abs=0.05)


def test_wheels_that_stand_say_so() -> None:
    reading = Odometer(WheelOdometry(3)).read(0.0, 0.0, 1 / 30)
    assert reading == (0.0, 0.0, 0.0, 0.0, 0.0)
