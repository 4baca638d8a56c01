# SPDX-License-Identifier: Apache-2.0
"""A robot is led over maps that grow and change; plans change when they have to, and not otherwise."""

from __future__ import annotations

import os
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from robot_vision.planning import FloorMap, Maze, Navigator, PlanningError, maze_to_grid
from robot_vision.simulation.maze import grown

DATA = Path(os.environ.get("ROBOT_VISION_DATA", Path(__file__).resolve().parents[3] / "shared" / "data"))
CELL = 0.05


def room(rows: int = 80, columns: int = 100) -> NDArray[np.int8]:
    cells = np.zeros((rows, columns), np.int8)
    cells[0] = cells[-1] = cells[:, 0] = cells[:, -1] = 100
    return cells


def going(cells: NDArray[np.int8], goal: tuple[float, float], **settings: float) -> Navigator:
    navigator = Navigator(**{"radius": 0.1, **settings})
    navigator.see_map(FloorMap(cells, CELL))
    navigator.set_goal(*goal)
    return navigator


def test_places_and_cells_on_a_turned_map_belong_together() -> None:
    floor = FloorMap(room(), CELL, (1.0, -2.0, 0.7))
    points = np.random.default_rng(0).uniform(0, 79, (50, 2))
    assert np.allclose(floor.to_cells(floor.to_world(points)), points)
    away = floor.to_world([(0, 10)])[0] - floor.to_world([(0, 0)])[0]
    assert np.allclose(away, 10 * CELL * np.array([np.cos(0.7), np.sin(0.7)]))
    x, y = floor.to_world([(12, 34)])[0]
    assert floor.cell_at(x, y) == (12, 34)


def test_a_way_leads_from_the_robot_to_the_goal_in_metres() -> None:
    route = going(room(), (4.0, 3.0)).route(1.0, 1.0)
    assert np.allclose(route.points[0], (1.0, 1.0), atol=CELL)
    assert np.allclose(route.points[-1], (4.0, 3.0), atol=CELL)
    assert np.isinf(route.seen)
    assert route.reason == ""


def test_a_change_that_does_not_matter_changes_no_plan() -> None:
    cells = room()
    navigator = going(cells, (4.0, 1.0))
    before = navigator.route(1.0, 1.0)
    cells = cells.copy()
    cells[60:70, 20:40] = 100
    navigator.see_map(FloorMap(cells, CELL))
    assert navigator.route(1.2, 1.0) is before
    cells = cells.copy()
    cells[60:70, 20:40] = 0
    navigator.see_map(FloorMap(cells, CELL))
    assert navigator.route(1.4, 1.0) is before


def test_a_wall_across_the_way_and_its_end_change_the_plan() -> None:
    cells = room()
    navigator = going(cells, (4.0, 1.0))
    straight = navigator.route(1.0, 1.0)
    blocked = cells.copy()
    blocked[1:40, 50] = 100
    navigator.see_map(FloorMap(blocked, CELL))
    around = navigator.route(1.0, 1.0)
    assert around.number > straight.number
    assert around.points[:, 1].max() > 2.0
    navigator.see_map(FloorMap(cells, CELL))
    assert len(navigator.route(1.0, 1.0).points) == len(straight.points)


def test_a_goal_that_moves_and_a_robot_that_strays_change_the_plan() -> None:
    navigator = going(room(), (4.0, 1.0))
    first = navigator.route(1.0, 1.0)
    navigator.set_goal(1.0, 3.0)
    second = navigator.route(1.0, 1.0)
    assert np.allclose(second.points[-1], (1.0, 3.0), atol=CELL)
    third = navigator.route(2.5, 2.0)
    assert first.number < second.number < third.number
    assert np.allclose(third.points[0], (2.5, 2.0), atol=CELL)


def test_what_nobody_has_seen_is_planned_through_but_told() -> None:
    cells = room()
    cells[:, 50:] = -1
    route = going(cells, (4.0, 1.0)).route(1.0, 1.0)
    assert route.reason == "leads over floor nobody has seen yet"
    assert route.seen == pytest.approx(50 * CELL - 1.0, abs=2 * CELL)
    known = room()
    known[1:40, 50] = -1  # a gap in the map on the straight way; there is a way around it
    around = going(known, (4.0, 1.0)).route(1.0, 1.0)
    assert np.isinf(around.seen)
    assert around.points[:, 1].max() > 1.9


@pytest.mark.parametrize(
    ("cells", "goal", "robot", "words"),
    [
        (np.full((40, 40), -1, np.int8), (1.0, 1.0), (0.5, 0.5), "knows nothing of the place"),
        (np.full((40, 40), 100, np.int8), (1.0, 1.0), (0.5, 0.5), "stands in a wall"),
        (room(), (0.02, 0.02), (1.0, 1.0), "lies in a wall"),
        (room(), (9.0, 1.0), (1.0, 1.0), "the goal .* lies outside the map"),
        (room(), (1.0, 1.0), (-3.0, 1.0), "the robot at .* lies outside the map"),
        (room(), (0.08, 2.0), (1.0, 1.0), "no way leads|lies in a wall"),
    ],
)
def test_where_there_is_no_way_it_says_why(
    cells: NDArray[np.int8], goal: tuple[float, float], robot: tuple[float, float], words: str
) -> None:
    route = going(cells, goal).route(*robot)
    assert len(route.points) == 0
    assert re.search(words, route.reason), route.reason


