# SPDX-License-Identifier: Apache-2.0
"""Kerbs of the floor's own stone along the way: neither colour nor height tells them pixel by pixel."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping.beside_lines import RIM, Beside
from robot_vision.mapping.ground_lines import Borders
from robot_vision.mapping.ground_view import GroundView
from robot_vision.mapping.plane_motion import Parallax
from robot_vision.mapping.pose import Pose

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Scores = NDArray[np.float32]

_SECTIONS = 16
_LEFT, _RIGHT = 0, 1
_TELLING = 0.3
"""Mean of `Parallax.telling` along a line below which parallax tells nothing of it."""


@dataclass
class _Known:
    """A kerb found in earlier pictures: its place across the way (m to the right of the camera) and its side."""

    aside: float
    side: int
    way: float = 0.0


@dataclass
class KerbFinder:
    """Looks beyond lines on the floor for a narrow strip of another tint that runs along it, before what is no floor.

    Stones differ from each other, too: a kerb differs along all of its length, and by more than its sections do among
    themselves. The line is followed over all the ground in view, not only where it was seen as a line, and a kerb
    found once is looked for in the pictures that follow. The outermost row of stones is such a strip, too: along the
    whole line parallax tells that it lies as low as the floor.

    Args:
        beside: distance from the line of the strips that are compared, from and to, m.
        beyond: distance from the line, from and to, within which floor must have ended, m.
        tint: least difference of colour between floor and kerb, CIE Lab of OpenCV.
        sure: by how many times its standard error that difference must be other than none for a kerb that is new, and
            for one that is known.
        fewest: sections, of 16, that must show a kerb that is new, and one that is known.
        apart: distance across the way that two lines must have to be judged each for itself, m.
        reach: how far a kerb is followed, m.
        low: share of what the floor beside shows by parallax that a strip must show to be floor.
        kept: way over which a kerb that is not seen is still known, m.
    """

    beside: tuple[float, float] = (0.03, 0.16)
    beyond: tuple[float, float] = (0.45, 0.65)
    tint: float = 1.5
    sure: tuple[float, float] = (4.0, 2.0)
    fewest: tuple[int, int] = (5, 2)
    apart: float = 0.04
    reach: float = 8.0
    low: float = 0.65
    kept: float = 2.0
    _known: list[_Known] = field(default_factory=list, init=False, repr=False)
    _last: Pose | None = field(default=None, init=False, repr=False)

    def reset(self) -> None:
        """Forget the kerbs of earlier pictures."""
        self._known.clear()
        self._last = None

    def find(
        self,
        ends: Array,
        direction: Array,
        score: Scores,
        dim: Mask,
        lab: NDArray[np.uint8],
        view: GroundView,
        pose: Pose | None,
        parallax: Parallax | None = None,
    ) -> Borders:
        """Find the lines at which the floor ends in a kerb.

        Args:
            ends: (N, 4) of lines on the floor towards the vanishing point, working pixels.
            direction: (3,) of the vanishing point, optical frame.
            score: (H - view.top, W) positive for floor, of the working picture.
            dim: (H - view.top, W) what has the colour of floor in shadow.
            lab: (H - view.top, W, 3) colours, CIE Lab of OpenCV.
            view: of the ground in the working picture.
            pose: of the robot in odom; None without odometry: then every kerb is new.
            parallax: of the part of the picture that shows ground; None without an earlier picture.
        """
        self._move(direction, view, pose)
        vanishing = view.camera.pixels(direction[None])[0] * view.scale + (view.scale - 1.0) / 2.0
        height = view.camera.height_m or 1.0
        aside = self._places(ends, vanishing, height)
        if not len(aside):
            return Borders.none()
        rays = self._rays(aside / height, vanishing, view, height)
        marks = self._marks(rays, aside, vanishing, score, dim, lab, view, parallax)
        self._remember(aside, np.asarray(marks.any(axis=2)))
        return Borders.along(rays, marks)

    def _move(self, direction: Array, view: GroundView, pose: Pose | None) -> None:
        """Bring the known kerbs to where they are seen from here."""
        if pose is None or self._last is None:
            self._known.clear()
        else:
            step = self._last.to_here(pose)
            ahead = view.camera.optical_to_base @ direction
            ahead = ahead[:2] / max(float(np.hypot(ahead[0], ahead[1])), 1e-9)
            # `step` is where the robot is now as seen from there; to the right of the way is (y, -x) of its direction.
            shift = float(step[1, 2] * ahead[0] - step[0, 2] * ahead[1])
            way = float(np.hypot(step[0, 2], step[1, 2]))
            for kerb in self._known:
                kerb.aside += shift
                kerb.way += way
            self._known = [kerb for kerb in self._known if kerb.way < self.kept]
        self._last = pose

    def _places(self, ends: Array, vanishing: Array, height: float) -> Array:
        """Places (M,) across the way of lines (N, 4) and of known kerbs, m to the right of the camera (20.3)."""
        middle = 0.5 * (ends[:, :2] + ends[:, 2:]) - vanishing
        seen = middle[:, 0] / np.maximum(middle[:, 1], 1.0) * height
        known = np.array([kerb.aside for kerb in self._known])
        weight = np.concatenate([np.hypot(*(ends[:, 2:] - ends[:, :2]).T), np.full(len(known), 1.0)])
        places = np.concatenate([seen, known])
        order = np.argsort(places)
        places, weight = places[order], weight[order]
        group = np.cumsum(np.diff(places, prepend=places[:1]) > self.apart)
        return np.asarray(np.bincount(group, places * weight) / np.maximum(np.bincount(group, weight), 1e-9))

    def _rays(self, slope: Array, vanishing: Array, view: GroundView, height: float) -> Array:
        """Lines (M, 4) over the ground in view, from where they leave the picture to `reach`."""
        far = view.camera.fx * view.scale * height / self.reach
        rows, columns = view.shape
        with np.errstate(divide="ignore"):
            edge = np.where(slope > 0.0, columns - 1.0 - vanishing[0], -vanishing[0]) / slope
        near = np.minimum(rows - 1.0 - vanishing[1], np.where(np.isfinite(edge), edge, np.inf))
        near = np.maximum(near, far + 1.0)
        ends = [slope * near, near, slope * far, np.full(len(slope), far)]
        return np.stack(ends, axis=1) + np.tile(vanishing, 2)

    def _marks(
        self,
        rays: Array,
        aside: Array,
        vanishing: Array,
        score: Scores,
        dim: Mask,
        lab: NDArray[np.uint8],
        view: GroundView,
        parallax: Parallax | None,
    ) -> Mask:
        """Sections (2, M, sections) to whose left or right a kerb stands."""
        beside, beyond, rim = (
            Beside(rays, view, vanishing, strip, _SECTIONS) for strip in (self.beside, self.beyond, RIM)
        )
        near, behind = beside.means(score), beyond.means(score)
        like = (near > 0.0) & (near[::-1] > 0.0) & np.isfinite(behind)
        ended = like & (behind < 0.0) & (rim.means(dim.astype(np.float32)) < 0.8)
        count = ended.sum(axis=2)
        known = self._is_known(aside)
        sure = np.where(known, self.sure[1], self.sure[0])
        found = np.zeros(count.shape, bool)
        for channel in (1, 2):
            tint = beside.means(lab[..., channel])
            step = np.where(ended, tint - tint[::-1], 0.0)
            mean = step.sum(axis=2) / np.maximum(count, 1)
            off = np.where(ended, step - mean[..., None], 0.0)
            error = np.sqrt((off**2).sum(axis=2) / np.maximum(count * (count - 1), 1))
            found |= np.abs(mean) > np.maximum(sure * error, self.tint)
        found &= count >= np.where(known, self.fewest[1], self.fewest[0])
        found &= count > np.where(known, 0.3, 0.6) * like.sum(axis=2)
        if parallax is not None:
            found &= ~self._lies_low(beside, ended, parallax)
        return np.asarray(_runs(ended) & found[..., None])

    def _lies_low(self, beside: Beside, here: Mask, parallax: Parallax) -> Mask:
        """Which strips (2, M) lie as low as the floor on the other side of their line, in the sections marked."""
        flat, telling = (np.nan_to_num(beside.means(part)) for part in (-parallax.raised, parallax.telling))
        shown = [
            (part * here).sum(axis=2) / np.maximum((told * here).sum(axis=2), 1e-6)
            for part, told in ((flat, telling), (flat[::-1], telling[::-1]))
        ]
        tells = (telling * here).sum(axis=2) > _TELLING * here.sum(axis=2)
        return np.asarray(tells & (shown[0] > self.low * np.maximum(shown[1], 0.0)))

    def _is_known(self, aside: Array) -> Mask:
        """Which places (M,) are, on the left and on the right (2, M), those of known kerbs."""
        known = np.zeros((2, len(aside)), bool)
        for kerb in self._known:
            known[kerb.side] |= np.abs(aside - kerb.aside) < 1.5 * self.apart
        return known

    def _remember(self, aside: Array, seen: Mask) -> None:
        for side in (_LEFT, _RIGHT):
            for place in aside[seen[side]]:
                same = [k for k in self._known if k.side == side and abs(k.aside - place) < 1.5 * self.apart]
                if same:
                    same[0].aside, same[0].way = float(place), 0.0
                else:
                    self._known.append(_Known(float(place), side))


def _runs(here: Mask) -> Mask:
    """Of marks along the last axis those with a neighbour; a single gap between marks is closed."""
    closed = here.copy()
    closed[..., 1:-1] |= here[..., :-2] & here[..., 2:]
    beside = np.zeros_like(here)
    beside[..., 1:] |= closed[..., :-1]
    beside[..., :-1] |= closed[..., 1:]
    return np.asarray(closed & beside)
