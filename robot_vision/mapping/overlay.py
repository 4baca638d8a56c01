# SPDX-License-Identifier: Apache-2.0
"""Shows in one picture what each stage of the plan found, beside the plan itself."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.mapping.ground_lines import LineKind
from robot_vision.mapping.mapper import Layers, PlanViewEstimate
from robot_vision.mapping.plan_view import FREE, OCCUPIED, PlanView
from robot_vision.perception import LineSegments

Picture = NDArray[np.uint8]

_FLOOR, _SHADOW, _END, _THING = (96, 176, 96), (200, 120, 40), (60, 60, 230), (0, 210, 250)
_LINE = {
    LineKind.IRRELEVANT: (150, 150, 150),
    LineKind.GROUND: (80, 220, 80),
    LineKind.BORDER: (220, 60, 220),
}


def draw_plan_view(picture: Picture, lines: LineSegments, estimate: PlanViewEstimate) -> Picture:
    """Four pictures in one, BGR uint8 (2 H', 2 W', 3) at half the size of the picture each.

    Above: lines (irrelevant grey, on the floor green, where it ends violet) with floor, shadow, its end and things;
    what of the picture looks and moves like floor (light) or not (dark). Below: parallax (red stands up, green lies,
    blue is mirrored); the plan, seen from above (white free, black taken, grey unknown).

    Args:
        picture: rectified, BGR (H, W, 3).
        lines: of it.
        estimate: what the mapper made of it.
    """
    size = (picture.shape[1] // 2, picture.shape[0] // 2)
    shown = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)
    empty = np.zeros_like(shown)
    plan = _draw_plan(estimate.plan_view, size)
    seen = estimate.layers
    if seen is None:
        return np.vstack([np.hstack([shown, empty]), np.hstack([empty, plan])])
    parts = [
        _draw_floor(shown, lines, seen, estimate),
        _draw_score(empty, seen),
        _draw_parallax(empty, seen),
        plan,
    ]
    for part, name in zip(parts, ("lines, floor, things", "floor or not", "parallax", "plan"), strict=True):
        cv2.putText(part, name, (6, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (0, 0, 0), 3, cv2.LINE_AA)
        cv2.putText(part, name, (6, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (255, 255, 255), 1, cv2.LINE_AA)
    return np.vstack([np.hstack(parts[:2]), np.hstack(parts[2:])])


def _draw_floor(shown: Picture, lines: LineSegments, seen: Layers, estimate: PlanViewEstimate) -> Picture:
    rows = np.arange(len(shown))[:, None]
    end = seen.boundary.rows[: shown.shape[1]]
    floor = rows > end
    tint = np.zeros_like(shown)
    tint[floor] = _FLOOR
    shadow = np.zeros(floor.shape, bool)
    shadow[seen.view.top :] = seen.shadow[: len(shown) - seen.view.top, : shown.shape[1]]
    tint[shadow & floor] = _SHADOW
    drawn = np.where(tint.any(axis=2, keepdims=True), (shown // 3 * 2 + tint // 3), shown).astype(np.uint8)
    for kind, ends in zip(seen.kinds, lines.endpoints * seen.view.scale, strict=True):
        a, b = ((round(float(u)), round(float(v))) for u, v in (ends[:2], ends[2:]))
        cv2.line(drawn, a, b, _LINE[LineKind(int(kind))], 1, cv2.LINE_AA)
    columns = np.flatnonzero(seen.boundary.ended[: shown.shape[1]])
    places = np.clip(np.round(end[columns]).astype(int), 0, len(shown) - 1)
    drawn[places, columns] = _END
    for thing in estimate.objects:
        foot = round(float(np.max(seen.boundary.rows[thing.left : thing.right + 1])))
        cv2.line(drawn, (thing.left, foot), (thing.right, foot), _THING, 2)
        text = f"{thing.distance:.1f} m"
        cv2.putText(
            drawn, text, (thing.left, foot + 12), cv2.FONT_HERSHEY_SIMPLEX, 0.36, _THING, 1, cv2.LINE_AA
        )
    return drawn


def _draw_score(empty: Picture, seen: Layers) -> Picture:
    drawn = empty.copy()
    level = np.clip(128.0 + 42.0 * seen.score, 0, 255).astype(np.uint8)
    drawn[seen.view.top :] = level[: len(drawn) - seen.view.top, : drawn.shape[1], None]
    return drawn


def _draw_parallax(empty: Picture, seen: Layers) -> Picture:
    drawn = empty.copy()
    if seen.parallax is None:
        cv2.putText(
            drawn, "no way yet", (6, 32), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (160, 160, 160), 1, cv2.LINE_AA
        )
        return drawn
    shares = (seen.parallax.mirrored, -seen.parallax.raised, seen.parallax.raised)
    colour = np.stack([np.clip(160.0 * share, 0, 255) for share in shares], axis=2).astype(np.uint8)
    drawn[seen.view.top :] = colour[: len(drawn) - seen.view.top, : drawn.shape[1]]
    return drawn


def _draw_plan(plan: PlanView, size: tuple[int, int]) -> Picture:
    """Ahead is up, left is left; the robot stands in the middle of the lower edge."""
    level = np.full(plan.cells.shape, 128, np.uint8)
    level[plan.cells == FREE], level[plan.cells == OCCUPIED] = 255, 0
    turned = np.ascontiguousarray(level[::-1, ::-1].T[:, ::1])
    scale = min(size[0] / turned.shape[1], size[1] / turned.shape[0])
    small = cv2.resize(turned, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    drawn = np.full((size[1], size[0]), 90, np.uint8)
    left = (size[0] - small.shape[1]) // 2
    drawn[-len(small) :, left : left + small.shape[1]] = small
    return np.asarray(cv2.cvtColor(drawn, cv2.COLOR_GRAY2BGR))
