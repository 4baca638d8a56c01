# SPDX-License-Identifier: Apache-2.0
"""Each stage of the plan on what it alone has to do."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from corridor_pictures import CAMERA, Box, feet, picture, vanishing_points

from robot_vision.geometry import GroundPlane
from robot_vision.mapping import OccupancyMap, PlanViewMapper, Pose, PoseHistory
from robot_vision.mapping.appearance import FloorAppearance
from robot_vision.mapping.boundary import Boundary
from robot_vision.mapping.clearance import Clearance
from robot_vision.mapping.evidence import Evidence
from robot_vision.mapping.ground_lines import GroundLines
from robot_vision.mapping.ground_view import GroundView
from robot_vision.mapping.horizon import HorizonFilter
from robot_vision.mapping.objects import ObjectFinder
from robot_vision.mapping.overlay import draw_plan_view
from robot_vision.mapping.plan_view import DOUBTFUL, FREE, OCCUPIED, UNKNOWN, PlanViewMaker, Seen
from robot_vision.mapping.plane_motion import Parallax
from robot_vision.perception import LineSegments

VIEW = GroundView(CAMERA, 0.5)


def wall_at(distance: float, view: GroundView = VIEW) -> Boundary:
    """The end of the floor at a wall straight ahead, m."""
    columns = np.arange(view.shape[1], dtype=float)
    rows = np.interp(columns, *view.pixels(np.full(401, distance), np.linspace(20.0, -20.0, 401)))
    return Boundary.at(rows, np.ones(len(rows), bool), view)


@pytest.mark.parametrize("scale", [1.0, 0.5])
@pytest.mark.parametrize("roll", [0.0, 0.05])
def test_the_view_agrees_with_the_ground_plane(scale: float, roll: float) -> None:
    camera = replace(CAMERA, roll=roll, x_m=0.2)
    view = GroundView(camera, scale)
    places = np.array([(1.5, 0.4), (3.0, -0.7), (6.0, 0.0)])
    u, v = view.pixels(*places.T)
    full = (np.column_stack([u, v]) - (scale - 1.0) / 2.0) / scale
    np.testing.assert_allclose(full, GroundPlane(camera).to_pixels(places), atol=1e-9)
    np.testing.assert_allclose(np.column_stack(view.ground(u, v)), places, atol=1e-9)
    above = np.array([view.horizon_rows[100] - 1.0])
    assert np.isnan(view.ground(np.array([100.0]), above)).all()


def test_a_plane_above_the_floor_is_seen_where_its_points_are() -> None:
    camera = replace(CAMERA, roll=0.05, x_m=0.2)
    share, places = 0.4, np.array([(1.5, 0.4), (3.0, -0.7), (6.0, 0.0)])
    seen = np.column_stack([places, np.ones(3)]) @ GroundView(camera, 0.5).planes((0.0, share))[1].T
    # A camera that stands as much lower sees the floor there.
    lower = GroundView(replace(camera, height_m=(1.0 - share) * (camera.height_m or 0.0)), 0.5)
    np.testing.assert_allclose(seen[:, :2] / seen[:, 2:], np.column_stack(lower.pixels(*places.T)), atol=1e-9)


def test_the_floor_is_what_the_sample_looks_like() -> None:
    appearance = FloorAppearance()
    random = np.random.default_rng(1)
    lab = random.normal((130, 128, 135), 3, (60, 80, 3)).astype(np.uint8)
    lab[:20, :30] = (90, 160, 150)
    sample = np.zeros((60, 80), bool)
    sample[40:] = True
    appearance.learn(lab, sample, random.normal((200, 120, 120), 3, (40, 80, 3)).astype(np.uint8))
    score = appearance.score(lab)
    assert score[30:].mean() > 2.0
    assert score[:20, :30].max() < -1.0
    with pytest.raises(ValueError, match="no floor"):
        FloorAppearance().score(lab)


def test_the_horizon_settles_between_noisy_vanishing_points() -> None:
    random = np.random.default_rng(2)
    leaning = replace(CAMERA, pitch=CAMERA.pitch + 0.02)
    known = HorizonFilter()
    for number in range(60):
        noisy = replace(leaning, pitch=leaning.pitch + random.normal(0.0, 0.004))
        told = known.update(CAMERA, vanishing_points(noisy, 0.004), number / 15.0)
    assert told.camera.pitch == pytest.approx(leaning.pitch, abs=0.003)
    assert told.pitch_sigma < 0.004
    assert told.reach(0.2) > 20.0


def test_the_horizon_follows_the_pitch_rate_of_the_odometry() -> None:
    known = HorizonFilter()
    for number in range(30):
        known.update(CAMERA, vanishing_points(), number / 15.0)
    for number in range(30, 45):
        told = known.update(CAMERA, None, number / 15.0, pitch_rate=0.02)
    assert told.camera.pitch == pytest.approx(CAMERA.pitch + 0.02, abs=1e-3)


def test_clearance_begins_at_the_front_and_needs_more_than_noise() -> None:
    clearance = Clearance(width=0.6, front=0.3)
    assert clearance.measure(wall_at(3.0), vanishing_points(), VIEW, 7.0) == pytest.approx(2.7, abs=0.02)
    assert clearance.measure(wall_at(3.0), None, VIEW, 7.0) == pytest.approx(2.7, abs=0.02)
    assert clearance.measure(wall_at(6.0), None, VIEW, 5.0) == np.inf
    speck = wall_at(6.0)
    rows = speck.rows.copy()
    rows[160] = 200.0
    assert clearance.measure(Boundary.at(rows, speck.ended, VIEW), None, VIEW, 5.0) == np.inf
    with pytest.raises(ValueError, match="width"):
        Clearance(width=0.0)


def test_what_has_left_the_picture_is_remembered_until_the_robot_has_passed_it() -> None:
    """A thing 0.2 m to the left, at the rim of the strip; from 0.9 m before it on the picture shows none of it."""
    clearance, known = Clearance(width=0.6, front=0.3), OccupancyMap()
    for number in range(5):
        foot = wall_at(1.3 - 0.05 * number)
        post = (foot.y > 0.15) & (foot.y < 0.35)
        known.update(Seen(Boundary.at(foot.rows, post, VIEW), VIEW, 3.0), Pose(0.05 * number, 0.0, 0.0))
    near = Pose(0.7, 0.0, 0.0)
    assert clearance.measure(wall_at(5.0), None, VIEW, 4.0) == np.inf
    assert clearance.remembered(known, near, None, VIEW) == pytest.approx(0.3, abs=0.06)
    assert clearance.remembered(known, Pose(0.7, -0.3, 0.0), None, VIEW) == np.inf, "it stands beside the way"
    assert clearance.remembered(known, Pose(1.4, 0.0, 0.0), None, VIEW) == np.inf, "it has been passed"
    assert clearance.remembered(known, Pose(-2.0, 0.0, 0.0), None, VIEW) == np.inf, "the picture shows it"


def test_the_end_of_the_floor_faces_the_camera_or_recedes() -> None:
    ahead = wall_at(3.0)
    assert ahead.facing[160] == pytest.approx(1.0, abs=0.02)
    u, v = VIEW.pixels(np.linspace(8.0, 1.2, 400), np.full(400, -1.0))
    place = np.interp(np.arange(320.0), u, v)
    beside = Boundary.at(place, np.ones(320, bool), VIEW)
    seen = slice(int(u[0]) + 3, 315)
    truth = np.abs(beside.y[seen]) / beside.distance[seen]
    np.testing.assert_allclose(beside.facing[seen], truth, rtol=0.03)


def test_what_recedes_along_the_ray_is_a_doubt_to_the_map_and_taken_to_the_plan() -> None:
    """A thing at 2 m before a wall at 4 m: between the two its rim is no place where anything stands."""
    wall, thing = wall_at(4.0), wall_at(2.0)
    rows = wall.rows.copy()
    rows[:150] = thing.rows[:150]
    rows[150:156] = np.linspace(thing.rows[150], wall.rows[156], 6)
    seen = Seen(Boundary.at(rows, wall.ended, VIEW), VIEW, 6.0)
    x, y = VIEW.ground(np.full(20, 153.0), np.full(20, rows[153]))
    x, y = x + np.linspace(0.04, 0.1, 20), y
    assert set(seen.at(x, y).tolist()) == {DOUBTFUL}
    assert set(seen.at(np.full(5, 2.06), np.linspace(0.2, 0.4, 5)).tolist()) == {OCCUPIED}
    assert DOUBTFUL not in PlanViewMaker().draw(seen).cells


def test_a_doubt_takes_back_what_was_free_and_makes_nothing_taken() -> None:
    grown = OccupancyMap()
    place = np.array([3.0]), np.array([0.0])

    def look(cells: int, x: float) -> float:
        grown.update(Everywhere(wall_at(6.0), VIEW, 6.0, cells=cells), Pose(x, 0.0, 0.0))
        return float(grown.odds(*place)[0])

    assert look(FREE, 0.0) < -0.1
    assert look(DOUBTFUL, 0.03) == 0.0
    assert look(DOUBTFUL, 0.06) == 0.0
    taken = look(OCCUPIED, 0.09)
    assert taken > 0.1
    assert look(DOUBTFUL, 0.12) == taken


@dataclass(frozen=True)
class Everywhere(Seen):
    """The same seen of all cells."""

    cells: int = FREE

    def at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.full(np.shape(x), self.cells, np.int8)


def test_a_thing_too_near_to_show_its_foot_is_no_mirror() -> None:
    """What seems to lie below the floor is a reflection only above floor in its column."""
    likeness = np.full((100, 60), -3.0, np.float32)
    likeness[60:, 30:] = 3.0
    telling = np.ones_like(likeness)
    raised = np.where(likeness > 0.0, -telling, 0.0 * telling)
    mirrored = np.where(likeness < 0.0, telling, 0.0 * telling)
    none = np.zeros((0, 2))
    parallax = Parallax(raised, mirrored, telling, 0.3, 0.0, 0.0, 0.01, none, none, np.zeros(0))
    score = Evidence().score(likeness, parallax)
    assert (score[:60, 30:] > 0.0).all()
    assert (score[:, :30] < 0.0).all()


def test_a_line_too_short_to_be_told_from_the_blur_about_a_thing_is_no_border() -> None:
    ends = feet()
    part = replace_ends(ends, 0.1)
    score = np.full((VIEW.shape[0] - VIEW.top, VIEW.shape[1]), -3.0, np.float32)
    x, y = VIEW.ground(
        *np.meshgrid(np.arange(320, dtype=float), np.arange(VIEW.top, VIEW.shape[0], dtype=float))
    )
    score[(np.abs(y) < 1.0) & np.isfinite(x)] = 3.0
    dim = np.zeros(score.shape, bool)
    whole, short = (
        GroundLines().sort(lines, vanishing_points(), score, dim, VIEW)[1] for lines in (ends, part)
    )
    assert len(whole.ends)
    assert not len(short.ends)


def replace_ends(lines: LineSegments, share: float) -> LineSegments:
    """The first share of each line."""
    ends = lines.endpoints.copy()
    ends[:, 2:] = ends[:, :2] + share * (ends[:, 2:] - ends[:, :2])
    return LineSegments.from_endpoints(ends)


def test_things_are_cut_out_where_the_floor_ends_sooner_than_beside_them() -> None:
    wall, box = wall_at(5.0), wall_at(2.5)
    inside = np.abs(box.y) < 0.2
    both = Boundary.at(np.where(inside, box.rows, wall.rows), wall.ended, VIEW)
    (thing,) = ObjectFinder().find(both, np.zeros(len(inside), bool), VIEW)
    assert (thing.x, thing.y, thing.width) == pytest.approx((2.5, 0.0, 0.4), abs=0.03)


def test_a_picture_says_free_taken_and_nothing() -> None:
    seen = Seen(wall_at(3.0), VIEW, 7.0)
    told = seen.at(np.array([2.0, 3.05, 3.5, 2.0, 0.5]), np.array([0.0, 0.0, 0.0, 3.0, 0.0]))
    assert told.tolist() == [FREE, OCCUPIED, UNKNOWN, UNKNOWN, UNKNOWN]


def test_the_map_keeps_its_size_and_forgets_what_is_far_behind() -> None:
    grown = OccupancyMap(size=20.0)
    seen, size = Seen(wall_at(3.0), VIEW, 7.0), grown.nbytes
    assert grown.grid() is None
    for number in range(300):
        grown.update(seen, Pose(0.2 * number, 0.0, 0.0))
    grid = grown.grid()
    assert grid is not None
    assert grown.nbytes == size
    assert grid.cells.shape[1] * grid.resolution <= 20.0
    assert grid.origin[0] > 60.0 - 20.0
    assert grown.odds(np.array([1.5]), np.array([0.0])) == [0.0]


def test_the_same_view_counts_once() -> None:
    still, once = OccupancyMap(), OccupancyMap()
    seen = Seen(wall_at(3.0), VIEW, 7.0)
    once.update(seen, Pose(0.0, 0.0, 0.0))
    for _ in range(10):
        still.update(seen, Pose(0.0, 0.0, 0.0))
    places = np.linspace(1.2, 2.9, 10)
    np.testing.assert_array_equal(still.odds(places, 0 * places), once.odds(places, 0 * places))


def test_the_map_turns_with_the_robot() -> None:
    grown = OccupancyMap()
    for number in range(6):
        grown.update(Seen(wall_at(3.0 - 0.1 * number), VIEW, 7.0), Pose(1.0, 2.0 + 0.1 * number, np.pi / 2))
    assert grown.odds(np.array([1.0]), np.array([5.05]))[0] > 0.6
    assert grown.odds(np.array([1.0]), np.array([4.0]))[0] < -0.6


def test_poses_are_told_between_readings_and_not_long_after() -> None:
    history = PoseHistory()
    assert history.at(0.0) is None
    history.add(1.0, Pose(0.0, 0.0, 3.1), 0.01)
    history.add(1.1, Pose(0.1, 0.2, -3.1), 0.03)
    pose, pitch = history.at(1.05) or (None, 0.0)
    assert pose is not None
    assert (pose.x, pose.y, pitch) == pytest.approx((0.05, 0.1, 0.02))
    assert abs(pose.yaw) == pytest.approx(np.pi, abs=1e-6), "the short way round"
    ahead = history.at(1.15)
    assert ahead is not None and ahead[0].x == pytest.approx(0.15)
    assert history.at(1.5) is None
    history.add(0.5, Pose(7.0, 0.0, 0.0))
    assert history.at(1.05) is None, "time went back: what was known is forgotten"


def test_the_overlay_shows_every_stage_and_an_empty_one_where_nothing_is_known() -> None:
    mapper, lines, points = PlanViewMapper(), feet(), vanishing_points()
    shown = picture(0.0, (Box(2.5, 0.0),))
    drawn = draw_plan_view(shown, lines, mapper.update(shown, lines, points, CAMERA, 0.0))
    assert drawn.shape == (480, 640, 3)
    assert (drawn[:240, :320] == (0, 210, 250)).all(axis=2).any(), "the thing is marked"
    dark = np.zeros((480, 640, 3), np.uint8)
    empty = draw_plan_view(dark, lines, mapper.update(dark, lines, None, CAMERA, 0.1))
    assert not empty[:240, 320:].any()


@dataclass(frozen=True)
class Fenced(Seen):
    """Floor on both sides of a fence with a gap, all of it seen."""

    gap: float = 0.0

    def at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        fence = (y > 0.8) & (y < 1.0) & (np.abs(x - 4.0) > 0.5 * self.gap)
        return np.where(fence, OCCUPIED, FREE).astype(np.int8)


@pytest.mark.parametrize(("gap", "joined"), [(0.0, False), (0.08, False), (0.6, True)])
def test_floor_that_hangs_together_with_the_robots_only_by_a_crack_is_not_called_free(
    gap: float, joined: bool
) -> None:
    seen = Fenced(wall_at(6.0), VIEW, 6.0, gap=gap)
    grown = OccupancyMap()
    grown.update(seen, Pose(0.0, 0.0, 0.0), trust=20.0)
    grid = grown.grid()
    assert grid is not None

    def cell(x: float, y: float) -> int:
        row, column = (
            int((part - low) / grid.resolution) for part, low in zip((y, x), grid.origin[::-1], strict=True)
        )
        return int(grid.cells[row, column]) if row < grid.cells.shape[0] else UNKNOWN

    assert cell(4.0, 0.0) == FREE
    assert cell(3.0, 0.9) == OCCUPIED
    assert cell(4.0, 1.5) == (FREE if joined else UNKNOWN)
