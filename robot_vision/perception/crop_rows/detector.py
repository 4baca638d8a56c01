# SPDX-License-Identifier: Apache-2.0
"""Finds the crop rows of one picture: one object, one verb."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.perception.crop_rows.ground_fit import Curvature, GroundFit, nearest_row, pieces_of
from robot_vision.perception.crop_rows.pattern import RowPattern
from robot_vision.perception.crop_rows.recipe import ChapterRecipe
from robot_vision.perception.crop_rows.start import start_on_ground
from robot_vision.perception.crop_rows.tracing import RowTracer, TracedRows, straight
from robot_vision.perception.crop_rows.votes import USUAL_WIDTH, RowVotes, StraightRows
from robot_vision.perception.vegetation import Picture, VegetationMask, VegetationWeight

Array = NDArray[np.float64]
Method = Literal["traced", "straight", "plants"]
METHODS: tuple[Method, ...] = ("traced", "straight", "plants")

#: Smaller pictures hold no rows worth the name.
SMALLEST = 32
#: Pictures wider than this are searched at half, a third, ... of their size, px.
_WIDEST = 400
#: Votes of rows and of noise meet about here: the vote of scrambled real pictures reaches the first, that of hardly
#: any real field is below the second.
_NOISE, _SURE = 0.07, 0.25
_CELL_PX = 8
#: Mean and standard deviation of the logarithm of the height, for crop of any height.
_ANY_HEIGHT = (-0.05, 0.08)
#: Standard deviation of a row's place, spacings, and of the yaw, rad, in pictures without a calibrated camera.
_PLACE_SIGMA, _YAW_SIGMA = 0.03, 0.02


@dataclass
class CropRowDetector:
    """Finds rows in a picture of which nothing need be known: neither horizon nor spacing.

    Soft vegetation weights, row spectra by which all plants vote for all rows at once, and dynamic programming that
    follows the rows however they wind.

    Args:
        camera: rectified, of the pictures' size; None: not known. It may lack its height.
        spacing: between rows on the ground, m; None: not known.
        method: `traced` follows rows however they wind, `straight` leaves them as the votes have them, `plants` is the
            textbook's way (`recipe.ChapterRecipe`): the centres of whole plants vote.
        weight: of vegetation.
        votes: for straight rows.
        tracer: that follows them.
        least_confidence: below which there is no row.

    Raises:
        ValueError: for a spacing or a confidence without meaning.
    """

    camera: Camera | None = None
    spacing: float | None = None
    method: Method = "traced"
    weight: VegetationWeight = field(default_factory=VegetationWeight)
    votes: RowVotes = field(default_factory=RowVotes)
    tracer: RowTracer = field(default_factory=RowTracer)
    least_confidence: float = 0.1

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise ValueError(f"method must be one of {', '.join(METHODS)}, not {self.method!r}")
        if self.spacing is not None and not (np.isfinite(self.spacing) and self.spacing > 0.0):
            raise ValueError(f"spacing must be a positive number of metres, not {self.spacing}")
        if not 0.0 <= self.least_confidence <= 1.0:
            raise ValueError(f"least_confidence must lie in [0, 1], not {self.least_confidence}")

    def detect(
        self, bgr: Picture, horizon: float | None = None, spacing_at_bottom: float | None = None
    ) -> RowPattern | None:
        """Rows of a picture, or None where there are none to be sure of.

        Args:
            bgr: uint8 (H, W, 3), or (H, W) in the near infrared.
            horizon: image row of the vanishing line, px, if it is known.
            spacing_at_bottom: distance of the rows at the last image row, px, if it is known.

        Raises:
            ValueError: the array is no such picture, or a hint makes no sense.
        """
        height, width = np.asarray(bgr).shape[:2]
        _check_hints(horizon, spacing_at_bottom, height)
        if min(height, width) < SMALLEST:
            return None
        rows, traced = self.find(bgr, horizon, spacing_at_bottom)
        confidence = float(np.clip((rows.votes - _NOISE) / (_SURE - _NOISE), 0.0, 1.0))
        if confidence <= self.least_confidence:
            return None
        pattern = self._pattern(rows, traced, confidence, height, width)
        if self.camera is None or pattern.unit == "px" or self.camera.height_m is None:
            return pattern
        return self._on_ground(bgr, pattern, self.camera.rectified())

    def find(
        self, bgr: Picture, horizon: float | None = None, spacing_at_bottom: float | None = None
    ) -> tuple[StraightRows, TracedRows]:
        """The straight rows with the most votes, and the rows as they run, both in px of the picture given."""
        height, width = bgr.shape[:2]
        scale = -(-width // _WIDEST)
        small = bgr
        if scale > 1:
            size = width // scale, height // scale
            small = np.asarray(cv2.resize(bgr, size, interpolation=cv2.INTER_AREA))
        spacing = None if spacing_at_bottom is None else spacing_at_bottom / scale
        ratio = None if horizon is None else -horizon / (height - 1.0 - horizon)
        width = small.shape[1]
        least = self.votes.least * width / USUAL_WIDTH
        if self.method == "plants":
            rows = ChapterRecipe(votes=self.votes).find(small, spacing, ratio)
            traced = straight(rows, small.shape[0], width, least)
        else:
            weight = self.weight.of(small).weight
            rows = self.votes.search(self.votes.spectrum(weight), width, spacing, ratio)
            if self.method == "traced":
                known = spacing is not None and ratio is not None
                traced = self.tracer.trace(weight, rows, least, known)
            else:
                traced = straight(rows, small.shape[0], width, least)
        return _enlarged(rows, traced, bgr.shape[:2], small.shape[:2])

    def warm_up(self) -> None:
        """Load or compile the kernels, so that the first picture is not kept waiting."""
        stripes = np.zeros((64, 64, 3), np.uint8)
        stripes[:, ::8, 1] = 200
        CropRowDetector().find(stripes)

    def _pattern(
        self, rows: StraightRows, traced: TracedRows, confidence: float, height: int, width: int
    ) -> RowPattern:
        middle = 0.5 * (width - 1.0)
        reach = int(np.ceil(0.5 * width / traced.spacing[-1])) + 3
        nearest = np.round((traced.centre[-1] - middle) / traced.spacing[-1])
        table = traced.centre[:, None] + (np.arange(-reach, reach + 1) - nearest) * traced.spacing[:, None]
        camera = self.camera or Camera.uncalibrated(width, height)
        offset, yaw, spacing, unit = self._in_space(rows, traced, camera, height, middle)
        sigmas = np.array([_PLACE_SIGMA * spacing, _YAW_SIGMA, 0.05 / max(spacing, 1e-6)])
        return RowPattern(
            table,
            offset,
            yaw,
            0.0,
            spacing,
            np.diag(sigmas**2) / max(confidence, 0.05),
            confidence,
            rows.horizon(height),
            unit,
        )

    def _on_ground(self, bgr: Picture, pattern: RowPattern, camera: Camera) -> RowPattern:
        """The same rows with offset, yaw and curvature fitted on the ground, where plants enough are in view."""
        pieces = pieces_of(VegetationMask(index=self.weight.index).of(bgr), camera, _CELL_PX)
        start = start_on_ground(pattern, camera, pattern.spacing)
        rows = GroundFit().fit(pieces, camera, pattern.spacing, start, Curvature(), _ANY_HEIGHT)
        if rows is None:
            return pattern
        rows = nearest_row(rows, 0.0)
        offset, yaw, curvature = rows.values[:3].tolist()
        return replace(
            pattern, offset=offset, yaw=yaw, curvature=curvature, covariance=rows.covariance[:3, :3]
        )

    def _in_space(
        self, rows: StraightRows, traced: TracedRows, camera: Camera, height: int, middle: float
    ) -> tuple[float, float, float, str]:
        """Offset, yaw, spacing and their unit.

        The vanishing point of the rows lies at the angle of the yaw from the axis of the camera, and how far the
        offset of a row runs with its spacing is the offset on the ground in spacings.
        """
        horizon = rows.horizon(height)
        ray = camera.rays([[middle + rows.column, horizon if np.isfinite(horizon) else -1e4]])[0]
        ahead = camera.optical_to_base @ ray
        yaw = -float(np.arctan2(ahead[1], ahead[0]))
        # At the camera's feet the row stands where the phase is that of density 0 taken from the vanishing column
        phase = (traced.centre[-1] - middle - rows.column) / traced.spacing[-1]
        own = phase - np.round(phase)
        metric = self._spacing_m(traced, camera, height)
        if metric is None:
            return own * float(traced.spacing[-1]), yaw, float(traced.spacing[-1]), "px"
        return own * metric, yaw, metric, "m"

    def _spacing_m(self, traced: TracedRows, camera: Camera, height: int) -> float | None:
        if self.spacing is not None and self.camera is not None:
            return self.spacing
        if self.camera is None or camera.height_m is None:
            return None
        from robot_vision.geometry import GroundPlane

        last = height - 1.0
        pair = [[traced.centre[-1], last], [traced.centre[-1] + traced.spacing[-1], last]]
        ground = GroundPlane(camera.rectified()).from_pixels(pair)
        step = float(np.abs(ground[1, 1] - ground[0, 1]))
        return step if np.isfinite(step) else None


def _check_hints(horizon: float | None, spacing: float | None, height: int) -> None:
    if horizon is not None and not (np.isfinite(horizon) and horizon < height - 1.0):
        raise ValueError(f"horizon must lie above the last image row ({height - 1}), not at {horizon}")
    if spacing is not None and not (np.isfinite(spacing) and spacing > 0.0):
        raise ValueError(f"spacing_at_bottom must be a positive number of pixels, not {spacing}")


def _enlarged(
    rows: StraightRows, traced: TracedRows, whole: tuple[int, ...], small: tuple[int, ...]
) -> tuple[StraightRows, TracedRows]:
    """Rows found in a smaller picture, in px of the whole one (edge on edge, as cv2.resize lays them)."""
    height, width = whole
    if whole == small:
        return rows, traced
    factor = width / small[1]
    places = (np.arange(height) + 0.5) * small[0] / height - 0.5
    lines = np.arange(small[0])

    def stretched(values: Array) -> Array:
        inside = np.interp(places, lines, values)
        # beyond the middle of the first and the last small image row rows go straight on
        first, last = values[1] - values[0], values[-1] - values[-2]
        inside += np.minimum(places, 0.0) * first + np.maximum(places - (small[0] - 1.0), 0.0) * last
        return np.asarray(inside)

    spacing = factor * stretched(traced.spacing)
    centre = factor * (stretched(traced.centre) + 0.5) - 0.5
    enlarged = replace(rows, spacing=rows.spacing * factor, column=rows.column * factor)
    return enlarged, TracedRows(centre, spacing, traced.score)
