# SPDX-License-Identifier: Apache-2.0
"""Makes a film of a replay: every frame with its answers, beside gauges of heading and steering."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from robot_vision.demo.answers import Replay
from robot_vision.demo.drawing import DrawingError, Picture, annotated

HEIGHT, PANEL_WIDTH = 720, 400  # px
MARGIN = 28
INK, FAINT, GROUND = (235, 235, 235), (128, 124, 118), (34, 30, 28)
ESTIMATE, TRUE = (63, 210, 255), (255, 255, 255)
FONT = cv2.FONT_HERSHEY_SIMPLEX


@dataclass(frozen=True)
class Gauge:
    """One row of the panel.

    Attributes:
        label: what is shown.
        unit: as it is printed.
        value: in that unit, nan if not known.
        true: in that unit, nan if not known.
        reach: the end of the scale to either side, in that unit.
        mirrored: True where positive values point to the left, as yaw, offset and turn rate do.
    """

    label: str
    unit: str
    value: float
    true: float
    reach: float
    mirrored: bool = True


def write_film(
    replay: Replay, path: Path, turn_rates: dict[int, float], progress: Callable[[int], None] | None = None
) -> int:
    """Write the film of a replay.

    Args:
        replay: with at least one picture.
        path: of the mp4.
        turn_rates: rad/s by stamp, what the same law commands when it is told the true heading; may be empty.
        progress: called with the number of frames done.

    Returns:
        the number of frames.

    Raises:
        DrawingError: no film can be written there.
    """
    writer = None
    count = 0
    try:
        for stamp, pixels in replay.pictures():
            truth = replay.truth.get(stamp)
            answer = replay.answers[stamp]
            shown = annotated(pixels, answer, replay, truth.yaw if truth else None, HEIGHT)
            frame = np.hstack([shown, _panel(replay, stamp, turn_rates.get(stamp, math.nan))])
            frame = frame[:, : frame.shape[1] - frame.shape[1] % 2]
            if writer is None:
                size = (frame.shape[1], frame.shape[0])
                writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), replay.rate_hz, size)
                if not writer.isOpened():
                    raise DrawingError(f"cannot write the film {path}: no such folder, or OpenCV without mp4")
            writer.write(np.ascontiguousarray(frame))
            count += 1
            if progress is not None:
                progress(count)
    finally:
        if writer is not None:
            writer.release()
    return count


def _panel(replay: Replay, stamp: int, true_rate: float) -> Picture:
    """(HEIGHT, PANEL_WIDTH, 3): the gauges of one instant."""
    panel = np.empty((HEIGHT, PANEL_WIDTH, 3), np.uint8)
    panel[:] = GROUND
    answer, truth = replay.answers[stamp], replay.truth.get(stamp)
    true_yaw = math.degrees(truth.yaw) if truth else math.nan
    true_offset = 100 * truth.offset if truth else math.nan
    _text(panel, f"{replay.seconds(stamp):.1f} s", (MARGIN, 52), 0.9, INK)
    _text(
        panel,
        f"{len(answer.lines)} lines, {len(answer.directions)} vanishing points",
        (MARGIN, 82),
        0.5,
        FAINT,
    )
    gauges = (
        Gauge("heading", "deg", math.degrees(answer.yaw), true_yaw, 15.0),
        Gauge("offset to the left", "cm", 100 * answer.offset, true_offset, 60.0),
        Gauge("steering: turn", "deg/s", math.degrees(answer.turn_rate), math.degrees(true_rate), 45.0),
        Gauge("steering: speed", "m/s", answer.speed, math.nan, 1.0, mirrored=False),
    )
    for number, gauge in enumerate(gauges):
        _draw_gauge(panel, gauge, 138 + 130 * number)
    bottom = HEIGHT - 34
    cv2.rectangle(panel, (MARGIN, bottom - 12), (MARGIN + 14, bottom), ESTIMATE, -1)
    _text(panel, "from the pictures", (MARGIN + 24, bottom), 0.5, INK)
    cv2.line(panel, (MARGIN + 206, bottom - 14), (MARGIN + 206, bottom + 2), TRUE, 2, cv2.LINE_AA)
    _text(panel, "truth", (MARGIN + 218, bottom), 0.5, INK)
    return panel


def _draw_gauge(panel: Picture, gauge: Gauge, top: int) -> None:
    left, right = MARGIN, PANEL_WIDTH - MARGIN
    middle = (left + right) // 2
    bar = top + 44
    _text(panel, gauge.label, (left, top), 0.55, FAINT)
    number = "-" if math.isnan(gauge.value) else f"{gauge.value:+.2f}"
    _text(panel, f"{number} {gauge.unit}", (left, top + 27), 0.7, INK)
    if not math.isnan(gauge.true):
        _text(panel, f"truth {gauge.true:+.2f}", (middle + 24, top + 27), 0.55, FAINT)
    cv2.rectangle(panel, (left, bar), (right, bar + 18), (58, 53, 50), -1)
    origin = middle if gauge.mirrored else left
    if not math.isnan(gauge.value):
        tip = _place(gauge, gauge.value, origin, left, right)
        cv2.rectangle(panel, (min(origin, tip), bar + 2), (max(origin, tip), bar + 16), ESTIMATE, -1)
    if not math.isnan(gauge.true):
        mark = _place(gauge, gauge.true, origin, left, right)
        cv2.line(panel, (mark, bar - 5), (mark, bar + 23), TRUE, 2, cv2.LINE_AA)
    cv2.line(panel, (origin, bar - 2), (origin, bar + 20), FAINT, 1, cv2.LINE_AA)


def _place(gauge: Gauge, value: float, origin: int, left: int, right: int) -> int:
    """The column of a value on its scale; beyond the end it stays at the end."""
    span = origin - left if gauge.mirrored else right - left
    step = round(span * float(np.clip(value / gauge.reach, -1.0, 1.0)))
    return origin - step if gauge.mirrored else origin + step


def _text(
    panel: Picture, text: str, place: tuple[int, int], size: float, colour: tuple[int, int, int]
) -> None:
    cv2.putText(panel, text, place, FONT, size, colour, 1, cv2.LINE_AA)
