# SPDX-License-Identifier: Apache-2.0
"""Mazes are read as they are drawn, in both dialects, and what is wrong with a drawing is said by its place."""

from __future__ import annotations

import io
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from robot_vision.planning import Maze, MazeError

DATA = Path(os.environ.get("ROBOT_VISION_DATA", Path(__file__).resolve().parents[3] / "shared" / "data"))

SMALL = """\
+---+---+---+
|     G     |
+   +---+ . +
| S |       |
+---+---+---+
"""


def contest_files() -> list[Path]:
    files = sorted((DATA / "mazes").glob("*.maze"))
    if not files:
        pytest.skip(f"contest mazes are not there: {DATA / 'mazes'} (set ROBOT_VISION_DATA)")
    return files


@st.composite
def mazes(draw: st.DrawFn) -> Maze:
    shape = draw(st.tuples(st.integers(1, 7), st.integers(1, 7)))
    walls = [draw(arrays.arrays(np.uint8, shape, elements=st.integers(0, 2))) for _ in range(2)]
    walls[0][:, -1] = walls[1][-1] = 1
    cells = st.tuples(st.integers(0, shape[0] - 1), st.integers(0, shape[1] - 1))
    start = draw(cells)
    goals = draw(st.sets(cells.filter(lambda cell: cell != start), min_size=1)) if shape != (1, 1) else set()
    if not goals:
        shape = (1, 2)
        return Maze(np.array([[False, True]]), np.array([[True, True]]), (0, 0), ((0, 1),))
    return Maze(walls[0] == 1, walls[1] == 1, start, tuple(goals), walls[0] == 2, walls[1] == 2)


def test_walls_stand_where_they_are_drawn() -> None:
    maze = Maze.parse(SMALL)
    assert maze.size == (2, 3)
    assert maze.start == (0, 0)
    assert maze.goals == ((1, 1),)
    assert maze.walls_east.tolist() == [[True, False, True], [False, False, True]]
    assert maze.walls_north.tolist() == [[False, True, False], [True, True, True]]
    assert maze.unknown_north.tolist() == [[False, False, True], [False, False, False]]
    assert not maze.unknown_east.any()
    assert maze.upright.tolist() == [[True, True, False, True], [True, False, False, True]]
    assert maze.across.tolist() == [[True] * 3, [False, True, False], [True] * 3]


@pytest.mark.parametrize("dialect", ["posts", "windows", "margins", "unknown"])
def test_dialects_are_read_alike(dialect: str) -> None:
    drawn = {
        "posts": SMALL.replace("+", "o"),
        "windows": SMALL.replace("\n", "\r\n"),
        "margins": "\n" + SMALL.replace("\n", "  \n") + "\n\n",
        "unknown": SMALL.replace(" . ", "..."),
    }[dialect]
    assert Maze.parse(drawn) == Maze.parse(SMALL)


def test_a_maze_comes_from_a_name_a_path_or_an_open_file(tmp_path: Path) -> None:
    path = tmp_path / "small.maze"
    maze = Maze.parse(SMALL)
    for post in "+o":
        maze.write(path, post)
        assert path.read_text()[0] == post
        assert Maze.read(path) == Maze.read(str(path)) == maze
        with path.open() as file:
            assert Maze.read(file) == maze
    told = io.StringIO()
    maze.write(told)
    assert told.getvalue() == SMALL
    path.write_bytes(b"\xef\xbb\xbf" + SMALL.encode())
    assert Maze.read(path) == maze


@given(mazes(), st.sampled_from("+o"))
def test_what_is_written_is_read_again(maze: Maze, post: str) -> None:
    again = Maze.parse(maze.text(post))
    assert again == maze
    assert hash(again) == hash(maze)


def test_a_maze_with_another_wall_is_another_maze() -> None:
    maze = Maze.parse(SMALL)
    assert maze != Maze.parse(SMALL.replace(" . ", "---"))
    assert maze != Maze.parse(SMALL.replace(" . ", "   "))
    assert maze != Maze.parse(SMALL.replace("S |   ", "  | S "))
    assert maze != SMALL


def test_every_contest_maze_is_read_and_written_to_the_letter() -> None:
    files = contest_files()
    assert len(files) == 80
    for file in files:
        maze = Maze.read(file)
        assert maze.text("+") == file.read_text(encoding="utf-8"), file.name
        assert Maze.parse(maze.text("o")) == maze, file.name
    half = {file.name: Maze.read(file).size for file in files}
    assert half["16MM2015CX.maze"] == (16, 16)
    assert half["32MM2010HX.maze"] == (32, 32)


