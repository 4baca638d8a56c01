# SPDX-License-Identifier: Apache-2.0
"""One focal length for all pictures of a camera, from what is built at right angles in front of it.

Each picture with two or more orthogonal vanishing points says something of the focal length (for two of them,
f^2 = -(v1 - p) . (v2 - p), p the principal point). Here the lines of all pictures are fitted together: every picture
has a frame of its own, all share the focal length. A picture's frame is eliminated from its normal equations, so that
it says in one number where it would have the focal length, and in another how sure it is. Where pictures disagree the
majority is believed, and if there is none, nobody.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry.sphere import EqualAreaCells, cross
from robot_vision.perception.calibration.robust import block_sigma, student_weights
from robot_vision.perception.vanishing.bundle import Bundle
from robot_vision.perception.vanishing.focal import PRIOR_SIGMA, SHARED_ERROR, find_focal_length
from robot_vision.perception.vanishing.frames import best_frame
from robot_vision.perception.vanishing.refit import rotation_about
from robot_vision.perception.vanishing.support import assignment, false_alarms
from robot_vision.perception.vanishing.votes import proposals

Array = NDArray[np.float64]
Progress = Callable[[int], None]

#: Standard deviation of the logarithm of the focal length one picture gives, beyond what its lines explain: no two
#: walls of a town are quite at right angles. Measured on pictures of towns with a known camera.
_SCATTER = 0.03
#: Pictures less sure than this (sd of the logarithm) hardly tell anything and are not counted.
_TELLING = 0.2
#: How near (logarithm) to the common answer a picture must come to agree with it, besides its own error.
_NEAR = 0.08
_CERTAINTY = 0.01
_LARGEST_STEP = 0.1
_GRID = np.linspace(-1.0, 1.4, 1201)
_VOTERS, _CANDIDATES = 60, 8
_CELLS = float(np.deg2rad(3.0))


@dataclass(frozen=True)
class SharedFocalLength:
    """What N pictures say together of the focal length; ratios are to the focal length assumed.

    Attributes:
        ratio: the common answer; nan when no picture tells anything.
        sigma: standard deviation of its logarithm: scatter of the pictures and what right angles may be off.
        agreement: share of the telling pictures, each counted by how sure it is, that by itself agrees with it.
        own: (N,) what each picture says by itself; nan where it says nothing.
        own_sigma: (N,) standard deviation of the logarithm of it.
    """

    ratio: float
    sigma: float
    agreement: float
    own: Array
    own_sigma: Array

    @property
    def telling(self) -> int:
        """Number of pictures that tell of the focal length."""
        return int(np.isfinite(self.own).sum())


@dataclass
class _View:
    """The lines of one picture and the frame they lead to; only the members (rows) believed."""

    bundle: Bundle
    members: Array


@dataclass(frozen=True)
class _Opinion:
    """What one picture says at a common focal length.

    Attributes:
        shift: by which it would change the logarithm of the focal length.
        variance: of the shift.
        squareness: (3,) how the shift follows the angles between its members: vertical and ahead, vertical and
            across, ahead and across.
    """

    shift: float
    variance: float
    squareness: Array


def share_focal_length(
    bundles: Sequence[Bundle], squareness: float, progress: Progress = lambda done: None
) -> SharedFocalLength:
    """Find the focal length that N pictures of one camera agree on.

    Args:
        bundles: lines of each picture, in the coordinates of the focal length assumed.
        squareness: standard deviation of the right angles of what was built, common to all pictures, rad.
        progress: called with the number of pictures looked at.
    """
    cells = EqualAreaCells(_CELLS)
    own, own_sigma = np.full(len(bundles), np.nan), np.full(len(bundles), np.inf)
    for k, bundle in enumerate(bundles):
        own[k], own_sigma[k] = _alone(bundle, cells)
        progress(k + 1)
    told = np.flatnonzero(np.isfinite(own))
    if not len(told):
        return SharedFocalLength(np.nan, np.inf, 0.0, own, own_sigma)
    start = _most_agreed(np.log(own[told]), own_sigma[told])
    near = _near(np.log(own[told]) - start, own_sigma[told])
    believed = 1.0 / (own_sigma[told] ** 2 + _SCATTER**2)
    agreement = float(believed[near].sum() / believed.sum())
    views = [_view(bundles[k], cells, float(np.exp(start))) for k in told[near]]
    ratio, sigma = _fit_together([view for view in views if view is not None], start, squareness)
    # Looked at with a common focal length, pictures seem more alike than they are.
    alone = block_sigma(np.log(own[told[near]]), believed[near]) if len(told) > 1 else own_sigma[told[0]]
    few = _SCATTER / np.sqrt(np.count_nonzero(near))
    sigma = float(np.linalg.norm([sigma, alone, few]))
    return SharedFocalLength(ratio, sigma, agreement, own, own_sigma)


def _alone(bundle: Bundle, cells: EqualAreaCells) -> tuple[float, float]:
    """Focal length from one picture as ratio, and sd of its logarithm; (nan, inf) when it says nothing."""
    nothing = (np.nan, np.inf)
    if len(bundle) < 3:
        return nothing
    found = find_focal_length(bundle, cells, _VOTERS, _CANDIDATES)
    if found is None:
        return nothing
    scaled = bundle.at_focal_ratio(found.ratio)
    if _believed(scaled, found.frame).sum() < 2 or not found.sigma < _TELLING:
        return nothing
    # What the picture says itself, without the prior that kept it from running away.
    shrunk = 1.0 - (found.sigma / PRIOR_SIGMA) ** 2 / SHARED_ERROR**2
    log_ratio = np.log(found.ratio) / shrunk
    return float(np.exp(log_ratio)), found.sigma


def _believed(bundle: Bundle, frame: Array) -> NDArray[np.bool_]:
    """Which rows of a frame have lines enough of their own not to be chance."""
    residuals = bundle.residuals(frame)
    nearest, _ = assignment(residuals)
    pairs = 0.5 * len(bundle) ** 2
    free = [(nearest == k) | (nearest < 0) for k in range(3)]
    return np.array([false_alarms(bundle, residuals[k], free[k], 2, pairs) < _CERTAINTY for k in range(3)])


def _most_agreed(logs: Array, sigma: Array) -> float:
    """The logarithm of the focal length on which most pictures agree: the mode of what they say together."""
    spread = np.hypot(sigma, _SCATTER)
    votes = np.exp(-0.5 * ((_GRID[:, None] - logs) / spread) ** 2) / spread
    return float(_GRID[int(np.argmax(votes.sum(axis=1)))])


def _near(away: Array, sigma: Array) -> NDArray[np.bool_]:
    return np.asarray(np.abs(away) < np.maximum(_NEAR, np.minimum(sigma, 2.0 * _NEAR)))


def _view(bundle: Bundle, cells: EqualAreaCells, ratio: float) -> _View | None:
    """The frame of one picture at a given focal length; None without two members that are believed."""
    scaled = bundle.at_focal_ratio(ratio)
    proposed = proposals(scaled, cells, _VOTERS, _CANDIDATES)
    if not len(proposed):
        return None
    frame = best_frame(scaled, proposed)
    believed = _believed(scaled, frame)
    if believed.sum() < 2:
        return None
    # Rows in the order upright, ahead, across, so that the same row means the same in every picture.
    upright = int(np.argmax(np.abs(frame[:, 1])))
    rest = [k for k in range(3) if k != upright]
    rest.sort(key=lambda k: -abs(frame[k, 2]))
    order = [upright, *rest]
    return _View(bundle, np.where(believed[order][:, None], frame[order], np.nan))


def _fit_together(views: Sequence[_View], start: float, squareness: float) -> tuple[float, float]:
    """Gauss-Newton on the common focal length and the frame of every picture; ratio and sd of its logarithm."""
    if not views:
        return np.nan, np.inf
    log_ratio = start
    for _ in range(8):
        opinions = [_opinion(view, float(np.exp(log_ratio))) for view in views]
        shifts = np.array([opinion.shift for opinion in opinions])
        variances = np.array([opinion.variance for opinion in opinions]) + _SCATTER**2
        weights = student_weights(shifts**2 / variances, 1) / variances
        step = float(np.clip(weights @ shifts / weights.sum(), -_LARGEST_STEP, _LARGEST_STEP))
        log_ratio += step
        if abs(step) < 1e-5:
            break
    leaning = weights @ np.array([opinion.squareness for opinion in opinions]) / weights.sum()
    sigma = np.hypot(block_sigma(shifts, weights), squareness * float(np.linalg.norm(leaning)))
    return float(np.exp(log_ratio)), float(sigma)


def _opinion(view: _View, ratio: float, rounds: int = 4) -> _Opinion:
    """Turn a picture's frame to its lines at a focal length, and ask by how much it would have that changed."""
    scaled = view.bundle.at_focal_ratio(ratio)
    for turn in range(rounds):
        seen = np.isfinite(view.members[:, 0])
        members = np.where(seen[:, None], view.members, 0.0)
        residuals = np.where(seen[:, None], scaled.residuals(members), np.inf)
        nearest, support = assignment(residuals)
        each = np.flatnonzero(nearest >= 0)
        nearest, lines = nearest[each], scaled.lines[each]
        scale = 1.0 / (scaled.reach(members)[nearest, each] * scaled.sigma[each])
        own = members[nearest]
        turning = scale[:, None] * cross(own, lines)
        by_focal = -scale * lines[:, 2] * own[:, 2]
        weight = scaled.weight[each] * support[each]
        weighted = weight[:, None] * turning
        inverse = np.linalg.inv(weighted.T @ turning + 1e-6 * np.eye(3))
        residual = residuals[nearest, each]
        if turn < rounds - 1:
            view.members = view.members @ rotation_about(-inverse @ (weighted.T @ residual)).T
    free = by_focal - turning @ (inverse @ (weighted.T @ by_focal))
    information = max(float(weight * free @ by_focal), 1e-9)
    shift = -float(weight * free @ residual) / information
    leaning = [
        -float(weight * free @ _opened(members, first, second, nearest, lines, scale)) / information
        for first, second in ((0, 1), (0, 2), (1, 2))
    ]
    return _Opinion(shift, SHARED_ERROR**2 / information, np.array(leaning))


def _opened(
    members: Array, first: int, second: int, nearest: NDArray[np.intp], lines: Array, scale: Array
) -> Array:
    """How residuals (N,) follow the angle between two members that is opened evenly on both sides."""
    moved = np.zeros((3, 3))
    moved[first], moved[second] = -0.5 * members[second], -0.5 * members[first]
    return np.asarray(scale * np.sum(moved[nearest] * lines, axis=1))
