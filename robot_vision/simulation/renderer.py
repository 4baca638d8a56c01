# SPDX-License-Identifier: Apache-2.0
"""Pictures of a scene without a GPU, exact enough to be the truth that perception is judged by."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera, rotation_from_rpy
from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.packing import Lamps, Surfaces, Surroundings, pack
from robot_vision.simulation.scene import Scene

SAMPLES = 16
"""Visibility samples in a pixel: an edge is placed to 1/32 px."""
NEAREST_M = 0.02
"""Depth below which nothing is drawn: inside the lens."""


def sample_places(count: int = SAMPLES) -> NDArray[np.float64]:
    """Hammersley set (count, 2) in a pixel, relative to its centre; `count` is a power of two.

    No two samples share a row or a column, and their mean is the pixel centre.
    """
    bits = count.bit_length() - 1
    index = np.arange(count)
    reversed_bits = sum(((index >> bit) & 1) << (bits - 1 - bit) for bit in range(bits))
    return np.column_stack([(reversed_bits + 0.5) / count - 0.5, (index + 0.5) / count - 0.5])


class Renderer:
    """Renders one scene through one pinhole camera.

    Args:
        scene: what there is to see.
        camera: its intrinsics; must be without distortion.
        roughness: angle in radians by which glossy surfaces smear what they mirror.

    Raises:
        SimulationError: the camera has lens distortion.
    """

    def __init__(self, scene: Scene, camera: Camera, roughness: float = 0.03) -> None:
        if not camera.is_rectified:
            raise SimulationError(
                "renderer: the camera must be without lens distortion; use camera.rectified()"
            )
        self._camera = camera
        self._roughness = roughness
        self._background = np.asarray(scene.background, np.float64)
        self._sky = np.zeros((0, 1, 3), np.float32) if scene.sky is None else scene.sky
        self._extinction = scene.extinction
        self._packed = pack(scene)
        self._inverse_matrix = np.asarray(np.linalg.inv(camera.matrix), np.float64)
        self._places = sample_places()

    def render(self, world_from_optical: NDArray[np.float64]) -> NDArray[np.float32]:
        """The picture seen from a pose.

        Args:
            world_from_optical: (4, 4) rigid transform, metres; see `optical_pose`.

        Returns:
            float32 (height, width, 3): linear blue, green, red; 1 is a white surface in full light.
        """
        from robot_vision.simulation import raster  # numba: slow to import, needed for pictures only

        packed, camera = self._packed, self._camera
        rotation, centre = world_from_optical[:3, :3], world_from_optical[:3, 3]
        seen = _into_camera(packed.vertices, rotation, centre)
        bounds = self._row_bounds(seen)
        turned = np.linalg.det(seen)
        facing = (turned < -1e-12) | (packed.both_sides & (turned > 1e-12))
        kept = np.flatnonzero(facing & (bounds[:, 0] <= bounds[:, 1]))
        middles = seen[kept, 2] + 0.5 * (seen[kept, 0] + seen[kept, 1])
        kept = kept[np.argsort(middles[:, 2], kind="stable")]  # near ones first: they hide the others
        normals = np.cross(seen[kept, 0], seen[kept, 1])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        mirrors, mirror_of = self._mirrors(
            seen[kept], normals, packed.gloss[kept], _into_camera(packed.lamps, rotation, centre)
        )
        surfaces = Surfaces(
            self._forms(seen[kept]),
            bounds[kept],
            packed.windows[kept],
            packed.textures[kept],
            packed.lights[kept],
            packed.kinds[kept],
            packed.ellipses[kept],
            packed.gloss[kept],
            normals,
            mirror_of,
        )
        picture = np.empty((camera.height, camera.width, 3), np.float32)
        raster.render(
            surfaces,
            packed.materials,
            Lamps(mirrors, packed.lamp_colours, packed.lamp_sizes, self._roughness),
            Surroundings(
                self._inverse_matrix,
                np.ascontiguousarray(rotation, np.float64),
                self._background,
                self._sky,
                self._extinction,
            ),
            self._places,
            NEAREST_M,
            picture,
        )
        return picture

    def _forms(self, seen: NDArray[np.float64]) -> NDArray[np.float64]:
        """Linear forms (..., 3, 3) of s', t', 1/depth in (u, v, 1), for rows first, second, origin."""
        return np.ascontiguousarray(np.linalg.inv(np.swapaxes(seen, -1, -2)) @ self._inverse_matrix)

    def _row_bounds(self, seen: NDArray[np.float64]) -> NDArray[np.int64]:
        """First and last image row (Q, 2) a quad can touch; the whole height if it passes the camera."""
        first, second, origin = seen[:, 0], seen[:, 1], seen[:, 2]
        corners = np.stack([origin, origin + first, origin + first + second, origin + second], axis=1)
        depth = corners[..., 2]
        pixels = corners @ self._camera.matrix.T
        pixels = pixels[..., :2] / np.maximum(depth, NEAREST_M)[..., None]
        low, high = pixels.min(axis=1), pixels.max(axis=1)
        whole = depth.min(axis=1) < NEAREST_M
        top = np.where(whole, 0, np.clip(np.floor(low[:, 1] - 1), 0, self._camera.height))
        bottom = np.where(
            whole, self._camera.height - 1, np.clip(np.ceil(high[:, 1] + 1), -1, self._camera.height - 1)
        )
        outside = ~whole & ((high[:, 0] < -1) | (low[:, 0] > self._camera.width))
        bottom[outside | (depth.max(axis=1) < NEAREST_M)] = -1
        return np.column_stack([top, bottom]).astype(np.int64)

    def _mirrors(
        self,
        seen: NDArray[np.float64],
        normals: NDArray[np.float64],
        gloss: NDArray[np.float64],
        lamps: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Forms (P, G, 3, 3) of the lamps mirrored in each glossy quad, and each quad's index P or -1."""
        glossy = np.flatnonzero(gloss > 0)
        mirror_of = np.full(len(seen), -1, np.int64)
        if len(lamps) == 0 or len(glossy) == 0:
            return np.zeros((0, 0, 3, 3)), mirror_of
        mirror_of[glossy] = np.arange(len(glossy))
        mirrors = np.zeros((len(glossy), len(lamps), 3, 3))
        for index, q in enumerate(glossy):
            normal = normals[q]
            mirrored = lamps - 2 * (lamps @ normal)[..., None] * normal
            mirrored[:, 2] += 2 * (seen[q, 2] @ normal) * normal
            regular = np.abs(np.linalg.det(mirrored)) > 1e-9
            mirrors[index, regular] = self._forms(mirrored[regular])
        return mirrors, mirror_of


