# SPDX-License-Identifier: Apache-2.0
"""Cells of a maze as people tell them, and where contests have their goal."""

from __future__ import annotations

from collections.abc import Sequence

from robot_vision.planning.grid import Cell, PlanningError


def middle_goals(size: Cell) -> tuple[Cell, ...]:
    """The goal cells of a contest: the one in the middle, or the four there where none is; at least one."""
    rows, columns = size
    middles = [sorted({(count - 1) // 2, count // 2}) for count in (rows, columns)]
    return tuple((row, column) for row in middles[0] for column in middles[1])


def cells_from_texts(texts: Sequence[str]) -> tuple[Cell, ...]:
    """Cells told as texts, "row,column" each, row 0 in the south, column 0 in the west; empty texts are left out.

    Raises:
        PlanningError: naming the text that tells no cell.
    """
    found = []
    for text in texts:
        if not text.strip():
            continue
        parts = text.split(",")
        if len(parts) != 2 or not all(part.strip().isdigit() for part in parts):
            raise PlanningError(f"{text!r} is no cell: write row,column, for example 2,3")
        found.append((int(parts[0]), int(parts[1])))
    return tuple(found)
