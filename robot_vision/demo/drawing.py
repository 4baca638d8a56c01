# SPDX-License-Identifier: Apache-2.0
"""Shows a replay to a person in one picture: a frame with its answers, and all answers over time."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.demo.answers import Answer, Replay, labels_of
from robot_vision.perception import LineSegments, VanishingPoints
from robot_vision.perception.overlay import CLUTTER, COLOURS, draw_lines, draw_vanishing_points
from robot_vision.perception.vanishing import Role

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Picture = NDArray[np.uint8]
Array = NDArray[np.float64]
TRUE = (255, 255, 255)  # colour of the true direction, BGR
_DIMMED = 0.8  # the photograph steps back behind what is drawn on it


class DrawingError(ValueError):
    """A picture or a film cannot be written; the text names the file."""


def annotated(
    pixels: Picture, answer: Answer, replay: Replay, true_yaw: float | None, height: int
) -> Picture:
    """Draw lines in the colour of their vanishing point, the points themselves and the true direction.

    Args:
        pixels: (H, W, 3) rectified BGR.
        answer: what the graph said about it.
        replay: where it comes from.
        true_yaw: of the robot in the lane, rad; None if not known.
        height: of the answer, px; the width follows.

    Returns:
        (height, width, 3) BGR.
    """
    scale = height / pixels.shape[0]
    size = (round(pixels.shape[1] * scale), height)
    canvas = np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_CUBIC), np.uint8)
    canvas = (canvas * _DIMMED).astype(np.uint8)
    lines = LineSegments.from_endpoints((answer.lines + 0.5) * scale - 0.5)
    if replay.camera is None:
        return np.asarray(draw_lines(canvas, lines))
    camera = replay.camera.resized(*size)
    points = VanishingPoints(
        directions=answer.directions,
        covariance=np.zeros((len(answer.directions), 2, 2)),
        weight=np.ones(len(answer.directions)),
        roles=answer.roles,
        ids=np.zeros(len(answer.directions), np.uint32),
        labels=labels_of(lines.endpoints, answer.directions, camera),
        camera=camera,
    )
    draw_lines(canvas, lines, points)
    if true_yaw is not None:
        _mark_true_column(canvas, round(camera.cx + camera.fx * math.tan(true_yaw)))
    return np.asarray(draw_vanishing_points(canvas, points))


def _mark_true_column(canvas: Picture, column: int) -> None:
    """A dashed upright line where the lane's direction really meets the picture of a level camera."""
    height = canvas.shape[0]
    dash = height // 60
    for top in range(0, height, 2 * dash):
        cv2.line(canvas, (column, top), (column, top + dash), TRUE, 1, cv2.LINE_AA)


