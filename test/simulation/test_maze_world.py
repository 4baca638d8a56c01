# SPDX-License-Identifier: Apache-2.0
"""Mazes stand as they are drawn: every wall where it belongs, and a way through that touches none."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from robot_vision.planning import Maze
from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.maze import MazeSettings, grown, maze, maze_world
from robot_vision.simulation.renderer import Renderer, optical_pose
from robot_vision.simulation.world import World

DRAWN = """\
o---o---o---o---o
| G             |
o   o---o---o   o
|       |   .   |
o   o---o   o---o
| S |           |
o---o---o---o---o
"""


@pytest.fixture(scope="module")
def drawn() -> World:
    return maze_world(Maze.parse(DRAWN.replace(".", " ")), 0.18, seed=4)


def inside_any(world: World, place: tuple[float, float]) -> bool:
    """Whether a place (x, y) in metres lies in an object."""
    point = tuple(1e4 * value for value in place)
    return any(
        cv2.pointPolygonTest((1e4 * item.footprint).astype(np.float32), point, False) >= 0
        for item in world.objects
    )


def connected(plan: Maze) -> set[tuple[int, int]]:
    """Cells that can be reached from the start, by walls alone."""
    rows, columns = plan.size
    reached, border = {plan.start}, [plan.start]
    while border:
        r, c = border.pop()
        around = {
            (r, c + 1): plan.walls_east[r, c],
            (r, c - 1): c == 0 or plan.walls_east[r, c - 1],
            (r + 1, c): plan.walls_north[r, c],
            (r - 1, c): r == 0 or plan.walls_north[r - 1, c],
        }
        fresh = [cell for cell, wall in around.items() if not wall and cell not in reached]
        reached.update(fresh)
        border += fresh
    assert all(0 <= r < rows and 0 <= c < columns for r, c in reached)
    return reached


@pytest.mark.parametrize("size", [(2, 2), (3, 7), (8, 8), (16, 16)])
@pytest.mark.parametrize("loops", [0.0, 0.3])
def test_a_grown_maze_leads_everywhere(size: tuple[int, int], loops: float) -> None:
    plan = grown(*size, loops, seed=3)
    assert plan.size == size
    assert len(connected(plan)) == size[0] * size[1]
    assert plan.start == (0, 0)
    assert plan.walls_east[0, 0]
    assert not plan.walls_north[0, 0]
    assert len(plan.goals) == (4 if min(size) >= 4 else 1)
    assert grown(*size, loops, seed=3) == plan
    if size == (8, 8):
        assert grown(*size, loops, seed=4) != plan
        walls = int(plan.walls_east[:, :-1].sum() + plan.walls_north[:-1].sum())
        perfect = (size[0] - 1) * (size[1] - 1)  # walls of a maze without loops
        assert walls <= perfect if loops == 0 else walls < 0.85 * perfect


def test_walls_stand_where_they_are_drawn(drawn: World) -> None:
    plan = Maze.parse(DRAWN.replace(".", " "))
    rows, columns = plan.size
    for r in range(rows):
        for c in range(columns):
            assert not inside_any(drawn, ((c + 0.5) * 0.18, (r + 0.5) * 0.18))
            assert inside_any(drawn, ((c + 1) * 0.18, (r + 0.5) * 0.18)) == plan.walls_east[r, c]
            assert inside_any(drawn, ((c + 0.5) * 0.18, (r + 1) * 0.18)) == plan.walls_north[r, c]
    for item in drawn.objects:
        assert item.height == pytest.approx(0.05)
        assert np.ptp(item.footprint, axis=0).min() == pytest.approx(0.012)


def test_the_lane_leads_to_the_goal_in_the_middle_of_the_cells(drawn: World) -> None:
    lane = drawn.lane
    assert lane is not None
    first, last = lane.point(0.0), lane.point(lane.length)
    assert first[:2] == pytest.approx((0.09, 0.09))
    assert last[:2] == pytest.approx((0.09, 0.45))
    assert lane.length == pytest.approx(0.36, abs=1e-3)
    assert drawn.beginning[:2] == pytest.approx(first[:2])
    assert drawn.beginning.yaw == pytest.approx(np.pi / 2)


def test_lanes_round_corners_and_touch_no_wall() -> None:
    world = maze(MazeSettings(rows=6, columns=6, loops=0.0), seed=2)
    lane = world.lane
    assert lane is not None
    ways = np.linspace(0, lane.length, 400)
    points = np.array([lane.point(float(way)) for way in ways])
    assert np.ptp(points[:, 2]) > 1.5  # it turns
    for x, y, yaw, _ in points[::4]:
        for side in (-1, 1):  # a robot of the stated width has room on both sides
            place = (
                x - side * world.robot_width / 2 * np.sin(yaw),
                y + side * world.robot_width / 2 * np.cos(yaw),
            )
            assert not inside_any(world, place)


def test_a_wall_is_seen_where_geometry_puts_it(drawn: World) -> None:
    """Foot and top of the outer wall north of the start, seen along the western passage."""
    light = render(drawn, 0.09, 0.20, np.pi / 2)
    camera = drawn.camera.resized(320, 240)
    face = 3 * 0.18 - 0.006
    pose = optical_pose(camera, 0.09, 0.20, np.pi / 2)
    foot, top = (
        camera.pixels((np.array([[0.05, face, z]]) - pose[:3, 3]) @ pose[:3, :3])[0] for z in (0, 0.05)
    )
    column = light[:, round(float(foot[0]))].mean(axis=1)
    middle = round((foot[1] + top[1]) / 2)
    wall, floor = column[int(foot[1]) - 3], column[int(foot[1]) + 4]
    assert wall > 5 * floor
    row = middle + int(np.flatnonzero(column[middle:] < (wall + floor) / 2)[0])
    above, below = column[row - 1 : row + 1]
    assert row - 1 + (above - (wall + floor) / 2) / (above - below) == pytest.approx(foot[1], abs=0.5)
    red = light[:, round(float(top[0])), 2] / light[:, round(float(top[0])), 0]
    assert abs(int(red[:middle].argmax()) - top[1]) < 2.0  # the red edge lies just above the wall's top


def render(world: World, x: float, y: float, yaw: float) -> NDArray[np.float32]:
    camera = world.camera.resized(320, 240)
    return Renderer(world.scene, camera).render(optical_pose(camera, x, y, yaw))


def test_shadows_on_the_floor_are_those_that_are_told(drawn: World) -> None:
    (floor,) = [item for item in drawn.scene.quads if item.light is not None and item.light.shape[0] > 30]
    assert floor.light is not None
    rows, columns = floor.light.shape[:2]
    places = floor.lattice(columns, rows)[..., :2].reshape(-1, 2)
    depth = np.array(
        [
            max(
                cv2.pointPolygonTest((1e4 * outline).astype(np.float32), tuple(1e4 * place), True)
                for outline in drawn.shadows
            )
            / 1e4
            for place in places
        ]
    )
    light = floor.light.reshape(-1, 3).mean(axis=1)
    assert (depth < -0.05).any()
    assert light[depth > 0.02].max() < 0.6
    assert light[depth < -0.05].min() > 0.9


def test_a_room_has_the_same_walls_in_larger(drawn: World) -> None:
    large = maze_world(Maze.parse(DRAWN.replace(".", " ")), 1.8, seed=4)
    for mouse, room in zip(drawn.objects, large.objects, strict=True):
        np.testing.assert_allclose(room.footprint, 10 * mouse.footprint)
        assert room.height == pytest.approx(0.5)
    assert large.camera.height_m == pytest.approx(0.6)
    assert large.robot_width == pytest.approx(10 * drawn.robot_width)
    colours = [
        render(world, 0.5 * cell, 0.6 * cell, np.pi / 2) for world, cell in ((drawn, 0.18), (large, 1.8))
    ]
    assert abs(colours[0].mean() - colours[1].mean()) > 0.02


def test_a_file_in_either_format_and_unknown_walls_make_a_maze(tmp_path: Path) -> None:
    worlds = []
    for post in "o+":
        path = tmp_path / f"{ord(post)}.maze"
        Maze.parse(DRAWN).write(path, post)
        worlds.append(maze(MazeSettings(file=str(path)), seed=1))
    for first, second in zip(worlds[0].objects, worlds[1].objects, strict=True):
        np.testing.assert_array_equal(first.footprint, second.footprint)
    assert not inside_any(worlds[0], (3 * 0.18, 1.5 * 0.18))


def test_without_a_way_to_the_goal_the_lane_leads_as_far_as_it_can() -> None:
    walled = maze_world(Maze.parse("+---+---+---+\n| S     | G |\n+---+---+---+\n"))
    assert walled.lane is not None
    assert walled.lane.point(walled.lane.length)[:2] == pytest.approx((0.27, 0.09))
    assert maze_world(Maze.parse("+---+---+\n| S | G |\n+---+---+\n")).lane is None


def test_the_same_seed_makes_the_same_maze() -> None:
    first, again, other = (maze(MazeSettings(rows=4, columns=4), seed) for seed in (5, 5, 6))
    for a, b in zip(first.scene.quads, again.scene.quads, strict=True):
        np.testing.assert_array_equal(a.corners, b.corners)
        np.testing.assert_array_equal(a.texture.texels, b.texture.texels)
    assert [tuple(map(tuple, item.footprint)) for item in first.objects] != [
        tuple(map(tuple, item.footprint)) for item in other.objects
    ]


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"rows": 1}, "rows must be between 2 and 64, not 1"),
        ({"columns": 400}, "columns must be between"),
        ({"rows": 4.5}, "rows must be a whole number"),
        ({"loops": float("nan")}, "loops must be between"),
        ({"cell": 0.0}, "cell must be between 0.06 and 5.0 m"),
    ],
)
def test_impossible_mazes_are_refused(asked: dict[str, float], words: str) -> None:
    with pytest.raises(SimulationError, match=words):
        MazeSettings(**asked)  # type: ignore[arg-type]


def test_a_broken_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(SimulationError, match=r"none\.maze: cannot be read"):
        maze(MazeSettings(file=str(tmp_path / "none.maze")))
    (tmp_path / "broken.maze").write_text(DRAWN.replace("o   o---o---o", "o   o---o-  o"))
    with pytest.raises(SimulationError, match=r"broken\.maze: line 3, column 10: the wall is drawn '-  '"):
        maze(MazeSettings(file=str(tmp_path / "broken.maze")))
