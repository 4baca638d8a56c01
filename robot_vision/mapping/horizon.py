# SPDX-License-Identifier: Apache-2.0
"""Holds how the camera leans, live from the vanishing points: one pixel of horizon costs dZ / Z = Z / (H f) (20.2)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.perception import VanishingPoints
from robot_vision.perception.attitude import estimate_attitude

Array = NDArray[np.float64]

_LOOSE = 0.3
"""Standard deviation (rad) at which the mounting holds the attitude of one picture: the filter has its own memory."""
_LONGEST_STEP_S = 1.0


@dataclass(frozen=True)
class Horizon:
    """The ground as one picture sees it.

    Attributes:
        camera: rectified, with the roll and pitch of this moment.
        covariance: (2, 2) of roll and pitch, rad^2.
        steady: False while the vanishing points contradict what earlier ones told: nothing is certain then.
        knocked: by how much the camera was turned on the robot (rad), in the picture in which that became certain.
    """

    camera: Camera
    covariance: Array
    steady: bool = True
    knocked: float = 0.0

    @property
    def pitch_sigma(self) -> float:
        """Standard deviation of the pitch, rad."""
        return float(np.sqrt(self.covariance[1, 1]))

    @property
    def knock(self) -> str:
        """In words that the camera was turned on the robot, in the picture in which that became certain; else empty."""
        return (
            f"the camera has been knocked by {np.degrees(self.knocked):.1f} degrees" if self.knocked else ""
        )

    def reach(self, share: float) -> float:
        """How far away (m) distances are known to a share: dZ / Z = Z dpitch / H, from (20.1)."""
        height = self.camera.height_m or 0.0
        return share * height / max(self.pitch_sigma, 1e-6)


@dataclass
class HorizonFilter:
    """Kalman filter of roll and pitch, moved by the pitch rate where odometry tells it.

    A robot swings about the lean of its camera's mounting, which is learnt: the lean fades back to it.

    Args:
        lean: standard deviation of the lean about the mounting that the parameters tell, rad.
        restless: growth of the lean's variance where nobody tells its rate, rad^2/s.
        guided: the same where odometry tells it, rad^2/s.
        sharing: factor on the variance of one picture: errors of lines stay the same for several pictures.
        line_floor: what the lines of one picture can tell of the lean at best, rad.
        motion_floor: what the motion of the floor can tell of the pitch at best, rad.
        motion_sharing: factor on the variance of that: the same points are seen in several pictures.
        gate: squared Mahalanobis distance (2 degrees of freedom) beyond which a picture is not believed.
        knock: change of the lean below which a contradiction is noise, rad.
        confirmations: contradicting pictures in a row after which they are believed.
    """

    lean: float = 0.035
    restless: float = 4e-4
    guided: float = 4e-6
    sharing: float = 2.0
    line_floor: float = 0.0016
    motion_floor: float = 0.0015
    motion_sharing: float = 4.0
    gate: float = 25.0
    knock: float = 0.015
    confirmations: int = 6
    _lean: Array | None = field(default=None, init=False, repr=False)
    _covariance: Array = field(default_factory=lambda: np.eye(2), init=False, repr=False)
    _stamp: float = field(default=0.0, init=False, repr=False)
    _against: list[Array] = field(default_factory=list, init=False, repr=False)

    def reset(self) -> None:
        """Forget all but the settings."""
        self._lean = None
        self._against = []

    def update(
        self, camera: Camera, points: VanishingPoints | None, stamp_s: float, pitch_rate: float | None = None
    ) -> Horizon:
        """Take in the vanishing points of the next picture.

        Args:
            camera: as it is mounted; `roll` and `pitch` are where the search begins.
            points: of the picture; None or empty when there are none.
            stamp_s: of the picture, s.
            pitch_rate: of the robot, rad/s, nose down positive; None when nobody knows.
        """
        camera = camera.rectified()
        self._predict(camera, stamp_s, pitch_rate)
        assert self._lean is not None
        knocked, steady = 0.0, True
        if points is not None and len(points):
            told = estimate_attitude(replace(points, camera=camera), _LOOSE)
            if told.seen:
                measured, noise = (
                    np.array([told.roll, told.pitch]),
                    self.sharing * (told.covariance + self.line_floor**2 * np.eye(2)),
                )
                off = measured - self._lean
                distance = float(off @ np.linalg.solve(self._covariance + noise, off))
                if distance > self.gate and np.abs(off).max() > self.knock:
                    self._against.append(measured)
                    steady = False
                    if len(self._against) >= self.confirmations:
                        knocked, steady = float(np.abs(off).max()), True
                        self._lean, self._covariance = np.median(self._against, axis=0), noise
                        self._against = []
                else:
                    self._against = []
                    gain = np.linalg.solve(self._covariance + noise, self._covariance).T
                    self._lean = self._lean + gain @ off
                    self._covariance = (np.eye(2) - gain) @ self._covariance
        roll, pitch = (float(angle) for angle in self._lean)
        leaning = replace(camera, roll=roll, pitch=pitch)
        return Horizon(leaning, self._covariance.copy(), steady, knocked)

    def correct(self, pitch_error: float, sigma: float) -> None:
        """Take in what the motion of the floor tells of the pitch, for the pictures to come.

        Args:
            pitch_error: by which the pitch last told is too large, rad.
            sigma: standard deviation of that, rad.
        """
        if self._lean is None:
            return
        noise = self.motion_sharing * (sigma**2 + self.motion_floor**2)
        if pitch_error**2 > self.gate * (self._covariance[1, 1] + noise):
            return
        gain = self._covariance[:, 1] / (self._covariance[1, 1] + noise)
        self._lean = self._lean - gain * pitch_error
        self._covariance = self._covariance - np.outer(gain, self._covariance[1])

    def _predict(self, camera: Camera, stamp_s: float, pitch_rate: float | None) -> None:
        seconds = stamp_s - self._stamp
        self._stamp = stamp_s
        if self._lean is None or not 0.0 <= seconds <= _LONGEST_STEP_S:
            self._lean = np.array([camera.roll, camera.pitch])
            self._covariance = self.lean**2 * np.eye(2)
            return
        if self._against:  # what contradicts must not win by waiting
            return
        growth = np.array([self.restless, self.restless if pitch_rate is None else self.guided])
        self._lean = self._lean + np.array([0.0, 0.0 if pitch_rate is None else pitch_rate * seconds])
        self._covariance = np.minimum(self._covariance + np.diag(growth * seconds), self.lean**2 * 4.0)
