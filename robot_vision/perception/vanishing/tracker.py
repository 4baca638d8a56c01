# SPDX-License-Identifier: Apache-2.0
"""Vanishing points matched from picture to picture, so that one wrong picture cannot turn the robot."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.geometry.sphere import angle_between
from robot_vision.perception.vanishing.points import Role, VanishingPoints
from robot_vision.perception.vanishing.refit import rotation_about
from robot_vision.perception.vanishing.track import Motion, Track

Array = NDArray[np.float64]

_FAR = 1e6
#: A leading direction farther off the robot's own than this leads no longer, rad.
_ASIDE = np.deg2rad(65.0)
_RANK = {Role.PRIMARY: 0, Role.VERTICAL: 1, Role.HORIZONTAL: 2, Role.OTHER: 3}


@dataclass
class VanishingPointTracker:
    """Follows vanishing points through successive pictures.

    Each is a Kalman filter of its own. An observation joins the track it fits best if it lies within the gate; one
    that fits none begins a track of its own, which is believed after `confirmations` pictures in a row, so that a
    wrong vanishing point never takes the place of a right one. A track that was missed in a picture and not seen for
    `patience` dies. The primary one stays primary while it lives and leads roughly forward. Only the very first
    picture after a start is believed at once: there is nothing yet to hold it against.

    Args:
        gate: largest squared Mahalanobis distance of an observation (2 degrees of freedom; 13.8 loses one good
            observation in a thousand).
        widest_jump: largest angle of an observation from the prediction whatever the covariances say, rad.
        confirmations: successive pictures in which a new direction must have been seen.
        patience: how long a track lives without being seen, s; a single prediction it outlives in any case.
        agility: rate of turn in roll, pitch and, without odometry, yaw (standard deviation), rad/s.
        turn_rate_error: standard deviation of the turn rate given, rad/s, and relative to it.
        rate_memory: how long a turn that nobody announced lasts, s.
        longest_step: pictures farther apart in time than this start afresh, s.

    Raises:
        ValueError: for settings without meaning, naming the setting.
    """

    gate: float = 13.8
    widest_jump: float = float(np.deg2rad(12.0))
    confirmations: int = 3
    patience: float = 0.6
    agility: float = 0.25
    turn_rate_error: tuple[float, float] = (0.05, 0.05)
    rate_memory: float = 0.5
    longest_step: float = 2.0
    _tracks: list[Track] = field(default_factory=list, init=False, repr=False, compare=False)
    _started: bool = field(default=False, init=False, repr=False, compare=False)
    _stamp: float | None = field(default=None, init=False, repr=False, compare=False)
    _next_number: int = field(default=1, init=False, repr=False, compare=False)
    _looked: Array | None = field(default=None, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in ("gate", "widest_jump", "agility", "rate_memory", "longest_step"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a positive number, not {value}")
        if not 0.0 <= self.patience < np.inf:
            raise ValueError(f"patience must be a number of seconds, 0 or more, not {self.patience}")
        if self.confirmations < 1:
            raise ValueError(f"confirmations must be at least 1 picture, not {self.confirmations}")
        if len(self.turn_rate_error) != 2 or not all(0.0 <= e < np.inf for e in self.turn_rate_error):
            raise ValueError(
                f"turn_rate_error must be two numbers, 0 or more (rad/s, and relative), not {self.turn_rate_error}"
            )

    def reset(self) -> None:
        """Forget all tracks, as after a clock that jumped; numbers are not used again."""
        self._tracks.clear()
        self._started = False
        self._stamp = self._looked = None

    def predict(self, stamp_s: float, camera: Camera, turn_rate: float | None = None) -> Array | None:
        """Move all tracks to the time of the next picture.

        Args:
            stamp_s: time of the picture, s. Going back in time is a reset; far ahead, tracks are given up.
            camera: tells by its mounting about which axis the robot turns, and where a head that carries it looks.
            turn_rate: of the robot since the last picture, rad/s counter-clockwise; None when unknown.

        Returns:
            (3,) where the primary vanishing point is expected; None when nothing is.

        Raises:
            ValueError: for a stamp or a turn rate that is no finite number; the tracks stay as they were.
        """
        if not np.isfinite(stamp_s):
            raise ValueError(f"stamp_s must be a finite number, not {stamp_s}")
        if turn_rate is not None and not np.isfinite(turn_rate):
            raise ValueError(f"turn_rate must be a finite number or None, not {turn_rate}")
        if self._stamp is not None and stamp_s < self._stamp:
            self.reset()
        if self._stamp is not None and stamp_s - self._stamp > self.longest_step:
            # Not a reset: after a gap a direction is believed only when it has been seen again and again.
            self._tracks.clear()
            self._stamp = None
        seconds = 0.0 if self._stamp is None else stamp_s - self._stamp
        self._stamp = stamp_s
        turn = np.eye(3)
        body_rates = np.full(3, self.agility)
        if turn_rate is not None:
            # The world turns against the robot, about the robot's vertical as the camera sees it.
            turn = rotation_about(-turn_rate * seconds * camera.optical_to_base[2])
            body_rates[2] = np.hypot(self.turn_rate_error[0], self.turn_rate_error[1] * turn_rate)
        optical_from_base = camera.optical_to_base.T
        if self._looked is not None and not np.array_equal(self._looked, camera.optical_to_base):
            turn = turn @ (optical_from_base @ self._looked)  # the head has moved
        self._looked = camera.optical_to_base
        motion = Motion(self.rate_memory, (optical_from_base * body_rates**2) @ optical_from_base.T)
        for track in self._tracks:
            track.predict(seconds, turn, motion)
        # However far apart pictures are, what the last one showed is looked for in this one.
        self._tracks = [t for t in self._tracks if t.missed <= 1 or t.unseen_for <= self.patience]
        primary = self._primary(camera)
        return None if primary is None else primary.direction

    def update(self, observed: VanishingPoints) -> VanishingPoints:
        """Take in the vanishing points of the picture that was predicted.

        Returns:
            The tracks that are believed, seen in this picture or not, primary first; `labels` refer to them.
        """
        first_picture, self._started = not self._started, True
        partner = self._match(observed)
        for k, track in enumerate(partner):
            direction, covariance = observed.directions[k], observed.covariance[k]
            role, weight = Role(int(observed.roles[k])), float(observed.weight[k])
            if track is None:
                track = Track(self._next_number, direction, covariance, role, self.agility)
                track.weight = weight
                track.seen = self.confirmations if first_picture else 1
                self._next_number += 1
                self._tracks.append(track)
                partner[k] = track
            else:
                track.update(direction, covariance, weight)
                if role is not Role.PRIMARY and track.role is not Role.PRIMARY:
                    track.role = role
        self._tracks = [t for t in self._tracks if t.seen >= self.confirmations or t.missed == 0]
        self._pass_on_the_lead(observed, partner)
        return self._believed(observed, partner)

    def _match(self, observed: VanishingPoints) -> list[Track | None]:
        """The track of each observation, None for those that fit none."""
        from scipy.optimize import linear_sum_assignment  # slow to import

        partner: list[Track | None] = [None] * len(observed)
        if not self._tracks or not len(observed):
            return partner
        cost = np.full((len(observed), len(self._tracks)), _FAR)
        for j, track in enumerate(self._tracks):
            near = angle_between(observed.directions, track.direction) < self.widest_jump
            for k in np.flatnonzero(near):
                distance = track.distance(observed.directions[k], observed.covariance[k])
                if distance < self.gate:
                    # Among several that fit, the longer-lived track and the better supported point belong together.
                    cost[k, j] = distance - min(track.seen, 10) - min(float(observed.weight[k]), 50.0) / 10.0
        for k, j in zip(*linear_sum_assignment(cost), strict=True):
            if cost[k, j] < _FAR:
                partner[k] = self._tracks[j]
        return partner

    def _primary(self, camera: Camera) -> Track | None:
        """The track that leads, once it is believed, unless it has come to lie off to the side."""
        forward = camera.optical_to_base[0]
        for track in self._tracks:
            if track.role is Role.PRIMARY and track.seen >= self.confirmations:
                if angle_between(track.direction, forward) < _ASIDE:
                    return track
                track.role = Role.HORIZONTAL
        return None

    def _pass_on_the_lead(self, observed: VanishingPoints, partner: list[Track | None]) -> None:
        """Only one track leads: the one that did, else the first believed one that is observed as primary."""
        leads = self._primary(observed.camera)
        for k, track in enumerate(partner):
            if track is None or observed.roles[k] != Role.PRIMARY or track is leads:
                continue
            free = leads is None and track.seen >= self.confirmations
            track.role = Role.PRIMARY if free else Role.HORIZONTAL
            leads = track if free else leads

    def _believed(self, observed: VanishingPoints, partner: list[Track | None]) -> VanishingPoints:
        believed = [
            track
            for track in self._tracks
            if track.seen >= self.confirmations and track.unseen_for <= self.patience
        ]
        believed.sort(key=lambda track: (_RANK[track.role], -track.weight, track.number))
        if not believed:
            return VanishingPoints.none(observed.camera, len(observed.labels), observed.focal_sigma)
        place = {track.number: place for place, track in enumerate(believed)}
        relabel = np.array([place.get(track.number, -1) for track in partner if track is not None] + [-1])
        return replace(
            observed,
            directions=np.array([track.direction for track in believed]),
            covariance=np.array([track.covariance for track in believed]),
            weight=np.array([track.weight if track.missed == 0 else 0.0 for track in believed]),
            roles=np.array([track.role for track in believed], np.uint32),
            ids=np.array([track.number for track in believed], np.uint32),
            labels=relabel[observed.labels],
        )
