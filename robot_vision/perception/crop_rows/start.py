# SPDX-License-Identifier: Apache-2.0
"""From columns in a picture to a first guess on the ground, good enough for the fit to begin with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.perception.crop_rows.ground_fit import HEIGHT, OFFSET, ground_places, lateral
from robot_vision.perception.crop_rows.pattern import RowPattern

Array = NDArray[np.float64]

#: Lean (rad) and logarithm of the height beyond which a guess is not followed.
_MOST_LEAN, _MOST_STRETCH = 0.08, 0.25


def start_on_ground(pattern: RowPattern, camera: Camera, spacing: float) -> Array:
    """Offset, yaw, curvature, roll, pitch and logarithm of the height, (6,), as `RowsOnGround.values`.

    The vanishing point of the middle row tells yaw and pitch, its place at the last image row the offset, and the
    distance of its neighbours there the height.

    Args:
        pattern: of a picture.
        camera: rectified, with its height.
        spacing: between rows, m.
    """
    height, width = camera.height, camera.width
    last, upper = pattern.columns(height - 1.0), pattern.columns(0.5 * height)
    middle = int(np.clip(np.abs(last - 0.5 * (width - 1.0)).argmin(), 1, len(last) - 2))
    slope = (upper[middle] - last[middle]) / (0.5 * height - (height - 1.0))
    horizon = pattern.horizon if np.isfinite(pattern.horizon) else -1e4
    column = last[middle] + slope * (horizon - (height - 1.0))
    ahead = camera.optical_to_base @ camera.rays([[column, horizon]])[0]
    pitch = float(np.arctan2(ahead[2], np.hypot(ahead[0], ahead[1])))
    yaw = -float(np.arctan2(ahead[1], ahead[0]))
    values = np.array([0.0, yaw, 0.0, 0.0, np.clip(pitch, -_MOST_LEAN, _MOST_LEAN), -0.02])
    rays = camera.rays(np.column_stack([last[middle - 1 : middle + 2], np.full(3, height - 1.0)]))
    places = lateral(*ground_places(rays @ camera.optical_to_base.T, camera, values), values)[0]
    values[OFFSET] = -places[1]
    seen = max(0.5 * abs(float(places[2] - places[0])), 1e-3)
    values[HEIGHT] += float(np.clip(np.log(spacing / seen), -_MOST_STRETCH, _MOST_STRETCH))
    return values
