# SPDX-License-Identifier: Apache-2.0
"""From picture after picture to a map of the floor: the stages of Table 20.1 in their order, one object, one verb."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera, GroundPlane
from robot_vision.mapping.appearance import FloorAppearance
from robot_vision.mapping.boundary import Boundary, BoundaryFinder
from robot_vision.mapping.clearance import Clearance
from robot_vision.mapping.evidence import Evidence, sharp
from robot_vision.mapping.feature_points import FeatureAnnotator, GroundPoints
from robot_vision.mapping.floor_sample import FloorSample
from robot_vision.mapping.freeze import FreezeDetector
from robot_vision.mapping.ground_lines import Borders, GroundLines, LineKind
from robot_vision.mapping.ground_view import GroundView
from robot_vision.mapping.horizon import Horizon, HorizonFilter
from robot_vision.mapping.kerbs import KerbFinder
from robot_vision.mapping.objects import GroundObject, ObjectFinder
from robot_vision.mapping.occupancy import OccupancyMap
from robot_vision.mapping.plan_view import PlanView, PlanViewMaker, Seen
from robot_vision.mapping.plane_motion import Parallax, PlaneMotion
from robot_vision.mapping.pose import Pose
from robot_vision.mapping.shadows import ShadowFinder
from robot_vision.perception import LineSegments, Role, VanishingPoints

Picture = NDArray[np.uint8]
Scores = NDArray[np.float32]

_DARK = 12.0
"""Mean grey level below which a picture shows nothing."""
_FLAT = 3.0
"""Standard deviation of the grey levels below which something covers the lens."""
_MOVED_M, _TURNED = 0.03, 0.02
"""Way (m) and turn (rad) after which no two pictures are the same."""


@dataclass(frozen=True)
class Layers:
    """What the stages found in one picture, for people to see.

    Attributes:
        view: of the ground in the working picture.
        gray: (H, W) the working picture.
        score: (H - view.top, W) positive for floor.
        shadow: (H - view.top, W) floor in shadow.
        parallax: against an earlier picture, None without one.
        kinds: (N,) `LineKind` of each line.
        boundary: end of the floor.
    """

    view: GroundView
    gray: Picture
    score: Scores
    shadow: NDArray[np.bool_]
    parallax: Parallax | None
    kinds: NDArray[np.intp]
    boundary: Boundary


@dataclass(frozen=True)
class PlanViewEstimate:
    """What one picture adds to the knowledge of the floor.

    Attributes:
        plan_view: cells in base_link; all unknown when the picture tells nothing.
        clearance: free floor before the robot's front, m; inf as far as is seen; None when nobody can tell.
        objects: things on the floor.
        horizon: how the camera leans.
        mapped: whether the picture went into the map.
        slip: share by which odometry tells too much motion; nan while nobody can tell.
        reason: in plain words what is wrong or missing; empty when nothing is.
        layers: of the stages; None when the picture tells nothing.
    """

    plan_view: PlanView
    clearance: float | None
    objects: list[GroundObject]
    horizon: Horizon
    mapped: bool
    slip: float
    reason: str
    layers: Layers | None


@dataclass
class PlanViewMapper:
    """Draws the plan of the floor of every picture and gathers them in a map (Table 20.1).

    Args:
        reach: farthest floor spoken of, m.
        trusted: relative error of a distance beyond which nothing is said; it limits the reach, too.
        unchecked: weight in the map of a picture that could not be held against an earlier one.
        slip: share of the way that odometry may be wrong by before its pictures stay out of the map.
        low_borders: whether floor may end at a line beyond which nothing stands up; not where all that stands is tall.
        horizon, sample, appearance, motion, evidence, shadows, finder, lines, kerbs, objects, maker, clearance,
            features, map: the stages.

    Raises:
        ValueError: naming the setting that is not a positive number.
    """

    reach: float = 7.0
    trusted: float = 0.2
    unchecked: float = 0.25
    slip: float = 0.1
    low_borders: bool = True
    horizon: HorizonFilter = field(default_factory=HorizonFilter)
    sample: FloorSample = field(default_factory=FloorSample)
    appearance: FloorAppearance = field(default_factory=FloorAppearance)
    motion: PlaneMotion = field(default_factory=PlaneMotion)
    evidence: Evidence = field(default_factory=Evidence)
    shadows: ShadowFinder = field(default_factory=ShadowFinder)
    finder: BoundaryFinder = field(default_factory=BoundaryFinder)
    lines: GroundLines = field(default_factory=GroundLines)
    kerbs: KerbFinder = field(default_factory=KerbFinder)
    objects: ObjectFinder = field(default_factory=ObjectFinder)
    maker: PlanViewMaker = field(default_factory=PlanViewMaker)
    clearance: Clearance = field(default_factory=Clearance)
    features: FeatureAnnotator = field(default_factory=FeatureAnnotator)
    map: OccupancyMap = field(default_factory=OccupancyMap)
    _freeze: FreezeDetector = field(
        default_factory=lambda: FreezeDetector(_MOVED_M, _TURNED), init=False, repr=False
    )
    _slips: deque[float] = field(default_factory=lambda: deque(maxlen=15), init=False, repr=False)

    def __post_init__(self) -> None:
        for name in ("reach", "trusted", "unchecked", "slip"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a positive number, not {value}")

    def reset(self) -> None:
        """Forget everything earlier pictures told, the map too."""
        seen = (self.horizon, self.sample, self.appearance, self.motion, self.shadows, self.kerbs, self.map)
        for stage in (*seen, self._freeze):
            stage.reset()
        self._slips.clear()

    def warm_up(self) -> None:
        """Go once through all stages, so that the first picture is not kept waiting."""
        camera = Camera(400.0, 400.0, 159.5, 119.5, 320, 240, height_m=0.6, pitch=0.1)
        picture = np.random.default_rng(0).integers(60, 200, (240, 320, 3), dtype=np.uint8)
        trial = PlanViewMapper()
        for step in range(2):
            pose = Pose(0.5 * step, 0.0, 0.0)
            trial.update(np.roll(picture, step, axis=1), LineSegments.empty(), None, camera, 0.1 * step, pose)

    def update(
        self,
        picture: Picture,
        lines: LineSegments,
        points: VanishingPoints | None,
        camera: Camera,
        stamp_s: float,
        pose: Pose | None = None,
        pitch_rate: float | None = None,
    ) -> PlanViewEstimate:
        """Take in the next picture.

        Args:
            picture: rectified, BGR (H, W, 3) or grey (H, W), uint8.
            lines: of the picture, rectified pixels.
            points: its vanishing points; None when nobody knows any.
            camera: of the picture, with `height_m`, roll and pitch of its mounting.
            stamp_s: of the picture, s.
            pose: of base_link in odom at that time; None without odometry: then there is no map.
            pitch_rate: of the robot, rad/s, nose down positive; None when nobody knows.

        Raises:
            ValueError: the picture is not of the camera's size.
            GroundPlaneError: height or focal length of the camera are not known.
        """
        camera = camera.rectified()
        GroundPlane(camera).check_metric()
        if picture.shape[:2] != (camera.height, camera.width):
            size = f"{picture.shape[1]} x {picture.shape[0]}"
            raise ValueError(f"the picture is {size}, but the camera's are {camera.width} x {camera.height}")
        horizon = self.horizon.update(camera, points, stamp_s, pitch_rate)
        working = _half(picture)
        gray = np.asarray(cv2.cvtColor(working, cv2.COLOR_BGR2GRAY), np.uint8)
        unreadable = _unreadable(gray)
        if unreadable:
            return self._nothing(horizon, unreadable)
        if pose is not None and self._freeze.update(gray, pose):
            return self._nothing(
                horizon, "the picture stays the same while the robot moves: does the camera hang?"
            )
        if not horizon.steady:
            return self._nothing(
                horizon, "the vanishing points contradict the horizon: was the camera knocked?"
            )
        view = GroundView(horizon.camera, 0.5)
        reach = min(self.reach, horizon.reach(self.trusted))
        return self._look(working, gray, lines, points, view, reach, horizon, pose)

    def ground_points(self, estimate: PlanViewEstimate) -> GroundPoints | None:
        """Feature points of the picture of an estimate with their coordinates; None when it told nothing."""
        seen = estimate.layers
        if seen is None:
            return None
        reach = min(self.reach, estimate.horizon.reach(self.trusted))
        tilt = estimate.horizon.covariance
        return self.features.annotate(seen.gray, seen.boundary, seen.shadow, seen.view, tilt, reach)

    def _look(
        self,
        working: Picture,
        gray: Picture,
        lines: LineSegments,
        points: VanishingPoints | None,
        view: GroundView,
        reach: float,
        horizon: Horizon,
        pose: Pose | None,
    ) -> PlanViewEstimate:
        top = view.top
        lower = working[top:]
        lab = np.asarray(cv2.cvtColor(cv2.GaussianBlur(working, (0, 0), 0.8), cv2.COLOR_BGR2LAB), np.uint8)
        strange = self._learn(lower, lab, view, pose)
        likeness = np.asarray(cv2.blur(self.appearance.score(lab[top:]), (3, 3)), np.float32)
        parallax = None
        if pose is not None:
            parallax = self.motion.compare(gray, pose, view, likeness > self.evidence.likeness)
        if parallax is not None and np.isfinite(parallax.slip):
            self.horizon.correct(parallax.pitch_error, parallax.pitch_sigma)
        score = self.evidence.score(likeness, parallax)
        dim = self.shadows.dim(lower)
        shadow = self.shadows.find(dim, score, view, parallax)
        score[shadow] = 1.0
        kinds, borders = np.zeros(len(lines), np.intp), Borders.none()
        if points is not None:
            kinds, borders = self.lines.sort(lines, points, score, dim, view)
            if self.low_borders:
                borders = borders.joined(
                    self._kerbs(lines, kinds, points, score, dim, lab[top:], view, pose, parallax)
                )
                score[self.lines.cut(borders, score.shape, view)] = -1.0
        boundary = self.finder.find(score, sharp(gray, 4.0, 4)[top:], gray, view, reach)
        straight = self.lines.straighten(boundary, borders, view)
        on_border = straight.rows != boundary.rows
        seen = Seen(straight, view, reach)
        slip = self._slip(parallax)
        reason = strange or self._doubt(horizon, pose, slip)
        mapped = pose is not None and not strange and not abs(slip) > self.slip
        if mapped and pose is not None:
            self.map.update(seen, pose, 1.0 if parallax is not None else self.unchecked)
        return PlanViewEstimate(
            plan_view=self.maker.draw(seen),
            clearance=0.0 if strange else self._clear(straight, points, view, reach, pose),
            objects=self.objects.find(straight, on_border, view),
            horizon=horizon,
            mapped=mapped,
            slip=slip,
            reason=reason,
            layers=Layers(view, gray, score, shadow, parallax, kinds, straight),
        )

    def _kerbs(
        self,
        lines: LineSegments,
        kinds: NDArray[np.intp],
        points: VanishingPoints,
        score: Scores,
        dim: NDArray[np.bool_],
        lab: Picture,
        view: GroundView,
        pose: Pose | None,
        parallax: Parallax | None,
    ) -> Borders:
        primary = points.of(Role.PRIMARY)
        if primary is None:
            return Borders.none()
        ends = lines.endpoints[kinds != LineKind.IRRELEVANT] * view.scale + (view.scale - 1.0) / 2.0
        return self.kerbs.find(ends, points.directions[primary], score, dim, lab, view, pose, parallax)

    def _learn(self, lower: Picture, lab: Picture, view: GroundView, pose: Pose | None) -> str:
        """Learn the floor just before the robot; say so if it looks like no floor that is known."""
        part = lab[view.top :]
        sample, strange = self.sample.choose(part, self.appearance, view, pose)
        if sample is not None:
            self.appearance.learn(part, sample, lab[: max(view.top, 1)])
            self.shadows.learn(lower, sample)
        return strange

    def _clear(
        self,
        boundary: Boundary,
        points: VanishingPoints | None,
        view: GroundView,
        reach: float,
        pose: Pose | None,
    ) -> float:
        """Free floor ahead of the robot's front, m: what the picture shows, and what the map knows that it does not."""
        clear = self.clearance.measure(boundary, points, view, reach)
        return clear if pose is None else min(clear, self.clearance.remembered(self.map, pose, points, view))

    def _slip(self, parallax: Parallax | None) -> float:
        if parallax is not None and np.isfinite(parallax.slip):
            self._slips.append(parallax.slip)
        return float(np.median(self._slips)) if len(self._slips) >= 3 else float("nan")

    def _doubt(self, horizon: Horizon, pose: Pose | None, slip: float) -> str:
        if horizon.knock:
            return horizon.knock
        if abs(slip) > self.slip:
            more = "more" if slip > 0.0 else "less"
            return (
                f"odometry tells {abs(slip):.0%} {more} way than the floor shows: nothing goes into the map"
            )
        if pose is None:
            return "no odometry: a plan of each picture, but no map"
        return ""

    def _nothing(self, horizon: Horizon, reason: str) -> PlanViewEstimate:
        return PlanViewEstimate(self.maker.draw(None), None, [], horizon, False, float("nan"), reason, None)


def _half(picture: Picture) -> Picture:
    """The working picture, BGR at half the size."""
    size = (round(picture.shape[1] * 0.5), round(picture.shape[0] * 0.5))
    half = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    return np.asarray(half if half.ndim == 3 else cv2.cvtColor(half, cv2.COLOR_GRAY2BGR))


def _unreadable(gray: Picture) -> str:
    """Why a picture shows nothing; empty when it shows something."""
    mean, deviation = (float(part[0, 0]) for part in cv2.meanStdDev(gray))
    if mean < _DARK:
        return "the picture is dark"
    if deviation < _FLAT:
        return "the picture shows nothing: is the lens covered?"
    return ""
