# SPDX-License-Identifier: Apache-2.0
"""The inspection of one picture as a person asks for it and reads it: texts in, a table and a drawing out."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.perception.centres import CentreError, CentreFinder, Centres
from robot_vision.perception.centres_overlay import draw_centres
from robot_vision.perception.picture import Picture, to_gray

_HEAD = "   ellipse u        v     centre u        v    shift    sd  semi-axes"


def numbers_of(name: str, text: str | None) -> NDArray[np.float64] | None:
    """Read three numbers with commas between, such as a normal; None stays None.

    Raises:
        CentreError: naming `name`, for any other text.
    """
    if text is None:
        return None
    try:
        numbers = np.array([float(word) for word in text.split(",")])
    except ValueError:
        numbers = np.array([])
    if numbers.shape != (3,) or not np.isfinite(numbers).all() or not numbers.any():
        raise CentreError(
            f"{name} must be three numbers with commas between, not all of them zero, not {text!r}"
        )
    return numbers


def inspect(
    picture: Picture,
    finder: CentreFinder,
    camera: Camera | None = None,
    normal: NDArray[np.float64] | None = None,
    line: NDArray[np.float64] | None = None,
) -> tuple[Centres, Picture]:
    """Find the true centres in a picture as it comes from a camera, and draw them.

    Args:
        picture: (H, W) or BGR (H, W, 3).
        finder: that finds them.
        camera: of the picture; lens distortion is taken out first, and all pixels are then rectified ones.
        normal: (3,) of the plane, optical frame.
        line: (3,) its vanishing line, rectified px.

    Raises:
        CentreError, ConicError: as `CentreFinder.find`.
        PictureError: not a grey or BGR picture.
    """
    if camera is not None and not camera.is_rectified:
        picture = np.asarray(cv2.remap(picture, *camera.rectification_maps(), cv2.INTER_CUBIC))
        camera = camera.rectified()
    centres = finder.find(to_gray(picture), camera, normal, line)
    shown = picture if picture.dtype == np.uint8 else to_gray(picture)
    return centres, draw_centres(shown, centres)


def table(centres: Centres) -> Iterator[str]:
    """Lines of text: how the plane lies, and each ellipse with its true centre, in px."""
    if centres.plane is not None:
        x, y, z = centres.plane.normal
        sigma = np.degrees(np.sqrt(np.linalg.eigvalsh(centres.plane.covariance)[-1]))
        agreeing = int(centres.plane.circles.sum())
        yield f"plane as {agreeing} circles tell it: normal {x:.4f},{y:.4f},{z:.4f} (to {sigma:.2f}°)"
    yield _HEAD
    for each in centres.found:
        ellipse = each.seen.ellipse
        sigma = np.sqrt(0.5 * np.trace(each.covariance))
        kind = "" if each.circle is None else ("  circle" if each.circle else "  ellipse")
        yield (
            f"{ellipse.u:12.3f} {ellipse.v:8.3f} {each.centre[0]:12.3f} {each.centre[1]:8.3f} {each.shift:8.3f} "
            f"{sigma:5.3f} {ellipse.major:5.1f} {ellipse.minor:4.1f}{kind}"
        )
    for other, reason in centres.left_out:
        yield f"left out: the ellipse at ({other.ellipse.u:.1f}, {other.ellipse.v:.1f}): {reason}"


def write_drawing(path: Path, picture: Picture) -> None:
    """Write a picture, its kind by the ending of its name.

    Raises:
        CentreError: the kind is not known, or the file cannot be written.
    """
    try:
        done, data = cv2.imencode(path.suffix or ".", picture, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    except cv2.error:
        done = False
    if not done:
        raise CentreError(
            f"{path}: pictures are written as .png or .jpg, not as {path.suffix or 'nothing'!r}"
        )
    try:
        path.write_bytes(data.tobytes())
    except OSError as error:
        raise CentreError(f"cannot write {path}: {error.strerror}") from error