def write_picture(replay: Replay, path: Path, turn_rates: dict[int, float]) -> None:
    """Write the picture that opens the report: one frame beside heading, offset and steering over time.

    Args:
        replay: with at least one answer.
        path: of the png.
        turn_rates: rad/s by stamp, what the same law commands when it is told the true heading; may be empty.

    Raises:
        DrawingError: the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    stamp = telling_stamp(replay)
    _, pixels = next(replay.pictures(only=stamp))
    answer, truth = replay.answers[stamp], replay.truth.get(stamp)
    shown = annotated(pixels, answer, replay, truth.yaw if truth else None, 720)

    figure = Figure(figsize=(16, 7.4), dpi=110, facecolor="#1c1e22")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(
        3,
        2,
        width_ratios=(1.42, 1),
        left=0.012,
        right=0.985,
        top=0.925,
        bottom=0.075,
        wspace=0.11,
        hspace=0.16,
    )
    left = figure.add_subplot(grid[:, 0])
    left.imshow(cv2.cvtColor(shown, cv2.COLOR_BGR2RGB), interpolation="antialiased")
    left.set_axis_off()
    left.set_title(_sentence(answer, replay, stamp), loc="left", color="white", fontsize=14)
    _explain_colours(left)

    time = np.array([replay.seconds(each) for each in replay.stamps])
    answers, truths = list(replay.answers.values()), [replay.truth.get(each) for each in replay.stamps]
    yaw = np.degrees([each.yaw for each in answers])
    yaw_sd = np.degrees([each.yaw_sd for each in answers])
    true_yaw = np.degrees([each.yaw if each else math.nan for each in truths])
    offset = 100 * np.array([each.offset for each in answers])
    offset_sd = 100 * np.array([each.offset_sd for each in answers])
    true_offset = 100 * np.array([each.offset if each else math.nan for each in truths])
    rate = np.degrees([each.turn_rate for each in answers])
    true_rate = np.degrees([turn_rates.get(each, math.nan) for each in replay.stamps])
    rows = (
        ("heading, °", yaw, yaw_sd, true_yaw, "truth"),
        ("offset to the left, cm", offset, offset_sd, true_offset, "truth"),
        ("steering, °/s", rate, None, true_rate, "the same law, told the truth"),
    )
    for number, (label, values, sd, true, true_label) in enumerate(rows):
        axes = figure.add_subplot(grid[number, 1])
        _plot(axes, time, values, sd, true, label, true_label)
        axes.axvline(replay.seconds(stamp), color="#8a8f98", linewidth=0.8, linestyle=":")
        axes.tick_params(labelbottom=number == len(rows) - 1)
    axes.set_xlabel("seconds", color="#d0d3d8")
    try:
        figure.savefig(path)
    except OSError as error:
        raise DrawingError(f"cannot write {path}: {error.strerror}") from error


def _explain_colours(axes: Axes) -> None:
    """Say under the picture what its colours mean."""
    entries = [
        ("ahead", COLOURS[Role.PRIMARY]),
        ("upright", COLOURS[Role.VERTICAL]),
        ("across", COLOURS[Role.HORIZONTAL]),
        ("clutter", CLUTTER),
    ]
    axes.text(
        0.0, -0.035, "lines leading", color="#d0d3d8", fontsize=11, transform=axes.transAxes, va="center"
    )
    for number, (name, (blue, green, red)) in enumerate(entries):
        place = 0.14 + 0.125 * number
        colour = (red / 255, green / 255, blue / 255)
        axes.plot(
            [place, place + 0.04],
            [-0.035] * 2,
            color=colour,
            linewidth=4,
            transform=axes.transAxes,
            clip_on=False,
        )
        axes.text(
            place + 0.05, -0.035, name, color="white", fontsize=11, transform=axes.transAxes, va="center"
        )
    axes.text(
        0.665,
        -0.035,
        "○ vanishing point   ┆ true direction",
        color="#d0d3d8",
        fontsize=11,
        transform=axes.transAxes,
        va="center",
    )


def telling_stamp(replay: Replay) -> int:
    """Return the stamp of the picture that shows most: a heading, many lines, the robot turned aside."""

    def tells(stamp: int) -> float:
        answer = replay.answers[stamp]
        if math.isnan(answer.yaw):
            return -1.0
        return min(len(answer.lines), 150) / 150 + min(abs(answer.yaw), 0.15) / 0.15

    return max(replay.stamps, key=tells)


def _sentence(answer: Answer, replay: Replay, stamp: int) -> str:
    if math.isnan(answer.yaw):
        return "no heading in this picture"
    text = f"heading {math.degrees(answer.yaw):+.2f}°"
    truth = replay.truth.get(stamp)
    if truth is not None:
        text += f"  (truth {math.degrees(truth.yaw):+.2f}°)"
    if not math.isnan(answer.offset):
        text += f"     offset {100 * answer.offset:+.1f} cm"
        if truth is not None:
            text += f"  (truth {100 * truth.offset:+.1f} cm)"
    return text


def _plot(
    axes: Axes,
    time: Array,
    values: Array,
    sd: Array | None,
    true: Array,
    label: str,
    true_label: str,
) -> None:
    """One curve, with its two-sigma band if it has one, over the truth."""
    axes.set_facecolor("#25282e")
    axes.axhline(0.0, color="#4a4f58", linewidth=0.8)
    if sd is not None:
        axes.fill_between(time, values - 2 * sd, values + 2 * sd, color="#ffd23f", alpha=0.18, linewidth=0)
    if np.isfinite(true).any():
        axes.plot(
            time, true, color="#8fb8ff", linewidth=5, alpha=0.75, solid_capstyle="butt", label=true_label
        )
        rms = (
            float(np.sqrt(np.nanmean((values - true) ** 2))) if np.isfinite(values - true).any() else math.nan
        )
        axes.set_title(
            f"RMS difference {rms:.2f} {label.split(',')[-1].strip()}",
            loc="left",
            fontsize=9.5,
            color="#d0d3d8",
            pad=4,
        )
    axes.plot(time, values, color="#ffd23f", linewidth=1.4, label="from the pictures")
    limit = 1.25 * max(np.nanmax(np.abs(np.concatenate([values, true, [1e-3]]))), 1e-3)
    axes.set_ylim(-limit, limit)
    axes.set_xlim(time[0], max(time[-1], time[0] + 1e-3))
    axes.set_ylabel(label, color="#d0d3d8")
    axes.tick_params(colors="#a0a5ad", labelsize=9)
    for spine in axes.spines.values():
        spine.set_color("#4a4f58")
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2, fontsize=9, frameon=False, labelcolor="white"
    )
