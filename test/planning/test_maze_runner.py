# SPDX-License-Identifier: Apache-2.0
"""Mazes explored by plans of the floor and odometry that drifts, without pictures (test/nodes has one with them)."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from seen_mazes import CAMERA, EYE, directions_from, plan_from

from robot_vision.mapping import PlanView, Pose
from robot_vision.planning import Maze, MazeRunner, PlanningError
from robot_vision.planning.maze_cells import cells_from_texts, middle_goals
from robot_vision.planning.navigator import Route
from robot_vision.simulation.live import LiveDrive
from robot_vision.simulation.maze import grown

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from bench.maze_camera import Explorer, Look, explore  # noqa: E402  (the benchmarks are not installed)


def by_rays(maze: Maze, seed: int) -> Look:
    """What a camera would show at best, with noise."""
    random = np.random.default_rng(seed)

    def look(mouse: Explorer, drive: LiveDrive, now: float) -> None:
        state = drive.state
        seen = directions_from(state.yaw + random.normal(0.0, 0.003))
        mouse.runner.see_directions(now, seen, np.full(2, 0.004), CAMERA)
        plan = plan_from(maze, Pose(state.x, state.y, state.yaw), 0.02, random)
        mouse.runner.see_plan(now, plan, EYE)

    return look


def test_mazes_are_explored_and_run_the_shortest_way() -> None:
    taken = perfect = 0
    for size, seed in ((4, 3), (6, 5)):
        maze = grown(size, size, 0.12, seed)
        run = explore(maze, seed, look=by_rays(maze, seed))
        assert run.done
        assert run.contacts == 0
        assert run.closest_m > 0.05
        assert run.wrong == 0
        assert run.track_true
        assert run.ran == run.shortest == len(run.perfect.shortest_path) - 1
        taken += sum(run.steps[stage] for stage in ("goal", "proof", "home") if stage in run.steps)
        perfect += run.perfect.steps_home
    assert taken <= 1.3 * perfect


def test_a_goal_walled_in_is_said_and_the_robot_stands() -> None:
    maze = Maze.parse("+---+---+\n| S | G |\n+---+---+\n")
    runner = MazeRunner(maze.size, maze.goals, maze.start, heading=1)
    assert runner.route().reason == "no odometry yet"
    pose = Pose(0.5, 0.5, 0.0)
    for number in range(20):
        runner.move(0.2 * number, Pose(0.0, 0.0, 0.0))
        runner.see_plan(0.2 * number, plan_from(maze, pose), EYE)
        route = runner.route()
        assert route.seen == 0.0 or not len(route.points)
    assert not len(route.points)
    assert "no way leads on from the cell (0, 0)" in route.reason


def test_the_way_ends_before_what_nobody_has_seen() -> None:
    runner = MazeRunner((3, 3), [(2, 2)])
    runner.move(0.0, Pose(0.0, 0.0, 0.0))
    route = runner.route()
    assert route.seen == 0.0
    assert "looks" in route.reason
    assert route.points[-1] == pytest.approx((0.5, 1.5))


def test_the_robot_turns_off_in_the_middle_of_a_cell_and_not_before() -> None:
    maze = Maze.parse("+---+---+\n|     G |\n+   +---+\n| S |   |\n+---+---+\n")
    runner = MazeRunner(maze.size, maze.goals)
    for number, y in enumerate((*np.linspace(0.5, 1.44, 20), 1.52)):
        north = Pose(0.5, float(y), np.pi / 2)
        runner.move(0.2 * number, north)
        runner.see_plan(0.2 * number, plan_from(maze, north), EYE)
        points = runner.route().points
        assert points[-1] == pytest.approx((0.5, 1.5) if y < 1.45 else (1.5, 1.5))
    assert points[0] == pytest.approx((0.5, 1.5))


def test_it_stands_while_it_cannot_see_and_goes_on_when_it_can() -> None:
    hall = Maze.parse("+---+---+---+\n| S       G |\n+---+---+---+\n")
    runner = MazeRunner(hall.size, hall.goals, heading=1)

    def after(stamp: float, x: float, plan: PlanView, odometry: bool = True) -> Route:
        if odometry:
            runner.move(stamp, Pose(x - 0.5, 0.0, 0.0))
        runner.see_plan(stamp, plan, EYE)
        return runner.route()

    seen = [plan_from(hall, Pose(x, 0.5, 0.0)) for x in (0.5, 0.6, 0.7)]
    for number in range(9):
        route = after(0.1 * number, 0.5, seen[0])
    assert len(route.points)
    frozen = after(1.0, 0.56, seen[0])
    assert not len(frozen.points)
    assert "stays the same while the robot moves" in frozen.reason
    assert not len(after(1.1, 0.56, seen[0]).points)
    assert len(after(1.2, 0.6, seen[1]).points)
    dark = after(1.3, 0.65, PlanView(np.full_like(seen[0].cells, -1), seen[0].resolution, seen[0].origin))
    assert not len(dark.points)
    assert "shows nothing" in dark.reason
    assert len(after(1.4, 0.7, seen[2]).points)
    lost = after(3.0, 0.7, plan_from(hall, Pose(0.8, 0.5, 0.0)), odometry=False)
    assert not len(lost.points)
    assert "no odometry" in lost.reason


def test_settings_that_make_no_sense_are_refused() -> None:
    for given, cause in (
        ({"goals": [(4, 0)]}, "goal"),
        ({"goals": []}, "no goal"),
        ({"goals": [(1, 1)], "start": (9, 9)}, "start"),
        ({"goals": [(1, 1)], "cell": 0.0}, "cell"),
        ({"goals": [(1, 1)], "wall": np.nan}, "wall"),
    ):
        with pytest.raises(PlanningError, match=cause):
            MazeRunner((4, 4), **given)  # type: ignore[arg-type]


def test_cells_are_read_from_texts() -> None:
    assert cells_from_texts(["2,3", " 0 , 1 ", ""]) == ((2, 3), (0, 1))
    for text in ("2", "a,b", "1,-1", "1,2,3"):
        with pytest.raises(PlanningError, match="is no cell"):
            cells_from_texts([text])


def test_the_goal_of_a_contest_is_in_the_middle() -> None:
    assert middle_goals((16, 16)) == ((7, 7), (7, 8), (8, 7), (8, 8))
    assert middle_goals((9, 9)) == ((4, 4),)
    assert middle_goals((1, 1)) == ((0, 0),)
