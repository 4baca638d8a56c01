# SPDX-License-Identifier: Apache-2.0
"""Rows in metres: offset, yaw and curvature on the ground, with the lean of the camera that the same plants tell.

Rows a known distance apart are a ruler on the ground: how far they stand apart in the picture tells the height and
the pitch of the camera, and that they stand equally far apart on the left and on the right tells its roll. So the
fit has six unknowns, (20.11)-(20.13) in full: offset, yaw, curvature, roll, pitch and the height in spacings.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.geometry.rotation import rotation_from_rpy

Array = NDArray[np.float64]

OFFSET, YAW, CURVATURE, ROLL, PITCH, HEIGHT = range(6)
#: Steps of the numeric derivatives: m, rad, 1/m, rad, rad, share.
_STEPS = np.array([1e-3, 1e-4, 1e-5, 1e-4, 1e-4, 1e-4])
#: Rounds of the fit: distance at which a bit loses its say (in that of the last round), ground ahead and to each side
#: that counts (in that of the last round).
_SCHEDULE = (
    (3.1, 0.37, 0.13),
    (3.1, 0.37, 0.13),
    (2.5, 0.43, 0.20),
    (2.5, 0.50, 0.28),
    (2.0, 0.67, 0.37),
    (1.7, 0.83, 0.47),
    (1.5, 1.0, 0.6),
    (1.2, 1.0, 0.6),
    (1.0, 1.0, 0.6),
    (1.0, 1.0, 0.6),
)
#: Rounds after these in which the curvature is let go, where it is so many standard deviations from what was expected.
_FREED, _SURPRISE = 2, 3.0
#: Rays that fall less than this, rad, meet the ground too far off.
_LEAST_FALL = 0.06
#: Fewer bits than this say nothing.
_FEWEST = 12
_LEAST_YIELD = 0.3
#: Standard deviation of offset (m) and yaw (rad) of a start.
_PLACE, _START_SIGMAS = [0, 1], np.array([0.06, 0.02])
#: Length of row that counts as one clump, m.
_CLUMP_M = 0.35
#: Standard deviation of a plant about the line of its row, m.
_SCATTER = 0.02
#: Factor on the variance, for what leans all plants one way: wind, the sun, the slope; of what grows, and of the bare
#: ground between, whose borders are the leaves of tall plants: leaves higher on one side look like a roll of the body
#: by half a degree, which is a centimetre of offset.
_DOUBT = {0.0: 2.0, 0.5: 8.0}
#: Share of the vegetation that stands in rows, as a rule.
_USUAL_SHARE = 0.5
#: Of the middle of a clump, m: no field is sown better.
_LEAST_SCATTER = 0.008


@dataclass(frozen=True)
class RowsOnGround:
    """The robot among rows.

    Attributes:
        values: (6,) offset to the left of a row (m), yaw relative to it (rad, counter-clockwise), curvature (1/m,
            to the left positive), roll and pitch of the body on top of the camera's mounting (rad), logarithm of
            the height over the one that is given.
        covariance: (6, 6) of these.
        spacing: between rows, m.
        share: of the vegetation looked at that stands in rows, 1 at best, 0 where it stands anywhere.
        plants: number of clumps that the fit stands on.
    """

    values: Array
    covariance: Array
    spacing: float
    share: float
    plants: int


@dataclass(frozen=True)
class Pieces:
    """Bits of vegetation, or of the bare ground between.

    Attributes:
        rays: (N, 3) in base_link, unit, for a body that does not lean.
        weight: (N,) m^2 of ground that a bit covers.
        aside: where bits gather, in spacings from a row: 0 for what grows, 0.5 for bare ground.
    """

    rays: Array
    weight: Array
    aside: float = 0.0

    def __len__(self) -> int:
        return len(self.weight)


@dataclass(frozen=True)
class Curvature:
    """What is known of the rows' curvature before a picture: its mean and standard deviation, 1/m."""

    mean: float = 0.0
    sigma: float = 0.015


_ANY_CURVATURE = Curvature(0.0, 0.1)


