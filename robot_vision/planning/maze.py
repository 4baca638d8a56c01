# SPDX-License-Identifier: Apache-2.0
"""Contest mazes come as drawings in text; here they become arrays of walls, and text again.

Both usual dialects are read, with posts drawn `+` or `o`. A cell is three characters wide:

    +---+---+
    | G     |
    +   + . +
    | S |   |
    +---+---+

`---` and `|` are walls, blanks are openings, `.` is a wall nobody has looked at yet; `S` marks the one start
cell, `G` the goal cells. The last line of cells is row 0, as in contests and in occupancy grids: rows count
northwards (up in the text), columns eastwards.
"""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn, TextIO

import numpy as np
from numpy.typing import NDArray

Cell = tuple[int, int]
"""Row (counted northwards) and column (counted eastwards) of a cell."""

POSTS = "+o"
_ACROSS = {"---": "wall", "   ": "open", " . ": "unknown", "...": "unknown"}
_UPRIGHT = {"|": "wall", " ": "open", ".": "unknown"}
_CELLS = {"   ": "", " S ": "S", " G ": "G"}
_PITCH = 4
"""Characters from one post to the next."""


class MazeError(ValueError):
    """A drawing or arrays that are no maze; the text names file, line and column."""


@dataclass(frozen=True, eq=False)
class Maze:
    """Walls between the square cells of a maze, closed all around.

    Attributes:
        walls_east: bool (R, C), a wall between each cell and its eastern neighbour; the last column is True.
        walls_north: bool (R, C), the same to the north; the last row is True.
        start: where a run begins; the outer walls to the west and south are always there.
        goals: cells of which any ends the run, in the order of their rows; at least one.
        unknown_east: bool (R, C), nobody knows yet whether that wall stands (`walls_east` is False there).
        unknown_north: bool (R, C), the same to the north.

    Raises:
        MazeError: arrays of different shape, a gap in the outer wall, start or goal outside, no goal.
    """

    walls_east: NDArray[np.bool_]
    walls_north: NDArray[np.bool_]
    start: Cell
    goals: tuple[Cell, ...]
    unknown_east: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0), np.bool_))
    unknown_north: NDArray[np.bool_] = field(default_factory=lambda: np.zeros((0, 0), np.bool_))

    def __post_init__(self) -> None:
        shape = np.shape(self.walls_east)
        if len(shape) != 2 or 0 in shape:
            raise MazeError(f"maze: walls_east must be (rows, columns), not {shape}")
        for name in ("walls_east", "walls_north", "unknown_east", "unknown_north"):
            given = np.array(getattr(self, name), np.bool_)
            if name.startswith("unknown") and given.size == 0:
                given = np.zeros(shape, np.bool_)
            if given.shape != shape:
                raise MazeError(f"maze: {name} must be {shape} as walls_east is, not {given.shape}")
            given.setflags(write=False)
            object.__setattr__(self, name, given)
        if not (self.walls_east[:, -1].all() and self.walls_north[-1].all()):
            raise MazeError("maze: the outer wall has a gap")
        if (self.unknown_east & self.walls_east).any() or (self.unknown_north & self.walls_north).any():
            raise MazeError("maze: a wall cannot be both there and unknown")
        if not self.goals:
            raise MazeError("maze: it has no goal")
        for what, cell in [("start", self.start), *(("goal", goal) for goal in self.goals)]:
            if not (0 <= cell[0] < shape[0] and 0 <= cell[1] < shape[1]):
                raise MazeError(f"maze: {what} {cell} lies outside its {shape[0]} rows, {shape[1]} columns")
        object.__setattr__(self, "goals", tuple(sorted(set(self.goals))))

    @property
    def size(self) -> tuple[int, int]:
        """Rows, columns."""
        rows, columns = self.walls_east.shape
        return int(rows), int(columns)

    @property
    def upright(self) -> NDArray[np.bool_]:
        """Walls that run north and south, bool (R, C + 1): [r, c] stands on the west side of cell (r, c)."""
        return np.concatenate([np.ones((self.size[0], 1), np.bool_), self.walls_east], axis=1)

    @property
    def across(self) -> NDArray[np.bool_]:
        """Walls that run east and west, bool (R + 1, C): [r, c] stands on the south side of cell (r, c)."""
        return np.concatenate([np.ones((1, self.size[1]), np.bool_), self.walls_north], axis=0)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Maze):
            return NotImplemented
        return self._key() == other._key()

    def __hash__(self) -> int:
        return hash(self._key())

    def _key(self) -> tuple[object, ...]:
        arrays = (self.walls_east, self.walls_north, self.unknown_east, self.unknown_north)
        return (self.size, self.start, self.goals, *(array.tobytes() for array in arrays))

    @classmethod
    def read(cls, file: str | os.PathLike[str] | TextIO) -> Maze:
        """Read a drawing from a file by name, or from an open text file.

        Raises:
            MazeError: the file cannot be read, or it is no maze; says file, line and column.
        """
        if not isinstance(file, (str, os.PathLike)):
            return cls.parse(file.read(), str(getattr(file, "name", "maze")))
        name = os.fspath(file)
        if "\n" in name:
            raise MazeError("maze: this is the text of a maze and no file name; give it to Maze.parse")
        try:
            text = Path(name).read_text(encoding="utf-8-sig")
        except OSError as error:
            raise MazeError(f"{name}: cannot be read: {error.strerror or error}") from error
        except UnicodeDecodeError as error:
            raise MazeError(f"{name}: is not text (byte {error.start})") from error
        return cls.parse(text, name)

    @classmethod
    def parse(cls, text: str, name: str = "maze") -> Maze:
        """Read a drawing; `name` is what errors call it.

        Raises:
            MazeError: it is no maze; says line and column, both counted from 1.
        """
        return _Drawing(text, name).maze()

    def text(self, post: str = "+") -> str:
        """The drawing, its posts drawn `+` or `o`; `Maze.parse` gives the same maze back.

        Raises:
            MazeError: another post is asked for.
        """
        if post not in ("+", "o"):
            raise MazeError(f"maze: posts are drawn '+' or 'o', not {post!r}")
        rows, columns = self.size
        marks = {goal: " G " for goal in self.goals}
        marks[self.start] = " S "
        lines = [post + columns * ("---" + post)]
        for row in reversed(range(rows)):
            line = "|"
            for column in range(columns):
                line += marks.get((row, column), "   ")
                unknown = bool(self.unknown_east[row, column])
                line += "|" if self.walls_east[row, column] else "." if unknown else " "
            lines.append(line)
            below = post
            for column in range(columns):
                known = "---" if row == 0 or self.walls_north[row - 1, column] else "   "
                below += " . " if row and self.unknown_north[row - 1, column] else known
                below += post
            lines.append(below)
        return "\n".join(lines) + "\n"

    def write(self, file: str | os.PathLike[str] | TextIO, post: str = "+") -> None:
        """Write the drawing to a file by name or to an open text file.

        Raises:
            MazeError: another post than `+` or `o`, or the file cannot be written.
        """
        drawing = self.text(post)
        if not isinstance(file, (str, os.PathLike)):
            file.write(drawing)
            return
        try:
            Path(file).write_text(drawing, encoding="utf-8")
        except OSError as error:
            message = f"{os.fspath(file)}: cannot be written: {error.strerror or error}"
            raise MazeError(message) from error


