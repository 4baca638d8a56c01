# SPDX-License-Identifier: Apache-2.0
"""A picture with its ellipses, their true centres and the shift between them, drawn large enough to be seen."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.perception.centres import Centres, TrueCentre

Picture = NDArray[Any]
Colour = tuple[int, int, int]

#: BGR, from the set of Okabe and Ito.
BORDER: Colour = (233, 180, 86)
ELLIPSE_CENTRE: Colour = (233, 180, 86)
TRUE_CENTRE: Colour = (0, 159, 230)
HORIZON: Colour = (66, 228, 240)
TEXT: Colour = (255, 255, 255)
BACKGROUND: Colour = (30, 30, 30)
#: Drawing places lines to 1/16 px.
_SHIFT = 4
_FONT = cv2.FONT_HERSHEY_SIMPLEX


def draw_centres(picture: Picture, centres: Centres, scale: int = 2, magnified: float = 20.0) -> Picture:
    """Draw each ellipse, its centre, the true centre beside it and ε in px.

    Args:
        picture: BGR uint8 (H, W, 3), or grey (H, W).
        centres: in its pixels.
        scale: by which the picture is enlarged.
        magnified: how many times its length each shift is drawn, as an arrow from the ellipse's centre.

    Returns:
        a new picture, BGR uint8 (scale H, scale W, 3).
    """
    height, width = (scale * side for side in picture.shape[:2])
    colours = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR) if picture.ndim == 2 else picture
    canvas = cv2.resize(colours, (width, height), interpolation=cv2.INTER_NEAREST)  # pixels stay pixels
    _draw_line(canvas, centres.line, scale)
    for each in centres.found:
        _draw(canvas, each, scale, magnified)
    words = f"+ ellipse centre   x true centre   arrow: {magnified:g} x shift"
    size = 0.00075 * width
    cv2.rectangle(canvas, (0, height - round(44 * size)), (width, height), BACKGROUND, -1)
    cv2.putText(
        canvas, words, (round(12 * size), height - round(14 * size)), _FONT, size, TEXT, 1, cv2.LINE_AA
    )
    return np.asarray(canvas)


def _draw(canvas: Picture, each: TrueCentre, scale: int, magnified: float) -> None:
    ellipse = each.seen.ellipse
    outline = np.rint(_enlarged(ellipse.points(180), scale) * (1 << _SHIFT)).astype(np.int32)
    cv2.polylines(canvas, [outline], True, BORDER, 1, cv2.LINE_AA, _SHIFT)
    start, true = _enlarged(np.array([ellipse.centre, each.centre]), scale)
    tip = start + magnified * (true - start)
    if np.hypot(*(tip - start)) > 2.0:
        ends = np.rint(np.array([start, tip])).astype(int)
        cv2.arrowedLine(
            canvas, ends[0].tolist(), ends[1].tolist(), TRUE_CENTRE, 1, cv2.LINE_AA, tipLength=0.25
        )
    reach = max(3.0, 2.0 * scale)
    _cross(canvas, start, np.array([(reach, 0.0), (0.0, reach)]), ELLIPSE_CENTRE)
    _cross(canvas, true, 0.7 * reach * np.array([(1.0, 1.0), (1.0, -1.0)]), TRUE_CENTRE)
    _label(canvas, f"{each.shift:.2f}", outline.max(axis=0) / (1 << _SHIFT), 0.22 * scale)


def _label(canvas: Picture, text: str, corner: NDArray[np.float64], size: float) -> None:
    """Text beside the border, where the arrow and the crosses are not."""
    (width, height), below = cv2.getTextSize(text, _FONT, size, 1)
    left, bottom = (round(float(place)) for place in corner)
    cv2.rectangle(
        canvas, (left, bottom - height - 3), (left + width + 4, bottom + below // 2), BACKGROUND, -1
    )
    cv2.putText(canvas, text, (left + 2, bottom - 2), _FONT, size, TEXT, 1, cv2.LINE_AA)


def _cross(canvas: Picture, middle: NDArray[np.float64], arms: NDArray[np.float64], colour: Colour) -> None:
    for arm in arms:
        ends = np.rint(np.array([middle - arm, middle + arm]) * (1 << _SHIFT)).astype(int)
        cv2.line(canvas, ends[0].tolist(), ends[1].tolist(), colour, 1, cv2.LINE_AA, _SHIFT)


def _draw_line(canvas: Picture, line: NDArray[np.float64], scale: int) -> None:
    """The vanishing line, where it crosses the picture."""
    height, width = canvas.shape[:2]
    a, b, c = line / scale + (0.0, 0.0, line[2] * (1.0 - 1.0 / scale))
    if abs(b) > abs(a):
        ends = [(x, -(a * x + c) / b) for x in (0.0, width - 1.0)]
    elif a != 0.0:
        ends = [(-(b * y + c) / a, y) for y in (0.0, height - 1.0)]
    else:
        return
    if all(abs(place) < 1e5 for end in ends for place in end):
        first, second = (tuple(map(round, end)) for end in ends)
        cv2.line(canvas, first, second, HORIZON, 1, cv2.LINE_AA)


def _enlarged(points: NDArray[np.float64], scale: int) -> NDArray[np.float64]:
    """Pixels of the enlarged picture: edge on edge, as cv2.resize lays them."""
    return np.asarray((points + 0.5) * scale - 0.5)