@dataclass(frozen=True)
class GroundFit:
    """Fits rows to bits of vegetation; each belongs to the row nearest to it, whichever that is.

    It begins with the ground at the robot's feet, where a lean moves little, and looks farther from round to round.

    Args:
        lean: standard deviation of the body's roll and pitch about the mounting, rad.
        narrow: distance from a row beyond which a bit loses its say, in spacings.
        far: ground that counts, m ahead of the camera; to the sides 0.6 of it.

    Raises:
        ValueError: naming the setting that is no positive number.
    """

    lean: float = 0.02
    narrow: float = 0.12
    far: float = 8.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a positive number, not {value}")

    def fit(
        self,
        pieces: Pieces,
        camera: Camera,
        spacing: float,
        start: Array,
        curvature: Curvature,
        tall: tuple[float, float],
    ) -> RowsOnGround | None:
        """Fit rows from a start that is right to a third of a spacing at the robot's feet.

        The curvature expected steadies the search to its end; a last step then leaves it out, so that the answer and
        its covariance are without it, ready to be joined with what is known.

        Args:
            pieces: of vegetation.
            camera: with its height.
            spacing: between rows, m.
            start: (6,) as `RowsOnGround.values`.
            curvature: expected.
            tall: mean and standard deviation of the logarithm of the height over the one given.

        Returns:
            None when too little vegetation is in view.
        """
        values = np.array(start, np.float64)
        last = len(_SCHEDULE) - 1
        for number, (scale, far, aside) in enumerate(_SCHEDULE):
            information, prior = self._prior(curvature, tall)
            if number < last - 1:
                # Weeds alone, as in a gap, must not lead astray what begins with the ground at the robot's feet
                information[_PLACE, _PLACE] = _START_SIGMAS**-2.0
                prior[_PLACE] = start[_PLACE]
            scale *= self.narrow * spacing
            here = self._in_view(pieces, camera, values, far * self.far, aside * self.far)
            if here is not None:
                values = _nearer(here, camera, values, spacing, scale, information, prior)
        told = self._judged(pieces, camera, values, spacing, tall)
        if told is None or not _surprises(told, curvature):
            return told
        # rows that bend otherwise than expected were held to wrong places until the last step
        values = told.values
        known, anything = self._prior(_ANY_CURVATURE, tall)
        for _ in range(_FREED):
            here = self._in_view(pieces, camera, values, self.far, 0.6 * self.far)
            if here is not None:
                values = _nearer(here, camera, values, spacing, self.narrow * spacing, known, anything)
        return self._judged(pieces, camera, values, spacing, tall)

    def _prior(self, curvature: Curvature, tall: tuple[float, float]) -> tuple[Array, Array]:
        """Information (6, 6) and mean (6,) of what is known before."""
        sigmas = np.array([1e3, 1e3, curvature.sigma, self.lean, self.lean, tall[1]])
        return np.diag(sigmas**-2.0), np.array([0.0, 0.0, curvature.mean, 0.0, 0.0, tall[0]])

    def _in_view(
        self, pieces: Pieces, camera: Camera, values: Array, far: float, aside: float
    ) -> Pieces | None:
        x, y = ground_places(pieces.rays, camera, values)
        seen = (x - camera.x_m > 0.0) & (x - camera.x_m < far) & (np.abs(y) < aside)
        if int(seen.sum()) < _FEWEST:
            return None
        return Pieces(pieces.rays[seen], pieces.weight[seen], pieces.aside)

    def _judged(
        self, pieces: Pieces, camera: Camera, values: Array, spacing: float, tall: tuple[float, float]
    ) -> RowsOnGround | None:
        """The answer, its covariance from how the clumps of vegetation scatter about the rows."""
        here = self._in_view(pieces, camera, values, self.far, 0.6 * self.far)
        if here is None:
            return None
        residual, jacobian = _residuals(here, camera, values, spacing)
        scale = self.narrow * spacing
        trust = _trust(here.weight, residual, scale)
        x, y = ground_places(here.rays, camera, values)
        row = np.round((lateral(x, y, values)[0] - residual) / spacing)
        _, clump = np.unique(np.stack([row, np.floor(x / _CLUMP_M)]), axis=1, return_inverse=True)
        count = int(clump.max()) + 1
        # Bits of one plant err together: what scatters about the rows are the middles of clumps
        amount = np.bincount(clump.ravel(), trust, count) + 1e-12
        middle = np.bincount(clump.ravel(), trust * residual, count) / amount
        scatter = float(np.average(middle**2, weights=amount)) + _LEAST_SCATTER**2
        clumps = float(amount.sum() ** 2 / (amount**2).sum())
        honest = clumps / scatter / float(trust.sum())
        known, prior = self._prior(_ANY_CURVATURE, tall)
        information = honest * (jacobian.T @ (trust[:, None] * jacobian)) + known
        values = values - _step(residual, jacobian, trust, scale, known, values - prior)
        share = float(np.average(np.cos(2.0 * np.pi * residual / spacing), weights=here.weight))
        # The less of what grows stands in rows, the more the weeds have a say
        weedy = max(1.0, _USUAL_SHARE / max(share, 0.05)) ** 2
        covariance = weedy * _DOUBT[here.aside] * np.linalg.inv(information)
        return RowsOnGround(values, 0.5 * (covariance + covariance.T), spacing, share, count)


def _surprises(told: RowsOnGround, expected: Curvature) -> bool:
    """Whether rows bend surely otherwise than was expected."""
    sigma = float(np.sqrt(told.covariance[CURVATURE, CURVATURE]))
    return abs(float(told.values[CURVATURE]) - expected.mean) > _SURPRISE * sigma