class _Drawing:
    """The lines of one drawing, read piece by piece so that whatever is wrong is named by its place."""

    def __init__(self, text: str, name: str) -> None:
        self._name = name
        lines = text.splitlines()
        filled = [number for number, line in enumerate(lines) if line.strip()]
        if not filled:
            raise MazeError(f"{name}: it is empty, there is no maze in it")
        self._first = filled[0]
        width = Counter(len(lines[number].rstrip()) for number in filled).most_common(1)[0][0]
        # Blanks behind the drawing are no part of it; blanks within its width are openings.
        self._lines = [line[:width] + line[width:].rstrip() for line in lines[filled[0] : filled[-1] + 1]]
        self._starts: list[Cell] = []
        self._goals: list[Cell] = []

    def maze(self) -> Maze:
        rows, columns = self._measure()
        across = np.full((rows + 1, columns), "", dtype=object)
        upright = np.full((rows, columns + 1), "", dtype=object)
        for line in range(2 * rows + 1):
            row = rows - (line + 1) // 2
            if line % 2 == 0:
                across[row] = self._wall_line(line, columns, outer=line in (0, 2 * rows))
            else:
                upright[row] = self._cell_line(line, columns, row)
        if not self._starts:
            raise MazeError(f"{self._name}: no cell is marked S, so it has no start")
        if not self._goals:
            raise MazeError(f"{self._name}: no cell is marked G, so it has no goal")
        return Maze(
            upright[:, 1:] == "wall",
            across[1:] == "wall",
            self._starts[0],
            tuple(self._goals),
            upright[:, 1:] == "unknown",
            across[1:] == "unknown",
        )

    def _measure(self) -> tuple[int, int]:
        """Rows and columns, once every line has been found as long as the others."""
        width = Counter(len(line) for line in self._lines).most_common(1)[0][0]
        for number, line in enumerate(self._lines):
            if len(line) != width:
                self._refuse(
                    number,
                    min(len(line), width),
                    f"the line is {len(line)} characters long, most are {width}",
                )
        if width < _PITCH + 1 or width % _PITCH != 1:
            self._refuse(0, width - 1, f"{width} characters are no whole number of cells, 4 each and 1 more")
        if len(self._lines) < 3 or len(self._lines) % 2 == 0:
            self._refuse(
                len(self._lines) - 1,
                0,
                f"{len(self._lines)} lines are no whole number of cells, 2 each and 1 more",
            )
        return len(self._lines) // 2, width // _PITCH

    def _wall_line(self, line: int, columns: int, outer: bool) -> list[str]:
        """Walls between the rows of cells: post, wall, post, ..."""
        found = []
        for column in range(columns + 1):
            at = _PITCH * column
            if self._lines[line][at] not in POSTS:
                self._refuse(
                    line, at, f"here stands {self._lines[line][at]!r} instead of a post ('+' or 'o')"
                )
            if column == columns:
                break
            piece = self._lines[line][at + 1 : at + _PITCH]
            if piece not in _ACROSS:
                self._refuse(line, at + 1, f"the wall is drawn {piece!r}, not '---', '   ' or ' . '")
            if outer and _ACROSS[piece] != "wall":
                self._refuse(line, at + 1, "the outer wall is missing")
            found.append(_ACROSS[piece])
        return found

    def _cell_line(self, line: int, columns: int, row: int) -> list[str]:
        """Cells and the walls beside them: wall, cell, wall, ..."""
        found = []
        for column in range(columns + 1):
            at = _PITCH * column
            mark = self._lines[line][at]
            if mark not in _UPRIGHT:
                self._refuse(line, at, f"the wall is drawn {mark!r}, not '|', ' ' or '.'")
            if column in (0, columns) and _UPRIGHT[mark] != "wall":
                self._refuse(line, at, "the outer wall is missing")
            found.append(_UPRIGHT[mark])
            if column == columns:
                break
            piece = self._lines[line][at + 1 : at + _PITCH]
            if piece not in _CELLS:
                self._refuse(line, at + 1, f"the cell is drawn {piece!r}, not '   ', ' S ' or ' G '")
            if _CELLS[piece] == "S":
                if self._starts:
                    self._refuse(line, at + 2, "a second start")
                self._starts.append((row, column))
            elif _CELLS[piece] == "G":
                self._goals.append((row, column))
        return found

    def _refuse(self, line: int, column: int, why: str) -> NoReturn:
        """Raise the error for a place counted from 0 in the drawing."""
        raise MazeError(f"{self._name}: line {self._first + line + 1}, column {column + 1}: {why}")
