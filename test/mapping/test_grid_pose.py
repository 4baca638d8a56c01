# SPDX-License-Identifier: Apache-2.0
"""A robot among walls on a grid: odometry that drifts is put right by vanishing points and by faces of walls."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from robot_vision.mapping import GridPose, PlanView, Pose
from robot_vision.mapping.wall_faces import floor_ends
from robot_vision.planning import Maze

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "planning"))

from seen_mazes import CAMERA, EYE, WALL, directions_from, plan_from  # noqa: E402  (drawn for the planner)

Shadow = tuple[float, float]

HALL = Maze.parse(
    "+---+---+---+---+\n| S             |\n+   +---+---+   +\n|             G |\n+---+---+---+---+\n"
)


def lap(step: float = 0.1) -> list[Pose]:
    """Poses of a robot that goes round the hall, turning on the spot in its corners."""
    corners = np.array([(0.5, 0.5), (3.5, 0.5), (3.5, 1.5), (0.5, 1.5), (0.5, 0.5)])
    poses = []
    for side, (begin, end) in enumerate(zip(corners, corners[1:], strict=False)):
        yaw, length = side * np.pi / 2, float(np.hypot(*(end - begin)))
        for part in np.arange(0.0, length, step) / length:
            poses.append(Pose(*(begin + part * (end - begin)).tolist(), yaw))
        poses += [Pose(*end.tolist(), yaw + turn) for turn in np.arange(0.0, np.pi / 2, 0.15)]
    return poses


def driven(corrected: bool, laps: int = 2, shadow: Shadow = (0.0, 0.0)) -> tuple[float, float, Shadow]:
    """Worst error of place (m) and of yaw (rad) with wheels that are 3 % wrong, over the last lap; shadow learnt (m).

    Where walls cast shadows, floor seems to end at their edge in half of the pictures.
    """
    random = np.random.default_rng(1)
    truth = lap() * laps
    odometry = np.zeros(3)
    pose = GridPose(truth[0], 1.0, WALL)
    pose.move(0.0, Pose(*odometry.tolist()))
    worst = np.zeros(2)
    for number, (before, now) in enumerate(zip(truth, truth[1:], strict=False), start=1):
        way = float(np.hypot(now.x - before.x, now.y - before.y)) * 1.02
        odometry[2] += ((now.yaw - before.yaw + np.pi) % (2 * np.pi) - np.pi) * 1.03 + random.normal(
            0.0, 0.002
        )
        odometry[:2] += way * np.cos(odometry[2]), way * np.sin(odometry[2])
        stamp = 0.1 * number
        pose.move(stamp, Pose(*odometry.tolist()))
        if corrected:
            seen = directions_from(now.yaw + random.normal(0.0, 0.003))
            pose.see_directions(stamp, seen, np.full(2, 0.004), CAMERA)
            taken_in = (0.0, 0.0) if random.random() < 0.5 else shadow
            pose.see_plan(stamp, plan_from(HALL, now, 0.02, random, taken_in), EYE)
        told = pose.pose
        assert told is not None
        if number > len(truth) * (laps - 1) // laps:
            turn = (told.yaw - now.yaw + np.pi) % (2 * np.pi) - np.pi
            worst = np.maximum(worst, (np.hypot(told.x - now.x, told.y - now.y), abs(turn)))
    east, north = pose.shadow.tolist()
    return float(worst[0]), float(worst[1]), (east, north)


def test_walls_and_vanishing_points_hold_what_odometry_loses() -> None:
    place, yaw, _ = driven(corrected=True)
    assert place < 0.06
    assert yaw < np.deg2rad(1.5)
    lost_place, lost_yaw, _ = driven(corrected=False)
    assert lost_place > 0.3
    assert lost_yaw > np.deg2rad(10.0)


@pytest.mark.parametrize("shadow", [(-0.11, -0.21), (0.2, -0.12)])
def test_edges_of_shadows_are_told_from_feet_of_walls(shadow: Shadow) -> None:
    place, yaw, learnt = driven(corrected=True, shadow=shadow)
    assert place < 0.06
    assert yaw < np.deg2rad(1.5)
    assert learnt == pytest.approx(shadow, abs=0.04)


LANE = Maze.parse(
    "+---+---+---+---+---+---+---+---+---+---+---+\n"
    "| S                                         |\n"
    "+---+---+---+---+---+---+---+---+---+---+   +\n"
    "|                                         G |\n"
    "+---+---+---+---+---+---+---+---+---+---+---+\n"
)


@pytest.mark.parametrize(("seed", "wheels"), [(2, -0.015), (3, -0.015), (2, 0.015), (3, 0.015)])
def test_at_the_end_of_a_long_corridor_a_shadow_is_not_taken_for_what_odometry_lost(
    seed: int, wheels: float
) -> None:
    random = np.random.default_rng(seed)
    way = [Pose(0.5 + 0.2 * step, 1.5, 0.0) for step in range(51)]
    way += [Pose(10.5, 1.5, -turn) for turn in np.arange(0.0, np.pi / 2, 0.25)]
    way += [Pose(10.5, 1.5 - 0.1 * step, -np.pi / 2) for step in range(11)]
    way += [Pose(10.5, 0.5, -np.pi / 2 - turn) for turn in np.arange(0.0, np.pi / 2, 0.25)]
    back = [Pose(10.5 - 0.2 * step, 0.5, -np.pi) for step in range(8)]
    pose = GridPose(way[0], 1.0, WALL)
    odometry = Pose(0.0, 0.0, 0.0)
    pose.move(0.0, odometry)
    for number, (before, now) in enumerate(zip([*way, *back], [*way[1:], *back], strict=False), start=1):
        step = before.inverse.then(now)
        odometry = odometry.then(Pose((1.0 + wheels) * step.x, (1.0 + wheels) * step.y, step.yaw))
        stamp = 0.1 * number
        pose.move(stamp, odometry)
        pose.see_directions(
            stamp, directions_from(now.yaw + random.normal(0.0, 0.003)), np.full(2, 0.004), CAMERA
        )
        shadow = (-0.2, -0.11) if random.random() < 0.5 else (0.0, 0.0)
        pose.see_plan(stamp, plan_from(LANE, now, 0.02, random, shadow), EYE)
    told = pose.pose
    assert told is not None
    assert told.x == pytest.approx(now.x, abs=0.05)
    assert abs(told.x - now.x) < 3.0 * pose.sigma[0]


def test_a_vanishing_point_far_off_is_not_believed() -> None:
    pose = GridPose(Pose(0.5, 0.5, 0.0), 1.0, WALL)
    pose.move(0.0, Pose(0.0, 0.0, 0.0))
    pose.see_directions(0.0, directions_from(0.6), np.full(2, 0.004), CAMERA)
    assert pose.pose == pytest.approx(Pose(0.5, 0.5, 0.0))


@pytest.mark.parametrize(("off", "left"), [(0.03, 0.025), (-0.03, 0.025), (0.2, 0.2), (-0.2, 0.2)])
def test_a_face_a_little_off_is_believed_to_both_sides_and_one_far_off_hardly(
    off: float, left: float
) -> None:
    pose = GridPose(Pose(2.5, 0.5, 0.0), 1.0, WALL)
    pose.move(0.0, Pose(0.0, 0.0, 0.0))
    for _ in range(60):
        pose.see_plan(0.0, plan_from(HALL, Pose(2.5 + off, 0.5, 0.0)), EYE)
    told = pose.pose
    assert told is not None
    error = abs(2.5 + off - told.x)
    assert error < left
    assert abs(off) < 0.1 or error > 0.15


def test_a_pose_and_its_inverse_cancel_out() -> None:
    first, second = Pose(1.0, -2.0, 2.5), Pose(0.3, 0.4, 1.2)
    assert first.then(first.inverse) == pytest.approx(Pose(0.0, 0.0, 0.0))
    assert first.inverse.then(first.then(second)) == pytest.approx(second)
    point = np.array([0.7, -0.2, 1.0])
    assert first.then(second).matrix @ point == pytest.approx(first.matrix @ second.matrix @ point)


def test_without_odometry_there_is_no_place() -> None:
    pose = GridPose(Pose(0.5, 0.5, 0.0), 1.0, WALL)
    pose.see_plan(0.0, plan_from(HALL, Pose(0.5, 0.5, 0.0)), EYE)
    assert pose.pose is None
    assert pose.at(0.0) is None


def test_floor_that_was_not_seen_up_to_its_end_tells_no_end() -> None:
    cells = np.full((160, 160), -1, np.int8)
    cells[60:100, 10:14] = 100
    assert np.isnan(floor_ends(PlanView(cells, 0.05, (0.0, -4.0)), EYE, 2.0)).all()
    cells[60:100, 2:10] = 0
    ends = floor_ends(PlanView(cells, 0.05, (0.0, -4.0)), EYE, 2.0)
    assert ends[45] == pytest.approx((0.5, 0.0), abs=0.03)


@pytest.mark.parametrize("name", ["cell", "wall", "way_drift", "turn_drift", "direction_floor", "face_sigma"])
def test_settings_that_make_no_sense_are_refused(name: str) -> None:
    given = {"start": Pose(0.5, 0.5, 0.0), "cell": 1.0, "wall": WALL, name: 0.0}
    with pytest.raises(ValueError, match=name):
        GridPose(**given)  # type: ignore[arg-type]
