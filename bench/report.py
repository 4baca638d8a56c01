# SPDX-License-Identifier: Apache-2.0
"""Tables of measured numbers beside the marks to reach, for people (rich) and for programs (JSON)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console


@dataclass(frozen=True)
class Mark:
    """What a number is to reach: at least, or at most, a limit (both inclusive)."""

    limit: float
    at_least: bool

    def reached(self, value: float) -> bool:
        """Tell whether a number does; one that could not be measured (nan) does not."""
        return value >= self.limit if self.at_least else value <= self.limit

    def __str__(self) -> str:
        return f"{'≥' if self.at_least else '≤'} {self.limit:g}"


def at_least(limit: float) -> Mark:
    """Make a mark that greater numbers reach."""
    return Mark(limit, True)


def at_most(limit: float) -> Mark:
    """Make a mark that smaller numbers reach."""
    return Mark(limit, False)


@dataclass(frozen=True)
class Cell:
    """A measured number (nan: not measured) and its mark, if there is one."""

    value: float
    mark: Mark | None = None


@dataclass(frozen=True)
class Row:
    """One quantity under the conditions of the table's columns.

    Attributes:
        name: what was measured.
        unit: such as `deg`; empty for a bare number.
        cells: one a column, None where the quantity has no meaning.
        digits: after the point, for people.
    """

    name: str
    unit: str
    cells: Sequence[Cell | None]
    digits: int = 1


@dataclass(frozen=True)
class Table:
    """What one benchmark has measured.

    Attributes:
        title: what was measured on what.
        columns: the conditions compared.
        rows: the quantities.
        notes: sentences beneath the table.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Row]
    notes: Sequence[str] = ()

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row.cells) != len(self.columns):
                raise ValueError(f"{row.name} has {len(row.cells)} cells for {len(self.columns)} columns")

    @property
    def verdicts(self) -> list[bool]:
        """Whether each mark in the table is reached."""
        cells = [cell for row in self.rows for cell in row.cells if cell is not None]
        return [cell.mark.reached(cell.value) for cell in cells if cell.mark is not None]

    def as_json(self) -> dict[str, Any]:
        """Return the table as plain values; a number that was not measured becomes None."""
        return {
            "title": self.title,
            "notes": list(self.notes),
            "rows": [
                {
                    "name": row.name,
                    "unit": row.unit,
                    "values": {
                        column: _cell_json(cell)
                        for column, cell in zip(self.columns, row.cells, strict=True)
                        if cell is not None
                    },
                }
                for row in self.rows
            ],
        }

    def print(self, console: Console) -> None:
        """Print the table: pass or short behind every number that has a mark."""
        from rich.table import Table as RichTable

        console.print(self.title, style="bold", markup=False)
        shown = RichTable()
        shown.add_column("")
        for column in self.columns:
            shown.add_column(column, justify="right")
        for row in self.rows:
            label = f"{row.name}, {row.unit}" if row.unit else row.name
            shown.add_row(label, *[_cell_text(cell, row.digits) for cell in row.cells])
        console.print(shown)
        for note in self.notes:
            console.print(f"  {note}", style="dim", markup=False)


def _cell_text(cell: Cell | None, digits: int) -> str:
    if cell is None:
        return ""
    number = "none" if math.isnan(cell.value) else f"{cell.value:.{digits}f}"
    if cell.mark is None:
        return number
    verdict = "[green]pass[/]" if cell.mark.reached(cell.value) else "[red]short[/]"
    return f"{number} ({cell.mark}) {verdict}"


def _cell_json(cell: Cell) -> dict[str, Any]:
    said: dict[str, Any] = {"value": cell.value if math.isfinite(cell.value) else None}
    if cell.mark is not None:
        said |= {"mark": str(cell.mark), "reached": cell.mark.reached(cell.value)}
    return said
