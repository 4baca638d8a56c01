# SPDX-License-Identifier: Apache-2.0
"""The loop over `look_at` closed in one process: round a sharp bend the head keeps the way in view."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from bench.gaze_drives import Moment, on_road, share_in_view, with_lens
from robot_vision.simulation.head import HeadSettings
from robot_vision.simulation.record import build_world
from robot_vision.simulation.world import StartPose, World

SHARP = {"curvature": 0.05, "bend": 40.0, "length": 120.0}
START_M, SECONDS = 40.0, 3.5
FIRST_S = 1.5


def in_view(world: World, moment: Moment) -> float:
    """Share of the way driven, from 3 to 15 m ahead, that is in a picture."""
    assert world.lane is not None
    along = world.lane.locate(moment.state.x, moment.state.y, moment.state.yaw).along
    return share_in_view(
        moment, np.array([world.lane.point(along + away)[:2] for away in np.arange(3.0, 15.1, 0.5)])
    )


def test_round_a_sharp_bend_the_head_keeps_the_way_in_view() -> None:
    """What a fixed camera would see is told from the places that this drive went through."""
    world = with_lens(build_world("road", 101, SHARP), 686.0)
    assert world.lane is not None
    world = replace(world, start=StartPose(*world.lane.point(START_M)[:3]))
    moments = [m for m in on_road(world, 101, HeadSettings(), SECONDS, 4.0) if m.time_s >= FIRST_S]
    turned = [in_view(world, moment) for moment in moments]
    fixed = [in_view(world, replace(moment, camera=world.camera)) for moment in moments]
    assert np.mean(turned) > np.mean(fixed) + 0.1
    lanes = [(moment.way.lane, moment.state) for moment in moments]
    known = [lane.yaw - world.lane.locate(s.x, s.y, s.yaw).yaw for lane, s in lanes if lane is not None]
    # A robot that has hardly moved yet knows its yaw to some 2 degrees (see the README's limits).
    assert len(known) >= 0.9 * len(moments)
    assert math.degrees(np.sqrt(np.mean(np.square(known)))) < 4.0
