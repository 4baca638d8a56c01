# SPDX-License-Identifier: Apache-2.0
"""How cost grows: with the number of lines for vanishing points, with the number of pixels for lines."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.report import Cell, Row, Table, at_most
from bench.sources import ROOT, york_urban
from robot_vision.geometry import Camera
from robot_vision.perception import LineDetector, LineSegments, VanishingPointEstimator

COUNTS = (50, 100, 200, 400, 800, 1200, 2000)  # lines
SIZES = ((320, 240), (640, 480), (960, 720), (1280, 960), (1920, 1080))  # px
CURVES = ROOT / "out" / "costs.png"
#: Cost grows as the number of pixels to this power at most: 1 would be linear.
LARGEST_POWER = 1.15
_ROUNDS = 9
_SHARE_OF_CLUTTER = 0.3


def run(quick: bool) -> list[Table]:
    """Measure, each cost fewer times when it is to be quick, and draw the curves.

    Raises:
        MissingSetError: the pictures are not there.
    """
    rounds = 3 if quick else _ROUNDS
    cv2.setNumThreads(1)
    known, blind = by_lines(rounds)
    limited, whole = by_pixels(rounds)
    draw(CURVES, known, blind, limited, whole)
    counts = [str(count) for count in COUNTS]
    sizes = [f"{width}x{height}" for width, height in SIZES]
    pixels = np.array([width * height for width, height in SIZES], np.float64)
    power = float(np.polyfit(np.log(pixels), np.log(whole), 1)[0])
    powers: list[Cell | None] = [None] * (len(SIZES) - 1)
    return [
        Table(
            "Vanishing points: CPU against the number of lines",
            counts,
            [
                Row("focal length known", "ms", [Cell(value) for value in known]),
                Row("focal length withheld", "ms", [Cell(value) for value in blind]),
            ],
            [
                f"three directions at right angles and {_SHARE_OF_CLUTTER:.0%} clutter; the longest lines are used"
            ],
        ),
        Table(
            "Lines: CPU against the size of the picture",
            sizes,
            [
                Row("as set", "ms", [Cell(value) for value in limited]),
                Row("no limit on the area", "ms", [Cell(value) for value in whole]),
                Row("power of the number of pixels", "", [*powers, Cell(power, at_most(LARGEST_POWER))], 2),
            ],
            [f"York Urban side by side, none enlarged; the curves are in {CURVES.relative_to(ROOT)}"],
        ),
    ]


def by_lines(rounds: int) -> tuple[list[float], list[float]]:
    """Return the CPU time (ms) to vanishing points for each of `COUNTS`, focal length known and withheld."""
    camera = Camera(600.0, 600.0, 319.5, 239.5, 640, 480)
    blind = Camera.uncalibrated(640, 480)
    estimator = VanishingPointEstimator()
    estimator.warm_up()
    scenes = [right_angled(np.random.default_rng(count), camera, count) for count in COUNTS]
    known = [_cost(partial(estimator.estimate, lines, camera), rounds) for lines in scenes]
    withheld = [_cost(partial(estimator.estimate, lines, blind), rounds) for lines in scenes]
    return known, withheld


def by_pixels(rounds: int) -> tuple[list[float], list[float]]:
    """Return the CPU time (ms) to lines for each of `SIZES`, as set and without a limit on the area searched."""
    pictures = [picture.gray() for picture in york_urban()[1][:12]]
    tiled = [side_by_side(pictures, width, height) for width, height in SIZES]
    limited, whole = LineDetector(), LineDetector(largest_area=100_000_000)
    limited.warm_up()
    return (
        [_cost(partial(limited.detect, gray), rounds) for gray in tiled],
        [_cost(partial(whole.detect, gray), rounds) for gray in tiled],
    )


def side_by_side(pictures: list[NDArray[np.uint8]], width: int, height: int) -> NDArray[np.uint8]:
    """Lay pictures of one size in rows until they cover (height, width), and cut off what stands over."""
    across = -(-width // pictures[0].shape[1])
    down = -(-height // pictures[0].shape[0])
    rows = [
        np.hstack([pictures[(row * across + column) % len(pictures)] for column in range(across)])
        for row in range(down)
    ]
    return np.ascontiguousarray(np.vstack(rows)[:height, :width])


def right_angled(random: np.random.Generator, camera: Camera, count: int) -> LineSegments:
    """Lines of a scene of three directions at right angles, with clutter, ends placed to 0.3 px."""
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    middles = random.uniform((0.0, 0.0), (camera.width, camera.height), (count, 2))
    points = axes[random.integers(0, 3, count)] @ camera.matrix.T
    along = points[:, :2] - points[:, 2:] * middles
    clutter = random.random(count) < _SHARE_OF_CLUTTER
    along[clutter] = random.normal(size=(int(clutter.sum()), 2))
    along *= random.uniform(10.0, 60.0, (count, 1)) / np.linalg.norm(along, axis=1, keepdims=True)
    ends = np.hstack([middles - along, middles + along])
    return LineSegments.from_endpoints(ends + random.normal(0.0, 0.3, ends.shape))


def draw(
    path: Path, known: list[float], blind: list[float], limited: list[float], whole: list[float]
) -> None:
    """Draw both curves into a picture file."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    left.plot(COUNTS, known, "o-", label="focal length known")
    left.plot(COUNTS, blind, "s-", label="focal length withheld")
    left.set(title="vanishing points", xlabel="lines", ylabel="CPU, ms", ylim=(0.0, None))
    pixels = [width * height / 1e6 for width, height in SIZES]
    right.plot(pixels, limited, "o-", label="as set")
    right.plot(pixels, whole, "s-", label="no limit on the area")
    right.set(title="lines", xlabel="megapixels", ylabel="CPU, ms", ylim=(0.0, None))
    for axes in (left, right):
        axes.grid(alpha=0.3)
        axes.legend()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)


def _cost(work: Callable[[], object], rounds: int) -> float:
    """Return the median CPU time of some work, ms, the first time left out."""
    work()
    spent = []
    for _ in range(rounds):
        began = time.process_time_ns()
        work()
        spent.append(1e-6 * (time.process_time_ns() - began))
    return float(np.median(spent))
