# SPDX-License-Identifier: Apache-2.0
"""Holds a picture against an earlier one as if all were floor: what stands up moves too far, a shadow does not.

A point at height h is seen by a camera at height H on the floor behind it, H / (H - h) times as far away. When the
camera moves by t, that image of it moves by t h / (H - h) more than floor would: its *rise* is h / (H - h), whatever
its distance, below zero for what the floor mirrors. Floor itself rises by nothing: what it seems to rise everywhere is
the slip of the odometry, what it seems to rise with distance is an error of the pitch.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry.rotation import wrap_angle
from robot_vision.mapping.disagreement import FEWEST_POINTS, USUAL_SLIP, FloorMotion
from robot_vision.mapping.ground_view import GroundView
from robot_vision.mapping.pose import Pose

Array = NDArray[np.float64]
Gray = NDArray[np.uint8]
Grid = NDArray[np.float32]
Mask = NDArray[np.bool_]

_WINDOW = (15, 15)
_LANE = (14.0, 1.6)
"""Length and half width of the ground that is tracked, as multiples of the camera's height."""
_NOISE = 0.8
"""Mean difference of two pictures of the same thing, grey levels."""
_LOOSE_SLIP, _OUTRIGHT = 0.3, 0.15
"""Standard deviation with which a slip is looked for, and the slip that is taken for one."""


@dataclass(frozen=True)
class Parallax:
    """What the motion between two pictures tells of the part of a picture that shows ground.

    Attributes:
        raised: (H, W) log ratio by which something above the floor explains each pixel better than floor does;
            negative: floor explains it better.
        mirrored: (H, W) the same for something below the floor, which only a mirror shows.
        telling: (H, W) the log ratio in favour of floor that floor of this texture would show; 0: nothing to see.
        travelled: between the two pictures, m.
        slip: share by which odometry tells more motion than the floor shows; nan when the floor shows nothing.
        pitch_error: by which the pitch of this picture is wrong as far as the motion of the floor tells, rad.
        pitch_sigma: standard deviation of that, rad.
        points: (N, 2) tracked points of the picture, working pixels.
        moved: (N, 2) how far each has moved over the floor since the earlier picture if it is floor, m ahead and left,
            with the lean of this picture as it was told and that of the earlier one as the floor's motion has it.
        rise: (N,) of each, after slip and pitch error.
    """

    raised: Grid
    mirrored: Grid
    telling: Grid
    travelled: float
    slip: float
    pitch_error: float
    pitch_sigma: float
    points: Array
    moved: Array
    rise: Array


@dataclass(frozen=True)
class _Kept:
    gray: Gray
    pose: Pose
    view: GroundView


