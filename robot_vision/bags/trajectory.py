# SPDX-License-Identifier: Apache-2.0
"""Turns the camera's way through the world into the odometry of the robot that carries it."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robot_vision.bags.errors import BagError
from robot_vision.geometry import BODY_FROM_OPTICAL, Camera

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]
_NOT_A_ROTATION = 1e-2  # largest departure of R R^T from the identity; KITTI's six digits give 1e-6


@dataclass(frozen=True)
class Trajectory:
    """Poses of base_link in odom and its twists.

    Attributes:
        positions: (N, 3) m in odom.
        quaternions: (N, 4) x y z w, odom from base_link.
        linear: (N, 3) m/s in base_link.
        angular: (N, 3) rad/s in base_link.
    """

    positions: Floats
    quaternions: Floats
    linear: Floats
    angular: Floats

    def __len__(self) -> int:
        return len(self.positions)


def read_poses(path: str | os.PathLike[str]) -> Floats:
    """Read a KITTI `poses.txt`: 12 numbers a line, the 3x4 matrix world from camera (z forward, m).

    Returns:
        (N, 4, 4) homogeneous matrices.

    Raises:
        BagError: missing, or a line that is no pose; the text names the line.
    """
    path = Path(path)
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is no text"
        raise BagError(f"poses {path} cannot be read: {reason}") from error
    poses = []
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            values = np.array([float(word) for word in line.split()])
        except ValueError as error:
            raise BagError(f"poses {path}, line {number}: {error}") from error
        if values.size != 12 or not np.all(np.isfinite(values)):
            raise BagError(f"poses {path}, line {number}: a pose is 12 finite numbers, not {values.size}")
        pose = np.vstack([values.reshape(3, 4), (0.0, 0.0, 0.0, 1.0)])
        turn = pose[:3, :3]
        if np.abs(turn @ turn.T - np.eye(3)).max() > _NOT_A_ROTATION or np.linalg.det(turn) < 0:
            raise BagError(f"poses {path}, line {number}: the first three columns are not a rotation")
        poses.append(pose)
    if not poses:
        raise BagError(f"poses {path} holds no pose")
    return np.array(poses)


def odometry_from_camera(camera_poses: Floats, rate_hz: float, camera: Camera | None = None) -> Trajectory:
    """Convert camera poses to odometry of base_link.

    With C the pose of the camera in base_link (its rotation `camera.optical_to_base`, its centre at
    (x, 0, height); without these the bare change of axes optical -> body at the origin) and W_i the pose of
    the camera in the world, base_link in odom is O_i = C W_0^-1 W_i C^-1: odom is base_link at the first
    picture.

    The twist is the mean of the motions from the picture before and to the picture after, each taken as a
    constant turn about its rotation vector with the translation seen from halfway.

    Args:
        camera_poses: (N, 4, 4) world from camera, m.
        rate_hz: pictures a second.
        camera: gives its place on the robot.
    """
    from scipy.spatial.transform import Rotation  # slow to import

    base_from_camera = np.eye(4)
    base_from_camera[:3, :3] = BODY_FROM_OPTICAL
    if camera is not None:
        base_from_camera[:3, :3] = camera.optical_to_base
        base_from_camera[:3, 3] = camera.x_m, 0.0, camera.height_m or 0.0
    start = np.linalg.inv(camera_poses[0])
    base = base_from_camera @ start @ camera_poses @ np.linalg.inv(base_from_camera)
    turns = Rotation.from_matrix(base[:, :3, :3])
    linear, angular = _twists(base[:, :3, 3], turns, rate_hz)
    quaternions = turns.as_quat()
    quaternions *= np.where(quaternions[:, 3:] < 0, -1.0, 1.0)
    return Trajectory(np.array(base[:, :3, 3]), quaternions, linear, angular)


def _twists(positions: Floats, turns: Rotation, rate_hz: float) -> tuple[Floats, Floats]:
    from scipy.spatial.transform import Rotation

    count = len(positions)
    if count < 2:
        return np.zeros((count, 3)), np.zeros((count, 3))
    turned = (turns[:-1].inv() * turns[1:]).as_rotvec()
    halfway = turns[:-1] * Rotation.from_rotvec(turned / 2)
    moved = halfway.inv().apply(np.diff(positions, axis=0))
    return _mean_of_neighbours(moved * rate_hz), _mean_of_neighbours(turned * rate_hz)


def _mean_of_neighbours(steps: Floats) -> Floats:
    return (np.vstack([steps[:1], steps]) + np.vstack([steps, steps[-1:]])) / 2
