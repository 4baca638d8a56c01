# SPDX-License-Identifier: Apache-2.0
"""Single plants in one picture: what grows is laid out on the ground and cut into plants there.

On the ground a plant is as large wherever it stands, so that one size tells leaves of one plant from plants side by
side. The ground is looked at from above in a window of square cells, at the height of the leaves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.geometry.rotation import rotation_from_rpy
from robot_vision.perception.crop_rows.ground_fit import lateral
from robot_vision.perception.crop_rows.plant_bodies import bodies, cut_beside, cut_foreign
from robot_vision.perception.crop_rows.plant_twins import twins

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Vegetation this near to the picture's border (px) belongs to a plant that may go on beyond it.
_BORDER = 6
#: Marks of a cell of the window: something grows there; likewise, at the border of the picture.
_GROWS, _CUT = 1, 3
#: Distance of bodies from plants that are known already, in radii of a usual plant.
_NEW = 1.3
#: Ground that tells how wide rows are (m ahead of the nearest), in so many bins; fewest cells and rounds of the fit.
_NEAR_M, _BINS, _FEWEST_CELLS, _ROUNDS = 1.2, 60, 100, 20
#: What grows this near to the line of a row tells the colour of the crop, radii of a usual plant.
_MIDDLE = 0.5
#: One in so many rows and columns of cells is asked for it.
_SPARSE = 3
#: Standard deviation of a plant about the line of its row, m.
_SOWN = 0.014
#: Blobs larger than so many usual plants are cut.
_TOO_LARGE = 2.2
#: Where the crop closes, blobs up to so many radii of a usual plant may be weeds side by side; these are known to be
#: several where known ones stand so many of the blob's own radii from their middle.
_MAY_BE_SEVERAL, _SEVERAL = 0.5, 0.5
#: What is cut out of leaves by its colour is at least so many times as large as the smallest plant: light on single
#: leaves comes and goes.
_LEAST_FOREIGN = 3.0
#: Share of the ground grown over from which on the crop closes: what stands out then is mostly its own leaves.
_CLOSES = 0.45


@dataclass(frozen=True)
class Lean:
    """How the camera stood over the leaves: roll and pitch (rad), logarithm of its height over the usual."""

    roll: float = 0.0
    pitch: float = 0.0
    height: float = -0.02


@dataclass(frozen=True)
class Blobs:
    """What stands on its own in one picture.

    Attributes:
        slopes: (N, 2) way ahead and to the left of the camera that the sight to the middle of each goes while it
            falls by 1, the body taken to lean as told.
        areas: (N,) on the plane of the window, m^2.
        whole: (N,) whether all of it is in the picture.
        lean: the one taken.
        foreign: (N,) share of each that has another colour than the crop.
    """

    slopes: Array
    areas: Array
    whole: Mask
    lean: Lean
    foreign: Array

    def __len__(self) -> int:
        return len(self.areas)


@dataclass(frozen=True)
class GroundWindow:
    """The ground before the robot seen from above, in square cells.

    Attributes:
        cells: uint8 (rows, columns); row 0 the nearest, column 0 the rightmost; 0 bare or not in the picture.
        seen: bool (rows, columns): in the picture, not at its border.
        foreign: bool (rows, columns): what grows there has another colour than the crop.
        corner: (2,) ahead and left of base_link of the middle of cell (0, 0), m.
        side: of a cell, m.
        fall: height of the camera over the window's plane, m.
    """

    cells: NDArray[np.uint8]
    seen: Mask
    foreign: Mask
    corner: Array
    side: float
    fall: float

    @property
    def closes(self) -> bool:
        """Whether the crop closes over the ground."""
        return bool(np.count_nonzero(self.cells) >= _CLOSES * np.count_nonzero(self.seen))

    def at(self, places: Array) -> tuple[NDArray[np.intp], Mask]:
        """Cells (N, 2) of places (N, 2) in the window's plane, and whether they are in view."""
        index = np.rint((places - self.corner) / self.side).astype(np.intp)
        shape = np.array(self.cells.shape)
        inside = ((index >= 0) & (index < shape)).all(axis=1)
        index = np.clip(index, 0, shape - 1)
        return index, inside & self.seen[index[:, 0], index[:, 1]]


