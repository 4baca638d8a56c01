# SPDX-License-Identifier: Apache-2.0
"""A Kalman filter for each plant, all of them in one set of arrays: plants do not sway each other.

A plant's state is its place in the field (m) and the logarithm of the share q = 1 - h / H of the camera's height H
that is above its middle: for a camera at c the sight to it falls by 1 while it goes (p - c) / (q H) over the ground,
so that a tall plant, seen from afar and then from near by, tells its height and with it where its stem stands.

What is wrong about the lean of the body is wrong about all plants, and for as long as the same rows tell it: more
pictures do not average it out. Each plant therefore keeps how its errors go with that common one, which is
considered and not estimated (Schmidt 1966).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping.pose import Pose

Array = NDArray[np.float64]

#: Height of the middle of any plant and its standard deviation, in radii; the latter of plants of the crop, which are
#: those larger than a share of a usual one.
_TALL, _TALL_SIGMA, _CROP_SIGMA, _ALIKE = 0.6, 0.35, 0.15, 0.5
#: Least standard deviation of the logarithm of q.
_LEAST_SIGMA = 0.004
#: A plant is known once so many pictures have shown it.
KNOWN_AGE = 3
#: Plants that so many pictures in a row have not shown are forgotten, young ones after fewer.
_MOST_MISSED, _MOST_MISSED_YOUNG, _MOST_HIDDEN = 5, 2, 12
#: How fast the area that is told forgets: as if it were the mean of so many pictures.
_MEMORY = 8.0


@dataclass(frozen=True)
class Stature:
    """How high plants stand, in radii of the circle as large as their leaves.

    Attributes:
        radius: of a usual plant of the crop, m; None: not known.
        crop: height of the middle of such a plant.
    """

    radius: float | None = None
    crop: float = 0.6

    def of(self, radii: Array) -> tuple[Array, Array]:
        """Height of the middle of plants (N,) and its standard deviation (N,), m."""
        alike = radii > (np.inf if self.radius is None else _ALIKE * self.radius)
        tall = np.where(alike, self.crop, _TALL)
        return radii * tall, radii * np.where(alike, _CROP_SIGMA, _TALL_SIGMA)


@dataclass
class PlantTracks:
    """All plants that are known, one row each.

    Attributes:
        ids: (N,) uint32.
        states: (N, 3) x and y in the field (m), logarithm of q.
        covariances: (N, 3, 3).
        shared: (N, 3, 2) covariance of the error of the state with the common one, in standard deviations of that.
        log_areas: (N,) of m^2.
        foreign: (N,) share of it that has another colour than the crop.
        ages: (N,) pictures that showed it.
        missed: (N,) pictures in a row that showed bare ground in its place.
        hidden: (N,) pictures in a row that showed other leaves in its place.
    """

    ids: NDArray[np.uint32]
    states: Array
    covariances: Array
    shared: Array
    log_areas: Array
    foreign: Array
    ages: NDArray[np.intp]
    missed: NDArray[np.intp]
    hidden: NDArray[np.intp]

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def radii(self) -> Array:
        """Radii (N,) of circles as large as the plants, m."""
        return np.asarray(np.sqrt(np.exp(self.log_areas) / np.pi))

    @staticmethod
    def none() -> PlantTracks:
        """No plant yet."""
        count = np.zeros(0, np.intp)
        return PlantTracks(
            np.zeros(0, np.uint32),
            np.zeros((0, 3)),
            np.zeros((0, 3, 3)),
            np.zeros((0, 3, 2)),
            np.zeros(0),
            np.zeros(0),
            count,
            count.copy(),
            count.copy(),
        )

    def keep(self, which: NDArray[np.bool_]) -> None:
        """Forget the others."""
        for name in self.__dataclass_fields__:
            setattr(self, name, getattr(self, name)[which])

    def forget(self, pose: Pose, behind: float) -> None:
        """Forget plants that were missed too often, and those farther behind the robot than so many metres."""
        young = self.ages < KNOWN_AGE
        most = np.where(young, _MOST_MISSED_YOUNG, _MOST_MISSED)
        longest = np.where(young, _MOST_MISSED_YOUNG, _MOST_HIDDEN)
        ahead = (self.states[:, :2] - (pose.x, pose.y)) @ (np.cos(pose.yaw), np.sin(pose.yaw))
        self.keep((self.missed < most) & (self.hidden < longest) & (ahead > -behind))

    def seen_from(self, pose: Pose, camera_x: float) -> tuple[Array, Array]:
        """Where the middles of plants appear on the ground from a camera, (N, 2) ahead and left of it, m.

        Also the derivatives (N, 2, 3) by the state.
        """
        turn = _to_base(pose.yaw)
        away = (self.states[:, :2] - (pose.x, pose.y)) @ turn.T - (camera_x, 0.0)
        rise = np.exp(-self.states[:, 2])
        seen = away * rise[:, None]
        jacobian = np.empty((len(self), 2, 3))
        jacobian[:, :, :2] = turn * rise[:, None, None]
        jacobian[:, :, 2] = -seen
        return seen, jacobian

    def correct(
        self,
        rows: NDArray[np.intp],
        seen: Array,
        noise: Array,
        common: Array,
        pose: Pose,
        camera_x: float,
    ) -> None:
        """Take in where plants were seen.

        Args:
            rows: (M,) of the plants.
            seen: (M, 2) as of `seen_from`.
            noise: (M, 2, 2) of it, without the common error.
            common: (M, 2, 2) what the common error does to it, m a standard deviation.
            pose: of the robot in the field.
            camera_x: of the camera ahead of base_link, m.
        """
        expected, jacobian = self.seen_from(pose, camera_x)
        expected, jacobian = expected[rows], jacobian[rows]
        before, shared = self.covariances[rows], self.shared[rows]
        cross = before @ _turned(jacobian) + shared @ _turned(common)
        surely = jacobian @ shared + common
        gain = cross @ np.linalg.inv(jacobian @ cross + common @ _turned(surely) + noise)
        self.states[rows] += (gain @ (seen - expected)[:, :, None])[:, :, 0]
        after = before - gain @ _turned(cross)
        self.covariances[rows] = 0.5 * (after + _turned(after))
        self.shared[rows] = shared - gain @ surely

    def see_looks(self, rows: NDArray[np.intp], areas: Array, foreign: Array) -> None:
        """Take in how large plants (M,) are, m^2, how much of them is foreign (M,), and that they were seen."""
        self.ages[rows] += 1
        self.missed[rows] = self.hidden[rows] = 0
        share = np.maximum(1.0 / self.ages[rows], 1.0 / _MEMORY)
        self.log_areas[rows] += share * (np.log(areas) - self.log_areas[rows])
        self.foreign[rows] += share * (foreign - self.foreign[rows])

    def begin(
        self,
        first_id: int,
        seen: Array,
        noise: Array,
        common: Array,
        areas: Array,
        foreign: Array,
        pose: Pose,
        camera_x: float,
        height: float,
        stature: Stature,
    ) -> None:
        """Begin with new plants.

        Args:
            first_id: of them; the others follow.
            seen: (M, 2) as of `seen_from`, m.
            noise: (M, 2, 2) of it, without the common error.
            common: (M, 2, 2) what the common error does to it, m a standard deviation.
            areas: (M,) as they appear on the ground, m^2.
            foreign: (M,) share of them that has another colour than the crop.
            pose: of the robot in the field.
            camera_x: of the camera ahead of base_link, m.
            height: of the camera, m.
            stature: of plants.
        """
        count = len(seen)
        radius = np.sqrt(areas / np.pi)
        tall, unsure = stature.of(radius)
        log_q = np.log(np.maximum(1.0 - tall / height, 0.5))
        sigma = np.hypot(unsure / height, _LEAST_SIGMA)
        q = np.exp(log_q)
        to_field = _to_base(pose.yaw).T
        states = np.empty((count, 3))
        states[:, :2] = (seen * q[:, None] + (camera_x, 0.0)) @ to_field.T + (pose.x, pose.y)
        states[:, 2] = log_q
        slant = (seen * q[:, None]) @ to_field.T
        covariances = np.zeros((count, 3, 3))
        noise = noise + common @ _turned(common)
        covariances[:, :2, :2] = q[:, None, None] ** 2 * (to_field @ noise @ to_field.T)
        covariances[:, :2, :2] += sigma[:, None, None] ** 2 * slant[:, :, None] * slant[:, None, :]
        covariances[:, :2, 2] = covariances[:, 2, :2] = sigma[:, None] ** 2 * slant
        covariances[:, 2, 2] = sigma**2
        shared = np.zeros((count, 3, 2))
        shared[:, :2] = -q[:, None, None] * (to_field @ common)
        fresh = PlantTracks(
            np.arange(first_id, first_id + count, dtype=np.uint32),
            states,
            covariances,
            shared,
            np.log(areas * q**2),
            foreign.copy(),
            np.ones(count, np.intp),
            np.zeros(count, np.intp),
            np.zeros(count, np.intp),
        )
        for name in self.__dataclass_fields__:
            setattr(self, name, np.concatenate([getattr(self, name), getattr(fresh, name)]))


def _turned(matrices: Array) -> Array:
    """Transposes (N, j, i) of matrices (N, i, j)."""
    return matrices.transpose(0, 2, 1)


def _to_base(yaw: float) -> Array:
    """Matrix (2, 2) that turns vectors of the field into those of a robot that heads for yaw."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    return np.array([[cosine, sine], [-sine, cosine]])
