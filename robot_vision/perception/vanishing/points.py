# SPDX-License-Identifier: Apache-2.0
"""Vanishing points as they travel from the estimator through the tracker to everything that steers by them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera

Array = NDArray[np.float64]


class Role(IntEnum):
    """What a vanishing point means to a robot on a floor."""

    OTHER = 0
    PRIMARY = 1
    VERTICAL = 2
    HORIZONTAL = 3


@dataclass(frozen=True)
class VanishingPoints:
    """M vanishing points of one picture, the primary one first if there is any.

    Attributes:
        directions: (M, 3) unit vectors in the optical frame (x right, y down, z forward), z >= 0.
        covariance: (M, 2, 2) rad^2, in the tangent plane of each direction (`geometry.sphere.tangent_basis`).
        weight: (M,) support: lines that agree, each by the root of length times contrast (the mean line counts 1).
        roles: (M,) uint32, a `Role` each.
        ids: (M,) uint32, stable from picture to picture once tracked, 0 before.
        labels: (N,) index of the vanishing point of each line given, -1 for clutter.
        camera: the rectified camera the directions belong to; with the focal length found, when none was given.
        focal_sigma: relative standard deviation of the focal length, 0 when it was given.
    """

    directions: Array
    covariance: Array
    weight: Array
    roles: NDArray[np.uint32]
    ids: NDArray[np.uint32]
    labels: NDArray[np.intp]
    camera: Camera
    focal_sigma: float = 0.0

    @classmethod
    def none(cls, camera: Camera, lines: int = 0, focal_sigma: float = 0.0) -> VanishingPoints:
        """No vanishing point, all lines clutter: an ordinary answer."""
        return cls(
            directions=np.zeros((0, 3)),
            covariance=np.zeros((0, 2, 2)),
            weight=np.zeros(0),
            roles=np.zeros(0, np.uint32),
            ids=np.zeros(0, np.uint32),
            labels=np.full(lines, -1, np.intp),
            camera=camera,
            focal_sigma=focal_sigma,
        )

    def __len__(self) -> int:
        return len(self.directions)

    @property
    def sigma(self) -> Array:
        """(M,) standard deviation of each direction in its worse tangent direction, rad."""
        if not len(self):
            return np.zeros(0)
        return np.asarray(np.sqrt(np.linalg.eigvalsh(self.covariance)[:, -1]))

    @property
    def pixels(self) -> Array:
        """(M, 2) places in the rectified picture, px; +-inf for a vanishing point at infinity."""
        camera = self.camera
        depth = self.directions[:, 2]
        far = depth < 1e-9
        safe = np.where(far, 1.0, depth)
        places = np.stack(
            [
                camera.cx + camera.fx * self.directions[:, 0] / safe,
                camera.cy + camera.fy * self.directions[:, 1] / safe,
            ],
            axis=1,
        )
        # Towards infinity only the signs are left; a zero component stays at the principal point.
        endless = np.where(
            np.abs(self.directions[:, :2]) > 1e-12,
            np.copysign(np.inf, self.directions[:, :2]),
            [camera.cx, camera.cy],
        )
        return np.where(far[:, None], endless, places)

    def of(self, role: Role) -> int | None:
        """Index of the first vanishing point with a role, None when there is none."""
        found = np.flatnonzero(self.roles == role)
        return int(found[0]) if len(found) else None
