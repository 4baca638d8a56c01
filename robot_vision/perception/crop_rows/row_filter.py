# SPDX-License-Identifier: Apache-2.0
"""Carries offset, yaw and curvature from picture to picture, through gaps, and keeps to one row (20.10).

Successive pictures show the same plants, so their errors are alike: a plant that grew to the left pulls to the left
until it is out of view. The filter therefore knows two kinds of error: one that is new in each picture, and one that
is carried along and forgotten with the way gone (a first-order Gauss-Markov process). Without it a covariance
promises after ten pictures what only ten fields could hold.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from filterpy.kalman import KalmanFilter

Array = NDArray[np.float64]

OFFSET, YAW, CURVATURE, TURNED = range(4)
_COMMON = slice(4, 7)
_SIZE = 7


@dataclass(frozen=True)
class Motion:
    """How the robot moved between two pictures, as far as odometry tells.

    Attributes:
        seconds: between them.
        speed: mean, m/s; None when unknown.
        turn_rate: mean, rad/s counter-clockwise; None when unknown.
    """

    seconds: float
    speed: float | None = None
    turn_rate: float | None = None


@dataclass
class RowFilter:
    """A Kalman filter on (offset, yaw, curvature, turn of the camera) and the error common to successive pictures.

    Args:
        shared: share of a picture's variance that successive pictures have in common.
        view: way after which that part is forgotten, m.
        sidestep: standard deviation of what the robot slips to the side, m per square root of m.
        turn: standard deviation of what odometry misses of a turn, rad per square root of m.
        bend: standard deviation by which the curvature changes, 1/m per square root of m.
        turned: standard deviation of the camera's yaw about its mounting, rad; 0: it is known.
        gate: squared Mahalanobis distance (3 degrees of freedom) beyond which a picture is not believed.

    Raises:
        ValueError: naming the setting that makes no sense.
    """

    shared: float = 0.8
    view: float = 1.2
    sidestep: float = 0.0025
    turn: float = 0.003
    bend: float = 0.0003
    turned: float = float(np.deg2rad(0.3))
    gate: float = 21.0
    _filter: KalmanFilter | None = field(default=None, init=False, repr=False, compare=False)
    _common_gain: float = field(default=0.0, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not 0.0 <= self.shared < 1.0:
            raise ValueError(f"shared must lie in [0, 1), not {self.shared}")
        for name in ("view", "sidestep", "turn", "bend", "gate"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise ValueError(f"{name} must be a positive number, not {getattr(self, name)}")
        if not 0.0 <= self.turned < 1.0:
            raise ValueError(f"turned must lie in [0, 1) rad, not {self.turned}")

    @property
    def knows(self) -> bool:
        """Whether there is anything to predict from."""
        return self._filter is not None

    @property
    def state(self) -> Array:
        """Offset (m), yaw (rad), curvature (1/m), turn of the camera (rad): (4,)."""
        assert self._filter is not None
        return np.asarray(self._filter.x[:4, 0], np.float64)

    @property
    def covariance(self) -> Array:
        """(4, 4) of the state."""
        assert self._filter is not None
        return np.asarray(self._filter.P[:4, :4], np.float64)

    def reset(self) -> None:
        """Forget all."""
        self._filter = None

    def predict(self, motion: Motion) -> None:
        """Go on by what the robot did; without odometry it may have done anything within reason."""
        f = self._filter
        if f is None:
            return
        seconds = max(motion.seconds, 0.0)
        blind = motion.speed is None
        speed = 0.0 if motion.speed is None else motion.speed
        way = abs(speed) * seconds
        yaw, curvature = float(f.x[YAW, 0]), float(f.x[CURVATURE, 0])
        turn = (motion.turn_rate or 0.0) * seconds - curvature * speed * seconds
        f.x[OFFSET, 0] += speed * seconds * np.sin(yaw + 0.5 * turn)
        f.x[YAW, 0] += turn
        move = np.eye(_SIZE)
        move[OFFSET, YAW] = speed * seconds * np.cos(yaw)
        move[YAW, CURVATURE] = -speed * seconds
        keep = np.exp(-(seconds if blind else way) / self.view)
        move[_COMMON, _COMMON] *= keep
        f.x[_COMMON] *= keep
        noise = np.zeros((_SIZE, _SIZE))
        noise[OFFSET, OFFSET] = self.sidestep**2 * way + 1e-8 + (0.3 * seconds) ** 2 * blind
        noise[YAW, YAW] = self.turn**2 * way + 1e-8
        if motion.turn_rate is None:
            noise[YAW, YAW] += (0.3 * seconds) ** 2
        noise[CURVATURE, CURVATURE] = self.bend**2 * (seconds if blind else way) + 1e-12
        f.P = move @ f.P @ move.T + noise
        self._common_gain = 1.0 - keep**2

    def update(self, measured: Array, covariance: Array, doubt: float = 1.0) -> bool:
        """Take in what a picture says; returns whether it is believed.

        Args:
            measured: (3,) offset (m), yaw (rad), curvature (1/m).
            covariance: (3, 3) of it.
            doubt: factor on the covariance of what has passed the gate; nothing begins with what is doubted.
        """
        f = self._filter
        if f is None:
            if doubt > 1.0:
                return False
            self._begin(measured, covariance)
            return True
        # New plants bring a new common error, as large as this picture's
        f.P[_COMMON, _COMMON] += self._common_gain * self.shared * covariance
        if not self.agrees(measured, covariance):
            return False
        f.R = (doubt - self.shared) * covariance
        f.H = _SEEN
        f.update(measured[:, None])
        f.P = 0.5 * (f.P + f.P.T)
        return True

    def agrees(self, measured: Array, covariance: Array) -> bool:
        """Whether what a picture says, (3,) and (3, 3) as of `update`, lies within the gate."""
        assert self._filter is not None
        expected = _SEEN @ self._filter.P @ _SEEN.T + (1.0 - self.shared) * covariance
        surprise = measured - (_SEEN @ self._filter.x)[:, 0]
        return float(surprise @ np.linalg.solve(expected, surprise)) <= self.gate

    def expected(self) -> Array:
        """What a picture would say: offset, yaw as the camera sees it, curvature: (3,)."""
        assert self._filter is not None
        seen = np.array(self._filter.x[:3, 0], np.float64)
        seen[YAW] += float(self._filter.x[TURNED, 0])
        return seen

    def _begin(self, measured: Array, covariance: Array) -> None:
        from filterpy.kalman import KalmanFilter  # slow to import: it brings scipy.stats

        f = KalmanFilter(dim_x=_SIZE, dim_z=3)
        f.x = np.zeros((_SIZE, 1))
        f.x[:3, 0] = measured
        f.P = np.zeros((_SIZE, _SIZE))
        f.P[:3, :3] = covariance
        f.P[TURNED, TURNED] = self.turned**2 + 1e-12
        f.P[YAW, YAW] += self.turned**2
        f.P[YAW, TURNED] = f.P[TURNED, YAW] = -(self.turned**2)
        f.P[_COMMON, _COMMON] = self.shared * covariance
        f.P[:3, _COMMON] = f.P[_COMMON, :3] = -self.shared * covariance
        self._filter = f
        self._common_gain = 0.0


#: A picture shows offset, yaw plus the turn of the camera, and curvature, each with the common error.
_SEEN = np.zeros((3, _SIZE))
_SEEN[:, :3] = np.eye(3)
_SEEN[YAW, TURNED] = 1.0
_SEEN[:, _COMMON] = np.eye(3)
