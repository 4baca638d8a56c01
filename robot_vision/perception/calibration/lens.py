# SPDX-License-Identifier: Apache-2.0
"""A lens goes with its focal length: one cannot be changed without the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robot_vision.geometry import Camera

#: Power of the radius by which each coefficient is multiplied; the tangential ones go with one power less.
_POWERS = {
    "plumb_bob": (2, 4, 1, 1, 6),
    "rational_polynomial": (2, 4, 1, 1, 6, 2, 4, 6),
}


def with_focal_length(camera: Camera, ratio: float) -> Camera | None:
    """The camera whose raw and rectified pictures belong together as before, with another focal length.

    x' = x (1 + k1 r^2 + ...) in units of the focal length; in units of one `ratio` times as long x is smaller by
    that, and each coefficient has to grow by the power of r it goes with.

    Returns:
        None where the lens model (or a rectifying rotation) allows no such change.
    """
    if camera.rectification is not None or camera.distortion and camera.distortion_model not in _POWERS:
        return None
    powers = _POWERS.get(camera.distortion_model, ())
    coefficients = [value * ratio**power for value, power in zip(camera.distortion, powers, strict=False)]
    projection = None
    if camera.projection is not None:
        projection = np.array(camera.projection)
        projection[[0, 1], [0, 1]] *= ratio
    return replace(
        camera,
        fx=camera.fx * ratio,
        fy=camera.fy * ratio,
        distortion=tuple(coefficients),
        projection=projection,
        focal_known=True,
    )