@pytest.mark.parametrize(
    ("drawing", "words"),
    [
        (SMALL.replace("|     G", "      G"), r"line 2, column 1: the outer wall is missing"),
        (SMALL.replace("G     |", "G      "), r"line 2, column 13: the outer wall is missing"),
        (SMALL.replace("+---+---+---+", "+---+   +---+", 1), r"line 1, column 6: the outer wall is missing"),
        (SMALL[:-14] + "+---+---+ . +\n", r"line 5, column 10: the outer wall is missing"),
        (
            SMALL.replace("| S |       |", "| S |     |"),
            r"line 4, column 12: .* 11 characters .* most are 13",
        ),
        (SMALL.replace("G     |", "G     | x"), r"line 2, column 14: .* 15 characters .* most are 13"),
        (SMALL.replace("+   +---+", "+   +-- +"), r"line 3, column 6: the wall is drawn '-- '"),
        (SMALL.replace("| S |   ", "| S !   "), r"line 4, column 5: the wall is drawn '!'"),
        (SMALL.replace("+   +---", "+   *---"), r"line 3, column 5: here stands '\*' instead of a post"),
        (SMALL.replace(" S |   ", " S | X "), r"line 4, column 6: the cell is drawn ' X '"),
        (SMALL.replace(" S |   ", " S | S "), r"line 4, column 7: a second start"),
        (SMALL.replace("S", " "), r"no cell is marked S"),
        (SMALL.replace("G", " "), r"no cell is marked G"),
        (SMALL[:-14], r"line 4, column 1: 4 lines are no whole number of cells"),
        (
            "\n\n" + SMALL.replace("+---+---+---+", "+---+---+--", 1),
            r"line 3, column 12: .* 11 characters .* most are 13",
        ),
        ("+---+--\n| S |  \n+---+--\n", r"line 1, column 7: 7 characters are no whole number of cells"),
        ("", r"it is empty"),
        (" \n\n", r"it is empty"),
    ],
)
def test_what_is_wrong_is_said_by_file_line_and_column(tmp_path: Path, drawing: str, words: str) -> None:
    path = tmp_path / "broken.maze"
    path.write_text(drawing)
    with pytest.raises(MazeError, match=words) as caught:
        Maze.read(path)
    assert str(caught.value).startswith(str(path) + ": ")
    assert "\n" not in str(caught.value)


def test_files_that_cannot_be_read_or_written_say_so(tmp_path: Path) -> None:
    with pytest.raises(MazeError, match=r"none\.maze: cannot be read: No such file"):
        Maze.read(tmp_path / "none.maze")
    (tmp_path / "picture.maze").write_bytes(b"\x89PNG\r\n\xff\xff")
    with pytest.raises(MazeError, match=r"picture\.maze: is not text"):
        Maze.read(tmp_path / "picture.maze")
    with pytest.raises(MazeError, match=r"give it to Maze\.parse"):
        Maze.read(SMALL)
    maze = Maze.parse(SMALL)
    with pytest.raises(MazeError, match="cannot be written"):
        maze.write(tmp_path / "nowhere" / "small.maze")
    with pytest.raises(MazeError, match="not 'x'"):
        maze.text("x")


def test_arrays_that_are_no_maze_are_refused() -> None:
    closed = np.ones((2, 2), np.bool_)
    gap = closed.copy()
    gap[0, -1] = False
    with pytest.raises(MazeError, match="outer wall has a gap"):
        Maze(gap, closed, (0, 0), ((1, 1),))
    with pytest.raises(MazeError, match=r"walls_north must be \(2, 2\)"):
        Maze(closed, closed[:1], (0, 0), ((1, 1),))
    with pytest.raises(MazeError, match=r"goal \(2, 0\) lies outside"):
        Maze(closed, closed, (0, 0), ((2, 0),))
    with pytest.raises(MazeError, match="no goal"):
        Maze(closed, closed, (0, 0), ())
    with pytest.raises(MazeError, match="both there and unknown"):
        Maze(closed, closed, (0, 0), ((1, 1),), closed)
    maze = Maze(closed, closed, (0, 0), ((1, 1),))
    with pytest.raises(ValueError, match="read-only"):
        maze.walls_east[0, 0] = False
