# SPDX-License-Identifier: Apache-2.0
"""Every plane has a vanishing line, which its orientation and the camera alone decide."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from robot_vision.geometry.arrays import FloatArray
from robot_vision.geometry.camera import Camera


def vanishing_line(camera: Camera, normal: ArrayLike) -> FloatArray:
    """Give the vanishing line (a, b, c) of all planes with this normal: a u + b v + c = 0, rectified pixels.

    It holds the pixels whose rays are at right angles to the normal: l = K⁻ᵀ n. a u + b v + c is the distance
    (px) of a pixel from it, positive on the side the normal points to, so that a plane whose normal points to
    the camera's side is seen where it is negative. A plane parallel to the picture has its vanishing line at
    infinity: (0, 0, ±1).

    Args:
        camera: its rectified picture counts.
        normal: (3,) of any length, optical frame.

    Raises:
        ValueError: when the normal is zero or not finite.
    """
    n = np.asarray(normal, dtype=np.float64)
    length = float(np.linalg.norm(n)) if n.shape == (3,) else float("nan")
    if not (np.isfinite(length) and length > 1e-12):
        raise ValueError(f"normal must be three finite numbers, not all zero, got {n.tolist()}")
    line = np.asarray(np.linalg.solve(camera.rectified().matrix.T, n / length), dtype=np.float64)
    slope = float(np.hypot(line[0], line[1]))
    if slope * camera.width < 1e-12 * abs(line[2]):
        return np.array([0.0, 0.0, float(np.sign(line[2]))])
    return np.asarray(line / slope)
