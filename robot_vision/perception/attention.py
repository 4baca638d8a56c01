# SPDX-License-Identifier: Apache-2.0
"""Where to look in the next picture: a region around the lines that tell most, everywhere when surprised.

What a robot steers by stands on the floor: the feet of walls, borders and kerbs run from the bottom of the picture to
the vanishing point, uprights stand on the floor across the vanishing line. What lies higher tells the same again.
So the region reaches from the bottom of the picture to some way above the vanishing line, and to both sides as far as
what leads ahead on the floor. It is laid out by a look at the whole picture, as well as a given share of that
look's cost allows, and goes along with the primary vanishing point until the next such look.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.perception.attention_layout import Layout, lay_out
from robot_vision.perception.attitude import Attitude
from robot_vision.perception.region import Region
from robot_vision.perception.segments import LineSegments
from robot_vision.perception.vanishing import Role, VanishingPoints

Array = NDArray[np.float64]

#: Without a turn rate the robot may turn, and its body may nod, this fast, rad/s.
_UNKNOWN_TURN, _NOD = 0.15, 0.15
#: Pictures farther apart in time than this start afresh, s; between nearer ones things move a while besides, s.
_LONGEST_STEP = 0.5
#: Whoever searches may hear late where: a picture shows that it was searched everywhere by a line so far outside the
#: region asked for last, as a share of the picture's width; or it is the last of so many asked for.
_OUTSIDE, _SURELY = 0.03, 3


@dataclass
class Attention:
    """Chooses, from what one picture showed, where lines are looked for in the next.

    A part of a picture may be misread now and then: one picture with little support, or with an attitude that jumps,
    is let pass, a second in a row is a surprise. All else that is odd is a surprise at once.

    Args:
        budget: cost of a look at the region, as a share of one at the whole picture.
        every: pictures from one look at the whole picture to the next at the latest.
        least_support: share of what the last whole look promised that vanishing points must keep.
        least_lines: share of the lines promised that must be found.
        jump: change of roll or pitch between two pictures that is odd, rad.
        margin: kept free around what the region is laid out for, rad.

    Attributes:
        asked: the region asked for in the picture that comes next; None: everywhere.
        reason: why it is everywhere; empty when it is not.

    Raises:
        ValueError: for settings without meaning, naming the setting.
    """

    budget: float = 0.44
    every: int = 25
    least_support: float = 0.5
    least_lines: float = 0.4
    jump: float = float(np.deg2rad(2.0))
    margin: float = float(np.deg2rad(1.5))
    asked: Region | None = field(default=None, init=False, compare=False)
    reason: str = field(default="start", init=False, compare=False)
    _layout: Layout | None = field(default=None, init=False, repr=False, compare=False)
    _pictures: int = field(default=0, init=False, repr=False, compare=False)
    _lead: int | None = field(default=None, init=False, repr=False, compare=False)
    _leans: tuple[float, float] | None = field(default=None, init=False, repr=False, compare=False)
    _camera: Camera | None = field(default=None, init=False, repr=False, compare=False)
    _stamp: float | None = field(default=None, init=False, repr=False, compare=False)
    _odd: bool = field(default=False, init=False, repr=False, compare=False)
    _last: Region | None = field(default=None, init=False, repr=False, compare=False)
    _everywhere: int = field(default=0, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in ("budget", "least_support", "least_lines"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise ValueError(f"{name} must be a share in (0, 1], not {getattr(self, name)}")
        for name in ("jump", "margin"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a positive number, not {value}")
        if self.every < 1:
            raise ValueError(f"every must be at least 1 picture, not {self.every}")

    def reset(self) -> None:
        """Forget what earlier pictures told: look everywhere next."""
        self.asked, self.reason = None, "start"
        self._layout = self._stamp = self._leans = self._last = None

    def update(
        self,
        lines: LineSegments,
        points: VanishingPoints,
        attitude: Attitude | None,
        stamp_s: float,
        turn_rate: float | None = None,
    ) -> Region | None:
        """Take in what was seen in a picture where `asked` said.

        Args:
            lines: of the picture, with `points.labels` for each.
            points: believed vanishing points, primary first.
            attitude: of the camera, if the picture told of it.
            stamp_s: time of the picture, s.
            turn_rate: of the robot, rad/s counter-clockwise; None when unknown.

        Returns:
            Where to look in the next picture, the same as `asked`; None: everywhere.
        """
        step = np.inf if self._stamp is None else stamp_s - self._stamp
        self._stamp = stamp_s
        lean = (attitude.roll, attitude.pitch) if attitude is not None and attitude.seen else None
        self.reason = self._surprise(lines, points, lean, step)
        self._camera = points.camera
        primary = points.of(Role.PRIMARY)
        if self.asked is not None:
            self._last, self._everywhere = self.asked, 0
        else:
            self._everywhere += 1
        if self.reason or primary is None:
            self.asked = self._layout = None
            return None
        up = points.camera.optical_to_base[2] if attitude is None else attitude.up
        if self._layout is None:
            if not self._was_whole(lines, points.camera):
                self.reason = "the picture was not searched everywhere yet"
                return None
            self._layout = lay_out(lines, points, primary, up, self.budget)
            self._pictures = 0
            self._lead = int(points.ids[primary])
            if self._layout is None:
                self.reason = "no part of the picture holds enough of what leads ahead"
                self.asked = None
                return None
        self._pictures += 1
        if self._pictures >= self.every:
            self.reason = "whole picture due"
            self.asked = self._layout = None
            return None
        seconds = min(step, _LONGEST_STEP) if np.isfinite(step) else _LONGEST_STEP
        turned = seconds * (_UNKNOWN_TURN if turn_rate is None else abs(turn_rate))
        room = (self.margin + turned, 0.5 * self.margin + 0.5 * seconds * _NOD)
        self.asked = self._layout.region(points, primary, up, room)
        if self.asked is None:
            self.reason = "the vanishing line leaves the picture"
            self._layout = None
        return self.asked

    def _surprise(
        self, lines: LineSegments, points: VanishingPoints, lean: tuple[float, float] | None, step: float
    ) -> str:
        """Why the whole picture must be looked at; empty when nothing is odd, or for the first time."""
        odd_before, self._odd = self._odd, False
        before = self._leans
        if lean is not None:
            self._leans = lean
        primary = points.of(Role.PRIMARY)
        if primary is None or points.weight[primary] <= 0.0:
            return "no way ahead is seen"
        if not points.camera.focal_known:
            return "the focal length is not known"
        place = points.pixels[primary]
        if not (0.0 <= place[0] < points.camera.width and 0.0 <= place[1] < points.camera.height):
            return "the way ahead lies outside the picture"
        if self._layout is None:
            return ""
        if not 0.0 < step <= _LONGEST_STEP:
            return "pictures are far apart"
        if points.camera != self._camera:
            return "another camera"
        if int(points.ids[primary]) != self._lead:
            return "another way ahead"
        if len(lines) < self.least_lines * self._layout.lines:
            return "few lines"
        odd = ""
        if self._is_weak(points, primary, self._layout):
            odd = "little support"
        elif lean is not None and before is not None and _apart(lean, before) > self.jump:
            odd, self._leans = "the attitude jumps", before
        self._odd = bool(odd)
        return odd if odd_before else ""

    def _was_whole(self, lines: LineSegments, camera: Camera) -> bool:
        """Whether the picture, for which everywhere was asked, was searched everywhere."""
        last = self._last
        if last is None or self._everywhere >= _SURELY:
            return True
        away = _OUTSIDE * camera.width
        u, v = lines.endpoints[:, ::2], lines.endpoints[:, 1::2]
        beside = (u < last.left - away) | (u > last.right + away)
        return bool(np.any(beside | (v < last.top - away) | (v > last.bottom + away)))

    def _is_weak(self, points: VanishingPoints, primary: int, layout: Layout) -> bool:
        """Whether vanishing points keep too little of the support that the layout promised."""
        upright = points.of(Role.VERTICAL)
        led, stood = layout.support
        if points.weight[primary] < self.least_support * led:
            return True
        # Uprights come and go as they are passed; what leads ahead does not.
        return stood > 0.0 and (
            upright is None or bool(points.weight[upright] < 0.5 * self.least_support * stood)
        )


def _apart(lean: tuple[float, float], other: tuple[float, float]) -> float:
    return max(abs(lean[0] - other[0]), abs(lean[1] - other[1]))
