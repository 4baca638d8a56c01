# SPDX-License-Identifier: Apache-2.0
"""What lies between the world and the message: a camera's blur, exposure and noise, and errors of wheels."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.simulation.drive import STEPS_PER_SECOND, Motion, integrate
from robot_vision.simulation.errors import SimulationError

_GAMMA = 1 / 2.2
_SATURATION = 1.5
"""Share of full scale beyond which a pixel is as bright as it gets, and so is its blur on its neighbours."""
_STARTS = 1 << 20
"""Places at which a picture's noise can begin in the sensor's store: drawing it anew takes most of the time."""


@dataclass
class CameraSensor:
    """Turns linear light into the picture of a cheap camera; keeps its exposure from picture to picture.

    Attributes:
        seed: of the noise; the same seed and the same pictures give the same answer.
        blur_px: standard deviation of the lens blur.
        noise: standard deviation of a full-scale pixel's noise as a share of full scale (photons).
        dark_noise: the same for a black pixel (read-out).
        exposure: share of full scale at which the picture's mean is held.
        adaptation: part of an exposure error that is put right per picture.
    """

    seed: int = 0
    blur_px: float = 0.5
    noise: float = 0.010
    dark_noise: float = 0.003
    exposure: float = 0.27
    adaptation: float = 0.1
    _gain: float | None = field(default=None, init=False, repr=False)
    _work: NDArray[np.float32] | None = field(default=None, init=False, repr=False)
    _noise: NDArray[np.float32] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("blur_px", "noise", "dark_noise"):
            if getattr(self, name) < 0:
                raise SimulationError(
                    f"camera sensor: {name} must not be negative, not {getattr(self, name)}"
                )
        self._random = np.random.default_rng((self.seed, 3))
        self._curve = (255 * np.linspace(0, 1, 4096) ** _GAMMA + 0.5).astype(np.uint8)

    def capture(self, light: NDArray[np.float32]) -> NDArray[np.uint8]:
        """A picture, uint8 (H, W, 3) BGR, from linear light, float32 (H, W, 3)."""
        from robot_vision.simulation.exposing import expose  # numba: slow to import, needed for pictures only

        wanted = self.exposure / max(float(np.minimum(light[::4, ::4], _SATURATION).mean()), 1e-3)
        self._gain = wanted if self._gain is None else self._gain + self.adaptation * (wanted - self._gain)
        seen = self._scratch(light.shape)
        np.multiply(light, np.float32(self._gain), out=seen)
        np.minimum(seen, np.float32(_SATURATION), out=seen)
        if self.blur_px > 0:
            cv2.GaussianBlur(seen, (0, 0), self.blur_px, dst=seen, borderType=cv2.BORDER_REPLICATE)
        start = int(self._random.integers(_STARTS))
        picture = np.empty(light.shape, np.uint8)
        expose(
            seen.reshape(-1),
            self._noise[start : start + seen.size],
            self.noise**2,
            self.dark_noise**2,
            self._curve,
            picture.reshape(-1),
        )
        return picture

    def _scratch(self, shape: tuple[int, ...]) -> NDArray[np.float32]:
        """A picture to work in, kept because fresh memory costs as much as the work, and noise for it."""
        if self._work is None or self._work.shape != shape:
            self._work = np.empty(shape, np.float32)
            self._noise = self._random.standard_normal(_STARTS + self._work.size, dtype=np.float32)
        return self._work


@dataclass(frozen=True)
class WheelOdometry:
    """Dead reckoning with wheels that are not quite as large and as far apart as believed.

    Attributes:
        seed: of scale errors and noise.
        speed_scale: standard deviation of the constant relative error of the speed.
        turn_scale: standard deviation of the constant relative error of the turn rate.
        speed_noise: standard deviation of the speed, m/s, new in every reading.
        turn_noise: standard deviation of the turn rate, rad/s, new in every reading.
    """

    seed: int = 0
    speed_scale: float = 0.01
    turn_scale: float = 0.015
    speed_noise: float = 0.005
    turn_noise: float = 0.004

    def read(self, motion: Motion, rate: int) -> NDArray[np.float64]:
        """Readings (M, 5), `rate` a second: x, y (m), yaw (rad) since the first reading, speed, turn rate.

        A reading's speed and turn rate are means over the time since the one before.

        Raises:
            SimulationError: a rate that does not divide STEPS_PER_SECOND.
        """
        if rate <= 0 or STEPS_PER_SECOND % rate:
            raise SimulationError(f"odometry: rate must divide {STEPS_PER_SECOND}, not {rate}")
        random = np.random.default_rng((self.seed, 4))
        stride = STEPS_PER_SECOND // rate
        count = (len(motion.speed) - 1) // stride
        moving = [
            values[: count * stride].reshape(count, stride).mean(axis=1)
            for values in (motion.speed, motion.turn_rate)
        ]
        scales = 1 + random.standard_normal(2) * (self.speed_scale, self.turn_scale)
        noises = random.standard_normal((2, count)) * np.array([[self.speed_noise], [self.turn_noise]])
        standing = np.abs(moving[0]) + np.abs(moving[1]) < 1e-6
        noises[:, standing] = 0.0  # wheels that stand do not count
        speed, turn_rate = (
            values * scale + noise for values, scale, noise in zip(moving, scales, noises, strict=True)
        )
        x, y, yaw = integrate(np.append(speed, 0.0), np.append(turn_rate, 0.0), (0.0, 0.0, 0.0), rate)
        return np.column_stack([x, y, yaw, np.append(0.0, speed), np.append(0.0, turn_rate)])
