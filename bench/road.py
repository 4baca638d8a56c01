# SPDX-License-Identifier: Apache-2.0
"""Winding roads: heading and curvature on the recorded one, and the graph that drives 500 m of bends by itself."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.closed_loop import drive
from bench.replay import LINES, PICTURES, STEERING, VANISHING, said
from bench.report import Cell, Row, Table, at_least, at_most
from bench.sources import ROOT
from robot_vision.bags import HeadingScore, decode, score_heading
from robot_vision.bags.messages import stamp_ns
from robot_vision.geometry.rotation import quaternion_to_rotation, rpy_from_rotation
from robot_vision.ros.replays import replay
from robot_vision.simulation.lane import PolyLane
from robot_vision.simulation.road import RoadSettings, winding

ROAD, SEED = ROOT / "bags" / "road.mcap", 1
HEIGHT, PITCH = 1.3, 0.0524
SEEDS, QUICK_SEEDS = range(11, 21), range(11, 12)
WAY_M, SPEED = 500.0, 8.0
ROBOT_M = 1.5
QUICK_S = 6.0
NEAR_M = 2.0


def run(quick: bool) -> list[Table]:
    """Measure, the first seconds and one drive when it is to be quick.

    Raises:
        ProcessError: a node failed.
    """
    return [recorded(QUICK_S if quick else 0.0), driven(QUICK_SEEDS if quick else SEEDS)]


def recorded(duration_s: float) -> Table:
    """Replay the recorded road through the real nodes."""
    settings: dict[str, dict[str, Any]] = {
        LINES: {"transport": "compressed"},
        VANISHING: {"camera.height": HEIGHT, "camera.pitch": PITCH},
    }
    with tempfile.TemporaryDirectory(prefix="robot_vision-") as scratch:
        answers = Path(scratch) / "answers.mcap"
        nodes = [LINES, VANISHING, STEERING]
        replay(ROAD, answers, nodes, "vanishing_points", settings, duration_s, exclude=PICTURES)
        heading, bends = score_heading(answers), curvatures(answers)
    errors = bends[:, 0] - bends[:, 1]
    return _recorded_table(heading, float(np.sqrt(np.mean(errors**2))), float(np.ptp(bends[:, 1])))


def curvatures(bag: Path) -> NDArray[np.float64]:
    """Curvature (1/m) of each `path_ahead` beside the robot, and the true one: (N, 2)."""
    truth = true_curvatures(bag)
    found = []
    for cdr in said(bag, "path_ahead"):
        message = decode(cdr, "nav_msgs/msg/Path")
        points = np.array([(pose.pose.position.x, pose.pose.position.y) for pose in message.poses])
        found.append((curvature_at_start(points), truth[stamp_ns(message)]))
    return np.array(found)


def true_curvatures(bag: Path) -> dict[int, float]:
    """Curvature (1/m) of the road beside the robot, by stamp (ns)."""
    lane = PolyLane(winding(RoadSettings(), SEED), RoadSettings().width)
    truth = {}
    for cdr in said(bag, "truth/odom"):
        message = decode(cdr, "nav_msgs/msg/Odometry")
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        yaw = rpy_from_rotation(quaternion_to_rotation((turn.x, turn.y, turn.z, turn.w)))[2]
        truth[stamp_ns(message)] = lane.locate(place.x, place.y, yaw).curvature
    return truth


def curvature_at_start(points: NDArray[np.float64]) -> float:
    """Slope of the direction over the way at the first of points 0.5 m apart, by a parabola through the directions."""
    ways = np.diff(points, axis=0)
    lengths = np.hypot(ways[:, 0], ways[:, 1])
    near = np.cumsum(lengths) - 0.5 * lengths <= NEAR_M
    along = (np.cumsum(lengths) - 0.5 * lengths)[near]
    directions = np.unwrap(np.arctan2(ways[:, 1], ways[:, 0]))[near]
    return float(np.polyfit(along, directions, 2)[1])


def driven(seeds: range) -> Table:
    """Let the real nodes drive 500 m of bends in lockstep, from the right side of the road into its middle."""
    nodes = {
        LINES: {},
        VANISHING: {"camera.height": HEIGHT, "camera.pitch": PITCH, "path_length": 30.0},
        STEERING: {"speed": SPEED, "lookahead": 4.0, "most_acceleration": 1.0},
    }
    how: dict[str, Any] = {
        "world": "road",
        "settings": [f"length={WAY_M + 40:g}"],
        "vehicle": "ackermann",
        "start.offset": 0.0,
        "start.yaw": 0.0,
        "lean": math.radians(0.3),
        "width": ROBOT_M,
        "rate": 10,
        "settling": 20.0,
        "lockstep_timeout": 1.0,
    }
    drives = [drive(seed, nodes, **how) for seed in seeds]
    half = 0.5 * (RoadSettings().width - ROBOT_M)
    worst = max(math.inf if one["offset_worst_m"] is None else float(one["offset_worst_m"]) for one in drives)
    rows = [
        Row("driven, shortest", "m", [Cell(min(float(one["way_m"]) for one in drives), at_least(WAY_M))]),
        Row("contacts, all drives", "", [Cell(sum(int(one["contacts"]) for one in drives), at_most(0.0))], 0),
        Row("offset after 20 m, greatest of all", "m", [Cell(worst, at_most(half))], 2),
    ]
    title = f"Closed loop on the road: {len(drives)} drives of {WAY_M:g} m at {SPEED:g} m/s, in lockstep"
    note = f"a robot {ROBOT_M:g} m wide leaves the asphalt at an offset of {half:g} m"
    return Table(title, ["through the nodes"], rows, [note])


def _recorded_table(heading: HeadingScore, bend_rms: float, spread: float) -> Table:
    share = 100.0 * bend_rms / spread
    rows = [
        Row("heading error, RMS", "deg", [Cell(heading.yaw_rms_deg, at_most(0.5))], 3),
        Row("curvature error, RMS, of its range", "%", [Cell(share, at_most(10.0))], 1),
        Row("offset error, RMS", "mm", [Cell(1e3 * heading.offset.rms)], 1),
        Row("pictures with a heading", "%", [Cell(100.0 * heading.answers / heading.truths)], 1),
    ]
    title = f"Recorded road: {heading.truths} pictures, in lockstep through the nodes"
    return Table(title, ["through the nodes"], rows)
