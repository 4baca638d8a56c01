# SPDX-License-Identifier: Apache-2.0
"""Settings chosen on some pictures of York Urban and judged on the others: what tuning is worth on pictures not seen.

Settings are chosen on four fifths by the mean of AA@3, AA@5 and AA@10, and judged on the fifth that had no say in it;
every picture is judged so once in a round, and rounds divide the pictures anew.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np
from numpy.typing import NDArray

from bench import directions as scores
from bench.report import Cell, Row, Table, at_least
from bench.sources import YorkPicture, york_urban
from robot_vision.geometry import Camera
from robot_vision.perception import LineDetector, LineSegments, VanishingPointEstimator

BLURS = (0.6, 0.8, 1.0)  # px
CONTRASTS = (8.0, 10.0)  # grey levels a pixel
ORTHOGONALITIES_DEG = (0.8, 1.0, 1.3)
MOST_LINES = (300, 400)
FOLDS = 5
ROUNDS = 20
Array = NDArray[np.float64]

#: Columns of a picture's scores, percent.
_AA3, _AA5, _AA10, _AHEAD_1, _AHEAD_5, _HORIZON = range(6)


def run(quick: bool) -> list[Table]:
    """Measure, with every fourth picture when it is to be quick.

    Raises:
        MissingSetError: the pictures are not there.
    """
    camera, pictures = york_urban()
    if quick:
        pictures = pictures[::4]
    of_all = np.array(list(every_setting(pictures, camera)))
    judged = held_out(of_all, np.random.default_rng(0)).tolist()
    usual = (
        per_picture(
            [LineDetector().detect(each.gray()) for each in pictures],
            pictures,
            camera,
            VanishingPointEstimator(),
        )
        .mean(axis=0)
        .tolist()
    )
    best = of_all.mean(axis=1)[int(np.argmax(chosen_by(of_all).mean(axis=1)))].tolist()

    def row(name: str, column: int, mark: float | None = None) -> Row:
        values = [judged[column], usual[column], best[column]]
        held = at_least(mark) if mark is not None else None
        return Row(name, "%", [Cell(values[0], held), Cell(values[1]), Cell(values[2])])

    rows = [
        row("AA@3", _AA3, 74.0),
        row("AA@5", _AA5),
        row("AA@10", _AA10, 92.0),
        row("forward within 1 deg", _AHEAD_1, 80.0),
        row("forward within 5 deg", _AHEAD_5),
        row("horizon AUC", _HORIZON, 96.5),
    ]
    title = f"York Urban, {len(of_all)} settings, {FOLDS} folds of {len(pictures)} pictures, {ROUNDS} rounds"
    return [Table(title, ["held out", "default settings", "best on all"], rows)]


def every_setting(pictures: list[YorkPicture], camera: Camera) -> Iterator[Array]:
    """Yield the scores (P, 6) of all pictures under each combination of settings."""
    for blur, contrast in product(BLURS, CONTRASTS):
        detector = LineDetector(blur=blur, contrast=contrast, edge_contrast=0.5 * contrast)
        lines = [detector.detect(picture.gray()) for picture in pictures]
        for degrees, most in product(ORTHOGONALITIES_DEG, MOST_LINES):
            estimator = VanishingPointEstimator(orthogonality=float(np.radians(degrees)), most_lines=most)
            yield per_picture(lines, pictures, camera, estimator)


def per_picture(
    lines: list[LineSegments], pictures: list[YorkPicture], camera: Camera, estimator: VanishingPointEstimator
) -> Array:
    """Return the scores of each picture by itself, (P, 6) percent; the mean over pictures is the score of all."""
    rows = []
    for found, picture in zip(lines, pictures, strict=True):
        points = estimator.estimate(found, camera)
        given = scores.best_supported(points.directions, points.weight)
        errors = scores.matched_errors_deg(picture.directions, given)
        ahead = [scores.forward_error_deg(picture.directions, given)]
        horizon = [scores.horizon_error(picture.directions, given, camera, camera)]
        rows.append(
            [scores.area_under_recall(errors, threshold) for threshold in (3.0, 5.0, 10.0)]
            + [scores.share_within(ahead, limit) for limit in (1.0, 5.0)]
            + [scores.area_under_recall(horizon, scores.HORIZON_CUT)]
        )
    return np.array(rows)


def chosen_by(of_all: Array) -> Array:
    """Return what settings are chosen by, (S, P), of the scores (S, P, 6)."""
    return np.asarray(of_all[:, :, : _AA10 + 1].mean(axis=2))


def held_out(of_all: Array, random: np.random.Generator, goal: Array | None = None) -> Array:
    """Return the scores (K,) of pictures under settings chosen without them.

    Args:
        of_all: (S, P, K) scores of each setting and picture.
        random: that divides the pictures.
        goal: (S, P) by which settings are chosen; those of York Urban if there is none.
    """
    goal = chosen_by(of_all) if goal is None else goal
    count = of_all.shape[1]
    judged = []
    for _ in range(ROUNDS):
        fold = random.permutation(count) % FOLDS
        for k in range(FOLDS):
            best = int(np.argmax(goal[:, fold != k].mean(axis=1)))
            judged.append(of_all[best, fold == k])
    return np.asarray(np.concatenate(judged).mean(axis=0))
