# SPDX-License-Identifier: Apache-2.0
"""From successive pictures to the robot's place among the rows: one object, one verb."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from importlib import import_module

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.perception.crop_rows.between_rows import between_plants
from robot_vision.perception.crop_rows.detector import CropRowDetector
from robot_vision.perception.crop_rows.ground_fit import (
    HEIGHT,
    OFFSET,
    YAW,
    Curvature,
    GroundFit,
    Pieces,
    RowsOnGround,
    ground_places,
    lateral,
    nearest_row,
    pieces_of,
    tall_by_cover,
)
from robot_vision.perception.crop_rows.row_dispute import RowDispute
from robot_vision.perception.crop_rows.row_extent import (
    ALONE,
    CELL_M,
    RowExtent,
    go_on_until,
    row_cover,
    sideways,
)
from robot_vision.perception.crop_rows.row_filter import Motion, RowFilter
from robot_vision.perception.crop_rows.sight import fault_of
from robot_vision.perception.crop_rows.single_plant import contradicting_heading
from robot_vision.perception.crop_rows.start import start_on_ground
from robot_vision.perception.lane import LaneHeading
from robot_vision.perception.vegetation import Picture, VegetationMask

Array = NDArray[np.float64]

_CELL_PX = 8
#: Share of the ground covered from which on the bare ground between the rows is the rarer and tells more.
_CLOSED = 0.4
#: Height and spacing contradict each other beyond this share and twice what plants may be high: one is not as given.
_CONTRADICTION = 0.05
#: Without odometry, after so many pictures in a row that fit no row the search begins anew.
_MOST_REFUSED = 8
#: Standard deviation of the offset, in spacings, beyond which nobody knows which row this is.
_LOST = 0.2
#: Rows to either side of the robot's own that tell where rows end.
_SIDE_ROWS = 2.5
#: Rows beyond open ground are those before it only where these are known to such a standard deviation, in spacings.
_TIED = 0.125
#: Ground ahead whose plants are asked for the heading one by one, m, and factor on the variances where they dissent.
_ASKED_M, _DISSENT = 5.0, 10.0


@dataclass(frozen=True)
class RowEstimate:
    """What one picture adds to the knowledge of the way along the rows.

    Attributes:
        lane: the robot in its row, curvature included; None while it is not known, or not seen any more.
        reason: in plain words why there is no lane, or what is wrong with it; empty when all is well.
        seen: whether this picture shows the rows; else `lane` is carried on by odometry.
        rows: as this picture alone has them; None where it does not.
        end: metres from the robot to where the rows end; None while no end is near.
        fault: why the picture shows nothing at all, as at night; empty when it does.
    """

    lane: LaneHeading | None
    reason: str
    seen: bool
    rows: RowsOnGround | None
    end: float | None
    fault: str = ""


@dataclass
class RowTracker:
    """Follows the row the robot stands over through successive pictures.

    Args:
        spacing: between rows, m.
        mask: of vegetation.
        detector: that finds rows where nothing is known yet; its camera and spacing are of no account.
        fit: of the rows on the ground.
        row_filter: over time.
        dispute: between the filter and pictures that it refuses.
        extent: of the rows along the way.
        end_within: an end farther ahead is not told, m: the last plants, few or small, are not all seen from there;
            infinite: every end is told.
        coherence: least share of the vegetation that must stand in rows, 0 to 1.
        cover: least share of the ground that plants must cover.

    Raises:
        ValueError: naming the setting that makes no sense.
    """

    spacing: float
    mask: VegetationMask = field(default_factory=VegetationMask)
    detector: CropRowDetector = field(default_factory=CropRowDetector)
    fit: GroundFit = field(default_factory=GroundFit)
    row_filter: RowFilter = field(default_factory=RowFilter)
    dispute: RowDispute = field(default_factory=RowDispute)
    extent: RowExtent = field(default_factory=RowExtent)
    end_within: float = 4.0
    coherence: float = 0.12
    cover: float = 0.004
    _way: float = field(default=0.0, init=False, repr=False, compare=False)
    _refused: int = field(default=0, init=False, repr=False, compare=False)
    _unseen: float = field(default=0.0, init=False, repr=False, compare=False)
    _blind: bool = field(default=False, init=False, repr=False, compare=False)
    _alone: bool = field(default=False, init=False, repr=False, compare=False)
    _reach: float = field(default=0.0, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not (np.isfinite(self.spacing) and self.spacing > 0.0):
            raise ValueError(f"spacing must be a positive number of metres, not {self.spacing}")
        if not self.end_within > 0.0:
            raise ValueError(f"end_within must be a positive number of metres, not {self.end_within}")
        for name in ("coherence", "cover"):
            if not 0.0 <= getattr(self, name) < 1.0:
                raise ValueError(f"{name} must lie in [0, 1), not {getattr(self, name)}")

    def warm_up(self) -> None:
        """Load the compiled kernels and what the filter stands on."""
        import_module("filterpy.kalman")
        self.detector.warm_up()

    def reset(self) -> None:
        """Forget everything earlier pictures told."""
        self.row_filter.reset()
        self.dispute.reset()
        self.extent.reset()
        self._way = self._unseen = self._reach = 0.0
        self._refused = 0

    def update(self, picture: Picture, camera: Camera, motion: Motion) -> RowEstimate:
        """Take in the next picture.

        Args:
            picture: rectified, uint8 (H, W, 3) BGR, or (H, W) in the near infrared.
            camera: with its place on the robot, of the picture's size; its height must be known.
            motion: since the picture before.

        Raises:
            ValueError: the camera has no height, or the array is no picture.
        """
        camera = camera.rectified()
        if camera.height_m is None or not camera.focal_known:
            raise ValueError(
                "rows in metres need a calibrated camera and its height (parameter camera.height)"
            )
        self.row_filter.predict(motion)
        self.dispute.predict(motion)
        self._blind = motion.speed is None
        self._way += (motion.speed or 0.0) * motion.seconds
        self._unseen += abs(motion.speed or 0.0) * motion.seconds
        fault = fault_of(picture)
        if fault:
            # Odometry alone may carry on over ground that was looked at and is bare, not through the dark
            return replace(self._without(fault), lane=None, fault=fault)
        mask = self.mask.of(picture)
        cell = _CELL_PX * max(1, picture.shape[1] // 640)
        pieces = pieces_of(mask, camera, cell)
        covered = self._covered(pieces, camera)
        if self._end() is None:
            # Leaves that close meet midway between their rows; later on the open ground behind is in view
            self._reach = 0.5 * self.spacing if covered >= _CLOSED else 0.0
        told = (
            pieces
            if covered < _CLOSED
            else between_plants(pieces_of(~mask, camera, cell, 0.5), pieces, camera)
        )
        plants = pieces
        if self.row_filter.knows:
            plants = self._where_rows_stand(pieces, camera)
            told = self._where_rows_stand(told, camera) if told.aside else plants

        def look(anew: bool) -> tuple[RowsOnGround | None, str]:
            return self._fitted(picture, told, plants, covered, camera, anew)

        rows, fault = look(not self.row_filter.knows)
        if rows is None:
            return self._refuse(pieces, camera, motion, fault)
        rows, dissent, doubt = self._weighed(rows, pieces, camera)
        knew = self.row_filter.knows
        believed = self.row_filter.update(*_told(rows), doubt)
        if believed and doubt == 1.0:
            self.dispute.trust()
        if knew and not self._blind and (self.dispute.goes_on or not believed):
            # A start that is wrong holds the fit to wrong rows: by itself the picture may say something else
            better = self._disputed(look(True)[0], pieces, camera, believed)
            if better is not None:
                rows, dissent, doubt, believed = *better, True
        if not believed:
            why = dissent or "what stands in this picture does not go on from the rows before"
            return self._refuse(pieces, camera, motion, why)
        rows = replace(rows, covariance=doubt * rows.covariance)
        self._refused = 0
        self._unseen = 0.0
        self._look_along(pieces, camera, rows.values, rows.covariance[:3, :3], motion)
        return RowEstimate(self._lane(), dissent, True, rows, self._told_end())

    def _refuse(self, pieces: Pieces, camera: Camera, motion: Motion, reason: str) -> RowEstimate:
        """The answer to a picture not believed: what stands along the way is noted where rows should be."""
        if self.row_filter.knows:
            self._look_along(pieces, camera, self._start(), self._spread(), motion)
        return self._without(reason)

    def _disputed(
        self, rows: RowsOnGround | None, pieces: Pieces, camera: Camera, believed: bool
    ) -> tuple[RowsOnGround, str, float] | None:
        """Rows of a picture by itself, what speaks against them, and the doubt, where the filter gives way to them."""
        if rows is None:
            return None
        rows, dissent, doubt = self._weighed(rows, pieces, camera)
        better = self.dispute.hear(self.row_filter, *_told(rows), doubt, self.spacing, believed)
        if better is None:
            return None
        self.row_filter = better
        self.extent.reset()  # what was noted along the way was noted at the wrong place
        return rows, dissent, doubt

    def _weighed(self, rows: RowsOnGround, pieces: Pieces, camera: Camera) -> tuple[RowsOnGround, str, float]:
        """Rows counted from the robot's own, what speaks against them, and the factor of doubt on their covariance."""
        expected = float(self.row_filter.expected()[OFFSET]) if self.row_filter.knows else 0.0
        rows = nearest_row(rows, expected)
        dissent = self._dissent(pieces, rows, camera)
        return rows, dissent, _DISSENT if dissent else 1.0

    def _dissent(self, pieces: Pieces, rows: RowsOnGround, camera: Camera) -> str:
        """What single plants (20.11)-(20.15) have against the rows fitted to all of them; empty when nothing."""
        x, y = ground_places(pieces.rays, camera, rows.values)
        asked = (
            (x > camera.x_m) & (x < camera.x_m + _ASKED_M) & (np.abs(y) < (_SIDE_ROWS + 0.5) * self.spacing)
        )
        offset, yaw, curvature = rows.values[:3].tolist()
        # Rows that bend away are straightened: the quadratic is that of straight ones
        left = y[asked] - 0.5 * curvature * x[asked] ** 2
        other = contradicting_heading(x[asked], left, pieces.weight[asked], offset, self.spacing, yaw)
        if other is None:
            return ""
        return f"single plants say the robot heads {np.rad2deg(other - yaw):+.0f} degrees off what their rows say"

    def _end(self) -> float | None:
        return self.extent.end(self._way, self._reach)

    def _told_end(self) -> float | None:
        end = self._end()
        return None if end is None or end > self.end_within else end

    def _start(self) -> Array:
        """What a picture should show, (6,): as predicted, the body upright."""
        return np.array([*self.row_filter.expected(), 0.0, 0.0, -0.02])

    def _spread(self) -> Array:
        """Covariance (3, 3) of that."""
        return np.asarray(self.row_filter.covariance[:3, :3])

    def _where_rows_stand(self, pieces: Pieces, camera: Camera) -> Pieces:
        """Leave out what grows in known gaps and where the rows are over: weeds, and the grass of the headland."""
        x, _ = ground_places(pieces.rays, camera, self._start())
        here = ~self.extent.is_open(self._way, x)
        end = self._end()
        if end is not None:
            # Beyond the last stems bare ground lies between no plants, while their leaves still tell
            here &= x < end + (0.0 if pieces.aside else CELL_M)
        return Pieces(pieces.rays[here], pieces.weight[here], pieces.aside)

    def _covered(self, pieces: Pieces, camera: Camera) -> float:
        """Share of the ground that plants cover, straight before the robot."""
        upright = np.zeros(6)
        x, y = ground_places(pieces.rays, camera, upright)
        near, far = ground_in_view(camera, upright)
        far = min(far, 0.5 * self.fit.far)
        half = _SIDE_ROWS * self.spacing
        here = (x > near) & (x < far) & (np.abs(y) < half)
        return float(pieces.weight[here].sum()) / max(2.0 * half * (far - near), 1e-6)

    def _fitted(
        self, picture: Picture, pieces: Pieces, plants: Pieces, covered: float, camera: Camera, anew: bool
    ) -> tuple[RowsOnGround | None, str]:
        """Rows of this picture alone, fitted to pieces of plants or of the ground between, or why there are none.

        The plants tell besides where open ground is. Anew: the search starts without what is known of the rows; what
        grows on ground that is known to be open is left out all the same.
        """
        if covered < self.cover:
            return None, "hardly anything grows in this picture"
        if not anew:
            start = self._start()
            curvature = float(start[2])
            sigma = float(np.sqrt(self.row_filter.covariance[2, 2]))
            bend = Curvature(curvature, float(np.clip(sigma, 5e-4, 0.015)))
        else:
            pattern = self.detector.detect(picture)
            if pattern is None:
                return None, "no rows stand out in this picture"
            start, bend = start_on_ground(pattern, camera, self.spacing), Curvature()
        pieces = self._tied(pieces, plants, camera, start, anew)
        rows = self.fit.fit(pieces, camera, self.spacing, start, bend, tall_by_cover(covered))
        if rows is None:
            return None, "hardly anything grows before the robot"
        if rows.share < self.coherence:
            return None, "what grows in this picture does not stand in rows"
        stretch = float(np.exp(rows.values[HEIGHT] - tall_by_cover(covered)[0]))
        if abs(np.log(stretch)) > _CONTRADICTION + 2.0 * tall_by_cover(covered)[1]:
            return None, (
                f"rows stand {self.spacing / stretch:.2f} m apart for a camera {camera.height_m:g} m up, "
                f"not {self.spacing:g} m: look at spacing, camera.height and camera.pitch"
            )
        if max(np.abs(rows.values[3:5])) > 4.0 * self.fit.lean:
            return None, "the rows lie as if the camera had been knocked over: look at camera.pitch and roll"
        return rows, ""

    def _tied(self, pieces: Pieces, plants: Pieces, camera: Camera, start: Array, anew: bool) -> Pieces:
        """Leave out rows beyond open ground while it is not sure which of them goes on as which of those before it."""
        grown, aside = self._among_rows(plants, camera, start)
        half, within = _SIDE_ROWS * self.spacing, self._strip(camera, start)
        if pieces.aside:
            # Leaves that close stand in no rows to be seen, nor are they open ground
            aside = np.where(np.abs(aside) < half, 0.0, aside)
        until = go_on_until(grown, aside, plants.weight, self.spacing, half, within)
        along = self._among_rows(pieces, camera, start)[0] if pieces.aside else grown
        here = along < until
        if not anew:
            here |= sideways(along, self._spread()) < _TIED * self.spacing
        return Pieces(pieces.rays[here], pieces.weight[here], pieces.aside)

    def _look_along(
        self, pieces: Pieces, camera: Camera, values: Array, covariance: Array, motion: Motion
    ) -> None:
        """Note where along the way rows stand."""
        # Without odometry nobody knows where the last picture was taken
        alone = motion.speed is None and motion.seconds > 0.0
        if alone or self._alone:
            self.extent.reset()
        self._alone = alone
        along, aside = self._among_rows(pieces, camera, values)
        half, within = _SIDE_ROWS * self.spacing, self._strip(camera, values)
        ahead, cover, seen = row_cover(along, aside, pieces.weight, self.spacing, half, within, covariance)
        self.extent.see(self._way, ahead, cover, ALONE * seen if alone else seen)

    def _among_rows(self, pieces: Pieces, camera: Camera, values: Array) -> tuple[Array, Array]:
        """Where bits stand along the robot's row, and how far to the left of it, (N,) each, m."""
        aside, along = lateral(*ground_places(pieces.rays, camera, values), values)
        return along, aside

    def _strip(self, camera: Camera, values: Array) -> tuple[float, float]:
        """Where the ground begins and ends that tells how rows go on, m ahead."""
        near, far = ground_in_view(camera, values)
        return near, min(far, 1.4 * self.fit.far)

    def _lane(self) -> LaneHeading | None:
        state, covariance = self.row_filter.state, self.row_filter.covariance
        if np.sqrt(covariance[OFFSET, OFFSET]) > _LOST * self.spacing:
            return None
        return LaneHeading(
            float(state[YAW]),
            float(covariance[YAW, YAW]),
            float(state[OFFSET]),
            float(covariance[OFFSET, OFFSET]),
            self.spacing,
            float(state[2]),
        )

    def _without(self, reason: str) -> RowEstimate:
        """The answer to a picture that shows no rows: odometry carries on, as far as a gap may be long."""
        if not self.row_filter.knows:
            return RowEstimate(None, reason, False, None, None)
        self._refused += 1
        end = self._told_end()
        lane = self._lane()
        lost = self._unseen > self.extent.gap or (self._blind and self._refused > _MOST_REFUSED)
        if lane is None or lost:
            self.reset()
            return RowEstimate(None, f"{reason}; the row is lost", False, None, end)
        return RowEstimate(lane, reason, False, None, end)


def _told(rows: RowsOnGround) -> tuple[Array, Array]:
    """What the filter hears of rows."""
    return rows.values[:3], rows.covariance[:3, :3]


def ground_in_view(camera: Camera, values: Array) -> tuple[float, float]:
    """Nearest and farthest ground (m ahead of base_link) in the middle column of a picture."""
    middle = 0.5 * (camera.width - 1.0)
    rays = camera.rays([[middle, camera.height - 1.0], [middle, 0.0]]) @ camera.optical_to_base.T
    x, _ = ground_places(rays, camera, values)
    far = float(x[1]) if 0.0 < x[1] < 100.0 else 100.0
    return float(x[0]), far
