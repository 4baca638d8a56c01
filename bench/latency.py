# SPDX-License-Identifier: Apache-2.0
"""From picture to steering at 30 Hz through processes over DDS: how long, what is lost, where the time goes."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from bench.arrivals import LOST, SKIPPED, first_of_each, latencies_ms, median, percentiles, stage_ms
from bench.drive import NODES, PROBE, Drive, drive
from bench.replay import LINES, STEERING, VANISHING
from bench.report import Cell, Mark, Row, Table, at_least, at_most
from bench.stream import RATE_HZ, write_stream

PICTURES = 600
RUNS = 3
QUICK_PICTURES = 150
QUIET = 5.0  # percent of the machine: what others may take without blurring what is measured
PROCESSES = ("bag_player", *NODES, PROBE, "bag_recorder")

Measure = Callable[[Drive], float]


def run(quick: bool) -> list[Table]:
    """Measure: a short drive each when it is to be quick.

    Raises:
        ProcessError: a process failed.
    """
    pictures = QUICK_PICTURES if quick else PICTURES
    with tempfile.TemporaryDirectory(prefix="robot_vision-") as scratch:
        bag = Path(scratch) / "pictures.mcap"
        shown = write_stream(bag, pictures)
        alone = [drive(bag, pictures, Path(scratch)) for _ in range(1 if quick else RUNS)]
        recorded = [drive(bag, pictures, Path(scratch), record=True)]
    return [_latency_table(alone, recorded, pictures, shown), _stage_table(alone, recorded)]


def _latency_table(alone: Sequence[Drive], recorded: Sequence[Drive], pictures: int, shown: str) -> Table:
    both = (alone, recorded)

    def row(
        name: str, unit: str, value: Measure, marks: Sequence[Mark | None] = (None, None), digits: int = 1
    ) -> Row:
        cells = [
            Cell(median([value(each) for each in drives]), mark)
            for drives, mark in zip(both, marks, strict=True)
        ]
        return Row(name, unit, cells, digits)

    def part(topic: str, place: int) -> Measure:
        return lambda each: percentiles(latencies_ms(each.heard.topics[topic]))[place]

    answered = at_least(pictures)
    rows = [
        row("picture to steering, p50", "ms", part("steering", 0), (at_most(20.0), None)),
        row("picture to steering, p95", "ms", part("steering", 1)),
        row("picture to steering, p99", "ms", part("steering", 2), (at_most(33.0), at_most(40.0))),
        row("picture to steering, worst", "ms", part("steering", 3)),
        row("picture to vanishing points, p50", "ms", part("vanishing_points", 0)),
        row("picture to vanishing points, p99", "ms", part("vanishing_points", 2)),
        row("pictures answered by vanishing_points", "", answers("vanishing_points"), (answered, None), 0),
        row("pictures answered by steering", "", answers("steering"), digits=0),
        row("pictures skipped or lost by line_detector", "", dropped(LINES), digits=0),
        *[
            row(f"{name}, share of a core", "%", share(name))
            for name in PROCESSES
            if name in recorded[0].load.cores
        ],
        row("others, share of the machine", "%", lambda each: each.load.others),
        row("stolen by the host, share of the machine", "%", lambda each: each.load.stolen),
    ]
    columns = (f"median of {len(alone)}", "with bag_recorder")
    notes = [
        *disturbance([*alone, *recorded]),
        f"pictures: {shown}",
        "a picture whose vanishing points name no way ahead gets no steering: the first of a new scene, for one",
    ]
    return Table(f"Latency: {pictures} pictures 640x480 bgr8 at {RATE_HZ:g} Hz", columns, rows, notes)


def _stage_table(alone: Sequence[Drive], recorded: Sequence[Drive]) -> Table:
    steps = (
        ("picture sent, heard, and its lines found", None, "lines"),
        ("lines heard, and the heading found", "lines", "heading"),
        ("heading heard, and the steering found", "heading", "steering"),
    )

    def stage(first: str | None, last: str, place: int) -> Measure:
        def value(each: Drive) -> float:
            topics = each.heard.topics
            return percentiles(stage_ms(None if first is None else topics[first], topics[last]))[place]

        return value

    def on_the_way(each: Drive) -> float:
        rows = first_of_each(each.heard.topics["steering"])
        return median(1e-6 * (rows[:, 2] - rows[:, 1]))

    def computing(node: str) -> Measure:
        return lambda each: median(each.heard.processing_ms.get(node, []))

    def row(name: str, value: Measure) -> Row:
        cells = [Cell(median([value(each) for each in drives])) for drives in (alone, recorded)]
        return Row(name, "ms", cells, 2)

    rows = []
    for name, first, last in steps:
        rows += [row(f"{name}, p50", stage(first, last, 0)), row(f"{name}, p99", stage(first, last, 2))]
    rows.append(row("steering on its way to the probe, p50", on_the_way))
    rows += [row(f"of this {node} computes, p50", computing(node)) for node in (LINES, VANISHING, STEERING)]
    return Table(
        "Where the time goes, from the sending of one message to the sending of the next",
        ("alone", "with bag_recorder"),
        rows,
    )


def disturbance(drives: Sequence[Drive]) -> list[str]:
    """Return a note when others kept the machine busy, so that nobody takes the times for the nodes' own."""
    worst = max(each.load.others + each.load.stolen for each in drives)
    if worst <= QUIET:
        return []
    return [f"NOT QUIET: others took up to {worst:.0f} % of the machine, so these times say little"]


def answers(topic: str) -> Measure:
    """Return what counts the pictures that a topic answered."""
    return lambda each: float(len(first_of_each(each.heard.topics[topic])))


def dropped(node: str) -> Measure:
    """Return what counts the inputs a node did not examine, by its own diagnostics."""

    def count(each: Drive) -> float:
        said = each.heard.counts[node]
        return said[SKIPPED] + said[LOST]

    return count


def share(process: str) -> Measure:
    """Return what tells the share of a core of a process; nan where it did not run."""
    return lambda each: each.load.cores.get(process, float("nan"))
