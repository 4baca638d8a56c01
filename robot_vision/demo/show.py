# SPDX-License-Identifier: Apache-2.0
"""Runs the demonstration from the bag to the report."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from robot_vision.bags import BagReader, HeadingScore, score_heading
from robot_vision.control import CorridorSteering
from robot_vision.demo.answers import Replay, Truth, picture_topic_of, read_replay
from robot_vision.perception import LaneHeading
from robot_vision.ros.replays import replay

if TYPE_CHECKING:
    from rich.console import Console

NODES = ("line_detector", "vp_estimator", "corridor_steering")
TELL_EVERY_S = 1.0  # a row of the table
ANSWER_S = 2.0  # how long the replay waits for an answer to one picture
TOLD = 1e-6  # variance of a heading that is the truth, rad² and m²


class MountError(ValueError):
    """A place where no camera can sit."""


@dataclass(frozen=True)
class Mount:
    """Where the camera sits: height over the ground (m), pitch (rad, down is positive)."""

    height: float
    pitch: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.height) and self.height >= 0.0):
            raise MountError(f"the camera must be 0 m or more over the ground, not {self.height}")
        if not abs(self.pitch) <= 0.5 * math.pi:
            raise MountError(
                f"the camera must look down by -90 to 90 degrees, not {math.degrees(self.pitch):g}"
            )


def run_demo(bag: Path, out: Path, mount: Mount, console: Console) -> None:
    """Replay a bag through the real nodes and leave demo.png, demo.mp4 and demo.mcap in a folder.

    Args:
        bag: with pictures and their calibration; with `truth/heading` the report compares.
        out: the folder; made if it is not there.
        mount: of the camera.
        console: where the report goes.

    Raises:
        BagError: the bag cannot be used.
        ProcessError: a node ended before the bag did.
        DrawingError: a result cannot be written.
    """
    reader = BagReader(bag)
    compressed = picture_topic_of(reader).endswith("compressed")
    count = reader.topics[picture_topic_of(reader)].count
    out.mkdir(parents=True, exist_ok=True)
    answers = out / "demo.mcap"
    console.print(f"{bag}: {count} pictures, {reader.duration_s:.1f} s, replayed in lockstep through")
    console.print(f"bag_player -> {' -> '.join(NODES)} and bag_recorder, each a process of its own")
    with console.status("starting; the first time kernels are compiled"):
        replay_through_nodes(bag, answers, "compressed" if compressed else "raw", mount)
    present(bag, answers, out, console)


def present(bag: Path, answers: Path, out: Path, console: Console) -> None:
    """Report on a drive and leave its picture and its film beside the bag of answers.

    Args:
        bag: with pictures and their calibration; with `truth/heading` the report compares.
        answers: what the nodes said; it may be the same bag.
        out: the folder.
        console: where the report goes.

    Raises:
        BagError: a bag cannot be used.
        DrawingError: a result cannot be written.
    """
    from robot_vision.demo.drawing import write_picture
    from robot_vision.demo.film import write_film

    replay = read_replay(bag, answers)
    told = steering_told_the_truth(replay)
    _report(replay, told, console)
    if replay.truth:
        _score(score_heading(answers, bag), replay, told, console)
    write_picture(replay, out / "demo.png", told)
    with _frames(console, len(replay.answers)) as progress:
        write_film(replay, out / "demo.mp4", told, progress)
    for path in (out / "demo.png", out / "demo.mp4", answers):
        console.print(f"{path}  {path.stat().st_size / 1e6:.1f} MB")


def replay_through_nodes(bag: Path, answers: Path, transport: str, mount: Mount) -> None:
    """Replay a bag in lockstep through the nodes, each a process, and record everything they say.

    Args:
        bag: to replay.
        answers: the bag to write; an old one is replaced.
        transport: how the bag holds its pictures, raw or compressed.
        mount: of the camera.

    Raises:
        ProcessError: a process ended before the replay did, or the replay failed.
    """
    settings: dict[str, dict[str, Any]] = {
        "line_detector": {"transport": transport},
        "vp_estimator": {"camera.height": mount.height, "camera.pitch": mount.pitch},
    }
    replay(bag, answers, NODES, "steering", settings, answer_s=ANSWER_S)


def steering_told_the_truth(replay: Replay) -> dict[int, float]:
    """Return by stamp the turn rate (rad/s) that the steering law commands when told the true heading."""
    law = CorridorSteering()
    return {
        stamp: law.update(_known(replay.truth[stamp]), stamp / 1e9).turn_rate
        for stamp in replay.stamps
        if stamp in replay.truth
    }


def _known(truth: Truth) -> LaneHeading:
    return LaneHeading(truth.yaw, TOLD, truth.offset, TOLD)


def _report(replay: Replay, told: dict[int, float], console: Console) -> None:
    """Print a row a second: what the nodes said, and the truth where it is known."""
    from rich.table import Table

    table = Table(title="from the pictures (truth)", title_justify="left")
    for name in ("time", "heading", "offset to the left", "turn", "speed"):
        table.add_column(name, justify="right")
    for stamp in _every_second(replay):
        answer, truth = replay.answers[stamp], replay.truth.get(stamp)
        table.add_row(
            f"{replay.seconds(stamp):.1f} s",
            _pair(math.degrees(answer.yaw), math.degrees(truth.yaw) if truth else None, "{:+.2f}", "°"),
            _pair(100 * answer.offset, 100 * truth.offset if truth else None, "{:+.1f}", " cm"),
            _pair(math.degrees(answer.turn_rate), _degrees(told.get(stamp)), "{:+.1f}", " °/s"),
            _pair(answer.speed, None, "{:.2f}", " m/s"),
        )
    console.print(table)


def _every_second(replay: Replay) -> Iterator[int]:
    due = 0.0
    for stamp in replay.stamps:
        if replay.seconds(stamp) >= due - 1e-3:
            due += TELL_EVERY_S
            yield stamp


def _pair(value: float, true: float | None, form: str, unit: str) -> str:
    text = "none" if math.isnan(value) else form.format(value) + unit
    return text if true is None else f"{text} ({form.format(true)})"


def _degrees(radians: float | None) -> float | None:
    return None if radians is None else math.degrees(radians)


def _score(score: HeadingScore, replay: Replay, told: dict[int, float], console: Console) -> None:
    """Print the errors over the whole drive."""
    console.print(f"answered  {score.answers} of {score.truths} pictures")
    rows = [("heading", score.yaw, 180 / math.pi, "°"), ("offset", score.offset, 100.0, " cm")]
    for name, part, scale, unit in rows:
        if part.count:
            console.print(
                f"{name:<9} RMS error {scale * part.rms:.2f}{unit}, worst {scale * part.worst:.2f}{unit}, "
                f"normalised error squared {part.normalised:.2f} (honest: 1)"
            )
    differences = [replay.answers[stamp].turn_rate - rate for stamp, rate in told.items()]
    known = np.array([each for each in differences if not math.isnan(each)])
    if known.size:
        rms = math.degrees(float(np.sqrt(np.mean(known**2))))
        console.print(
            f"steering  RMS {rms:.2f} °/s from what the same law commands when it is told the truth"
        )


@contextmanager
def _frames(console: Console, count: int) -> Iterator[Callable[[int], None]]:
    """Show a bar of the film's frames."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (TextColumn("film"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("film", total=count)
        yield lambda done: bar.update(task, completed=done)
