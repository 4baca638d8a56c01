# SPDX-License-Identifier: Apache-2.0
"""A pan-tilt head that turns the camera to a point: late and within limits, as servos do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robot_vision.geometry import Camera
from robot_vision.simulation.errors import SimulationError

JOINTS = ("camera_pan", "camera_tilt")
"""Names of its joints: about z (left positive), and about y (down positive)."""


@dataclass(frozen=True)
class HeadSettings:
    """What a head can do.

    Attributes:
        most_pan: to either side, radians.
        most_tilt: up and down, radians.
        rate: greatest, of each joint, radians a second.
        lag: time constant of the servos, seconds.
    """

    most_pan: float = 1.2
    most_tilt: float = 0.5
    rate: float = 2.0
    lag: float = 0.08

    def __post_init__(self) -> None:
        for name, most in (("most_pan", np.pi), ("most_tilt", np.pi / 2), ("rate", 100.0)):
            value = getattr(self, name)
            if not 0 < value <= most:
                raise SimulationError(f"head: {name} must be positive and at most {most:.3g}, not {value}")
        if not 0 <= self.lag <= 5:
            raise SimulationError(f"head: lag must be between 0 and 5 s, not {self.lag}")


class Head:
    """A head that carries the camera of a robot.

    Args:
        settings: what it can do.
        mounted: the camera as it sits while the head looks straight ahead.

    Attributes:
        pan: now, radians, left positive.
        tilt: now, radians, down positive, on top of the camera's own pitch.
    """

    def __init__(self, settings: HeadSettings, mounted: Camera) -> None:
        self.settings, self._mounted = settings, mounted
        self.pan = self.tilt = 0.0
        self._aim = (0.0, 0.0)

    @property
    def camera(self) -> Camera:
        """The camera as it looks now."""
        return replace(self._mounted, pan=self.pan, tilt=self.tilt)

    def look_at(self, point: Sequence[float]) -> None:
        """Turn towards a point from now on, as far as the joints go.

        Args:
            point: x, y, z in base_link, metres.

        Raises:
            SimulationError: it is not finite, is where the camera is, or lies behind the robot.
        """
        x, y, z = (float(part) for part in point)
        if not np.isfinite([x, y, z]).all():
            raise SimulationError(f"the point to look at, ({x:g}, {y:g}, {z:g}), is not finite")
        ahead, up = x - self._mounted.x_m, z - (self._mounted.height_m or 0.0)
        away = float(np.hypot(ahead, y))
        if away < 1e-3:
            raise SimulationError("the point to look at lies in the camera or straight above or below it")
        pan = float(np.arctan2(y, ahead))
        if abs(pan) > np.pi / 2:
            raise SimulationError(f"the point to look at, ({x:g}, {y:g}, {z:g}), lies behind the camera")
        able = self.settings
        tilt = float(np.arctan2(-up, away)) - self._mounted.pitch
        self._aim = (
            float(np.clip(pan, -able.most_pan, able.most_pan)),
            float(np.clip(tilt, -able.most_tilt, able.most_tilt)),
        )

    def step(self, seconds: float) -> None:
        """Turn for a short time."""
        able = self.settings
        share = 1.0 if able.lag == 0 else -float(np.expm1(-seconds / able.lag))
        most = able.rate * seconds
        self.pan += float(np.clip((self._aim[0] - self.pan) * share, -most, most))
        self.tilt += float(np.clip((self._aim[1] - self.tilt) * share, -most, most))
