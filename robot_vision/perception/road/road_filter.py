# SPDX-License-Identifier: Apache-2.0
"""A Kalman filter over offset, heading and curvature of a road whose borders are curves, from chords on the ground."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.perception.road.borders import Borders, beside, match_borders
from robot_vision.perception.road.chords import ChordReader, Chords
from robot_vision.perception.road.curve import Alignment, RoadCurve
from robot_vision.perception.road.estimate import BENDS, OFFSET, PAINT, PITCH, ROLL, WIDTH, YAW
from robot_vision.perception.road.search import FoundRoad

Array = NDArray[np.float64]

#: Times the state is improved for one picture, and for the first; chords are matched anew each time.
_ROUNDS, _FIRST_ROUNDS = 3, 6
#: Standard deviations of what a search tells: offset and width (m), yaw (rad).
_FOUND_OFFSET, _FOUND_WIDTH, _FOUND_YAW = 0.3, 0.4, 0.1
#: Half the width of painted lines, usual and its standard deviation, m.
_HALF_PAINT = 0.06
#: How far ahead it tells of the road, and at which distances, m.
_FOUND_REACH, _FOUND_STEP = 15.0, 3.0
#: A road just found is held to its borders less tightly, by this factor more, which each picture makes smaller.
_SETTLING, _SETTLES = 2.0, 0.6
#: A picture from the same place tells so much of what one from a new place would.
_LEAST_FRESH = 0.3


@dataclass(frozen=True)
class RoadMotion:
    """How a road may go on and how a robot moves on it, unless odometry tells.

    Attributes:
        bend: usual curvature of bends (standard deviation), 1/m.
        bend_length: way in which a road forgets its curvature, m.
        bend_change: of the curvature in 1 m of way, beyond an even change between knots, 1/m.
        roughness: standard deviation of a border about an even curve, m.
        fresh: way after which what is seen of a border tells something new, m.
        width_drift: change of the width in 1 m of way, m.
        lean_memory: how long the body keeps a lean, s.
        speed: usual speed of a robot without odometry, m/s.
        turn_rate: usual turn rate of a robot without odometry, rad/s.
        turn_rate_error: of odometry (standard deviation), rad/s.
        slip: sideways, m/s.
    """

    bend: float = 0.016
    bend_length: float = 8.0
    bend_change: float = 0.004
    roughness: float = 0.012
    fresh: float = 1.0
    width_drift: float = 0.02
    lean_memory: float = 0.3
    speed: float = 5.0
    turn_rate: float = 0.3
    turn_rate_error: float = 0.02
    slip: float = 0.1


class RoadFilter:
    """Follows one road, from where a search has found it.

    Args:
        alignment: knots of the curvature.
        motion: of road and robot.
        found: what the search tells.
        camera: as it is mounted, with its height.
        lean: standard deviation of the body's lean about that, rad.
    """

    def __init__(
        self,
        alignment: Alignment,
        motion: RoadMotion,
        found: FoundRoad,
        camera: Camera,
        lean: float,
    ) -> None:
        from filterpy.kalman import KalmanFilter  # slow to import: it brings scipy.stats

        self._alignment, self._motion = alignment, motion
        self._upright, self._lean = np.array([camera.roll, camera.pitch]), lean
        count = len(alignment.knots)
        kalman = KalmanFilter(dim_x=BENDS + count, dim_z=BENDS + count)
        fade = np.exp(-np.abs(alignment.knots[:, None] - alignment.knots) / motion.bend_length)
        kalman.x = np.zeros((BENDS + count, 1))
        kalman.x[[OFFSET, YAW, WIDTH], 0] = found.offset, found.yaw, found.width
        kalman.x[[ROLL, PITCH], 0] = self._upright
        kalman.P = np.zeros((BENDS + count, BENDS + count))
        kalman.P[[OFFSET, YAW, WIDTH], [OFFSET, YAW, WIDTH]] = np.square(
            [_FOUND_OFFSET, _FOUND_YAW, _FOUND_WIDTH]
        )
        kalman.P[[ROLL, PITCH], [ROLL, PITCH]] = lean**2
        kalman.x[PAINT, 0], kalman.P[PAINT, PAINT] = _HALF_PAINT, _HALF_PAINT**2
        kalman.P[BENDS:, BENDS:] = motion.bend**2 * fade
        self._kalman = kalman
        self._about = self.state
        self._fresh, self._rounds, self._settling = 1.0, _FIRST_ROUNDS, _SETTLING
        self._believe_places(found, camera)

    def _believe_places(self, found: FoundRoad, camera: Camera) -> None:
        """A search tells the places that the borders pass better than where they lead, how they bend or the lean."""
        assert camera.height_m is not None
        along = np.arange(_FOUND_STEP, _FOUND_REACH + 0.5 * _FOUND_STEP, _FOUND_STEP)
        whole = RoadCurve(self._alignment, np.full(len(self._alignment.knots), found.curvature))
        heading = whole.heading(along)
        left = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
        share = np.repeat([0.5, -0.5], len(along))
        away = np.tile(whole.points(along), (2, 1)) + found.width * share[:, None] * np.tile(left, (2, 1))
        away -= [0.0, found.offset]
        cos, sin = np.cos(found.yaw), np.sin(found.yaw)
        points = np.stack([cos * away[:, 0] + sin * away[:, 1], cos * away[:, 1] - sin * away[:, 0]], axis=1)
        leaning = leaning_on_ground(points - [camera.x_m, 0.0], camera.height_m)
        before, doubt = self._kalman.x, self._kalman.P
        for _ in range(_ROUNDS):
            state = self.state
            feet, slopes, turn = beside(self._alignment, state, points)
            slopes[:, WIDTH] = -share
            slopes[:, ROLL : PITCH + 1] = np.einsum("ni,ij,njk->nk", feet.normal, turn, leaning)
            self._kalman.x, self._kalman.P = before, doubt
            # The places are those for the camera as mounted, not for the lean believed by now.
            moved = slopes[:, ROLL : PITCH + 1] @ (state[[ROLL, PITCH]] - self._upright)
            aims = slopes @ state - (feet.left - share * state[WIDTH] + moved)
            self._kalman.update(aims[:, None], R=_FOUND_OFFSET**2 * np.eye(len(points)), H=slopes)

    @property
    def state(self) -> Array:
        """(S,) what is believed now, in the order that `estimate` tells."""
        return np.array(self._kalman.x[:, 0])

    @property
    def covariance(self) -> Array:
        """(S, S) of the state."""
        return np.array(self._kalman.P)

    def predict(self, seconds: float, speed: float | None, turn_rate: float | None) -> None:
        """Drive on.

        Args:
            seconds: since the last picture.
            speed: of the robot, m/s; None when unknown.
            turn_rate: of the robot, rad/s; None when unknown.
        """
        motion, state = self._motion, self._kalman.x[:, 0]
        size, count = len(state), len(self._alignment.knots)
        rolled = 0.0 if speed is None else speed * seconds
        turned = 0.0 if turn_rate is None else turn_rate * seconds
        lean_stays = float(np.exp(-seconds / motion.lean_memory))
        bends_stay = float(np.exp(-abs(rolled) / motion.bend_length))
        moves = np.eye(size)
        # On a bend the road turns under the robot; along its middle the way is longer or shorter than the robot's.
        cos, sin = np.cos(state[YAW]), np.sin(state[YAW])
        along = rolled * cos / max(1.0 - state[BENDS] * state[OFFSET], 0.2)
        moves[OFFSET, YAW] = rolled * cos
        moves[YAW, BENDS] = -along
        moves[ROLL, ROLL] = moves[PITCH, PITCH] = lean_stays
        place = np.clip((self._alignment.knots + along) / self._alignment.spacing, 0.0, count - 1.0)
        moves[BENDS:, BENDS:] = np.maximum(0.0, 1.0 - np.abs(place[:, None] - np.arange(count)))
        moves[-1] *= bends_stay
        noise = np.zeros((size, size))
        drift = motion.slip * seconds
        if speed is None:
            drift = np.hypot(drift, motion.speed * seconds * abs(sin))
        noise[OFFSET, OFFSET] = drift**2
        turning = motion.turn_rate_error if turn_rate is not None else motion.turn_rate
        noise[YAW, YAW] = (turning * seconds) ** 2
        way = abs(rolled) if speed is not None else motion.speed * seconds
        self._fresh = float(np.clip(way / motion.fresh, _LEAST_FRESH, 1.0))
        noise[WIDTH, WIDTH] = motion.width_drift**2 * way
        noise[ROLL, ROLL] = noise[PITCH, PITCH] = self._lean**2 * (1.0 - lean_stays**2)
        noise[range(BENDS, size), range(BENDS, size)] = motion.bend_change**2 * abs(rolled)
        noise[-1, -1] += motion.bend**2 * (1.0 - bends_stay**2)
        if speed is None:
            noise[range(BENDS, size), range(BENDS, size)] += (
                2.0 * motion.bend / motion.bend_length * way
            ) ** 2
        after = state.copy()
        after[OFFSET] += rolled * sin
        after[YAW] += turned - along * state[BENDS]
        after[[ROLL, PITCH]] = self._upright + lean_stays * (state[[ROLL, PITCH]] - self._upright)
        after[BENDS:] = moves[BENDS:, BENDS:] @ state[BENDS:]
        self._kalman.predict(F=moves, Q=noise)
        self._kalman.x = after[:, None]

    def update(self, reader: ChordReader) -> tuple[Chords, Borders]:
        """Take in the chords of a picture; returns them, and how they lie on the road."""
        before, doubt = self._kalman.x, self._kalman.P
        chords, borders = self._look(reader)
        rounds, self._rounds = self._rounds, _ROUNDS
        self._settling *= _SETTLES
        for _ in range(rounds):
            self._kalman.x, self._kalman.P = before, doubt
            chosen = borders.weight > 0.0
            if not chosen.any():
                break
            scale = np.sqrt(self._fresh * borders.weight[chosen, None] / borders.own[chosen])
            slopes = borders.slopes[chosen]
            rows = (scale[..., None] * slopes).reshape(-1, len(before))
            aims = (scale * (slopes @ self._about - borders.misses[chosen])).ravel()
            # However many chords there are, they tell no more than a triangle of numbers.
            turn, triangle = np.linalg.qr(rows)
            self._kalman.update((turn.T @ aims)[:, None], R=np.eye(len(triangle)), H=triangle)
            # Each round reaches as far ahead as the one before has made sure which border is which.
            chords, borders = self._look(reader)
        return chords, borders

    def _look(self, reader: ChordReader) -> tuple[Chords, Borders]:
        self._about = state = self.state
        chords = reader.read(float(state[ROLL]), float(state[PITCH]))
        roughness = (1.0 + self._settling) * self._motion.roughness
        borders = match_borders(self._alignment, state, self._kalman.P, chords, roughness)
        return chords, borders


def leaning_on_ground(points: Array, height: float) -> Array:
    """How ground points (N, 2) under given rays move with roll and pitch of a level camera, (N, 2, 2) m/rad."""
    x, y = points.T
    by_roll = np.stack([x * y / height, height + y**2 / height], axis=1)
    by_pitch = np.stack([-height - x**2 / height, -x * y / height], axis=1)
    return np.stack([by_roll, by_pitch], axis=2)