@dataclass
class PlaneMotion:
    """Compares each picture with one from so far back that heights can be told.

    Args:
        baseline: way after which an earlier picture is worth a comparison, m.
        longest: way after which it is too different, m.
        widest: turn after which it is too different, rad.
        heights: of the planes that are tried, as shares of the camera's height; negative ones are mirrored.
        window: over which a plane must explain the picture, working pixels.
        points: tracked from picture to picture at most.
        memory: pictures kept at most.
    """

    baseline: float = 0.28
    longest: float = 2.5
    widest: float = 0.2
    heights: tuple[float, ...] = (0.16, 0.32, 0.48, 0.64, -0.8, -4.0)
    window: int = 9
    points: int = 150
    memory: int = 16
    _kept: deque[_Kept] = field(default_factory=deque, init=False, repr=False)

    def reset(self) -> None:
        """Forget earlier pictures."""
        self._kept.clear()

    def compare(self, gray: Gray, pose: Pose, view: GroundView, floor: Mask) -> Parallax | None:
        """Compare with an earlier picture and keep this one.

        Args:
            gray: (H, W) the working picture.
            pose: of the robot in odom.
            view: of the ground in the working picture.
            floor: (H - top, W) what looks like floor, to hold the two pictures together by.

        Returns:
            None while the robot has not moved enough, or has turned too much.
        """
        earlier = self._partner(pose, gray.shape)
        self._keep(_Kept(gray, pose, view))
        if earlier is None:
            return None
        step = earlier.pose.to_here(pose)
        points, seen_at = self._track(earlier, gray, view, step, floor)
        # Odometry is believed to a per cent, unless the floor contradicts it outright.
        motion = FloorMotion(points, seen_at, earlier.view, view, step)
        loose = motion.disagreement(_LOOSE_SLIP)
        wrong = motion.disagreement(USUAL_SLIP) if abs(loose.slip) < _OUTRIGHT else loose
        corrected = wrong.righted(step)
        held = _leaning(earlier.view, wrong.pitch - wrong.common, wrong.roll)
        here = _leaning(view, -wrong.common)
        raised, mirrored, telling = self._sweep(earlier.gray, gray, held, here, view.top, corrected)
        told = _leaning(earlier.view, wrong.pitch, wrong.roll)
        moved, _ = _over_the_floor(points, seen_at, told, view, step)
        _, rise = _over_the_floor(points, seen_at, held, here, corrected)
        travelled = float(np.hypot(step[0, 2], step[1, 2]))
        slip = loose.slip if len(points) >= FEWEST_POINTS else float("nan")
        return Parallax(
            raised,
            mirrored,
            telling,
            travelled,
            slip,
            wrong.pitch + wrong.common,
            wrong.common_sigma,
            points,
            moved,
            rise,
        )

    def _partner(self, pose: Pose, shape: tuple[int, ...]) -> _Kept | None:
        for kept in reversed(self._kept):
            way = float(np.hypot(pose.x - kept.pose.x, pose.y - kept.pose.y))
            turned = abs(wrap_angle(pose.yaw - kept.pose.yaw)) > self.widest
            if turned or way > self.longest or kept.gray.shape != shape:
                return None
            if way >= self.baseline:
                return kept
        return None

    def _keep(self, picture: _Kept) -> None:
        if self._kept:
            last = self._kept[-1].pose
            moved = np.hypot(picture.pose.x - last.x, picture.pose.y - last.y)
            if moved < 0.02 and abs(wrap_angle(picture.pose.yaw - last.yaw)) < 0.01:
                return
        self._kept.append(picture)
        if len(self._kept) > self.memory:
            self._kept.popleft()

    def _track(
        self, earlier: _Kept, gray: Gray, view: GroundView, step: Array, floor: Mask
    ) -> tuple[Array, Array]:
        """Points (N, 2) of this picture and their places (N, 2) in the earlier one, working pixels.

        The earlier picture is drawn as its floor would look from here, so that little is left to be found
        (Lucas and Kanade 1981); points that do not come back where they started are left out.
        """
        top = view.top
        here = np.ascontiguousarray(gray[top:])
        lane = floor.astype(np.uint8) * _lane(view)
        corners = cv2.goodFeaturesToTrack(here, self.points, 0.002, 5, mask=lane, blockSize=3)
        if corners is None or len(corners) < FEWEST_POINTS:
            return np.zeros((0, 2)), np.zeros((0, 2))
        way = earlier.view.matrix @ step @ view.inverse
        warped = _drawn(earlier.gray, way, top, here.shape)
        there, found = _flow(here, warped, corners)
        again, back = _flow(warped, here, there)
        corners, there, again = (np.asarray(p, np.float64).reshape(-1, 2) for p in (corners, there, again))
        good = (found.ravel() > 0) & (back.ravel() > 0) & (np.hypot(*(again - corners).T) < 0.3)
        source = np.column_stack([there[good] + (0.0, top), np.ones(int(good.sum()))]) @ way.T
        source = source[:, :2] / source[:, 2:]
        rows, columns = gray.shape
        inside = (source > 1).all(axis=1) & (source[:, 0] < columns - 2) & (source[:, 1] < rows - 2)
        return corners[good][inside] + (0.0, top), source[inside]

    def _sweep(
        self, earlier: Gray, gray: Gray, before: GroundView, view: GroundView, top: int, step: Array
    ) -> tuple[Grid, Grid, Grid]:
        """How much better planes above and below explain the picture than the floor, and how much floor would show.

        A plane at a height is drawn by its own homography, so heights are tried without any search.
        """
        here = gray[top:]
        size = (self.window, self.window)
        shares = (0.0, *self.heights)
        ways = before.planes(shares) @ step @ np.linalg.inv(view.planes(shares))
        planes = [_drawn(earlier, way, top, here.shape) for way in ways]
        gain = float(here.mean()) / max(float(planes[0].mean()), 1.0)
        planes = [np.asarray(cv2.convertScaleAbs(plane, alpha=gain), np.uint8) for plane in planes]
        floor, *others = (cv2.boxFilter(cv2.absdiff(here, plane), cv2.CV_32F, size) for plane in planes)
        above = [cost for cost, share in zip(others, self.heights, strict=True) if share > 0.0]
        below = [cost for cost, share in zip(others, self.heights, strict=True) if share < 0.0]
        raised, mirrored = (
            _log((floor + _NOISE) / (np.asarray(reduce(cv2.min, some), np.float32) + _NOISE))
            for some in (above, below)
        )
        differs = np.asarray(cv2.boxFilter(cv2.absdiff(planes[0], planes[1]), cv2.CV_32F, size), np.float32)
        telling = _log(1.0 + differs / (2.0 * _NOISE))
        outside = _drawn(np.full(earlier.shape, 255, np.uint8), ways[0], top, here.shape, 0)
        unseen = cv2.erode(outside, np.ones(size, np.uint8)) < 255
        raised[unseen] = 0.0
        mirrored[unseen] = 0.0
        telling[unseen] = 0.0
        return raised, mirrored, telling