def optical_pose(
    camera: Camera, x: float, y: float, yaw: float, roll: float = 0.0, pitch: float = 0.0
) -> NDArray[np.float64]:
    """Pose (4, 4) of the camera's optical frame in the world for a robot on the ground z = 0.

    Args:
        camera: gives mounting height, pitch, roll and distance ahead of base_link.
        x: robot's place in the world, metres.
        y: robot's place in the world, metres.
        yaw: robot's direction, radians, counter-clockwise from the world's x axis.
        roll: of the robot's body about its own axis, on which the camera is mounted, radians.
        pitch: of the robot's body likewise, radians, positive looks down. The body leans about the
            camera, which stays where it is.
    """
    if camera.height_m is None:
        raise SimulationError("camera: it needs a height above the floor (height_m) to see a world")
    turn = rotation_from_rpy(0.0, 0.0, yaw)
    pose = np.eye(4)
    pose[:3, :3] = rotation_from_rpy(roll, pitch, yaw) @ camera.optical_to_base
    pose[:3, 3] = np.array([x, y, 0.0]) + turn @ np.array([camera.x_m, 0.0, camera.height_m])
    return pose


def _into_camera(
    vertices: NDArray[np.float64], rotation: NDArray[np.float64], centre: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Edges and origins (Q, 3, 3) from the world into the optical frame."""
    moved = vertices.copy()
    moved[:, 2] -= centre
    return np.asarray(moved @ rotation)
