# SPDX-License-Identifier: Apache-2.0
"""Where the robot stands between two walls: the two floor-wall lines, read through (20.3).

A line through the primary vanishing point that lies on the floor keeps one lateral distance X = H x / y all along,
with x and y measured from the vanishing point and the horizon. So every such line is one number, the lines of a
wall's foot agree in it, and the middle between the two feet is the middle of the lane.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robot_vision.perception.attitude import Attitude
from robot_vision.perception.floor_lines import FloorEvidence, floor_evidence
from robot_vision.perception.segments import LineSegments
from robot_vision.perception.vanishing import VanishingPoints

if TYPE_CHECKING:
    from filterpy.kalman import KalmanFilter

Array = NDArray[np.float64]

#: Systematic part of a foot's distance: the rounding of a skirting, the height of the camera. Relative.
_FOOT_SIGMA = 0.0015
_SIDES = (1, -1)
#: Uprights on a side that are together shorter than this share of its longest floor line tell nothing of its foot.
_FEW_UPRIGHTS = 0.3
#: Share of the uprights of a side (by length) that things before its wall may have, where a line tells the wall's foot.
_MOST_BEFORE_WALL = 0.5
#: Squared Mahalanobis distance (1 degree of freedom) beyond which a line is not the foot expected: 3 sigma.
_GATE = 9.0
#: Lines that differ by less in it are about as near.
_ABOUT = 2.0
_MOST_DOUBT = 0.9
#: Feet farther apart than this share of their distance are two; how far a doubtful one may be off.
_DOUBTFUL = 0.1


@dataclass(frozen=True)
class LaneHeading:
    """The robot in its lane.

    Attributes:
        yaw: of the robot relative to the lane, counter-clockwise positive, rad.
        yaw_variance: rad^2.
        offset: of the robot to the left of the centre line, m; 0 when unknown.
        offset_variance: m^2; inf when the offset is unknown.
        width: between the two walls, m; 0 when unknown.
        curvature: of the lane beside the robot, 1/m, to the left positive.
    """

    yaw: float
    yaw_variance: float
    offset: float = 0.0
    offset_variance: float = float("inf")
    width: float = 0.0
    curvature: float = 0.0

    @property
    def offset_known(self) -> bool:
        """Whether the offset means anything."""
        return bool(np.isfinite(self.offset_variance))


@dataclass(frozen=True)
class _Foot:
    """Where a wall meets the floor.

    Attributes:
        place: lateral, relative to the camera, m.
        sigma: standard deviation of the place, m, if this is the foot.
        doubt: chance that it is not.
    """

    place: float
    sigma: float
    doubt: float


@dataclass(frozen=True)
class _Expected:
    """Distance (m) to the side at which a foot is looked for, and its variance (m^2)."""

    away: float
    variance: float


@dataclass(frozen=True)
class _Hope:
    """Places (m) of two doubtful feet, left and right, and in how many successive pictures they were seen."""

    places: tuple[float, float]
    pictures: int


@dataclass
class LaneFilter:
    """Follows the offset from the centre line and the width of the lane between two walls.

    Nothing upright stands on the floor before a wall, and door frames stand on its foot or end at its skirting. So the
    nearest uprights tell where the wall is, and the foot is the innermost strong line there, at most a skirting's
    height before them: joints and reflections on the floor lie farther in, skirtings, recesses and rails farther
    out. Where no uprights are seen the foot is the innermost strong line. A foot runs all along the picture: a line
    that covers little of what a foot there would show is none or, if it covers more, is doubtful and counts for less.
    Once the lane is known a foot is looked for where it is expected, since a corridor hardly changes its width.

    Args:
        narrowest, widest: widths that a lane may have, m.
        drift: how fast the offset may wander (standard deviation after 1 s), m.
        width_drift: how fast the width may change (standard deviation after 1 s), m.
        cluster: relative spread of the lines of one wall's foot.
        foot_sigma: how straight the foot of a wall runs (standard deviation), relative to its distance.
        least_share: support a strong line has, relative to the strongest on its side.
        least_cover: share of what a foot at its place would show that a strong line covers.
        full_cover: share that leaves no doubt.
        confirmations: successive pictures in which a doubtful pair of feet must be seen to begin with.
        most_before: share of the uprights of a side (by length) that may end before its wall: chairs, reflections.
        tallest_skirting: height of the tallest skirting along a wall, m.
        patience: how long an offset is believed with a wall unseen, s.
        contradictions: successive pictures that must show both feet elsewhere before the lane is found anew.

    Raises:
        ValueError: for settings without meaning, naming the setting.
    """

    narrowest: float = 0.5
    widest: float = 12.0
    drift: float = 0.3
    width_drift: float = 0.03
    cluster: float = 0.04
    foot_sigma: float = 0.01
    least_share: float = 0.3
    least_cover: float = 0.25
    full_cover: float = 0.6
    confirmations: int = 3
    most_before: float = 0.08
    tallest_skirting: float = 0.13
    patience: float = 0.7
    contradictions: int = 8
    _filter: KalmanFilter | None = field(default=None, init=False, repr=False, compare=False)
    _stamp: float = field(default=0.0, init=False, repr=False, compare=False)
    _unseen: dict[int, float] = field(default_factory=dict, init=False, repr=False, compare=False)
    _contradicted: int = field(default=0, init=False, repr=False, compare=False)
    _hoped: _Hope | None = field(default=None, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in ("narrowest", "widest", "drift", "width_drift", "cluster", "foot_sigma", "full_cover"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a positive number, not {value}")
        if self.narrowest >= self.widest:
            raise ValueError(f"narrowest must be less than widest, {self.widest} m, not {self.narrowest}")
        for name in ("least_share", "least_cover", "most_before"):
            if not 0.0 <= getattr(self, name) < 1.0:
                raise ValueError(f"{name} must be a share in [0, 1), not {getattr(self, name)}")
        for name in ("tallest_skirting", "patience"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} must be a number, 0 or more, not {getattr(self, name)}")
        for name in ("confirmations", "contradictions"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1 picture, not {getattr(self, name)}")

    def reset(self) -> None:
        """Forget the lane."""
        self._filter = None
        self._contradicted = 0
        self._hoped = None

    def update(
        self, lines: LineSegments, points: VanishingPoints, attitude: Attitude, primary: int, stamp_s: float
    ) -> tuple[float, float, float] | None:
        """Offset of the camera to the left of the centre (m), its variance (m^2) and the width (m), if known.

        Args:
            lines: of the picture, with `points.labels` for each.
            points: vanishing points; `points.camera.height_m` must be known.
            attitude: of the camera.
            primary: index of the primary vanishing point.
            stamp_s: time of the picture, s.
        """
        evidence = floor_evidence(lines, points, attitude, primary)
        self._predict(stamp_s)
        feet = {side: self._foot(evidence, side) for side in _SIDES}
        if self._filter is not None:
            self._correct(evidence, feet)
        if self._filter is None and not self._begin(feet):
            return None
        assert self._filter is not None
        state, covariance = self._filter.x[:, 0], self._filter.P
        return float(state[0]), float(covariance[0, 0]), float(state[1])

    def _predict(self, stamp_s: float) -> None:
        seconds = stamp_s - self._stamp
        self._stamp = stamp_s
        if self._filter is None:
            return
        if not 0.0 <= seconds < 2.0:
            self.reset()
            return
        self._filter.predict(Q=np.diag([self.drift**2, self.width_drift**2]) * seconds)
        for side in self._unseen:
            self._unseen[side] += seconds

    def _begin(self, feet: dict[int, _Foot | None]) -> bool:
        """Take up a lane between two feet: at once where both are seen well, else once they have been confirmed."""
        from filterpy.kalman import KalmanFilter  # slow to import: it brings scipy.stats

        left, right = feet[1], feet[-1]
        if left is None or right is None or not self.narrowest <= left.place - right.place <= self.widest:
            self._hoped = None
            return False
        if max(left.doubt, right.doubt) > 0.0 and not self._confirmed(left, right):
            return False
        begun = KalmanFilter(dim_x=2, dim_z=1)
        begun.F = np.eye(2)
        mix = np.array([[-0.5, -0.5], [1.0, -1.0]])
        begun.x = mix @ np.array([[left.place], [right.place]])
        variances = [
            foot.sigma**2 + foot.doubt / (1.0 - foot.doubt) * (_DOUBTFUL * foot.place) ** 2
            for foot in (left, right)
        ]
        begun.P = mix @ np.diag(variances) @ mix.T
        self._filter = begun
        self._unseen = dict.fromkeys(_SIDES, 0.0)
        self._contradicted = 0
        self._hoped = None
        return True

    def _confirmed(self, left: _Foot, right: _Foot) -> bool:
        """Whether the same two feet have been seen in enough successive pictures."""
        before = self._hoped
        again = before is not None and all(
            abs(now.place - then) < _DOUBTFUL * abs(then)
            for now, then in zip((left, right), before.places, strict=True)
        )
        pictures = before.pictures + 1 if before is not None and again else 1
        self._hoped = _Hope((left.place, right.place), pictures)
        return pictures >= self.confirmations

    def _correct(self, evidence: FloorEvidence, feet: dict[int, _Foot | None]) -> None:
        """Take in the feet seen where they are expected; give up what is unseen or contradicted for too long."""
        assert self._filter is not None
        contradicted = False
        for side in _SIDES:
            expected = self._expected(side)
            near = self._foot(evidence, side, expected)
            anywhere = feet[side]
            if near is not None:
                # What may be chance is believed the less the more is known: in doubt by half, half the step.
                chance = near.doubt / (1.0 - near.doubt) * (expected.variance + near.sigma**2)
                self._filter.update(
                    np.array([[near.place]]), R=near.sigma**2 + chance, H=np.array([[-1.0, 0.5 * side]])
                )
                self._unseen[side] *= near.doubt
            if anywhere is not None and (
                near is None or abs(anywhere.place - near.place) > _DOUBTFUL * abs(near.place)
            ):
                contradicted = True
        self._contradicted = self._contradicted + 1 if contradicted and all(feet.values()) else 0
        if max(self._unseen.values()) > self.patience or self._contradicted >= self.contradictions:
            self.reset()

    def _expected(self, side: int) -> _Expected:
        """Where the filter looks for the foot of the wall on one side."""
        assert self._filter is not None
        observe = np.array([-side, 0.5])
        return _Expected(float(observe @ self._filter.x[:, 0]), float(observe @ self._filter.P @ observe))

    def _foot(self, evidence: FloorEvidence, side: int, expected: _Expected | None = None) -> _Foot | None:
        """The foot of the wall on one side (+1 left, -1 right), where it is expected or anywhere."""
        away = side * evidence.lateral
        usable = (away > 0.05) & (away < self.widest)
        surprise = np.zeros(len(away))
        if expected is not None:
            room = expected.variance + evidence.sigma**2 + (self.foot_sigma * expected.away) ** 2
            surprise = (away - expected.away) ** 2 / room
            usable &= surprise < _GATE
        if not usable.any():
            return None
        away, sigma, surprise = away[usable], evidence.sigma[usable], surprise[usable]
        weight, shown = evidence.weight[usable], evidence.shown[usable]
        reach = self.cluster * away[:, None] + sigma
        closeness = np.maximum(0.0, 1.0 - ((away[:, None] - away) / reach) ** 2)
        support = closeness @ weight
        strong = support >= np.maximum(self.least_share * support.max(), evidence.least)
        strong &= support >= self.least_cover * shown
        strong = self._before_uprights(strong, away, float(weight.max()), evidence, side)
        if not strong.any():
            return None
        # Of lines that are about as near the place expected, the innermost.
        strong &= surprise < surprise[strong].min() + _ABOUT
        foot = int(np.argmin(np.where(strong, away, np.inf)))
        share = closeness[foot] * weight / sigma**2
        place = float(share @ away / share.sum())
        scatter = float(share @ (away - place) ** 2 / share.sum())
        alone = float(1.0 / np.sqrt(np.sum(closeness[foot] / sigma**2)))
        own = float(np.hypot(alone, 0.5 * np.sqrt(scatter)) + _FOOT_SIGMA * place)
        doubt = float(np.clip(1.0 - support[foot] / (self.full_cover * shown[foot]), 0.0, _MOST_DOUBT))
        # What else might be the foot: anything as near the place expected; at first only where this one is doubtful.
        rivals = np.where(strong & (closeness[foot] == 0.0), weight, 0.0)
        rivals *= (1.0 if expected is not None else doubt) / (support[foot] + rivals.sum())
        torn = float(rivals @ (away - place) ** 2)
        return _Foot(side * place, float(np.sqrt(own**2 + torn)), doubt)

    def _before_uprights(
        self, strong: NDArray[np.bool_], away: Array, longest_line: float, evidence: FloorEvidence, side: int
    ) -> NDArray[np.bool_]:
        """Those of the strong lines (N,) of one side at which its uprights begin; all where there are too few to tell.

        Where none begin at the nearest ones, these are those of a thing on the floor: then a line counts on which
        enough of the uprights stand, if it is not before the wall that most of them stand.
        """
        bottoms, weight = side * evidence.bottoms, evidence.bottom_weight
        wall = self._wall(bottoms, weight, longest_line)
        if wall is None:
            return strong
        # A skirting of height h shows its upper edge as if it were H / (H - h) times as far out.
        skirting = min(self.tallest_skirting / evidence.height, 0.5)
        inner, outer = 1.0 - skirting - self.cluster, 1.0 + 2.0 * self.cluster
        there = strong & (away > inner * wall) & (away < outer * wall)
        if there.any() or not strong.any():
            return there
        weight = np.where(bottoms > 0.0, weight, 0.0)
        before = (bottoms < away[:, None] / outer) @ weight
        standing = (bottoms < away[:, None] / inner) @ weight - before
        enough = standing > _FEW_UPRIGHTS * longest_line
        return np.asarray(strong & enough & (before <= _MOST_BEFORE_WALL * weight.sum()))

    def _wall(self, bottoms: Array, weight: Array, longest_line: float) -> float | None:
        """Lateral distance at which the uprights of one side begin, m; None when there are too few to tell."""
        here = bottoms > 0.0
        bottoms, weight = bottoms[here], weight[here]
        if weight.sum() <= _FEW_UPRIGHTS * longest_line:
            return None
        order = np.argsort(bottoms, kind="stable")
        before = np.cumsum(weight[order])
        first = int(np.searchsorted(before, self.most_before * before[-1], side="right"))
        return float(bottoms[order[min(first, len(order) - 1)]])
