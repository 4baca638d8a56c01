# SPDX-License-Identifier: Apache-2.0
"""Scores of the vanishing points of single pictures against true ones.

The area under the recall curve of the error up to a threshold T is the mean of max(0, 1 - e/T) (AA@T, as in
Kluger et al. 2020, "CONSAC", and Zhou et al. 2019, "NeurVPS", with a missing point at 90 degrees).
"""

from __future__ import annotations

from itertools import permutations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from robot_vision.geometry import Camera
from robot_vision.geometry.sphere import angle_between, normalised

Array = NDArray[np.float64]

MISSING_DEG = 90.0
HORIZON_CUT = 0.25  # of the picture's height: a worse horizon is no horizon
NO_HORIZON = 1.0  # of the picture's height: the error where there is none
_UPRIGHT = np.sin(np.radians(45.0))  # |y| from which a direction is called vertical


def best_supported(directions: Array, weight: Array, count: int = 3) -> Array:
    """Return the `count` (or fewer) directions of most weight, (M, 3), the heaviest first."""
    return np.asarray(directions[np.argsort(-weight, kind="stable")[:count]])


def matched_errors_deg(true: Array, found: Array) -> Array:
    """Return the angle from each true direction to the found one assigned to it.

    Args:
        true: (T, 3) unit directions without sign.
        found: (M, 3), M may be 0.

    Returns:
        (T,) degrees by the assignment of least total error; 90 where there are not enough.
    """
    cost = np.full((len(true), max(len(true), len(found))), MISSING_DEG)
    cost[:, : len(found)] = np.degrees(angle_between(true[:, None], found[None, :]))
    rows, columns = linear_sum_assignment(cost)
    errors = np.empty(len(true))
    errors[rows] = cost[rows, columns]
    return errors


def area_under_recall(errors: ArrayLike, threshold: float) -> float:
    """Return the area under the recall curve up to a threshold, percent: the mean of max(0, 1 - e/T).

    An error that is not known (nan) counts as one beyond the threshold.
    """
    known = np.nan_to_num(np.asarray(errors, np.float64), nan=np.inf)
    return 100.0 * float(np.mean(np.maximum(0.0, 1.0 - known / threshold)))


def share_within(errors: ArrayLike, limit: float) -> float:
    """Return how many errors are not beyond a limit, percent; one that is not known is."""
    return 100.0 * float(np.mean(np.asarray(errors, np.float64) <= limit))


def upright(directions: Array) -> int | None:
    """Return the index of the vertical direction, None if all are more than 45 degrees from it."""
    if not len(directions):
        return None
    steepest = int(np.argmax(np.abs(directions[:, 1])))
    return steepest if abs(directions[steepest, 1]) > _UPRIGHT else None


def horizontal(directions: Array) -> Array:
    """Return the directions without the vertical one, in their order."""
    vertical = upright(directions)
    return directions if vertical is None else np.delete(directions, vertical, axis=0)


def forward(directions: Array) -> Array | None:
    """Return the horizontal direction (3,) nearest to the optical axis, None if there is none."""
    level = horizontal(directions)
    return np.asarray(level[int(np.argmax(np.abs(level[:, 2])))]) if len(level) else None


def forward_error_deg(true: Array, found: Array) -> float:
    """Return the angle between the true forward direction and the found one; 90 where there is none."""
    wanted, got = forward(true), forward(found)
    if wanted is None or got is None:
        return MISSING_DEG
    return float(np.degrees(angle_between(wanted, got)))


def horizon_normal(directions: Array) -> Array | None:
    """Return the normal (3,) of the plane of the horizon in the optical frame.

    It is spanned by the two horizontal directions that come first; with a single one the vertical direction
    is the normal. None where the directions tell of no horizon, or of one steeper than 45 degrees.
    """
    level, vertical = horizontal(directions), upright(directions)
    normal = None
    if len(level) >= 2:
        normal = normalised(np.cross(level[0], level[1]))
    if (normal is None or abs(normal[1]) < _UPRIGHT) and vertical is not None:
        normal = directions[vertical]
    return None if normal is None or abs(normal[1]) < _UPRIGHT else np.asarray(normal)


def horizon_error(true: Array, found: Array, true_camera: Camera, camera: Camera) -> float:
    """Return the largest error of the horizon across the picture over the picture's height; 1: no horizon.

    Args:
        true: (3, 3) directions in the optical frame of `true_camera`.
        found: (M, 3) directions in that of `camera`, which has found its own focal length perhaps.
        true_camera: the camera the truth belongs to.
        camera: the camera the answer belongs to, of the same picture.
    """
    wanted, got = horizon_normal(true), horizon_normal(found)
    if wanted is None or got is None:
        return NO_HORIZON
    difference = _horizon_rows(wanted, true_camera) - _horizon_rows(got, camera)
    return float(np.abs(difference).max()) / true_camera.height


def rotation_error_deg(true: Array, found: Array) -> float:
    """Return the angle between the frame of three orthogonal directions and the one nearest to those found.

    Signs and order of the axes mean nothing: the least of all is taken. Two found directions are completed by
    their normal; with fewer the answer is 90.
    """
    if len(found) == 2:
        found = np.vstack([found, normalised(np.cross(found[0], found[1]))])
    if len(found) < 3:
        return MISSING_DEG
    u, _, vt = np.linalg.svd(found[:3])  # the nearest orthogonal matrix (polar decomposition)
    frame = u @ vt
    cosines = np.abs(true @ frame.T)
    # With the signs that make every axis agree, 1 + 2 cos(angle) is the sum of the axes' cosines
    trace = max(
        float(sum(_signed(true, frame[list(order)], cosines[range(3), list(order)])))
        for order in permutations(range(3))
    )
    return float(np.degrees(np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0))))


def seen_by(directions: Array, camera: Camera, other: Camera) -> Array:
    """Return the directions (M, 3) in which another camera of the same picture sees the same points of it."""
    if not len(directions):
        return directions
    return normalised(directions @ camera.matrix.T @ np.linalg.inv(other.matrix).T)


def _horizon_rows(normal: Array, camera: Camera) -> Array:
    """Return the image row of the horizon at the first and the last column, (2,)."""
    line = np.linalg.inv(camera.matrix).T @ normal
    columns = np.array([0.0, camera.width - 1.0])
    return np.asarray(-(line[0] * columns + line[2]) / line[1])


def _signed(true: Array, frame: Array, cosines: Array) -> Array:
    """Return the cosines between axes, their signs chosen so that no reflection is needed."""
    signs = np.sign(np.sum(true * frame, axis=1))
    signs[signs == 0.0] = 1.0
    same_hand = np.linalg.det(true) * np.linalg.det(frame * signs[:, None]) > 0.0
    signed = cosines.copy()
    if not same_hand:
        signed[int(np.argmin(signed))] *= -1.0
    return signed
