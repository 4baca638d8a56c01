# SPDX-License-Identifier: Apache-2.0
"""The loop over `look_at` closed in one process: round a sharp bend the head keeps the way in view."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from bench.gaze import score
from bench.gaze_drives import on_road, with_lens
from robot_vision.simulation.head import HeadSettings
from robot_vision.simulation.record import build_world

SHARP = {"curvature": 0.05, "bend": 40.0, "length": 60.0}


def test_through_a_narrow_lens_the_head_sees_round_the_bend_that_a_fixed_camera_does_not() -> None:
    """What a fixed camera would see is told from the places that this drive went through."""
    world = with_lens(build_world("road", 101, SHARP), 920.0)
    moments = list(on_road(world, 101, HeadSettings(), 5.2, 5.0))
    turned = score(world, moments)
    fixed = score(world, [replace(moment, camera=world.camera) for moment in moments])
    assert np.abs(turned.pan).max() > math.radians(5.0)
    assert turned.in_view.mean() > fixed.in_view.mean() + 0.2
    assert np.isfinite(turned.yaw).mean() > 0.6
    assert math.degrees(np.sqrt(np.nanmean(turned.yaw**2))) < 1.0
