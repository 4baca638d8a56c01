# SPDX-License-Identifier: Apache-2.0
"""The loop closed through the real nodes: camera to steering to camera, one seed of those `bench` drives."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from bench.closed_loop import drive, drive_at_box, room_before_box  # noqa: E402  (the benchmarks are not installed)


def test_the_graph_keeps_to_the_middle_of_a_corridor() -> None:
    """From 0.4 m and 10 degrees off, 2 m wide, 1 m/s, body leaning by up to a degree, five pictures a second."""
    driven = drive(seed=4, rate=5)
    assert driven["ended"] == "lane"
    assert driven["way_m"] >= 30.0
    assert driven["contacts"] == 0, driven
    assert driven["offset_rms_m"] <= 0.030
    assert driven["without_steering"] == 0


def test_the_graph_comes_to_rest_before_a_box_in_the_way() -> None:
    driven = drive_at_box(seed=1)
    assert driven["contacts"] == 0, driven
    assert 0.3 <= room_before_box(driven) <= 1.5, driven