def test_a_map_of_one_cell() -> None:
    navigator = going(np.zeros((1, 1), np.int8), (0.02, 0.03), radius=0.0)
    route = navigator.route(0.02, 0.02)
    assert navigator.has_arrived(0.02, 0.02)
    assert len(route.points) == 2


def test_a_map_of_20_000_by_200_cells_that_grows() -> None:
    cells = room(20_000, 200)
    cells[1000::1000, :150] = cells[500::1000, 50:] = 100  # to and fro
    seen = cells.copy()
    seen[15_000:] = -1
    navigator = going(seen, (5.0, 999.0))
    hopeful = navigator.route(5.0, 1.0)
    assert hopeful.reason == "leads over floor nobody has seen yet"
    navigator.see_map(FloorMap(cells, CELL))
    route = navigator.route(5.0, 1.0)
    assert np.isinf(route.seen)
    assert np.allclose(route.points[-1], (5.0, 999.0), atol=CELL)
    assert len(route.points) == 2 + 2 * 39  # around the ends of 39 walls
    places = FloorMap(cells, CELL).to_cells(route.points)
    assert (np.diff(places[:, 0]) > 0).all()


@pytest.mark.parametrize(
    ("cells", "words"),
    [
        (np.zeros((0, 5), np.int8), "has no cells"),
        (np.full((3, 3), 101), r"cell \(0, 0\) is 101, neither -1 nor 0 to 100"),
        (np.full((3, 3), -2), r"cell \(0, 0\) is -2"),
    ],
)
def test_maps_that_make_no_sense_are_refused(cells: NDArray[np.int_], words: str) -> None:
    with pytest.raises(PlanningError, match=words):
        FloorMap(cells, CELL)


class Explorer:
    """A robot that sees all within a radius, walls included, and drives on along the route."""

    def __init__(
        self, truth: NDArray[np.int8], start: tuple[float, float], sight: float, **settings: float
    ) -> None:
        self.truth = FloorMap(truth, CELL)
        self.cells = np.full(truth.shape, -1, np.int8)
        self.place = np.array(start)
        self.sight = sight
        self.navigator = Navigator(**settings)
        self.navigator.set_mode("explore")
        self.way = 0.0

    def run(self, most: int = 3000) -> str:
        for _ in range(most):
            self._look()
            route = self.navigator.route(*self.place)
            if not len(route.points):
                return route.reason
            self._step(route.points)
        return "never done"

    def _look(self) -> None:
        row, column = self.truth.to_cells([self.place])[0]
        rows, columns = np.ogrid[: self.cells.shape[0], : self.cells.shape[1]]
        near = np.hypot(rows - row, columns - column) * CELL <= self.sight
        self.cells = np.where(near, self.truth.cells, self.cells)
        self.navigator.see_map(FloorMap(self.cells, CELL))

    def _step(self, points: NDArray[np.float64]) -> None:
        away = np.hypot(*(points - self.place).T)
        nearest = int(np.argmin(away))
        target = points[min(nearest + 1, len(points) - 1)]
        step = target - self.place
        length = float(np.hypot(*step))
        self.place = self.place + step * min(1.0, 0.1 / max(length, 1e-9))
        self.way += min(0.1, length)
        assert self.truth.cells[self.truth.cell_at(*self.place)] < 50, "it drives into a wall"


def test_it_explores_a_maze_until_nothing_is_left() -> None:
    maze = grown(4, 5, 0.2, 1)
    truth = maze_to_grid(maze, pitch=12, wall=1)
    explorer = Explorer(
        truth, (6.5 * CELL, 6.5 * CELL), 0.5, radius=0.15, frontier=0.1, arrival=0.08, astray=0.2
    )
    assert explorer.run() == "explored: nothing unseen can be reached any more"
    inside = maze_to_grid(Maze(maze.walls_east, maze.walls_north, maze.start, maze.goals), 12, 1) == 0
    assert (explorer.cells[inside] == 0).mean() > 0.97
    explorer.navigator.set_mode("go")
    explorer.navigator.set_goal(6.5 * CELL, 6.5 * CELL)
    assert np.isinf(explorer.navigator.route(*explorer.place).seen)


@pytest.mark.parametrize(("name", "resolution"), [("depot", 0.05), ("warehouse", 0.03)])
def test_it_finds_ways_on_maps_of_real_buildings(name: str, resolution: float) -> None:
    file = DATA / "maps" / f"{name}.pgm"
    if not file.exists():
        pytest.skip(f"the map is not there: {file} (set ROBOT_VISION_DATA)")
    picture = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
    cells = np.where(picture > 250, 0, np.where(picture < 100, 100, -1)).astype(np.int8)[::-1]
    floor = FloorMap(cells, resolution, (-15.1, -25.0, 0.0))
    navigator = Navigator(radius=0.3)
    navigator.see_map(floor)
    roomy = np.argwhere(navigator._known)
    _, labels = cv2.connectedComponents(navigator._known.astype(np.uint8), connectivity=4)
    largest = np.argwhere(labels == np.bincount(labels[labels > 0]).argmax())
    assert len(largest) > 0.5 * len(roomy)
    random = np.random.default_rng(1)
    for _ in range(5):
        start, goal = floor.to_world(largest[random.integers(len(largest), size=2)])
        navigator.set_goal(*goal)
        route = navigator.route(*start)
        assert np.allclose(route.points[-1], goal)
        for place in route.points:
            assert not floor.occupied[floor.cell_at(*place)]
