# SPDX-License-Identifier: Apache-2.0
"""Pictures of inspection plates from somewhere before them, with the truth, to judge those who find centres."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.simulation.plate import PlateSettings, plate
from robot_vision.simulation.renderer import Renderer, optical_pose
from robot_vision.simulation.sensors import CameraSensor


@dataclass(frozen=True)
class PlateView:
    """A picture of a plate, and what is true in it.

    Attributes:
        picture: BGR uint8 (H, W, 3).
        camera: that took it.
        centres: (N, 2) px, where the centres of the holes appear.
        normal: (3,) unit, optical frame, of the plate towards the camera.
    """

    picture: NDArray[np.uint8]
    camera: Camera
    centres: NDArray[np.float64]
    normal: NDArray[np.float64]

    @property
    def gray(self) -> NDArray[np.uint8]:
        """(H, W) uint8."""
        return np.asarray(cv2.cvtColor(self.picture, cv2.COLOR_BGR2GRAY), np.uint8)

    def errors(self, centres: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance (N,) of each hole's centre from the nearest of these (M, 2), px."""
        return np.asarray(np.linalg.norm(self.centres[:, None] - centres[None], axis=2).min(axis=1))


def plate_view(seed: int) -> PlateView:
    """A plate of another slant, lean and drilling for each seed, seen with a camera's blur, noise and grey levels."""
    random = np.random.default_rng((seed, 7))
    shape = PlateSettings(slant=random.uniform(-0.9, 0.9), lean=random.uniform(0.0, 0.9))
    world = plate(shape, seed)
    x, y, yaw = random.uniform(1.85, 2.15), random.uniform(-0.1, 0.1), random.uniform(-0.06, 0.06)
    pose = optical_pose(world.camera, x, y, yaw, 0.01, random.uniform(-0.02, 0.02))
    picture = CameraSensor(seed).capture(Renderer(world.scene, world.camera).render(pose))
    centres = world.camera.pixels((world.plate.centres - pose[:3, 3]) @ pose[:3, :3])
    return PlateView(picture, world.camera, centres, pose[:3, :3].T @ world.plate.normal)
