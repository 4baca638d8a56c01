# SPDX-License-Identifier: Apache-2.0
"""From the lines of one picture to its vanishing points: the one door to their detection."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.geometry.sphere import EqualAreaCells, angle_between, front_half
from robot_vision.perception.segments import LineSegments
from robot_vision.perception.vanishing.bundle import Bundle
from robot_vision.perception.vanishing.focal import PRIOR_SIGMA, find_focal_length
from robot_vision.perception.vanishing.frames import best_frame
from robot_vision.perception.vanishing.points import VanishingPoints
from robot_vision.perception.vanishing.refit import refit_each
from robot_vision.perception.vanishing.roles import primary_first, roles
from robot_vision.perception.vanishing.support import agreement, assignment, false_alarms
from robot_vision.perception.vanishing.votes import proposals

Array = NDArray[np.float64]

#: Fewer lines than this cannot even confirm one vanishing point.
_FEWEST_LINES = 3
#: Two lines fix a vanishing point.
_LINES_A_POINT = 2


@dataclass(frozen=True)
class VanishingPointEstimator:
    """Finds vanishing points on the Gaussian sphere, with a focal length if none is known.

    1. Pairs of the longest lines vote into cells of equal area; the fullest cells are proposals.
    2. About every proposal one vote of all lines gives its two orthogonal partners; the few best frames are turned
       to their lines, and the one they support most is kept. A scene need not be built at right angles: a member of
       the frame stays only if its own lines say so, or if the other two do.
    3. Each member is refitted to its own lines, held to the frame by a soft spring.
    4. Lines left over propose further vanishing points, until what is left is clutter.

    Args:
        cell: size of the cells, rad.
        voters: lines whose pairs vote (half as many among lines left over); the cost grows with its square and not
            with the number of lines.
        candidates: proposals examined.
        most_lines: lines used, the longest ones.
        orthogonality: how far vanishing points of built scenes stray from right angles, rad.
        certainty: vanishing points one accepts in a picture of clutter alone, in the mean.
        least_share: share of the lines left over that must agree on a further vanishing point.
        least_support: number of lines of mean length that must agree on a further vanishing point.
        most: most vanishing points given.
    """

    cell: float = float(np.deg2rad(3.0))
    voters: int = 60
    candidates: int = 12
    most_lines: int = 400
    orthogonality: float = float(np.deg2rad(1.0))
    certainty: float = 0.01
    least_share: float = 0.2
    least_support: float = 8.0
    most: int = 6
    _cells: EqualAreaCells = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name, least in (("voters", 2), ("candidates", 1), ("most_lines", 3), ("most", 1)):
            if getattr(self, name) < least:
                raise ValueError(f"{name} must be at least {least}, not {getattr(self, name)}")
        if not self.orthogonality > 0.0:
            raise ValueError(f"orthogonality must be a positive angle in rad, not {self.orthogonality}")
        object.__setattr__(self, "_cells", EqualAreaCells(self.cell))

    def estimate(self, lines: LineSegments, camera: Camera, ahead: Array | None = None) -> VanishingPoints:
        """Vanishing points of one picture.

        Args:
            lines: segments in rectified pixels; lines that are not finite are clutter.
            camera: of the picture. `Camera.uncalibrated` asks for a focal length to be found.
            ahead: (3,) direction known to be the way ahead, for the role of primary; else the robot's x axis.

        Returns:
            The points, primary first; none where no direction stands out from clutter.
        """
        camera = camera.rectified()
        bundle = Bundle.of(lines, camera, self.most_lines)
        focal_sigma = 0.0 if camera.focal_known else PRIOR_SIGMA
        if len(bundle) < _FEWEST_LINES:
            return VanishingPoints.none(camera, len(lines), focal_sigma)
        if camera.focal_known:
            directions, covariance = self._members(bundle, self._frame(bundle, ahead))
        else:
            bundle, camera, focal_sigma, directions, covariance = self._members_and_focal_length(
                bundle, camera
            )
        if ahead is not None:
            directions, covariance = self._add_expected(bundle, directions, covariance, ahead)
        members = len(directions)
        directions, covariance = self._add_others(bundle, directions, covariance)
        return self._answer(bundle, directions, covariance, members, camera, len(lines), focal_sigma, ahead)

    def warm_up(self) -> None:
        """Load or compile the kernels, so that the first picture is not kept waiting."""
        angles = np.linspace(0.1, 3.0, 40)
        middles = (
            np.stack([320.0 + 9.0 * np.cos(7.0 * angles), 240.0 + 9.0 * np.sin(5.0 * angles)], axis=1) * 0.9
        )
        along = 20.0 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        lines = LineSegments.from_endpoints(np.concatenate([middles - along, middles + along], axis=1))
        for camera in (Camera(500.0, 500.0, 320.0, 240.0, 640, 480), Camera.uncalibrated(640, 480)):
            self.estimate(lines, camera, np.array([0.0, 0.0, 1.0]))

    def _members_and_focal_length(
        self, bundle: Bundle, camera: Camera
    ) -> tuple[Bundle, Camera, float, Array, Array]:
        """Members of the frame together with the focal length that makes it orthogonal.

        One vanishing point alone says nothing of the focal length: then it stays as assumed.
        """
        focal = find_focal_length(bundle, self._cells, self.voters, self.candidates)
        if focal is not None:
            scaled = bundle.at_focal_ratio(focal.ratio)
            directions, covariance = self._members(scaled, focal.frame)
            if len(directions) > 1:
                found = replace(camera, fx=camera.fx * focal.ratio, fy=camera.fy * focal.ratio)
                return scaled, found, focal.sigma, directions, covariance
        return bundle, camera, PRIOR_SIGMA, *self._members(bundle, self._frame(bundle, None))

    def _frame(self, bundle: Bundle, ahead: Array | None) -> Array | None:
        """The orthogonal frame with the most support, turned to its lines; `ahead` is proposed too."""
        proposed = proposals(bundle, self._cells, self.voters, self.candidates)
        if not len(proposed):
            return None
        if ahead is not None:
            proposed = np.concatenate([ahead[None], proposed])
        return best_frame(bundle, proposed)

    def _members(self, bundle: Bundle, frame: Array | None) -> tuple[Array, Array]:
        """Members of the frame that are believed, each refitted: (M, 3) and covariance (M, 2, 2)."""
        if frame is None:
            return np.zeros((0, 3)), np.zeros((0, 2, 2))
        directions, covariance = refit_each(bundle, frame, self.orthogonality)
        residuals = bundle.residuals(directions)
        nearest, _ = assignment(residuals)
        pairs = 0.5 * len(bundle) ** 2
        believed = np.array(
            [
                false_alarms(bundle, residuals[k], (nearest == k) | (nearest < 0), _LINES_A_POINT, pairs)
                < self.certainty
                for k in range(3)
            ]
        )
        if believed.sum() >= 2:
            believed[:] = True
        return directions[believed], covariance[believed]

    def _add_expected(
        self, bundle: Bundle, directions: Array, covariance: Array, ahead: Array
    ) -> tuple[Array, Array]:
        """The direction earlier pictures lead to expect, unless it is there or nothing speaks for it.

        One direction named beforehand is one test, not one of all pairs of lines: few lines confirm it.
        """
        if len(directions) and angle_between(directions, ahead).min() < self.cell:
            return directions, covariance
        free = np.ones(len(bundle), bool)
        if len(directions):
            free = assignment(bundle.residuals(directions))[0] < 0
        rest = bundle[free]
        found, sure = refit_each(rest, ahead[None], self.orthogonality)
        residuals = rest.residuals(found)[0]
        few = (agreement(residuals) > 0.0).sum() < _FEWEST_LINES
        if few or false_alarms(rest, residuals, np.ones(len(rest), bool), 0, 1.0) >= self.certainty:
            return directions, covariance
        return np.concatenate([directions, found]), np.concatenate([covariance, sure])

    def _add_others(self, bundle: Bundle, directions: Array, covariance: Array) -> tuple[Array, Array]:
        """Further vanishing points among the lines left over, until what is left is clutter."""
        while len(directions) < self.most:
            free = np.ones(len(bundle), bool)
            if len(directions):
                free = assignment(bundle.residuals(directions))[0] < 0
            rest = bundle[free]
            if len(rest) < _FEWEST_LINES:
                break
            proposed = proposals(rest, self._cells, self.voters // 2, self.candidates)
            if not len(proposed):
                break
            support = agreement(rest.residuals(proposed)) @ rest.weight
            best = proposed[[int(np.argmax(support))]]
            found, sure = refit_each(rest, best, 2.0 * self.cell)
            residuals, all_free = rest.residuals(found)[0], np.ones(len(rest), bool)
            support, pairs = agreement(residuals), 0.5 * len(rest) ** 2
            certain = false_alarms(rest, residuals, all_free, _LINES_A_POINT, pairs) < self.certainty
            certain &= float(support @ rest.weight) > max(
                self.least_support, self.least_share * float(rest.weight.sum())
            )
            near = len(directions) and angle_between(directions, found[0]).min() < self.cell
            if not certain or near:
                break
            directions = np.concatenate([directions, found])
            covariance = np.concatenate([covariance, sure])
        return directions, covariance

    def _answer(
        self,
        bundle: Bundle,
        directions: Array,
        covariance: Array,
        members: int,
        camera: Camera,
        lines: int,
        focal_sigma: float,
        ahead: Array | None,
    ) -> VanishingPoints:
        if not len(directions):
            return VanishingPoints.none(camera, lines, focal_sigma)
        nearest, support = assignment(bundle.residuals(directions))
        mine = nearest == np.arange(len(directions))[:, None]
        weight = np.asarray(mine @ (bundle.weight * support))
        if members == 3:
            # The partners of an orthogonal frame fix a member as its own lines do: half the lesser one counts.
            own = weight[:3].copy()
            weight[:3] += 0.5 * np.array([np.delete(own, k).min() for k in range(3)])
        found = roles(directions, weight, camera, members, ahead)
        order = primary_first(found, weight)[: self.most]
        position = np.full(len(directions) + 1, -1, np.intp)
        position[order] = np.arange(len(order))
        labels = np.full(lines, -1, np.intp)
        labels[bundle.source] = position[nearest]
        return VanishingPoints(
            directions=front_half(directions)[order],
            covariance=covariance[order],
            weight=weight[order],
            roles=found[order],
            ids=np.zeros(len(order), np.uint32),
            labels=labels,
            camera=camera,
            focal_sigma=focal_sigma,
        )