@dataclass(frozen=True)
class PlantSegmenter:
    """Cuts a mask of vegetation into plants.

    Args:
        far: ground looked at, m ahead of the camera.
        aside: ground looked at to either side, m.
        side: of the cells, m.
        join: leaves as near to each other belong to one plant, m.
        least_area: smaller plants are left out, m^2.

    Raises:
        ValueError: naming the setting that makes no sense.
    """

    far: float = 3.2
    aside: float = 1.3
    side: float = 0.006
    join: float = 0.012
    least_area: float = 1.5e-4

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (np.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be a positive number, not {value}")
        if self.far * self.aside / self.side**2 > 4e6:
            raise ValueError(f"cells of {self.side:g} m are too many for {self.far:g} m of ground")

    def look(self, mask: Mask, camera: Camera, lean: Lean, foreign: Mask | None = None) -> GroundWindow:
        """Lay a mask (H, W) out on the ground, for a body that leans.

        Args:
            mask: of what grows.
            camera: rectified.
            lean: of the body.
            foreign: (H, W) the part of it that has another colour than the crop; None: nobody knows.
        """
        assert camera.height_m is not None
        marks = mask.astype(np.uint8)
        inner = marks[_BORDER:-_BORDER, _BORDER:-_BORDER].copy()
        marks *= _CUT
        marks[_BORDER:-_BORDER, _BORDER:-_BORDER] = inner
        frame = np.zeros_like(marks)
        frame[_BORDER:-_BORDER, _BORDER:-_BORDER] = 1
        cells, seen = (self.lay_out(part, camera, lean) for part in (marks, frame))
        strange = np.zeros_like(cells)
        if foreign is not None and foreign.any():
            strange = self.lay_out(foreign.view(np.uint8), camera, lean)
        near = nearest_ground(camera, lean)
        corner = np.array([camera.x_m + near, -self.side * (cells.shape[1] // 2)])
        fall = camera.height_m * float(np.exp(lean.height))
        return GroundWindow(cells, seen.astype(np.bool_), strange.astype(np.bool_), corner, self.side, fall)

    def lay_out(self, picture: NDArray[Any], camera: Camera, lean: Lean) -> NDArray[Any]:
        """The cells (rows, columns) of a window on what is (H, W) in a picture; 0 where it ends."""
        assert camera.height_m is not None
        near = nearest_ground(camera, lean)
        rows = max(int((self.far - near) / self.side), 8)
        columns = 2 * int(self.aside / self.side) + 1
        # (column, row, 1) of the window to (ahead, left, 1) of the camera
        rightmost = -self.side * (columns // 2)
        grid = np.array([[0.0, self.side, near], [self.side, 0.0, rightmost], [0.0, 0.0, 1.0]])
        to_pixels = _pixels_of_plane(camera, lean, camera.height_m * float(np.exp(lean.height))) @ grid
        flags = cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP
        return np.asarray(cv2.warpPerspective(picture, to_pixels, (columns, rows), flags=flags))

    def cut(
        self,
        window: GroundWindow,
        camera: Camera,
        lean: Lean,
        radius: float | None,
        known: Array,
        small: Array,
    ) -> Blobs:
        """Find the plants in a window.

        Args:
            window: of `look`.
            camera: rectified.
            lean: as given to `look`.
            radius: of a usual plant of the crop, m; None: not known, nothing is cut.
            known: (K, 2) where plants are expected in the window's plane, ahead and left of base_link, m: what has
                been cut once is cut again, so that plants do not come and go.
            small: (S, 2) likewise, small plants of whatever colour; they count where the crop closes.
        """
        grown = (window.cells > 0).astype(np.uint8)
        reach = max(int(0.5 * self.join / self.side + 0.5), 1)
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
        joined = np.asarray(cv2.morphologyEx(grown, cv2.MORPH_CLOSE, kernel), np.uint8)
        count, components = cv2.connectedComponents(joined, connectivity=8, ltype=cv2.CV_32S)
        labels = np.asarray(components, np.int32)
        count = cut_foreign(window.foreign, labels, count, _LEAST_FOREIGN * self.least_area / self.side**2)
        row, column = np.nonzero(grown)
        label = labels[row, column].astype(np.intp)
        if radius is not None:
            if not window.closes:
                most = _TOO_LARGE * np.pi * (radius / self.side) ** 2
                count = cut_beside(joined, labels, count, radius / self.side, self.side, most)
                label = labels[row, column].astype(np.intp)
            count, label = self._separated(window, labels, row, column, label, count, radius, known)
            if window.closes:
                labels[row, column] = label
                count, label = self._side_by_side(window, labels, row, column, label, count, radius, small)
        amount = np.bincount(label, minlength=count).astype(np.float64)
        cut = np.bincount(label, window.cells[row, column] == _CUT, count) > 0.0
        edge = (row == len(grown) - 1) | (column == 0) | (column == grown.shape[1] - 1)
        cut |= np.bincount(label, edge, count) > 0.0
        kept = amount * self.side**2 >= self.least_area
        amount = np.maximum(amount, 1.0)
        middle = np.column_stack([np.bincount(label, part, count) / amount for part in (row, column)])
        places = window.corner + self.side * middle
        slopes = (places - np.array([camera.x_m, 0.0])) / window.fall
        areas = np.minimum(amount, _disc(row, column, label, middle, slopes, amount)) * self.side**2
        strange = np.bincount(label, window.foreign[row, column], count) / amount
        return Blobs(slopes[kept], areas[kept], ~cut[kept], lean, strange[kept])

    def warm_up(self) -> None:
        """Load or compile the kernel, so that the first picture is not kept waiting."""
        from robot_vision.perception.crop_rows.plant_kernels import share_among_seeds

        one = np.zeros(1, np.intp)
        share_among_seeds(one.copy(), one, one, np.array([0, 1], np.intp), np.zeros((1, 2), np.intp), one)

    def _separated(
        self,
        window: GroundWindow,
        labels: NDArray[np.int32],
        row: NDArray[np.intp],
        column: NDArray[np.intp],
        label: NDArray[np.intp],
        count: int,
        radius: float,
        known: Array,
    ) -> tuple[int, NDArray[np.intp]]:
        """Cut blobs in which several bodies of a plant's size stand out; each cell goes to the nearest."""
        size = np.bincount(label, minlength=count)
        large = size * self.side**2 > _TOO_LARGE * np.pi * radius**2
        large[0] = False
        if not large.any():
            return count, label
        tops = bodies(window.cells, radius / self.side)
        index, inside = window.at(known)
        seeds = index[inside]
        if len(seeds):
            away = np.linalg.norm(tops[:, None, :] - seeds[None, :, :], axis=2).min(axis=1)
            tops = np.concatenate([seeds, tops[away > _NEW * radius / self.side]])
        tops = tops[large[labels[tops[:, 0], tops[:, 1]]]]
        if not len(tops):
            return count, label
        return _shared(row, column, label, count, tops, labels[tops[:, 0], tops[:, 1]])

    def _side_by_side(
        self,
        window: GroundWindow,
        labels: NDArray[np.int32],
        row: NDArray[np.intp],
        column: NDArray[np.intp],
        label: NDArray[np.intp],
        count: int,
        radius: float,
        small: Array,
    ) -> tuple[int, NDArray[np.intp]]:
        """Cut small blobs that are several plants side by side, by those that are known, or by a waist."""
        size = np.bincount(label, minlength=count)
        most = np.pi * (_MAY_BE_SEVERAL * radius / self.side) ** 2
        index, inside = window.at(small)
        seeds = index[inside]
        of = labels[seeds[:, 0], seeds[:, 1]]
        number = np.bincount(of, minlength=count)
        total = np.stack([np.bincount(of, part, count) for part in seeds.T], axis=1)
        middle = total / np.maximum(number, 1)[:, None]
        apart = ((seeds - middle[of]) ** 2).sum(axis=1) > _SEVERAL**2 * size[of] / np.pi
        several = (np.bincount(of, apart, count) > 1) & (size <= most)
        several[0] = False
        which, middles = twins(row, column, label, count, self.least_area / self.side**2, most)
        new = ~several[which]
        seeds = np.concatenate([seeds[several[of]], np.rint(middles[new]).astype(np.intp).reshape(-1, 2)])
        return _shared(
            row, column, label, count, seeds, np.concatenate([of[several[of]], np.repeat(which[new], 2)])
        )


def _shared(
    row: NDArray[np.intp],
    column: NDArray[np.intp],
    label: NDArray[np.intp],
    count: int,
    seeds: NDArray[np.intp],
    of: NDArray[np.integer[Any]],
) -> tuple[int, NDArray[np.intp]]:
    """Give each cell (N,) of blobs to the nearest of the seeds (M, 2), which lie in blobs (M,)."""
    if not len(seeds):
        return count, label
    from robot_vision.perception.crop_rows.plant_kernels import share_among_seeds

    order = np.argsort(of, kind="stable")
    first = np.searchsorted(of[order], np.arange(count + 1))
    names = np.arange(count, count + len(seeds))
    share_among_seeds(label, row, column, first, seeds[order], names)
    return count + len(seeds), label


def _disc(
    row: NDArray[np.intp],
    column: NDArray[np.intp],
    label: NDArray[np.intp],
    middle: Array,
    slopes: Array,
    amount: Array,
) -> Array:
    """Cells (N,) of discs as wide as blobs are across the sight: along it tall plants seem longer than they are."""
    ahead = slopes / np.maximum(np.linalg.norm(slopes, axis=1), 1e-9)[:, None]
    across = (column - middle[label, 1]) * ahead[label, 0] - (row - middle[label, 0]) * ahead[label, 1]
    # of a disc the variance is a quarter of the squared radius
    return np.asarray(4.0 * np.pi * (np.bincount(label, across**2, len(amount)) / amount + 1.0 / 12.0))


def row_radius(window: GroundWindow, rows: Array, spacing: float) -> float | None:
    """Radius of the crop's plants from how wide its rows are, m; None where hardly anything grows.

    What grows about a row scatters by half the radius of its plants; weeds, which stand anywhere, are told apart as
    the part that is spread evenly.

    Args:
        window: the ground.
        rows: (6,) as `RowsOnGround.values`.
        spacing: between rows, m.
    """
    row, column = np.nonzero(window.cells[: int(_NEAR_M / window.side) : 2, ::2])
    if len(row) < _FEWEST_CELLS:
        return None
    places = window.corner + 2.0 * window.side * np.column_stack([row, column])
    aside = lateral(places[:, 0], places[:, 1], rows)[0]
    aside -= spacing * np.round(aside / spacing)
    share, edges = np.histogram(aside, _BINS, (-0.5 * spacing, 0.5 * spacing))
    middle, share = 0.5 * (edges[1:] + edges[:-1]), share / share.sum()
    even, sigma, mean = 0.3, 0.15 * spacing, 0.0
    for _ in range(_ROUNDS):
        bell = (1.0 - even) * np.exp(-0.5 * ((middle - mean) / sigma) ** 2) / (np.sqrt(2.0 * np.pi) * sigma)
        own = bell / (bell + even / spacing)
        even = float(np.clip(1.0 - own @ share, 0.01, 0.95))
        mean = float((own * share) @ middle / (own @ share))
        sigma = float(np.sqrt((own * share) @ (middle - mean) ** 2 / (own @ share)) + 1e-4)
    return 2.0 * float(np.sqrt(max(sigma**2 - _SOWN**2, _SOWN**2 / 4.0)))


def middle_of_rows(window: GroundWindow, rows: Array, spacing: float, radius: float) -> Mask:
    """Some cells (rows, columns) that are grown over, well within the picture, in the middle of the crop's plants.

    Args:
        window: the ground.
        rows: (6,) as `RowsOnGround.values`.
        spacing: between rows, m.
        radius: of a usual plant of the crop, m.
    """
    row, column = _SPARSE * np.stack(np.nonzero(window.cells[::_SPARSE, ::_SPARSE] == _GROWS))
    places = window.corner + window.side * np.column_stack([row, column])
    aside = lateral(places[:, 0], places[:, 1], rows)[0]
    inside = np.abs(aside - spacing * np.round(aside / spacing)) < _MIDDLE * radius
    middle = np.zeros(window.cells.shape, np.bool_)
    middle[row[inside], column[inside]] = True
    return middle


def nearest_ground(camera: Camera, lean: Lean) -> float:
    """Nearest ground in the middle column of a picture, m ahead of the camera."""
    ray = camera.rays([[0.5 * (camera.width - 1.0), camera.height - 1.0]])[0]
    ray = rotation_from_rpy(lean.roll, lean.pitch, 0.0) @ camera.optical_to_base @ ray
    assert camera.height_m is not None
    return float(camera.height_m * np.exp(lean.height) * ray[0] / max(-ray[2], 1e-3))


def _pixels_of_plane(camera: Camera, lean: Lean, fall: float) -> Array:
    """Homography (3, 3) from a place (ahead, left, 1) of the camera on a plane so far below it to pixels."""
    places = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -fall]])
    to_body = rotation_from_rpy(lean.roll, lean.pitch, 0.0).T
    return np.asarray(camera.matrix @ camera.optical_to_base.T @ to_body @ places)
