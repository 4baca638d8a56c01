# SPDX-License-Identifier: Apache-2.0
"""One vanishing point followed over time: a Kalman filter on the tangent plane of the sphere."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry.sphere import cross, local_coordinates, retract, tangent_basis
from robot_vision.perception.vanishing.points import Role

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """How directions move between pictures.

    Attributes:
        rate_memory: time constant after which a rate of turn that nobody announced is forgotten, s.
        rate_covariance: (3, 3) of that rate of turn about the axes of the optical frame, (rad/s)^2.
    """

    rate_memory: float
    rate_covariance: Array


class Track:
    """A direction with its rate of turn, both in the tangent plane where the direction stands.

    The state of the filter is (offset, rate), two components each, rad and rad/s. After every update the offset is
    walked off on the sphere and starts from zero again, so the plane is always tangent where the direction is.

    Args:
        number: id, kept for life.
        direction: (3,) unit, optical frame.
        covariance: (2, 2) rad^2 in the tangent plane.
        role: what the observation was taken for.
        agility: standard deviation of its rate of turn at first, rad/s.

    Attributes:
        seen: pictures in which it was observed.
        missed: pictures since it was last observed, the one predicted included until it is observed there.
        unseen_for: time from that picture to the one predicted, s.
    """

    def __init__(self, number: int, direction: Array, covariance: Array, role: Role, agility: float) -> None:
        from filterpy.kalman import KalmanFilter  # slow to import: it brings scipy.stats

        self.number = number
        self.direction = direction.copy()
        self.role = role
        self.weight = 0.0
        self.seen = 1
        self.missed = 0
        self.unseen_for = 0.0
        self._filter = KalmanFilter(dim_x=4, dim_z=2)
        self._filter.H = np.eye(2, 4)
        self._filter.P = np.diag([0.0, 0.0, agility**2, agility**2])
        self._filter.P[:2, :2] = covariance

    @property
    def covariance(self) -> Array:
        """(2, 2) rad^2 in the tangent plane of `direction`."""
        return np.asarray(self._filter.P[:2, :2])

    def predict(self, seconds: float, turn: Array, motion: Motion) -> None:
        """Move on in time.

        Args:
            seconds: since the last picture.
            turn: (3, 3) rotation that directions undergo in the optical frame, as odometry tells; identity when
                there is none.
            motion: how directions move besides.
        """
        kept = np.exp(-seconds / motion.rate_memory)
        swept = motion.rate_memory * (1.0 - kept)
        transition = np.diag([1.0, 1.0, kept, kept])
        transition[0, 2] = transition[1, 3] = swept
        # Turning at w moves a direction v by w x v, which along a tangent t is w . (v x t).
        lever = cross(self.direction[None], tangent_basis(self.direction))
        # A rate that forgets itself and is renewed to the same spread (Ornstein-Uhlenbeck), integrated over the step.
        renewed = (1.0 - kept**2) * (lever @ motion.rate_covariance @ lever.T)
        noise = np.empty((4, 4))
        noise[:2, :2] = seconds**2 / 3.0 * renewed
        noise[:2, 2:] = noise[2:, :2] = seconds / 2.0 * renewed
        noise[2:, 2:] = renewed
        self._filter.predict(F=transition, Q=noise)
        self._move_to(turn @ retract(self.direction, self._filter.x[:2, 0]), turn)
        self.missed += 1
        self.unseen_for += seconds

    def distance(self, direction: Array, covariance: Array) -> float:
        """Squared Mahalanobis distance (2 degrees of freedom) of an observation from the prediction."""
        offset = local_coordinates(self.direction, direction)
        return float(offset @ np.linalg.solve(self.covariance + covariance, offset))

    def update(self, direction: Array, covariance: Array, weight: float) -> None:
        """Take in an observation that belongs to this track."""
        self._filter.update(local_coordinates(self.direction, direction)[:, None], R=covariance)
        self._move_to(retract(self.direction, self._filter.x[:2, 0]), np.eye(3))
        self.weight = weight
        self.seen += 1
        self.missed = 0
        self.unseen_for = 0.0

    def _move_to(self, direction: Array, turn: Array) -> None:
        """Stand on a new place of the sphere, carrying the components of the state over into its tangent plane."""
        if direction[2] < 0.0:
            direction, turn = -direction, -turn
        whole = np.zeros((4, 4))
        whole[:2, :2] = whole[2:, 2:] = _nearest_rigid(
            tangent_basis(direction) @ turn @ tangent_basis(self.direction).T
        )
        self._filter.P = whole @ self._filter.P @ whole.T
        self._filter.x = whole @ self._filter.x
        self._filter.x[:2] = 0.0
        self.direction = direction


def _nearest_rigid(matrix: Array) -> Array:
    """The rotation (or reflection, where that is nearer) closest to a (2, 2) matrix.

    Two tangent planes differ by a hair's tilt, which makes what carries one into the other not quite rigid.
    """
    (a, b), (c, d) = matrix.tolist()
    if a * d - b * c >= 0.0:
        size = math.hypot(a + d, c - b)
        cosine, sine = (a + d) / size, (c - b) / size
        return np.array([[cosine, -sine], [sine, cosine]])
    size = math.hypot(a - d, b + c)
    cosine, sine = (a - d) / size, (b + c) / size
    return np.array([[cosine, sine], [sine, -cosine]])
