# SPDX-License-Identifier: Apache-2.0
"""Knows every plant around the robot from the picture in which it comes into view to where the boom has passed it.

After Sanchiz, Marchant, Pla and Hague (1996): plants of a picture are matched with those that are known, where the
robot's motion lets them be expected; what all plants share of the difference is the lean of the body and the error of
odometry; what is left corrects each plant.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.mapping.plant_errors import common_lean, other_rows, pose_noise, stem_noise
from robot_vision.mapping.plant_kinds import PlantJudge, in_rows
from robot_vision.mapping.plant_leaves import LeafCover
from robot_vision.mapping.plant_matching import blob_noise, look_for, matched, shift_noise
from robot_vision.mapping.plant_shift import FORWARD, LEFT, PITCH, ROLL, TURN, Shift, by_lean, common_shift
from robot_vision.mapping.plant_tracks import KNOWN_AGE, PlantTracks, Stature
from robot_vision.mapping.plants import PlantKind, Plants
from robot_vision.mapping.pose import Pose
from robot_vision.perception.crop_rows.ground_window import GroundWindow, Lean
from robot_vision.perception.crop_rows.plant_blobs import Blobs, PlantSegmenter
from robot_vision.perception.crop_rows.plant_bodies import FOREIGN
from robot_vision.perception.crop_rows.plant_colours import CropColour
from robot_vision.perception.crop_rows.row_filter import Motion
from robot_vision.perception.crop_rows.row_looks import middle_of_rows, row_radius
from robot_vision.perception.crop_rows.tracker import RowEstimate
from robot_vision.perception.lane import LaneHeading
from robot_vision.perception.vegetation import LeafMask, Picture

Array = NDArray[np.float64]
Rows = NDArray[np.intp]
Mask = NDArray[np.bool_]

#: Standard deviation of roll and pitch where no rows tell them, rad.
_UNSEEN_LEAN = 0.02
#: Where the crop closes plants are cut out of its leaves, at first in other places: larger ones than this share of
#: the radius of a usual plant are known once so many pictures have shown them, and are no weeds of its colour.
_SMALL, _SURE_AGE = 0.35, 5
#: Share of a picture's word on how large plants are.
_SLOWLY = 0.1
#: Difference in the logarithm of the area that doubles the variance of a place.
_AS_LARGE = 0.15
#: Least and greatest height of the middle of a plant of the crop, in radii.
_STATURES = 0.25, 1.2
#: New plants keep so many radii from known ones.
_OWN_GROUND = 0.5


@dataclass
class PlantMap:
    """Follows plants from picture to picture.

    Args:
        segmenter: of single pictures.
        lean: standard deviations of roll and pitch (rad) that the rows leave open; 0: plants have no say in them.
        slip: standard deviation of what odometry misses, a share of the way and of the turn.
        noise: standard deviation of the middle of a plant in a picture: m, and m for a metre of distance.
        gate: squared Mahalanobis distance (3 degrees of freedom) beyond which plants are not the same.
        behind: plants so far behind base_link are forgotten, m.
        sure: probability from which on a plant is called a weed.
        mask: of leaves.
        colour: of the crop; only pictures in colour have one.
        judge: of crop and weeds.

    Raises:
        ValueError: naming the setting that makes no sense.
    """

    segmenter: PlantSegmenter = field(default_factory=PlantSegmenter)
    lean: float = 0.002
    slip: float = 0.03
    noise: tuple[float, float] = (0.004, 0.004)
    gate: float = 14.0
    behind: float = 2.0
    sure: float = 0.85
    mask: LeafMask = field(default_factory=LeafMask)
    colour: CropColour = field(default_factory=CropColour)
    judge: PlantJudge = field(default_factory=PlantJudge)
    radius: float | None = field(default=None, init=False, compare=False)
    tracks: PlantTracks = field(default_factory=PlantTracks.none, init=False, repr=False, compare=False)
    pose: Pose = field(default=Pose(0.0, 0.0, 0.0), init=False, compare=False)
    shift: Shift | None = field(default=None, init=False, repr=False, compare=False)
    _cover: LeafCover = field(default_factory=LeafCover, init=False, repr=False, compare=False)
    _next: int = field(default=1, init=False, repr=False, compare=False)
    _lean: Lean = field(default=Lean(), init=False, repr=False, compare=False)
    _tall: float = field(default=0.6, init=False, repr=False, compare=False)
    _blind: bool = field(default=False, init=False, repr=False, compare=False)
    _closes: bool = field(default=False, init=False, repr=False, compare=False)
    _height: float = field(default=1.0, init=False, repr=False, compare=False)
    _lean_error: Array = field(
        default_factory=lambda: np.zeros((2, 2)), init=False, repr=False, compare=False
    )
    _sigmas: Array = field(default_factory=lambda: np.full(6, 1e-3), init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in ("slip", "gate", "behind"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0.0):
                raise ValueError(f"{name} must be a positive number, not {getattr(self, name)}")
        if not 0.0 <= self.lean < 0.5:
            raise ValueError(f"lean must lie in [0, 0.5) rad, not {self.lean}")

    @property
    def leaves(self) -> Array | None:
        """Where leaves of the crop were seen: middles (L, 2) of cells, ahead and left of base_link, m.

        None where the crop does not close: there plants tell more of what is hidden.
        """
        return self._cover.places(self.pose) if self._closes and not self._blind else None

    @property
    def lean_seen(self) -> Lean:
        """How the body leaned in the last picture, as rows and plants have it."""
        if self.shift is None:
            return self._lean
        roll, pitch = self.shift.values[[ROLL, PITCH]].tolist()
        return Lean(self._lean.roll + roll, self._lean.pitch + pitch, self._lean.height)

    def reset(self) -> None:
        """Forget all plants; numbers are not given anew."""
        self.tracks = PlantTracks.none()
        self.pose, self.shift, self.radius = Pose(0.0, 0.0, 0.0), None, None
        self.judge.reset()
        self.colour.reset()
        self._cover.reset()
        self._closes = False

    def move(self, motion: Motion) -> None:
        """Go on by what the robot did; without a speed nobody knows where the plants are now.

        Args:
            motion: since the picture before.
        """
        if motion.speed is None:
            self.tracks, self.shift = PlantTracks.none(), None
            self._cover.reset()
            return
        turn = (motion.turn_rate or 0.0) * motion.seconds
        way = motion.speed * motion.seconds
        chord, course = way * np.sinc(turn / 2 / np.pi), self.pose.yaw + turn / 2
        x, y, yaw = self.pose
        self.pose = Pose(x + chord * np.cos(course), y + chord * np.sin(course), yaw + turn)
        self.tracks.shared *= other_rows(way)
        unsure = np.hypot(0.003, self.slip * way)
        self._sigmas = np.array(
            [unsure, unsure, np.hypot(0.001, self.slip * turn + 0.003 * way), self.lean, self.lean, 0.004]
        )

    def update(
        self, picture: Picture, camera: Camera, rows: RowEstimate, spacing: float, motion: Motion
    ) -> Plants:
        """Take in a picture, and tell which plants stand around the robot now.

        Without odometry no plant is known again: those of this picture are told, with new numbers.

        Args:
            picture: rectified, uint8 (H, W, 3) BGR, or (H, W) in the near infrared.
            camera: with its place on the robot, of the picture's size; its height must be known.
            rows: what the tracker says of the same picture.
            spacing: between rows, m.
            motion: since the picture before.

        Raises:
            ValueError: the camera has no height, or the array is no picture.
        """
        if camera.height_m is None:
            raise ValueError("plants need the height of the camera (parameter camera.height)")
        camera = camera.rectified()
        self.move(motion)
        self._blind = motion.speed is None
        if not rows.fault:
            self._see(picture, camera, rows, spacing)
        return self._told(rows.lane, spacing)

    def _see(self, picture: Picture, camera: Camera, rows: RowEstimate, spacing: float) -> None:
        assert camera.height_m is not None
        lean, sigma = Lean(height=self._lean.height), _UNSEEN_LEAN
        self._lean_error = np.zeros((2, 2))  # all that is not known of it is new in this picture
        if rows.rows is not None:
            lean, sigma = Lean(*rows.rows.values[ROLL:].tolist()), self.lean
            claimed = rows.rows.covariance[ROLL : PITCH + 1, ROLL : PITCH + 1]
            self._lean_error = common_lean(claimed, self.lean, 1.0 - float(np.exp(lean.height)))
        self._lean = lean
        self._sigmas[[ROLL, PITCH]] = sigma
        mask = self.mask.of(picture)
        # where leaves do not close, their shape tells plants apart, and more surely
        colours = self.colour.of(picture) if self._closes and self.mask.by_colour(picture) else None
        foreign = None if colours is None else self.colour.foreign(colours, mask)
        window = self.segmenter.look(mask, camera, lean, foreign)
        if rows.rows is not None:
            radius = row_radius(window, rows.rows.values, spacing)
            if radius is not None:
                # rows stand as high above the ground as their leaves do on the average
                high = camera.height_m * (1.0 - np.exp(lean.height))
                tall = float(np.clip(high / radius, *_STATURES))
                self._tall += (1.0 if self.radius is None else _SLOWLY) * (tall - self._tall)
                self.radius = (
                    radius if self.radius is None else self.radius + _SLOWLY * (radius - self.radius)
                )
            if colours is not None and self.radius is not None:
                crop = middle_of_rows(window, rows.rows.values, spacing, self.radius)
                self.colour.learn(self.segmenter.lay_out(colours, camera, lean)[crop])
        self._closes = window.closes
        self.see(window, camera, lean)
        if self._closes:
            self._cover.see(window, self.pose)

    def _told(self, lane: LaneHeading | None, spacing: float) -> Plants:
        """The plants that are known, as seen from the robot."""
        tracks = self.tracks
        large = tracks.radii > _SMALL * (self.radius or np.inf)
        known = tracks.ages >= (1 if self._blind else KNOWN_AGE)
        if self._closes and not self._blind:
            known &= ~large | (tracks.ages >= _SURE_AGE)
        cosine, sine = np.cos(self.pose.yaw), np.sin(self.pose.yaw)
        to_base = np.array([[cosine, sine], [-sine, cosine]])
        field_places = tracks.states[known, :2]
        places = (field_places - (self.pose.x, self.pose.y)) @ to_base.T
        log_areas, foreign = tracks.log_areas[known], tracks.foreign[known]
        covariance = np.asarray(to_base @ tracks.covariances[known, :2, :2] @ to_base.T)
        large = large[known]
        covariance += stem_noise(tracks.radii[known], large & self._closes)
        if self.shift is not None:
            covariance += pose_noise(places, self.shift)
        weed = np.full(len(places), np.nan)
        if lane is not None:
            weed = self.judge.judge(
                in_rows(places, covariance, log_areas, foreign, lane, spacing, self.judge.scatter), spacing
            )
        kinds = np.full(len(places), PlantKind.UNSURE, np.uint8)
        kinds[weed > self.sure] = PlantKind.WEED
        if self._closes:
            kinds[(foreign < FOREIGN) & large] = PlantKind.UNSURE
        kinds[weed < 0.5] = PlantKind.CROP
        return Plants(
            tracks.ids[known],
            places,
            self._height * (1.0 - np.exp(tracks.states[known, 2])),
            np.exp(log_areas),
            tracks.ages[known],
            covariance,
            weed,
            kinds,
            field_places,
        )

    def see(self, window: GroundWindow, camera: Camera, lean: Lean) -> None:
        """Match the plants of a window with those that are known, and correct these."""
        assert camera.height_m is not None
        self._height = camera.height_m
        known = self.tracks.ages >= KNOWN_AGE
        places = self.tracks.seen_from(self.pose, camera.x_m)[0] * (window.fall / camera.height_m)
        places += (camera.x_m, 0.0)
        alike = places[known & (self.tracks.foreign < FOREIGN)]
        small = places[known & (self.tracks.radii < _SMALL * (self.radius or np.inf))]
        blobs = self.segmenter.cut(window, camera, lean, self.radius, alike, small)
        height = camera.height_m
        self.shift = self._shift(blobs, camera)
        seen = height * self.shift.straightened(blobs.slopes)
        noise = blob_noise(blobs, height, self.noise) + shift_noise(blobs, self.shift, height, camera.x_m)
        tracks = self.tracks
        expected, jacobian = tracks.seen_from(self.pose, camera.x_m)
        spread = jacobian @ tracks.covariances @ jacobian.transpose(0, 2, 1)
        mine, theirs = matched(tracks, expected, spread, seen, noise, blobs, self.gate)
        whole = blobs.whole[theirs]
        tracks.missed[mine] = tracks.hidden[mine] = 0
        # what the border of the picture cuts is no plant less, but nobody knows how large it is
        tracks.ages[mine[~whole]] += 1
        alone = np.ones(len(tracks), bool)
        alone[mine] = False
        mine, theirs = mine[whole], theirs[whole]
        # a blob larger or smaller than its plant has something of another, or lacks something
        size = np.log(blobs.areas[theirs]) - tracks.log_areas[mine] + 2.0 * tracks.states[mine, 2]
        doubt = 1.0 + (size / _AS_LARGE) ** 2
        common = height * by_lean(blobs.slopes) @ self._lean_error
        tracks.correct(
            mine,
            seen[theirs],
            noise[theirs] * doubt[:, None, None],
            common[theirs],
            self.pose,
            camera.x_m,
        )
        q = np.exp(tracks.states[mine, 2])
        areas = blobs.areas[theirs] * (q * np.exp(-lean.height)) ** 2
        tracks.see_looks(mine, areas, blobs.foreign[theirs])
        places = expected * (window.fall / height) + (camera.x_m, 0.0)
        look_for(tracks, alone, places, window)
        self._begin(blobs, theirs, seen, noise, common, camera)
        tracks.forget(self.pose, self.behind)

    def _shift(self, blobs: Blobs, camera: Camera) -> Shift:
        """What all plants share; by it the pose is corrected."""
        assert camera.height_m is not None
        none = Shift(np.zeros(6), np.diag(self._sigmas**2))
        tracks = self.tracks
        if not len(tracks) or not len(blobs):
            return none
        expected, jacobian = tracks.seen_from(self.pose, camera.x_m)
        spread = jacobian @ tracks.covariances @ jacobian.transpose(0, 2, 1)
        own = blob_noise(blobs, camera.height_m, self.noise)
        common = shift_noise(blobs, none, camera.height_m, camera.x_m)
        seen = camera.height_m * blobs.slopes
        mine, theirs = matched(tracks, expected, spread, seen, own + common, blobs, self.gate)
        good = blobs.whole[theirs]
        mine, theirs = mine[good], theirs[good]
        if not len(mine):
            return none
        found = common_shift(
            blobs.slopes[theirs],
            expected[mine],
            spread[mine] + own[theirs],
            camera.height_m,
            camera.x_m,
            self._sigmas,
        )
        ahead, left, turn = found.values[[FORWARD, LEFT, TURN]]
        cosine, sine = np.cos(self.pose.yaw), np.sin(self.pose.yaw)
        x, y, yaw = self.pose
        self.pose = Pose(
            float(x + cosine * ahead - sine * left),
            float(y + sine * ahead + cosine * left),
            float(yaw + turn),
        )
        return found

    def _begin(
        self, blobs: Blobs, taken: Rows, seen: Array, noise: Array, common: Array, camera: Camera
    ) -> None:
        """Begin with blobs that are no known plant."""
        assert camera.height_m is not None
        new = blobs.whole.copy()
        new[taken] = False
        if len(self.tracks) and new.any():
            expected, _ = self.tracks.seen_from(self.pose, camera.x_m)
            radius = self.tracks.radii
            away = np.linalg.norm(seen[new][:, None, :] - expected[None, :, :], axis=2)
            strange = blobs.foreign[new] >= FOREIGN
            alike = ~strange[:, None] | (self.tracks.foreign >= FOREIGN)
            new[np.flatnonzero(new)[((away < _OWN_GROUND * radius) & alike).any(axis=1)]] = False
        count = int(new.sum())
        if count:
            self.tracks.begin(
                self._next,
                seen[new],
                noise[new],
                common[new],
                blobs.areas[new] * np.exp(-2.0 * blobs.lean.height),
                blobs.foreign[new],
                self.pose,
                camera.x_m,
                camera.height_m,
                Stature(self.radius, self._tall),
            )
            self._next += count
