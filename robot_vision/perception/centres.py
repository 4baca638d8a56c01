# SPDX-License-Identifier: Apache-2.0
"""Where holes, discs and dots really have their centres in a picture, for inspection: perspective is taken out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_vision.geometry import (
    Camera,
    CirclePlane,
    ConicError,
    ImageEllipse,
    plane_of_circles,
    projected_centre,
    vanishing_line,
)
from robot_vision.geometry.sphere import retract
from robot_vision.perception.ellipse_detector import EllipseDetector, SeenEllipse

Array = NDArray[np.float64]

#: rad: step of the derivative of a centre to the plane's normal.
_NUDGE = 1e-6
_BEYOND = "it lies beyond the vanishing line, where the plane of the others is not seen"


class CentreError(ValueError):
    """A picture whose true centres cannot be told; the text says what is missing."""


@dataclass(frozen=True)
class TrueCentre:
    """A hole, disc or dot with its true centre.

    Attributes:
        seen: the ellipse in the picture.
        centre: (2,) (u, v) px, where the centre of what it shows appears.
        covariance: (2, 2) of `centre`, px², from its edge points and, where circles told the plane, from that.
        circle: whether it is a circle on the plane; None when the plane was given and its shape not looked at.
    """

    seen: SeenEllipse
    centre: Array
    covariance: Array
    circle: bool | None

    @property
    def shift(self) -> float:
        """ε, px: how far the true centre lies from the ellipse's (20.10)."""
        return float(np.hypot(*(self.centre - self.seen.ellipse.centre)))


@dataclass(frozen=True)
class Centres:
    """The true centres in a picture.

    Attributes:
        found: from top to bottom.
        line: (3,) vanishing line of their plane, px.
        plane: as the circles told it; None when it was given.
        left_out: ellipses that cannot lie on it, each with the reason.
    """

    found: tuple[TrueCentre, ...]
    line: Array
    plane: CirclePlane | None
    left_out: tuple[tuple[SeenEllipse, str], ...]


class CentreFinder:
    """Finds ellipses in a picture and the true centres of what they show.

    Args:
        detector: that finds the ellipses; one with default settings if none is given.
    """

    def __init__(self, detector: EllipseDetector | None = None) -> None:
        self._detector = detector or EllipseDetector()

    def find(
        self,
        gray: NDArray[np.uint8],
        camera: Camera | None = None,
        normal: ArrayLike | None = None,
        line: ArrayLike | None = None,
    ) -> Centres:
        """Find true centres on one plane; how it lies is told by `line`, or `normal`, or by the circles themselves.

        Args:
            gray: (H, W) uint8, rectified.
            camera: of the picture; needed unless the vanishing line is given.
            normal: (3,) of the plane, optical frame, either way round, of any length.
            line: (3,) vanishing line (a, b, c) of the plane, a u + b v + c = 0.

        Raises:
            CentreError: nothing tells how the plane lies, or the picture has another size than the camera's.
            ConicError: the circles do not tell it, or no ellipse can lie on the plane that was given.
        """
        if line is not None and normal is not None:
            raise CentreError("give the plane's vanishing line or its normal, not both")
        if line is not None and not np.any(np.asarray(line, dtype=np.float64)):
            raise CentreError("a vanishing line (a, b, c) of zeros is no line")
        if camera is not None and gray.shape != (camera.height, camera.width):
            raise CentreError(
                f"the picture has {gray.shape[1]} x {gray.shape[0]} pixels, its camera {camera.width} x "
                f"{camera.height}"
            )
        seen = self._detector.detect(gray)
        if line is not None:
            return _centres(seen, np.asarray(line, dtype=np.float64))
        if camera is None and normal is not None:
            raise CentreError("the plane's normal is given; where it vanishes only a calibrated camera tells")
        if camera is None:
            raise CentreError(
                "nothing tells how the plane lies; give its vanishing line, or a calibrated camera and, "
                "where fewer than two circles show, the plane's normal"
            )
        if normal is not None:
            return _centres(seen, vanishing_line(camera, normal))
        plane = plane_of_circles([each.ellipse for each in seen], camera)
        return _centres(seen, vanishing_line(camera, plane.normal), camera, plane)


def _centres(
    seen: Sequence[SeenEllipse], line: Array, camera: Camera | None = None, plane: CirclePlane | None = None
) -> Centres:
    left_out: list[tuple[SeenEllipse, str]] = []
    clear: list[tuple[int, Array]] = []
    for number, each in enumerate(seen):
        try:
            clear.append((number, projected_centre(each.ellipse.conic, line)))
        except ConicError as error:
            left_out.append((each, error.reason))
    # A plane is seen on one side of its vanishing line only: where most of the ellipses lie, by their size.
    heights = [float(line @ np.append(centre, 1.0)) for _, centre in clear]
    side = sum(seen[n].ellipse.minor * np.sign(h) for (n, _), h in zip(clear, heights, strict=True))
    found: list[TrueCentre] = []
    for (number, centre), height in zip(clear, heights, strict=True):
        each = seen[number]
        if side * height < 0.0:
            left_out.append((each, _BEYOND))
            continue
        covariance = each.covariance
        if camera is not None and plane is not None:
            covariance = covariance + _from_plane(each.ellipse, camera, plane)
        circle = None if plane is None else bool(plane.circles[number])
        found.append(TrueCentre(each, centre, covariance, circle))
    if left_out and not found:
        each, reason = left_out[0]
        raise ConicError(f"the ellipse at ({each.ellipse.u:.1f}, {each.ellipse.v:.1f}): {reason}")
    left_out.sort(key=lambda other: (other[0].ellipse.v, other[0].ellipse.u))
    return Centres(tuple(found), line, plane, tuple(left_out))


def _from_plane(ellipse: ImageEllipse, camera: Camera, plane: CirclePlane) -> Array:
    """Covariance (2, 2) of a centre that comes with that of the plane's normal."""
    columns = []
    for step in _NUDGE * np.eye(2):
        ahead, behind = (
            projected_centre(ellipse.conic, vanishing_line(camera, retract(plane.normal, sign * step)))
            for sign in (1.0, -1.0)
        )
        columns.append((ahead - behind) / (2.0 * _NUDGE))
    slope = np.column_stack(columns)
    return np.asarray(slope @ plane.covariance @ slope.T)
