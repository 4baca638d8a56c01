# SPDX-License-Identifier: Apache-2.0
"""From the lines of successive pictures to a road that bends: found once, followed, given up when it is not seen."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.perception.road.borders import Borders
from robot_vision.perception.road.chords import ChordReader, Chords
from robot_vision.perception.road.curve import Alignment
from robot_vision.perception.road.estimate import OFFSET, PITCH, ROLL, WIDTH, YAW, RoadEstimate
from robot_vision.perception.road.road_filter import RoadFilter, RoadMotion
from robot_vision.perception.road.search import FoundRoad, find_road
from robot_vision.perception.segments import LineSegments

Array = NDArray[np.float64]

#: A road that is searched for is looked at so far ahead, m; its chords begin nearer than this, m.
_SEARCH_FARTHEST, _SEARCH_BEGIN = 20.0, 15.0
#: Two searches that tell of one road differ by less, as a share of its width.
_SAME = 0.2
#: A road stands at no such angle to the robot (rad) and makes the body lean by no so many standard deviations.
_MOST_YAW, _MOST_LEAN = 1.0, 5.0
#: Chords belong to the road down to this weight.
_BELONGS = 0.3
#: Pictures from one look whether the road that is followed is the one a search finds to the next such look.
_LOOK_EVERY = 5
#: Pictures farther apart in time than this start afresh, s.
_LONGEST_STEP = 2.0


@dataclass
class RoadTracker:
    """Follows a road with borders on both sides through successive pictures.

    Args:
        narrowest, widest: distance that the borders of a road may have, m.
        farthest: how far ahead chords tell of the road, m.
        lean: standard deviation of the body's roll and pitch about the camera's mounting, rad.
        least_support: length of chords that must lie on the road in a picture, px.
        confirmations: successive pictures in which a road must be seen before it is believed.
        patience: how long a road is remembered that is not seen, s.
        contradictions: successive looks that must find another road before the one followed is given up.
        motion: how roads go on and robots move.

    Raises:
        ValueError: for settings without meaning, naming the setting.
    """

    narrowest: float = 1.0
    widest: float = 12.0
    farthest: float = 36.0
    lean: float = float(np.deg2rad(2.0))
    least_support: float = 80.0
    confirmations: int = 3
    patience: float = 0.7
    contradictions: int = 4
    motion: RoadMotion = field(default_factory=RoadMotion)
    _alignment: Alignment = field(default_factory=Alignment, init=False, repr=False, compare=False)
    _filter: RoadFilter | None = field(default=None, init=False, repr=False, compare=False)
    _stamp: float | None = field(default=None, init=False, repr=False, compare=False)
    _seen: int = field(default=0, init=False, repr=False, compare=False)
    _unseen_for: float = field(default=0.0, init=False, repr=False, compare=False)
    _pictures: int = field(default=0, init=False, repr=False, compare=False)
    _contradicted: int = field(default=0, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in ("narrowest", "widest", "farthest", "lean", "least_support"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a positive number, not {value}")
        if self.narrowest >= self.widest:
            raise ValueError(f"narrowest must be less than widest, {self.widest} m, not {self.narrowest}")
        if not 0.0 <= self.patience < np.inf:
            raise ValueError(f"patience must be a number of seconds, 0 or more, not {self.patience}")
        for name in ("confirmations", "contradictions"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1 picture, not {getattr(self, name)}")

    def reset(self) -> None:
        """Forget the road."""
        self._filter = None
        self._stamp = None

    def update(
        self,
        lines: LineSegments,
        camera: Camera,
        stamp_s: float,
        speed: float | None = None,
        turn_rate: float | None = None,
    ) -> RoadEstimate | None:
        """Take in the lines of the next picture.

        Args:
            lines: segments in rectified pixels.
            camera: rectified, with its height.
            stamp_s: time of the picture, s.
            speed: of the robot since the last picture, m/s; None when unknown.
            turn_rate: likewise, rad/s counter-clockwise.

        Returns:
            The road, where it is believed and seen in this picture.

        Raises:
            ValueError: for a stamp that is no number, or a camera whose height or focal length is not known.
        """
        if not np.isfinite(stamp_s):
            raise ValueError(f"stamp_s must be a finite number, not {stamp_s}")
        if camera.height_m is None or not camera.focal_known:
            raise ValueError(
                "a road is measured on the ground: height and focal length of the camera are needed"
            )
        seconds = 0.0 if self._stamp is None else stamp_s - self._stamp
        if not 0.0 <= seconds <= _LONGEST_STEP:
            self.reset()
        self._stamp = stamp_s
        self._pictures += 1
        if self._filter is not None:
            self._filter.predict(seconds, speed, turn_rate)
            self._look_again(lines, camera)
        if self._filter is None and not self._begin(lines, camera):
            return None
        assert self._filter is not None
        chords, borders = self._filter.update(ChordReader(lines, camera, self.farthest))
        return self._judge(chords, borders, camera, seconds)

    def _begin(self, lines: LineSegments, camera: Camera) -> bool:
        found = self._search(lines, camera, camera.roll, camera.pitch)
        if found is None or found.support < 0.5 * self.least_support:
            return False
        self._filter = RoadFilter(self._alignment, self.motion, found, camera, self.lean)
        self._seen = self._contradicted = 0
        self._unseen_for = 0.0
        return True

    def _search(self, lines: LineSegments, camera: Camera, roll: float, pitch: float) -> FoundRoad | None:
        chords = ChordReader(lines, camera, _SEARCH_FARTHEST).read(roll, pitch)
        return find_road(chords, self.narrowest, self.widest, _SEARCH_BEGIN)

    def _look_again(self, lines: LineSegments, camera: Camera) -> None:
        """Search now and then all the same: a filter that follows a wrong border follows it well."""
        assert self._filter is not None
        young = self._seen < self.confirmations
        if self._pictures % _LOOK_EVERY and not young:
            return
        state = self._filter.state
        found = self._search(lines, camera, state[ROLL], state[PITCH])
        if found is None or found.support < 0.5 * self.least_support:
            return
        near = _SAME * state[WIDTH]
        same = abs(found.offset - state[OFFSET]) < near and abs(found.width - state[WIDTH]) < 2.0 * near
        self._contradicted = 0 if same else self._contradicted + 1
        if self._contradicted >= (1 if young else self.contradictions):
            self._filter = None

    def _judge(self, chords: Chords, borders: Borders, camera: Camera, seconds: float) -> RoadEstimate | None:
        """What is believed of the road, where this picture shows it."""
        assert self._filter is not None
        mine = borders.weight > _BELONGS
        support = float(chords.lengths[mine] @ borders.weight[mine])
        if support < self.least_support or mine.sum() < 2:
            self._unseen_for += seconds
            if self._unseen_for > self.patience or self._seen < self.confirmations:
                self._filter = None
            return None
        self._seen += 1
        self._unseen_for = 0.0
        if not self._sane(self._filter.state, camera):
            self._filter = None
            return None
        if self._seen < self.confirmations:
            return None
        return RoadEstimate(
            self._filter.state,
            self._filter.covariance,
            self._alignment,
            float(chords.points[mine, :, 0].max()),
            chords.index[mine],
            borders.along[mine],
        )

    def _sane(self, state: Array, camera: Camera) -> bool:
        lean = np.hypot(state[ROLL] - camera.roll, state[PITCH] - camera.pitch)
        fits = 0.8 * self.narrowest < state[WIDTH] < 1.2 * self.widest
        return bool(fits and abs(state[YAW]) < _MOST_YAW and lean < _MOST_LEAN * self.lean)
