# SPDX-License-Identifier: Apache-2.0
"""The way ahead is told by the floor: the primary vanishing point refitted with most say to lines below the horizon.

Kerbs, skirtings and joints are laid along the way; a roof or the next house may stand at a slight angle to it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from robot_vision.perception.segments import LineSegments
from robot_vision.perception.vanishing.bundle import Bundle
from robot_vision.perception.vanishing.points import Role, VanishingPoints
from robot_vision.perception.vanishing.refit import refit_each

Array = NDArray[np.float64]

#: Weight of a line below the horizon, relative to one above.
_FLOOR_WEIGHT = 4.0
#: How far below the horizon a line's middle must lie, as the sine of the angle.
_BELOW = 0.02
#: Spring to where all lines together saw it, rad.
_SPRING = np.deg2rad(3.0)


def led_by_the_floor(points: VanishingPoints, lines: LineSegments) -> VanishingPoints:
    """The same vanishing points, the primary one drawn to its lines on the floor.

    Args:
        points: with a label for each line.
        lines: the segments they were found in.
    """
    primary = points.of(Role.PRIMARY)
    if primary is None:
        return points
    mine = points.labels == primary
    bundle = Bundle.of(lines[mine], points.camera, int(mine.sum()))
    rays = np.column_stack([bundle.middles, np.ones(len(bundle))])
    below = rays @ points.camera.optical_to_base[2] < -_BELOW * np.linalg.norm(rays, axis=1)
    if not below.any():
        return points
    weight = bundle.weight * np.where(below, _FLOOR_WEIGHT, 1.0)
    # Weights say whom to believe, not how many lines there are: their sum stays what it was.
    weight *= bundle.weight.sum() / weight.sum()
    refitted, sure = refit_each(replace(bundle, weight=weight), points.directions[[primary]], _SPRING)
    directions, covariance = points.directions.copy(), points.covariance.copy()
    directions[primary] = refitted[0]
    covariance[primary] = sure[0]
    return replace(points, directions=directions, covariance=covariance)
