# SPDX-License-Identifier: Apache-2.0
"""Which plant of a picture is which: gates by what is unsure of both, and the assignment of least cost."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping.plant_shift import FORWARD, LEFT, PITCH, ROLL, TURN, Shift
from robot_vision.mapping.plant_tracks import PlantTracks
from robot_vision.perception.crop_rows.ground_window import GroundWindow
from robot_vision.perception.crop_rows.plant_blobs import Blobs

Array = NDArray[np.float64]
Rows = NDArray[np.intp]

#: Standard deviation by which two pictures of one plant differ in the logarithm of its area.
_AREA_SIGMA = 0.6
#: The same of the share of it that has another colour than the crop.
_FOREIGN_SIGMA = 0.5
#: How far from all that is seen a plant may be expected and yet be among it, m.
_BEYOND = 0.3
#: Share of the ground about a plant's place below which it is bare.
_BARE = 0.15
#: Cost of what must not be matched.
_NEVER = 1e6


def matched(
    tracks: PlantTracks,
    expected: Array,
    spread: Array,
    seen: Array,
    noise: Array,
    blobs: Blobs,
    gate: float,
) -> tuple[Rows, Rows]:
    """Which plant (M,) is which blob (M,): the assignment that costs least.

    Args:
        tracks: (N,) plants that are known.
        expected: (N, 2) where they should appear on the ground, ahead and left of the camera, m.
        spread: (N, 2, 2) covariance of that.
        seen: (K, 2) where blobs do.
        noise: (K, 2, 2) covariance of that.
        blobs: (K,) of the picture.
        gate: cost beyond which a plant and a blob are not the same.
    """
    from scipy.optimize import linear_sum_assignment  # slow to import

    if not len(tracks) or not len(blobs):
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    # what lies behind or aside of all that is seen is none of it
    low, high = seen.min(axis=0) - _BEYOND, seen.max(axis=0) + _BEYOND
    near = np.flatnonzero(((expected > low) & (expected < high)).all(axis=1))
    away = seen[None, :, :] - expected[near, None, :]
    total = spread[near, None] + noise[None, :]
    a, b, d = total[..., 0, 0], total[..., 0, 1], total[..., 1, 1]
    x, y = away[..., 0], away[..., 1]
    cost = (d * x * x - 2.0 * b * x * y + a * y * y) / (a * d - b * b)
    size = np.log(blobs.areas)[None, :] - (tracks.log_areas - 2.0 * tracks.states[:, 2])[near, None]
    cost = cost + np.where(blobs.whole[None, :], (size / _AREA_SIGMA) ** 2, 2.0)
    cost = cost + ((blobs.foreign[None, :] - tracks.foreign[near, None]) / _FOREIGN_SIGMA) ** 2
    cost[cost > gate] = _NEVER
    mine, theirs = linear_sum_assignment(cost)
    good = cost[mine, theirs] < _NEVER
    return near[mine[good]], theirs[good]


def blob_noise(blobs: Blobs, height: float, noise: tuple[float, float]) -> Array:
    """Covariance (N, 2, 2) of the middles of blobs on the ground, m^2: along the sight it is the larger."""
    reach = height * np.linalg.norm(blobs.slopes, axis=1)
    ahead = blobs.slopes / np.maximum(np.linalg.norm(blobs.slopes, axis=1), 1e-9)[:, None]
    near, by_distance = noise
    radius = np.sqrt(blobs.areas / np.pi)
    across = near + by_distance * np.hypot(reach, height) / 2 + 0.06 * radius
    along = across * np.hypot(reach, height) / height
    out = ahead[:, :, None] * ahead[:, None, :]
    return np.asarray(across[:, None, None] ** 2 * np.eye(2) + (along**2 - across**2)[:, None, None] * out)


def shift_noise(blobs: Blobs, shift: Shift, height: float, camera_x: float) -> Array:
    """Covariance (N, 2, 2) that what is not known of the shift gives to what is seen, m^2."""
    a, b = blobs.slopes.T
    jacobian = np.zeros((len(blobs), 2, 6))
    jacobian[:, :, FORWARD : LEFT + 1] = np.eye(2)
    jacobian[:, 0, TURN], jacobian[:, 1, TURN] = -height * b, height * a + camera_x
    jacobian[:, 0, ROLL], jacobian[:, 1, ROLL] = height * a * b, height * (1.0 + b * b)
    jacobian[:, 0, PITCH], jacobian[:, 1, PITCH] = -height * (1.0 + a * a), -height * a * b
    return np.asarray(jacobian @ shift.covariance @ jacobian.transpose(0, 2, 1))


def look_for(tracks: PlantTracks, alone: NDArray[np.bool_], places: Array, window: GroundWindow) -> None:
    """Note of plants without a blob whether their ground is bare, or hidden by other leaves.

    Args:
        tracks: (N,) plants that are known.
        alone: (N,) which of them have no blob.
        places: (N, 2) where they should appear in the window's plane, ahead and left of base_link, m.
        window: the ground.
    """
    index, inside = window.at(places)
    looked = np.flatnonzero(alone & inside)
    if not len(looked):
        return
    reach = np.arange(-1, 2) * max(int(0.006 / window.side), 1)
    shape = window.cells.shape
    rows = np.clip(index[looked, 0, None, None] + reach[None, :, None], 0, shape[0] - 1)
    columns = np.clip(index[looked, 1, None, None] + reach[None, None, :], 0, shape[1] - 1)
    bare = (window.cells[rows, columns] > 0).mean(axis=(1, 2)) < _BARE
    tracks.missed[looked[bare]] += 1
    tracks.hidden[looked[~bare]] += 1