def pieces_of(mask: NDArray[np.bool_], camera: Camera, cell: int, aside: float = 0.0) -> Pieces:
    """Cut a mask (H, W) of vegetation, or of bare ground, into cells, with the ground that each covers.

    Args:
        mask: of what counts.
        camera: rectified, of the mask's size, with its height.
        cell: side of a cell, px.
        aside: as in `Pieces`.
    """
    height, width = (side // cell * cell for side in mask.shape)
    filled = mask[:height, :width].reshape(height // cell, cell, width // cell, cell)
    share = filled.mean(axis=(1, 3))
    rows, columns = np.nonzero(share > 0.0)
    # The middle of what is filled, not of the cell: a leaf's edge is placed better than to a cell
    inside = filled[rows, :, columns].astype(np.float64)
    amount = inside.sum(axis=(1, 2))
    along = np.arange(cell)
    v = rows * cell + inside.sum(axis=2) @ along / amount
    u = columns * cell + inside.sum(axis=1) @ along / amount
    rays = camera.rays(np.column_stack([u, v])) @ camera.optical_to_base.T
    fall = -rays[:, 2]
    down = fall > _LEAST_FALL
    rays, fall, amount = rays[down], fall[down], amount[down]
    # A pixel's cone (1 / f^2 at the axis) meets the ground at distance r = H / fall: it covers r^2 / (f^2 fall)
    assert camera.height_m is not None
    axis = rays @ camera.optical_to_base[:, 2]
    cone = axis**3 / (camera.fx * camera.fy)
    return Pieces(rays, amount * cone * camera.height_m**2 / fall**3, aside)


def ground_places(rays: Array, camera: Camera, values: Array) -> tuple[Array, Array]:
    """Where rays (N, 3) of a body that leans meet the ground: ahead of and to the left of base_link, m."""
    leaning = rays @ rotation_from_rpy(float(values[ROLL]), float(values[PITCH]), 0.0).T
    height = (camera.height_m or 1.0) * np.exp(values[HEIGHT])
    reach = height / np.maximum(-leaning[:, 2], 1e-3)
    return camera.x_m + reach * leaning[:, 0], reach * leaning[:, 1]


def lateral(x: Array, y: Array, values: Array) -> tuple[Array, Array]:
    """Distance to the left of the row of the robot (m), and way along it, of places in base_link."""
    sine, cosine = np.sin(values[YAW]), np.cos(values[YAW])
    along = cosine * x - sine * y
    left = values[OFFSET] + sine * x + cosine * y
    bend = values[CURVATURE]
    # The distance to a circle of radius 1 / bend, in a form that bears a bend of 0; its neighbours are concentric
    reach = np.hypot(1.0 - bend * left, bend * along)
    return (2.0 * left - bend * (left**2 + along**2)) / (1.0 + reach), along


def _residuals(pieces: Pieces, camera: Camera, values: Array, spacing: float) -> tuple[Array, Array]:
    """Distance (N,) of each bit from the nearest place of its kind, m, and its derivatives (N, 6)."""
    left = lateral(*ground_places(pieces.rays, camera, values), values)[0]
    residual = left - spacing * (np.round(left / spacing - pieces.aside) + pieces.aside)
    jacobian = np.empty((len(pieces), 6))
    for k in range(6):
        moved = values.copy()
        moved[k] += _STEPS[k]
        jacobian[:, k] = (lateral(*ground_places(pieces.rays, camera, moved), moved)[0] - left) / _STEPS[k]
    return residual, jacobian


def _nearer(
    here: Pieces,
    camera: Camera,
    values: Array,
    spacing: float,
    scale: float,
    information: Array,
    prior: Array,
) -> Array:
    """Values (6,) a round nearer to those of what is in view and of what is known before."""
    residual, jacobian = _residuals(here, camera, values, spacing)
    trust = _trust(here.weight, residual, scale)
    return values - _step(residual, jacobian, trust, scale, information, values - prior)


def _step(
    residual: Array, jacobian: Array, trust: Array, scale: float, information: Array, off: Array
) -> Array:
    """A step (6,) of the fit, to be taken off, from values that are off their prior by so much (6,)."""
    # Plants as wide as the scale pull less than they say, as one side of them pulls against the other
    yields = float(np.clip(1.0 - trust @ (residual / scale) ** 2 / trust.sum(), _LEAST_YIELD, 1.0))
    hessian = jacobian.T @ (trust[:, None] * jacobian) + information
    gradient = jacobian.T @ (trust * residual) / yields + information @ off
    return np.asarray(np.linalg.solve(hessian, gradient))


def _trust(weight: Array, residual: Array, scale: float) -> Array:
    """Information (N,) of each bit, 1/m^2: a hundredth of all the ground covered speaks as one plant."""
    plant = max(float(weight.sum()) / 100.0, 1e-9) * max(_SCATTER, 0.5 * scale) ** 2
    return np.asarray(weight * np.exp(-0.5 * (residual / scale) ** 2) / plant)


def nearest_row(rows: RowsOnGround, offset: float) -> RowsOnGround:
    """The same rows, with that one as the robot's own which brings its offset nearest to a given one (m)."""
    values = rows.values.copy()
    values[OFFSET] += rows.spacing * np.round((offset - values[OFFSET]) / rows.spacing)
    return replace(rows, values=values)


def tall_by_cover(covered: float) -> tuple[float, float]:
    """How much plants that cover so much of the ground bring it nearer: mean and deviation of the logarithm of height.

    What covers the ground stands high: seedlings are flat, a canopy as high as its rows are apart.
    """
    return -0.02 - 0.25 * max(covered - 0.15, 0.0), 0.03 + 0.08 * max(covered - 0.15, 0.0)
