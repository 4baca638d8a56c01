# SPDX-License-Identifier: Apache-2.0
"""Pavements tell the vanishing line: by how wide equal stones look, or by what halves a stone.

The chapter asks (problem 3) for two ways to a vanishing point from rectangular flagstones, and which of them
serves stones laid anyhow.

1. By the widths of stones (`fit_widths`). Where one set of joints runs parallel to the picture, a joint of the
   width W at the depth Z is w = f W / Z wide and lies y = f H / Z below the vanishing line (20.2), so w = W y / H:
   widths shrink in proportion to y, and where they would be nothing is the vanishing line. Stones need not
   touch, and their lengths may be anything; but they must be equally wide and all be turned the same way, their
   joints parallel to the picture.
2. By lengths along a line (`fit_spacings`, (20.8)). It asks neither how the stones are turned nor how large they
   are, only for three points in a row whose ratio of lengths is known: the more general way.

Stones laid anyhow, each at its own place and angle, have no common width across the picture, and widths then
lead astray. Nor have they neighbours in line; but every rectangle brings three points in a row of its own, twice:
a diagonal's ends and its middle, where the other diagonal crosses it. There (20.8) holds for each stone alone, of
any size, and two diagonals give the whole vanishing line (`fit_stones`). So the second way still works.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from robot_vision.geometry.arrays import FloatArray
from robot_vision.geometry.errors import CrossRatioError

_STEPS = 20
#: Corners that span less than this share of a stone's squared size lie on one line.
_FLAT = 1e-9
#: A first guess is believed as it is while all corners lie so far (of the stones' mean) before its line.
_BEFORE = 1.0 - 1e-6


@dataclass(frozen=True)
class OffsetFit:
    """Where along a measuring line the vanishing line lies.

    Attributes:
        offset: in the unit and from the origin of the places given.
        sigma: its standard deviation.
        misfit: weighted sum of squared residuals; `freedom` on average when the widths are as good as was said.
        freedom: degrees of freedom of `misfit`, N - 2.
    """

    offset: float
    sigma: float
    misfit: float
    freedom: int


@dataclass(frozen=True)
class VanishingLineFit:
    """The vanishing line of a pavement.

    Attributes:
        line: (a, b, c) with a² + b² = 1, rectified pixels; negative where the pavement is seen.
        covariance: (3, 3) of `line`.
        misfit: weighted sum of squared residuals; `freedom` on average when the corners are as good as was said.
        freedom: degrees of freedom of `misfit`, 2 N - 2.
    """

    line: FloatArray
    covariance: FloatArray
    misfit: float
    freedom: int


def fit_widths(places: ArrayLike, widths: ArrayLike, sigma: ArrayLike = 0.7) -> OffsetFit:
    """Fit where the widths of equal stones would shrink to nothing: w = k (y - y3), by least squares.

    From two widths y3 = (w1 y2 - w2 y1) / (w1 - w2).

    Args:
        places: (N,) y of the joints measured, along any line of the picture that crosses the vanishing line,
            such as a column, px.
        widths: (N,) of a stone along each joint, px; all of the same true width, and parallel to the picture.
        sigma: standard deviation of a width, px; one for all or (N,). Two corners of 0.5 px make 0.7.

    Raises:
        CrossRatioError: fewer than two places, widths that are not positive, or widths that are all equal:
            the stones do not recede, and the vanishing line is at infinity.
    """
    y, w = np.asarray(places, dtype=np.float64), np.asarray(widths, dtype=np.float64)
    if y.ndim != 1 or y.shape != w.shape:
        raise ValueError(f"places and widths must both have shape (N,), got {y.shape} and {w.shape}")
    spread = np.broadcast_to(np.asarray(sigma, dtype=np.float64), y.shape)
    if len(y) < 2:
        raise CrossRatioError(f"widths must be known at two places or more, not {len(y)}")
    if not (np.isfinite(y).all() and np.isfinite(w).all() and (w > 0.0).all() and (spread > 0.0).all()):
        raise CrossRatioError("places must be finite, widths and their sigma finite and positive")
    weight = 1.0 / spread**2
    middle, level = np.average(y, weights=weight), np.average(w, weights=weight)
    about = float(weight @ (y - middle) ** 2)
    if about <= 1e-18 * float(weight @ (y**2 + 1.0)):
        raise CrossRatioError("the widths were all measured at one place: their spacing is zero")
    growth = float(weight @ ((y - middle) * (w - level))) / about
    if abs(growth) * float(np.ptp(y)) <= 1e-12 * level:
        raise CrossRatioError(
            "the widths are all equal, so the stones do not recede: their sides are parallel in the picture, "
            "and the vanishing line is at infinity"
        )
    reach = level / growth
    variance = (1.0 / float(weight.sum()) + reach**2 / about) / growth**2
    misfit = float(weight @ (w - level - growth * (y - middle)) ** 2)
    return OffsetFit(float(middle - reach), float(np.sqrt(variance)), misfit, len(y) - 2)


def fit_stones(corners: ArrayLike, sigma: float = 0.5) -> VanishingLineFit:
    """Fit the vanishing line to rectangular (or any parallelogram) stones, each of any size, place and turn.

    The crossing of a stone's diagonals halves both of them on the ground (20.8). With w the distance of a corner
    from the vanishing line, that says p1 / w1 + p3 / w3 = p2 / w2 + p4 / w4 of its corners p in the picture.
    The line is moved until each third corner lies where the other three put it.

    Args:
        corners: (N, 4, 2) rectified px, in order around each stone.
        sigma: standard deviation of a corner in each direction, px.

    Raises:
        CrossRatioError: no stone, corners that are not in order around a convex stone, three of them on a line,
            or stones seen from straight above: the vanishing line is at infinity.
    """
    stones = _checked_stones(corners, sigma)
    centre = stones.mean(axis=(0, 1))
    scale = float(np.abs(stones - centre).max())
    scaled = (stones - centre) / scale
    # The line as (x, y) -> 1 + g x + h y, which is positive on every stone; g = h = 0 is the line at infinity.
    slope = _first_guess(scaled)
    for _ in range(_STEPS):
        residual, by_line, by_corners = _closure(scaled, slope)
        weight = np.linalg.inv(by_corners @ np.swapaxes(by_corners, 1, 2))
        information = np.einsum("nij,nik,nkl->jl", by_line, weight, by_line)
        step = np.linalg.solve(information, np.einsum("nij,nik,nk->j", by_line, weight, residual))
        slope = slope - step
        if (1.0 + scaled @ slope <= 0.0).any():
            raise CrossRatioError("the stones lie on both sides of the vanishing line they would lead to")
        if float(np.abs(step).max()) < 1e-14 * (1.0 + float(np.abs(slope).max())):
            break
    residual, by_line, by_corners = _closure(scaled, slope)
    weight = np.linalg.inv(by_corners @ np.swapaxes(by_corners, 1, 2)) * (scale / sigma) ** 2
    information = np.einsum("nij,nik,nkl->jl", by_line, weight, by_line)
    misfit = float(np.einsum("ni,nij,nj->", residual, weight, residual))
    length = float(np.hypot(slope[0], slope[1]))
    if length < 1e-12:
        raise CrossRatioError("the stones are seen from straight above: their vanishing line is at infinity")
    line, turn = _in_pixels(slope, centre, scale)
    covariance = turn @ np.linalg.inv(information) @ turn.T
    return VanishingLineFit(line, np.asarray(covariance), misfit, 2 * len(stones) - 2)


def _checked_stones(corners: ArrayLike, sigma: float) -> FloatArray:
    stones = np.asarray(corners, dtype=np.float64)
    if stones.ndim != 3 or stones.shape[1:] != (4, 2):
        raise ValueError(f"corners must have shape (N, 4, 2), got {stones.shape}")
    if len(stones) == 0:
        raise CrossRatioError("a vanishing line needs one stone or more")
    if not (np.isfinite(stones).all() and sigma > 0.0):
        raise CrossRatioError("corners must be finite and sigma positive")
    sides = np.roll(stones, -1, axis=1) - stones
    following = np.roll(sides, -1, axis=1)
    turns = sides[..., 0] * following[..., 1] - sides[..., 1] * following[..., 0]
    size = np.sum(sides**2, axis=(1, 2))
    turns = turns * np.sign(turns[:, :1])
    bad = np.flatnonzero(turns.min(axis=1) <= _FLAT * size)
    if len(bad):
        raise CrossRatioError(
            f"the corners of stone {bad[0]} are not in order around a convex stone, or three of them lie on a line"
        )
    return stones


def _first_guess(stones: FloatArray) -> FloatArray:
    """Mean of the lines of the single stones: p1 / w1 - p2 / w2 + p3 / w3 = p4 / w4 gives w up to a scale."""
    homogeneous = np.concatenate([stones, np.ones((*stones.shape[:2], 1))], axis=2)
    three = np.swapaxes(homogeneous[:, :3], 1, 2) * (1.0, -1.0, 1.0)
    inverse_depths = np.linalg.solve(three, homogeneous[:, 3, :, None])[..., 0]
    depths = 1.0 / np.concatenate([inverse_depths, np.ones((len(stones), 1))], axis=1)
    lines = np.linalg.solve(homogeneous[:, :3], depths[:, :3, None])[..., 0]
    guess = np.asarray((lines[:, :2] / lines[:, 2:]).mean(axis=0))
    # One stone seen badly may point anywhere; the search must begin with all stones on one side.
    worst = float((stones @ guess).min())
    return guess if worst > -_BEFORE else guess * (-0.9 / worst)


def _closure(stones: FloatArray, slope: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """How far each third corner lies from where the other three put it, in the picture.

    p -> P = p / w takes the vanishing line to infinity, where a stone is a parallelogram: P3 = P2 - P1 + P4; and
    p = P / (1 - P . slope) leads back.

    Returns:
        residuals (N, 2), their derivatives to the line (N, 2, 2) and to the four corners (N, 2, 8).
    """
    depth = 1.0 + stones @ slope
    plane = stones / depth[..., None]
    third = plane[:, 1] - plane[:, 0] + plane[:, 3]
    back = 1.0 - third @ slope
    if (back <= 0.0).any():
        raise CrossRatioError("the stones lie on both sides of the vanishing line they would lead to")
    seen = third / back[:, None]
    from_plane = (np.eye(2) + seen[:, :, None] * slope) / back[:, None, None]
    to_plane = (np.eye(2) - plane[..., None] * slope) / depth[..., None, None]
    squares = plane[..., :, None] * plane[..., None, :]
    by_line = seen[:, :, None] * seen[:, None, :]
    by_line = by_line + from_plane @ (squares[:, 0] - squares[:, 1] - squares[:, 3])
    by_corners = [
        -from_plane @ to_plane[:, 0],
        from_plane @ to_plane[:, 1],
        np.broadcast_to(-np.eye(2), from_plane.shape),
        from_plane @ to_plane[:, 3],
    ]
    return seen - stones[:, 2], by_line, np.concatenate(by_corners, axis=2)


def _in_pixels(slope: FloatArray, centre: FloatArray, scale: float) -> tuple[FloatArray, FloatArray]:
    """The line in pixels, negative on the stones, and its derivative (3, 2) to the slope."""
    length = float(np.hypot(slope[0], slope[1]))
    unit = slope / length
    rest = scale - float(slope @ centre)
    line = -np.array([unit[0], unit[1], rest / length])
    turn = np.vstack([-(np.eye(2) - np.outer(unit, unit)), centre + rest * slope / length**2]) / length
    return line, turn
