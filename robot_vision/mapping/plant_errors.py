# SPDX-License-Identifier: Apache-2.0
"""What is wrong beyond single pictures of single plants: the lean that rows tell, the robot's own place, stems."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping.plant_shift import FORWARD, LEFT, TURN, Shift

Array = NDArray[np.float64]

#: Plants stand unevenly high: the lean that rows tell is wrong by so much (rad, standard deviation) for each of the
#: camera's heights that their leaves are above the ground, and in the same way for so much of the way, m.
_UNEVEN, _SAME_ROWS_M = 0.1, 1.5
#: Standard deviation of the stem about the middle of the leaves, in radii: plants lean, and grow to the light; and of
#: large plants along the way where the crop closes, as their leaves are cut apart there.
_STEM, _CUT_APART = 0.1, 0.3


def common_lean(claimed: Array, new: float, high: float) -> Array:
    """What is wrong with the lean of the rows in picture after picture: a root (2, 2) of its covariance, rad.

    The symmetric root, so that its columns go on meaning the same from picture to picture.

    Rows that stand higher on one side, or farther ahead, look as if the body leaned.

    Args:
        claimed: (2, 2) covariance of roll and pitch as the rows tell it, rad^2.
        new: standard deviation of what is wrong in one picture only, rad.
        high: height of the leaves above the ground, as a share of the camera's.
    """
    variance, axes = np.linalg.eigh(claimed + (_UNEVEN * high) ** 2 * np.eye(2))
    return np.asarray(axes * np.sqrt(np.maximum(variance - new**2, 0.0)) @ axes.T)


def other_rows(way: float) -> float:
    """Correlation of what is wrong with the lean with that so many metres of way before."""
    return float(np.exp(-abs(way) / _SAME_ROWS_M))


def pose_noise(places: Array, shift: Shift) -> Array:
    """Covariance (N, 2, 2) that what is not known of the robot's own place gives to places (N, 2) in base_link, m^2."""
    jacobian = np.zeros((len(places), 2, 3))
    jacobian[:, :, FORWARD : LEFT + 1] = np.eye(2)
    jacobian[:, 0, TURN], jacobian[:, 1, TURN] = -places[:, 1], places[:, 0]
    pose = shift.covariance[: TURN + 1, : TURN + 1]
    return np.asarray(jacobian @ pose @ jacobian.transpose(0, 2, 1))


def stem_noise(radii: Array, cut_apart: NDArray[np.bool_]) -> Array:
    """Covariance (N, 2, 2) of stems about the middles of leaves, m^2, of plants of such radii (N,), m.

    Args:
        radii: of circles as large as the leaves, m.
        cut_apart: (N,) plants whose leaves have closed with those of their neighbours in the row.
    """
    covariance = (_STEM * radii[:, None, None]) ** 2 * np.eye(2)
    covariance[cut_apart, 0, 0] += (_CUT_APART * radii[cut_apart]) ** 2
    return np.asarray(covariance)
