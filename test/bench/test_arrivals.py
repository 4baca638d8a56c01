# SPDX-License-Identifier: Apache-2.0
"""Latency and load, held to arrivals and to books of Linux that were written by hand."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path

import numpy as np
import pytest

from bench.arrivals import first_of_each, latencies_ms, median, percentiles, read_heard, stage_ms
from bench.machine import Ticks, between, look, machine_ticks, process_ticks

MS = 1_000_000
START = 1_700_000_000_000_000_000  # a float64 of such a stamp would be 0.2 us off


def test_latency_is_from_the_stamp_of_the_picture_to_the_arrival() -> None:
    rows = np.array(
        [[START, START + 9 * MS, START + 10 * MS], [START + MS, START + 20 * MS, START + 26 * MS]]
    )
    assert latencies_ms(rows).tolist() == [10.0, 25.0]


def test_a_command_that_repeats_a_stamp_does_not_count() -> None:
    rows = np.array([[5, 6, 7], [8, 9, 10], [8, 500 * MS, 501 * MS]])
    assert first_of_each(rows).tolist() == [[5, 6, 7], [8, 9, 10]]


def test_percentiles_of_known_numbers() -> None:
    assert percentiles(np.arange(101.0)) == pytest.approx([50.0, 95.0, 99.0, 100.0])
    assert all(math.isnan(value) for value in percentiles(np.zeros(0)))
    assert math.isnan(median([]))
    assert median([3.0, 1.0, 2.0]) == 2.0


def test_a_stage_compares_answers_to_the_same_picture_only() -> None:
    lines = np.array([[START, START + 8 * MS, 0], [START + 33 * MS, START + 40 * MS, 0]])
    heading = np.array([[START + 33 * MS, START + 45 * MS, 0], [START + 66 * MS, START + 99 * MS, 0]])
    assert stage_ms(None, lines).tolist() == [8.0, 7.0]
    assert stage_ms(lines, heading).tolist() == [5.0]
    assert stage_ms(lines, np.zeros((0, 3), np.int64)).size == 0


def test_what_the_probe_wrote_is_read_back(tmp_path: Path) -> None:
    path = tmp_path / "heard.json"
    told = [{"skipped": 0.0, "last processing ms": 0.0}, {"skipped": 2.0, "last processing ms": 8.5}]
    path.write_text(
        json.dumps({"topics": {"lines": [[1, 2, START]], "steering": []}, "diagnostics": {"n": told}})
    )
    heard = read_heard(path)
    assert heard.topics["lines"].tolist() == [[1, 2, START]]
    assert heard.topics["steering"].shape == (0, 3)
    assert heard.counts["n"]["skipped"] == 2.0
    assert heard.processing_ms["n"] == [8.5]  # 0 means: no answer yet


def test_the_books_of_the_machine() -> None:
    text = "cpu  100 20 30 1000 50 3 7 40 99 98\ncpu0 1 1 1 1 1 1 1 1 1 1\n"
    assert machine_ticks(text) == (1250, 160, 40)  # guests are in user time already


def test_the_books_of_a_process_whose_name_looks_like_fields() -> None:
    assert process_ticks("42 (a) R 1 (x) S 1 2 3 4 5 6 7 8 9 10 111 222 5 6") == 333


def test_shares_of_ours_and_of_others() -> None:
    before = Ticks(1000, 500, 0, {"ours": 10, "bench": 0})
    after = Ticks(3000, 1100, 20, {"ours": 310, "bench": 100})
    load = between(before, after, cores=2)
    assert load.cores == {"ours": 30.0, "bench": 10.0}
    assert (load.others, load.stolen) == (10.0, 1.0)


def test_work_is_seen_in_the_books() -> None:
    before = look({"this": os.getpid()})
    after = before
    while after.processes["this"] < before.processes["this"] + 2:
        after = look({"this": os.getpid()})
    assert after.total >= before.total and after.busy > before.busy
    assert between(before, after, os.cpu_count() or 1).cores["this"] > 0.0