def _log(values: Grid) -> Grid:
    """Natural logarithm (H, W): that of OpenCV takes a quarter of the time."""
    return np.asarray(cv2.log(values), np.float32)


def _leaning(view: GroundView, pitch: float, roll: float = 0.0) -> GroundView:
    """The view of a camera that leans by so much more, rad."""
    camera = view.camera
    return GroundView(replace(camera, pitch=camera.pitch + pitch, roll=camera.roll + roll), view.scale)


def _flow(first: Gray, second: Gray, corners: Any) -> tuple[Any, Any]:
    """Places of corners (N, 1, 2) of the first picture in the second, and which were found."""
    places, found, _ = cv2.calcOpticalFlowPyrLK(
        first,
        second,
        corners,
        None,  # type: ignore[call-overload]  # the places to begin at may be left out
        winSize=_WINDOW,
        maxLevel=1,
    )
    return places, found


def _lane(view: GroundView) -> Gray:
    """1 in the part (H - top, W) of the picture that shows the ground on which the robot is to drive, else 0.

    Verges and kerbs that look like floor lie higher; seen along the way, that would pass for an error of the pitch.
    """
    height = view.camera.height_m or 1.0
    near, far, aside = view.camera.x_m + 0.8 * height, view.camera.x_m + _LANE[0] * height, _LANE[1] * height
    u, v = view.pixels(np.array([near, near, far, far]), np.array([aside, -aside, -aside, aside]))
    lane = np.zeros((view.shape[0] - view.top, view.shape[1]), np.uint8)
    if np.isfinite(u).all():
        cv2.fillPoly(lane, [np.round(np.column_stack([u, v - view.top])).astype(np.int32)], 1)
    return lane


def _over_the_floor(
    points: Array, seen_at: Array, before: GroundView, view: GroundView, step: Array
) -> tuple[Array, Array]:
    """How far points have moved over the floor (N, 2), m, if they are floor, and their rise (N,)."""
    if not len(points):
        return np.zeros((0, 2)), np.zeros(0)
    here = np.column_stack(view.ground(points[:, 0], points[:, 1]))
    there = np.column_stack(before.ground(seen_at[:, 0], seen_at[:, 1]))
    moved = there - here
    turn, shift = step[:2, :2], step[:2, 2]
    expected = (there - shift) @ turn  # the earlier place as this base_link has it
    onward = turn.T @ shift
    # A raised point lies farther away as seen from behind: along the way the camera has come.
    rise = (expected - here) @ onward / float(onward @ onward)
    good = np.isfinite(rise)
    moved[~good], rise[~good] = 0.0, 0.0
    return moved, rise


def _drawn(
    picture: Gray, way: Array, top: int, shape: tuple[int, ...], border: int = cv2.BORDER_REPLICATE
) -> Gray:
    """The earlier picture (H, W) drawn from `top` on by the homography `way` from this picture to it."""
    drop = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, float(top)], [0.0, 0.0, 1.0]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    drawn = cv2.warpPerspective(picture, way @ drop, (shape[1], shape[0]), flags=flags, borderMode=border)
    return np.asarray(drawn)
