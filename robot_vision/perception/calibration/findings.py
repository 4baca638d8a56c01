# SPDX-License-Identifier: Apache-2.0
"""What a calibration from a drive found, how sure it is, and in plain words what it could not tell."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera

Array = NDArray[np.float64]


class CalibrationError(ValueError):
    """A calibration cannot even begin; the text names the argument and the cause."""


@dataclass(frozen=True)
class KnownLengths:
    """Lengths on the ground, any of which gives the height of the camera; m, None where not known.

    Attributes:
        corridor_width: between the feet of the two walls.
        stone_width: of a flagstone across the way, from the middle of one joint to the middle of the next.
        stone_length: the same along the way.
        row_spacing: from one crop row to the next.
    """

    corridor_width: float | None = None
    stone_width: float | None = None
    stone_length: float | None = None
    row_spacing: float | None = None

    def __post_init__(self) -> None:
        for length in fields(self):
            value = getattr(self, length.name)
            if value is not None and not (np.isfinite(value) and value > 0.0):
                raise CalibrationError(f"{length.name} must be a positive length in m, not {value}")

    @property
    def any(self) -> bool:
        """Whether there is one."""
        return any(getattr(self, length.name) is not None for length in fields(self))


@dataclass(frozen=True)
class Finding:
    """One quantity of the camera.

    Attributes:
        value: the answer; None when the pictures do not tell.
        sigma: its standard deviation, in the same unit; inf when there is no answer.
        told_by: number of pictures that say something of it.
        reason: in plain words how it was found, or why not.
        own: (N,) what each picture says by itself, nan where it says nothing.
    """

    value: float | None
    sigma: float
    told_by: int
    reason: str
    own: Array = field(repr=False)

    @property
    def known(self) -> bool:
        """Whether there is an answer."""
        return self.value is not None

    @classmethod
    def missing(cls, reason: str, pictures: int) -> Finding:
        """No answer, and why."""
        return cls(None, float("inf"), 0, reason, np.full(pictures, np.nan))


@dataclass(frozen=True)
class CameraCalibration:
    """A camera as its own pictures tell of it.

    Attributes:
        camera: with everything found put in; what was not found stays as it was given.
        given: the camera as it was given.
        pictures: number of pictures looked at.
        focal: focal length fx, px.
        roll, pitch: of the mounting, rad, in the sense of `Camera`.
        height: of the camera over the ground, m.
    """

    camera: Camera
    given: Camera
    pictures: int
    focal: Finding
    roll: Finding
    pitch: Finding
    height: Finding
