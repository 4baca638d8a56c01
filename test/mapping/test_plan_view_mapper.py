# SPDX-License-Identifier: Apache-2.0
"""The whole chain on drawn corridors: floor, things, shadows, clearance, map, and what it says when it cannot know."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from corridor_pictures import CAMERA, HALF_M, Box, Shade, feet, picture, vanishing_points

from robot_vision.geometry import Camera, GroundPlaneError
from robot_vision.mapping import LineKind, PlanViewEstimate, PlanViewMapper, PointKind, Pose
from robot_vision.perception import LineSegments

LINES, POINTS = feet(), vanishing_points()
STEP_M = 0.1


def drive(
    mapper: PlanViewMapper,
    pictures: int,
    boxes: tuple[Box, ...] = (),
    shades: tuple[Shade, ...] = (),
    told: float = 1.0,
) -> PlanViewEstimate:
    """Drive down the corridor; `told` is what odometry makes of a metre."""
    estimate = None
    for number in range(pictures):
        shown = picture(STEP_M * number, boxes, shades)
        pose = Pose(told * STEP_M * number, 0.0, 0.0)
        estimate = mapper.update(shown, LINES, POINTS, CAMERA, 0.1 * number, pose)
    assert estimate is not None
    return estimate


def cell(estimate: PlanViewEstimate, x: float, y: float) -> int:
    plan = estimate.plan_view
    row, column = (
        int((value - start) / plan.resolution) for value, start in ((y, plan.origin[1]), (x, plan.origin[0]))
    )
    return int(plan.cells[row, column])


def test_one_picture_without_odometry_tells_floor_walls_and_what_nobody_sees() -> None:
    estimate = PlanViewMapper().update(picture(), LINES, POINTS, CAMERA, 0.0)
    for x in (1.5, 3.0, 5.0):
        assert [cell(estimate, x, y) for y in (-0.7, 0.0, 0.7)] == [0, 0, 0]
        assert cell(estimate, x, 1.6) == -1
    assert cell(estimate, 3.0, HALF_M + 0.03) == 100
    assert cell(estimate, 0.4, 0.0) == -1, "below the picture"
    assert "no odometry" in estimate.reason
    assert not estimate.mapped


@pytest.mark.parametrize("x", [1.6, 2.5, 4.0])
def test_a_box_is_found_where_it_stands_and_clearance_ends_at_it(x: float) -> None:
    mapper = PlanViewMapper()
    estimate = mapper.update(picture(boxes=(Box(x, 0.0),)), LINES, POINTS, CAMERA, 0.0)
    assert estimate.clearance == pytest.approx(x - mapper.clearance.front, rel=0.04)
    (thing,) = [item for item in estimate.objects if abs(item.y) < 0.1]
    assert thing.distance == pytest.approx(x, rel=0.04)
    assert thing.width == pytest.approx(0.4, abs=0.06)
    assert cell(estimate, x - 0.2, 0.0) == 0
    assert cell(estimate, x + 0.07, 0.0) == 100
    assert cell(estimate, x + 0.6, 0.0) == -1, "behind it nobody has looked"


def test_a_box_beside_the_way_leaves_it_free() -> None:
    estimate = PlanViewMapper().update(picture(boxes=(Box(2.5, 0.7),)), LINES, POINTS, CAMERA, 0.0)
    assert estimate.clearance == np.inf


def test_a_box_too_near_to_see_its_foot_leaves_nothing_free() -> None:
    mapper = PlanViewMapper()
    mapper.update(picture(), LINES, POINTS, CAMERA, 0.0)
    estimate = mapper.update(picture(boxes=(Box(0.7, 0.0, 0.6, 1.5),)), LINES, POINTS, CAMERA, 0.1)
    assert estimate.clearance == 0.0
    assert "no floor seen so far" in estimate.reason


def test_what_stands_before_the_robot_is_not_learnt_as_floor() -> None:
    mapper = PlanViewMapper()
    mapper.update(picture(), LINES, POINTS, CAMERA, 0.0, Pose(0.0, 0.0, 0.0))
    near = picture(boxes=(Box(0.7, 0.0, 0.6, 1.5),))
    for number in range(1, 40):
        estimate = mapper.update(near, LINES, POINTS, CAMERA, 0.1 * number, Pose(0.0, 0.0, 0.0))
    assert estimate.clearance == 0.0


def test_a_shadow_is_floor_from_the_first_picture_on() -> None:
    shade = Shade((2.0, 2.8), (-0.6, 0.9))
    estimate = PlanViewMapper().update(picture(shades=(shade,)), LINES, POINTS, CAMERA, 0.0)
    assert cell(estimate, 2.4, 0.0) == 0
    assert cell(estimate, 4.0, 0.0) == 0
    assert estimate.clearance == np.inf
    assert estimate.layers is not None and estimate.layers.shadow.sum() > 500


def test_a_box_that_looks_like_the_floor_is_seen_by_its_motion() -> None:
    box = Box(3.2, 0.0, 0.6, 0.4, None)
    estimate = drive(PlanViewMapper(), 9, (box,))
    assert estimate.clearance == pytest.approx(3.2 - 8 * STEP_M - 0.3, abs=0.15)


def test_the_map_grows_free_and_taken_where_they_are() -> None:
    mapper = PlanViewMapper()
    drive(mapper, 12, (Box(3.0, -0.5),), (Shade((2.0, 2.6), (-0.2, 0.9)),))
    grid = mapper.map.grid()
    assert grid is not None

    def at(x: float, y: float) -> int:
        return int(grid.cells[int((y - grid.origin[1]) / 0.05), int((x - grid.origin[0]) / 0.05)])

    assert at(2.3, 0.3) == 0, "in shadow"
    assert at(4.5, 0.5) == 0
    assert at(3.05, -0.5) == 100
    assert at(3.0, HALF_M + 0.03) == 100
    assert at(3.6, -0.5) == -1, "behind the box"


def test_lines_above_the_vanishing_point_are_irrelevant_and_feet_of_walls_are_borders() -> None:
    estimate = PlanViewMapper().update(picture(), LINES, POINTS, CAMERA, 0.0)
    assert estimate.layers is not None
    kinds = estimate.layers.kinds.tolist()
    assert kinds == [LineKind.BORDER, LineKind.BORDER, LineKind.IRRELEVANT] * 2


def test_feature_points_have_kinds_and_a_covariance_that_grows_with_distance() -> None:
    mapper = PlanViewMapper()
    shade = Shade((2.0, 2.8), (-0.6, 0.9))
    estimate = mapper.update(picture(boxes=(Box(3.5, 0.0),), shades=(shade,)), LINES, POINTS, CAMERA, 0.0)
    points = mapper.ground_points(estimate)
    assert points is not None
    assert set(np.unique(points.kind)) == {PointKind.GROUND, PointKind.OBJECT, PointKind.SHADOW}
    far, near = points.x > 4.0, points.x < 1.5
    spread = np.sqrt(points.covariance[:, 0, 0])
    assert spread[far].min() > 3 * spread[near].max()
    box = (points.kind == PointKind.OBJECT) & (np.abs(points.y) < 0.15)
    assert np.median(points.x[box]) == pytest.approx(3.5, rel=0.04)


@pytest.mark.parametrize("told, more", [(1.2, "more"), (0.8, "less")])
def test_odometry_that_slips_is_told_and_stays_out_of_the_map(told: float, more: str) -> None:
    estimate = drive(PlanViewMapper(), 14, told=told)
    assert f"{more} way than the floor shows" in estimate.reason
    assert estimate.slip == pytest.approx(1.0 - 1.0 / told, abs=0.05)
    assert not estimate.mapped


def test_good_odometry_is_not_doubted() -> None:
    estimate = drive(PlanViewMapper(), 14)
    assert estimate.reason == ""
    assert abs(estimate.slip) < 0.02


@pytest.mark.parametrize("level", [0, 5])
def test_in_the_dark_nothing_is_free_and_light_brings_everything_back(level: int) -> None:
    mapper = PlanViewMapper()
    mapper.update(picture(), LINES, POINTS, CAMERA, 0.0, Pose(0.0, 0.0, 0.0))
    dark = np.full((480, 640, 3), level, np.uint8)
    estimate = mapper.update(dark, LineSegments.empty(), None, CAMERA, 0.1, Pose(0.1, 0.0, 0.0))
    assert estimate.clearance is None and not estimate.mapped
    assert (estimate.plan_view.cells == -1).all()
    assert "dark" in estimate.reason
    again = mapper.update(picture(0.2), LINES, POINTS, CAMERA, 0.2, Pose(0.2, 0.0, 0.0))
    assert again.clearance == np.inf


def test_a_camera_that_hangs_is_told_as_soon_as_the_robot_has_moved_and_nothing_is_free() -> None:
    mapper = PlanViewMapper()
    same = picture()
    for number, x in enumerate((0.0, 0.02, 0.1, 0.2, 0.3)):
        estimate = mapper.update(same, LINES, POINTS, CAMERA, 0.1 * number, Pose(x, 0.0, 0.0))
        hangs = x > 0.05
        assert ("stays the same while the robot moves" in estimate.reason) is hangs
        assert (estimate.plan_view.cells == -1).all() == (estimate.clearance is None) == hangs
        assert estimate.mapped is not hangs
    again = mapper.update(picture(0.4), LINES, POINTS, CAMERA, 0.5, Pose(0.4, 0.0, 0.0))
    assert again.clearance is not None and again.clearance > 4.0
    assert [cell(again, x, 0.0) for x in (1.5, 3.0)] == [0, 0]


def test_a_knocked_camera_is_told_and_measured_by_until_then_nothing_is_free() -> None:
    mapper = PlanViewMapper()
    for number in range(5):
        mapper.update(picture(), LINES, POINTS, CAMERA, 0.1 * number)
    knocked = replace(CAMERA, pitch=CAMERA.pitch + float(np.radians(3.0)))
    shown, lines, points = (
        picture(boxes=(Box(3.0, 0.0),), camera=knocked),
        feet(knocked),
        vanishing_points(knocked),
    )
    estimates = [mapper.update(shown, lines, points, CAMERA, 0.5 + 0.1 * n) for n in range(8)]
    assert (estimates[0].plan_view.cells == -1).all() and estimates[0].clearance is None
    assert "contradict" in estimates[0].reason
    told = [estimate.horizon.knocked for estimate in estimates if estimate.horizon.knocked]
    assert np.degrees(told) == pytest.approx([3.0], abs=0.2)
    assert estimates[-1].clearance == pytest.approx(2.7, rel=0.05)


def test_without_vanishing_points_less_is_claimed() -> None:
    sure = PlanViewMapper().update(picture(), LINES, POINTS, CAMERA, 0.0)
    blind = PlanViewMapper().update(picture(), LineSegments.empty(), None, CAMERA, 0.0)
    assert cell(sure, 5.0, 0.0) == 0
    assert cell(blind, 5.0, 0.0) == -1
    assert cell(blind, 2.0, 0.0) == 0


def test_grey_pictures_do() -> None:
    grey = picture(boxes=(Box(2.5, 0.0, colour=(30, 30, 30)),)).mean(axis=2).astype(np.uint8)
    estimate = PlanViewMapper().update(grey, LINES, POINTS, CAMERA, 0.0)
    assert estimate.clearance == pytest.approx(2.2, rel=0.05)


def test_the_same_pictures_give_the_same_answers() -> None:
    first, second = (drive(PlanViewMapper(), 6, (Box(3.0, 0.3),)) for _ in range(2))
    np.testing.assert_array_equal(first.plan_view.cells, second.plan_view.cells)
    assert first.clearance == second.clearance


def test_what_cannot_be_used_is_refused_in_words() -> None:
    mapper = PlanViewMapper()
    with pytest.raises(ValueError, match="320 x 240, but the camera's are 640 x 480"):
        mapper.update(np.zeros((240, 320, 3), np.uint8), LINES, POINTS, CAMERA, 0.0)
    with pytest.raises(GroundPlaneError, match="camera.height"):
        mapper.update(picture(), LINES, POINTS, replace(CAMERA, height_m=None), 0.0)
    with pytest.raises(GroundPlaneError, match="focal length"):
        guess = replace(Camera.uncalibrated(640, 480), height_m=0.6)
        mapper.update(picture(), LINES, POINTS, guess, 0.0)
    with pytest.raises(ValueError, match="reach"):
        PlanViewMapper(reach=-1.0)
