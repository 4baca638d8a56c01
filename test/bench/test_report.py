# SPDX-License-Identifier: Apache-2.0
"""Marks, tables and the command line of the benchmarks."""

from __future__ import annotations

import io
import json
import math
from pathlib import Path

import pytest
from rich.console import Console

from bench.__main__ import main
from bench.report import Cell, Row, Table, at_least, at_most
from bench.sources import VARIABLE, forth_and_back


@pytest.mark.parametrize(
    ("mark", "value", "reached"),
    [
        (at_least(70.0), 70.0, True),
        (at_least(70.0), 69.9, False),
        (at_most(0.3), 0.3, True),
        (at_most(0.3), 0.31, False),
        (at_least(70.0), math.nan, False),
        (at_most(0.3), math.nan, False),
    ],
)
def test_a_mark_is_reached_at_its_limit_and_never_by_what_was_not_measured(
    mark: object, value: float, reached: bool
) -> None:
    assert mark.reached(value) is reached  # type: ignore[attr-defined]


def table() -> Table:
    rows = [
        Row("error", "deg", [Cell(0.25, at_most(0.3)), Cell(math.nan, at_most(0.3))], 2),
        Row("count", "", [Cell(7.0), None], 0),
    ]
    return Table("a drive", ["first", "second"], rows, ["a note"])


def test_a_table_tells_every_verdict() -> None:
    assert table().verdicts == [True, False]


def test_a_printed_table_shows_numbers_marks_and_verdicts() -> None:
    console = Console(file=io.StringIO(), width=120)
    table().print(console)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    for part in ("a drive", "error, deg", "0.25 (≤ 0.3) pass", "none (≤ 0.3) short", "7", "a note"):
        assert part in text


def test_a_table_as_json_has_no_number_that_is_none() -> None:
    said = json.loads(json.dumps(table().as_json(), allow_nan=False))
    error, count = said["rows"]
    assert error["values"]["first"] == {"value": 0.25, "mark": "≤ 0.3", "reached": True}
    assert error["values"]["second"] == {"value": None, "mark": "≤ 0.3", "reached": False}
    assert count["values"] == {"first": {"value": 7.0}}


def test_a_row_that_does_not_fit_its_table_is_refused() -> None:
    with pytest.raises(ValueError, match="count has 1 cells for 2 columns"):
        Table("a drive", ["first", "second"], [Row("count", "", [Cell(1.0)])])


def test_a_sequence_goes_forth_and_back() -> None:
    assert list(forth_and_back(3, 8)) == [0, 1, 2, 1, 0, 1, 2, 1]
    assert list(forth_and_back(1, 3)) == [0, 0, 0]


def test_a_set_that_is_missing_is_said_by_name_and_skipped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path / "nowhere"))
    out = tmp_path / "out" / "bench.json"
    main(["york", "kitti", "--out", str(out)])
    said = " ".join(capsys.readouterr().out.split())
    assert "york is skipped" in said and "york_urban" in said
    assert "kitti is skipped" in said and "kitti_straight" in said
    assert "0 of 0 marks reached" in said
    assert set(json.loads(out.read_text())["benchmarks"]) == {"york", "kitti"}


def test_an_unknown_benchmark_is_refused_with_those_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as refusal:
        main(["yrok"])
    assert refusal.value.code == 2
    assert "there is no benchmark 'yrok'; choose from york" in capsys.readouterr().err
