# SPDX-License-Identifier: Apache-2.0
"""What is known of the plants around the robot: one table, one row a plant."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class PlantKind(IntEnum):
    """What a plant is taken for."""

    CROP = 0
    WEED = 1
    UNSURE = 2


@dataclass(frozen=True)
class Plants:
    """Plants around the robot.

    Attributes:
        ids: (N,) uint32, the same for a plant from picture to picture.
        places: (N, 2) of their stems, ahead of and to the left of base_link, m.
        heights: (N,) of their middles above the ground, m.
        areas: (N,) of ground that their leaves cover, m^2.
        ages: (N,) number of pictures that showed them.
        covariance: (N, 2, 2) of their places, m^2.
        weed: (N,) probability that each is a weed; nan where nobody can tell.
        kinds: (N,) uint8 of `PlantKind`.
        field_places: (N, 2) in the frame of the field: that of base_link at the first picture, carried by odometry, m.
    """

    ids: NDArray[np.uint32]
    places: Array
    heights: Array
    areas: Array
    ages: NDArray[np.intp]
    covariance: Array
    weed: Array
    kinds: NDArray[np.uint8]
    field_places: Array

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def radii(self) -> Array:
        """Radii (N,) of circles as large as the plants, m."""
        return np.asarray(np.sqrt(self.areas / np.pi))

    def take(self, which: NDArray[np.bool_] | NDArray[np.intp]) -> Plants:
        """Some of them."""
        return Plants(**{name: getattr(self, name)[which] for name in self.__dataclass_fields__})

    @staticmethod
    def none() -> Plants:
        """No plant at all."""
        return Plants(
            np.zeros(0, np.uint32),
            np.zeros((0, 2)),
            np.zeros(0),
            np.zeros(0),
            np.zeros(0, np.intp),
            np.zeros((0, 2, 2)),
            np.zeros(0),
            np.zeros(0, np.uint8),
            np.zeros((0, 2)),
        )
