# SPDX-License-Identifier: Apache-2.0
"""How far points of a real road move over the plan from picture to picture, against how far the car moved."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bench.report import Cell, Row, Table, at_most
from bench.sources import kitti_straight, read_picture
from robot_vision.bags.trajectory import read_poses
from robot_vision.geometry import BODY_FROM_OPTICAL, Camera, rpy_from_rotation
from robot_vision.mapping import PlanViewMapper, Pose
from robot_vision.perception import HeadingEstimator, LineDetector

HEIGHT_M, SECONDS = 1.63, 0.1
NEAR, FAR = (5.0, 12.0), (12.0, 20.0)
_ROAD_HALF_WIDTH_M = 3.0
#: Noise of the odometry made of the poses: share of the way, yaw and pitch (rad) a picture.
_WAY, _YAW, _PITCH = 0.01, 0.002, 0.0005


def road_table() -> Table:
    """Measure.

    Raises:
        MissingSetError: the pictures are not there.
    """
    errors = _errors()
    rows = []
    for name, (low, high), mark in (("5 to 12 m", NEAR, 3.5), ("12 to 20 m", FAR, 7.0)):
        part = np.abs(errors[(errors[:, 0] > low) & (errors[:, 0] < high), 1])
        value = 100.0 * float(np.median(part)) if len(part) else float("nan")
        rows.append(Row(f"road {name} away, error of its way, median", "%", [Cell(value, at_most(mark))], 2))
    note = "camera 1.63 m up, no pitch given, causal; odometry of the poses with noise of 1 % and 0.03 degrees of pitch"
    warning = (
        "filter settings were chosen on this drive; the lean between two pictures is held to that odometry"
    )
    title = "KITTI, straight road: way of road points over the plan"
    return Table(title, ["off by"], rows, [note, warning])


def _errors() -> NDArray[np.float64]:
    """Distance (m) of road points and the relative error of their way over the plan, (N, 2)."""
    folder = kitti_straight()
    poses = read_poses(folder / "poses.txt")
    numbers = np.array(
        (folder / "calib.txt").read_text(encoding="utf-8").splitlines()[0].split()[-12:], float
    )
    projection = numbers.reshape(3, 4)
    random = np.random.default_rng(0)
    mapper, detector, estimator = PlanViewMapper(reach=40.0, trusted=0.5), LineDetector(), HeadingEstimator()
    place, found = Pose(0.0, 0.0, 0.0), []
    body = [
        (BODY_FROM_OPTICAL @ p[:3, :3] @ BODY_FROM_OPTICAL.T, BODY_FROM_OPTICAL @ p[:3, 3]) for p in poses
    ]
    for number, file in enumerate(sorted((folder / "image_l").iterdir())):
        picture = read_picture(file, 0)
        height, width = picture.shape
        focal, cx, cy = projection[0, 0], projection[0, 2], projection[1, 2]
        camera = Camera(focal, focal, cx, cy, width, height, height_m=HEIGHT_M)
        way = yaw = 0.0
        rate = None
        if number:
            (before, start), (now, end) = body[number - 1 : number + 1]
            _, pitch, yaw = rpy_from_rotation(before.T @ now)
            way = float(np.linalg.norm(end - start))
            told, turned = way * (1 + random.normal(0, _WAY)), yaw + random.normal(0, _YAW)
            rate = (pitch + random.normal(0, _PITCH)) / SECONDS
            middle = place.yaw + turned / 2
            place = Pose(place.x + told * np.cos(middle), place.y + told * np.sin(middle), place.yaw + turned)
        lines = detector.detect(picture)
        points = estimator.update(lines, camera, SECONDS * number).vanishing_points
        estimate = mapper.update(picture, lines, points, camera, SECONDS * number, place, rate)
        if estimate.layers is None or estimate.layers.parallax is None:
            continue
        seen, view = estimate.layers.parallax, estimate.layers.view
        x, y = view.ground(seen.points[:, 0], seen.points[:, 1])
        truth = np.hypot(np.cos(yaw) * x - np.sin(yaw) * y + way - x, np.sin(yaw) * x + np.cos(yaw) * y - y)
        error = np.hypot(*seen.moved.T) / truth - 1.0
        road = np.abs(y) < _ROAD_HALF_WIDTH_M
        found.append(np.column_stack([x, error])[road])
    return np.concatenate(found)
