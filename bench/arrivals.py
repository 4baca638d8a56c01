# SPDX-License-Identifier: Apache-2.0
"""What a probe heard of a drive, and what it tells of latency, of losses, and of where the time went."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
PERCENTILES = (50, 95, 99, 100)
PROCESSING = "last processing ms"
SKIPPED, LOST = "skipped", "lost"


@dataclass(frozen=True)
class Heard:
    """Everything a probe heard.

    Attributes:
        topics: by topic, (N, 3) int64 ns: stamp of the picture, when the message was sent, when it was heard.
        counts: by node, the last values of its diagnostics that are numbers.
        processing_ms: by node, what its diagnostics said of single answers; a sample each second.
    """

    topics: Mapping[str, NDArray[np.int64]]
    counts: Mapping[str, Mapping[str, float]]
    processing_ms: Mapping[str, Sequence[float]]


def read_heard(path: Path) -> Heard:
    """Read what `bench.probe` wrote."""
    said = json.loads(path.read_text(encoding="utf-8"))
    return Heard(
        {topic: np.array(rows, np.int64).reshape(-1, 3) for topic, rows in said["topics"].items()},
        {node: values[-1] for node, values in said["diagnostics"].items()},
        {
            node: [each[PROCESSING] for each in values if each.get(PROCESSING, 0.0) > 0.0]
            for node, values in said["diagnostics"].items()
        },
    )


def first_of_each(rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the first message (N, 3) about each picture: a command to stand still repeats the last stamp."""
    return np.asarray(rows[np.sort(np.unique(rows[:, 0], return_index=True)[1])])


def latencies_ms(rows: NDArray[np.int64]) -> Array:
    """Return (N,) ms from the stamp of each picture to the arrival of the answer to it."""
    first = first_of_each(rows)
    return np.asarray(1e-6 * (first[:, 2] - first[:, 0]))


def percentiles(values: Array) -> list[float]:
    """Return p50, p95, p99 and the maximum; nan of nothing."""
    if not values.size:
        return [math.nan] * len(PERCENTILES)
    return [float(value) for value in np.percentile(values, PERCENTILES)]


def stage_ms(earlier: NDArray[np.int64] | None, later: NDArray[np.int64]) -> Array:
    """Return (N,) ms between the sending of two answers to the same picture.

    Args:
        earlier: (N, 3) as in `Heard.topics`; None: from the stamp of the picture.
        later: (N, 3).
    """
    last = first_of_each(later)
    if earlier is None:
        return np.asarray(1e-6 * (last[:, 1] - last[:, 0]))
    first = first_of_each(earlier)
    _, here, there = np.intersect1d(first[:, 0], last[:, 0], return_indices=True)
    return np.asarray(1e-6 * (last[there, 1] - first[here, 1]))


def median(values: Sequence[float] | NDArray[np.floating[Any]]) -> float:
    """Return the median, nan of nothing."""
    return float(np.median(values)) if len(values) else math.nan
