# SPDX-License-Identifier: Apache-2.0
"""Shows a person how sure a calibration is: what each picture says by itself, beside what all say together."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.bags import BagError
from robot_vision.calibrate.drive import Drive
from robot_vision.calibrate.report import Line, lines_of
from robot_vision.geometry import GroundPlane
from robot_vision.perception import VanishingPointEstimator
from robot_vision.perception.calibration import CameraCalibration
from robot_vision.perception.overlay import HORIZON, draw_lines

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DIMMED = 0.75
_PAPER, _PANEL, _INK, _FRAME = "#1c1e22", "#25282e", "#d0d3d8", "#4a4f58"
_TOGETHER, _ALONE = "#ffd23f", "#8fb8ff"


def write_plot(found: CameraCalibration, drive: Drive, path: Path) -> None:
    """Draw one picture with its lines and the horizon, and beside it what each picture says of each quantity.

    Args:
        found: the calibration.
        drive: what it was found from.
        path: of the png.

    Raises:
        BagError: the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14, 6.6), dpi=100, facecolor=_PAPER)
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(
        4, 2, width_ratios=(1.1, 1), left=0.012, right=0.985, top=0.93, bottom=0.075, wspace=0.14, hspace=0.42
    )
    left = figure.add_subplot(grid[:, 0])
    left.imshow(cv2.cvtColor(_annotated(found, drive), cv2.COLOR_BGR2RGB), interpolation="antialiased")
    left.set_axis_off()
    left.set_title(_caption(found), loc="left", color="white", fontsize=12)
    time = np.array(drive.stamps_s) - drive.stamps_s[0]
    for number, line in enumerate(lines_of(found)):
        axes = figure.add_subplot(grid[number, 1])
        _panel(axes, time, line)
        axes.tick_params(labelbottom=number == 3)
    axes.set_xlabel("seconds", color=_INK)
    try:
        figure.savefig(path)
    except OSError as error:
        raise BagError(f"cannot write {path}: {error.strerror}") from error


def _annotated(found: CameraCalibration, drive: Drive) -> NDArray[np.uint8]:
    """One picture, its lines in the colour of their vanishing point, and the horizon of the upright body."""
    canvas = cv2.cvtColor((drive.example * _DIMMED).astype(np.uint8), cv2.COLOR_GRAY2BGR)
    lines = drive.lines[drive.example_at]
    draw_lines(canvas, lines, VanishingPointEstimator().estimate(lines, found.camera))
    if found.pitch.known:
        a, b, c = GroundPlane(found.camera).horizon
        if abs(b) > 1e-6:
            ends = [(u, round(-(a * u + c) / b)) for u in (0, found.camera.width - 1)]
            cv2.line(canvas, ends[0], ends[1], HORIZON, 2, cv2.LINE_AA)
    return np.asarray(canvas, np.uint8)


def _caption(found: CameraCalibration) -> str:
    if not found.pitch.known:
        return "lines by vanishing point; no horizon: the pitch is not told"
    return "lines by vanishing point; the horizon with the body upright"


def _panel(axes: Axes, time: NDArray[np.float64], line: Line) -> None:
    """What each picture says (dots), what all say (line) and how sure that is (band of two sigma)."""
    axes.set_facecolor(_PANEL)
    own = line.finding.own * line.factor
    told = np.isfinite(own)
    if told.any():
        axes.plot(time[told], own[told], ".", color=_ALONE, markersize=4)
    if line.finding.value is not None:
        value, sigma = line.finding.value * line.factor, line.finding.sigma * line.factor
        axes.axhspan(value - 2 * sigma, value + 2 * sigma, color=_TOGETHER, alpha=0.18, linewidth=0)
        axes.axhline(value, color=_TOGETHER, linewidth=1.6)
        reach = max(4 * sigma, 1.3 * float(np.nanpercentile(np.abs(own - value), 95)) if told.any() else 0.0)
        axes.set_ylim(value - reach, value + reach)
    elif not told.any():
        axes.set_yticks([])
    if line.given is not None:
        axes.axhline(line.given * line.factor, color="white", linewidth=1.0, linestyle="--", label="given")
        axes.legend(loc="upper right", fontsize=8, frameon=False, labelcolor="white")
    if not line.finding.known:
        text = "\n".join(textwrap.wrap(f"not told: {line.finding.reason}", 82))
        axes.text(
            0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color="white", fontsize=8.5,
            bbox={"facecolor": _PANEL, "edgecolor": "none", "alpha": 0.8},
        )  # fmt: skip
    axes.set_title(f"{line.name}: {line.value} {line.sigma}", loc="left", fontsize=10, color=_INK, pad=4)
    axes.set_xlim(time[0], max(time[-1], time[0] + 1e-3))
    axes.tick_params(colors="#a0a5ad", labelsize=8)
    for spine in axes.spines.values():
        spine.set_color(_FRAME)
