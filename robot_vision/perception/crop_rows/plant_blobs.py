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
from robot_vision.perception.crop_rows.ground_window import (
    CUT,
    GroundWindow,
    Lean,
    nearest_ground,
    pixels_of_plane,
)
from robot_vision.perception.crop_rows.plant_bodies import bodies, cut_beside, cut_foreign
from robot_vision.perception.crop_rows.plant_cells import PlantCells
from robot_vision.perception.crop_rows.plant_twins import twins

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Vegetation this near to the picture's border (px) belongs to a plant that may go on beyond it.
_BORDER = 6
#: Distance of bodies from plants that are known already, in radii of a usual plant.
_NEW = 1.3
#: Blobs larger than so many usual plants are cut.
_TOO_LARGE = 2.2
#: Where the crop closes, blobs up to so many radii of a usual plant may be weeds side by side; these are known to be
#: several where known ones stand so many of the blob's own radii from their middle.
_MAY_BE_SEVERAL, _SEVERAL = 0.5, 0.5
#: What is cut out of leaves by its colour is at least so many times as large as the smallest plant: light on single
#: leaves comes and goes.
_LEAST_FOREIGN = 3.0


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
        marks *= CUT
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
        to_pixels = pixels_of_plane(camera, lean, camera.height_m * float(np.exp(lean.height))) @ grid
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
        cells = PlantCells.of(grown, joined)
        least = self.least_area / self.side**2
        cells.count = cut_foreign(window.foreign, cells.labels, cells.count, _LEAST_FOREIGN * least)
        if radius is not None:
            size = radius / self.side
            if not window.closes:
                most = _TOO_LARGE * np.pi * size**2
                cells.count = cut_beside(joined, cells.labels, cells.count, size, self.side, most)
            _separate(cells, window, size, known)
            if window.closes:
                _part_side_by_side(cells, window, size, small, least)
        return self._blobs(cells, window, camera, lean)

    def _blobs(self, cells: PlantCells, window: GroundWindow, camera: Camera, lean: Lean) -> Blobs:
        """What stands on its own now."""
        row, column, label, count = cells.row, cells.column, cells.label, cells.count
        amount = np.bincount(label, minlength=count).astype(np.float64)
        cut = np.bincount(label, window.cells[row, column] == CUT, count) > 0.0
        edge = (row == len(window.cells) - 1) | (column == 0) | (column == window.cells.shape[1] - 1)
        cut |= np.bincount(label, edge, count) > 0.0
        kept = amount * self.side**2 >= self.least_area
        amount = np.maximum(amount, 1.0)
        middle = np.column_stack([np.bincount(label, part, count) / amount for part in (row, column)])
        places = window.corner + self.side * middle
        slopes = (places - np.array([camera.x_m, 0.0])) / window.fall
        areas = np.minimum(amount, _disc(cells, label, middle, slopes, amount)) * self.side**2
        strange = np.bincount(label, window.foreign[row, column], count) / amount
        return Blobs(slopes[kept], areas[kept], ~cut[kept], lean, strange[kept])

    def warm_up(self) -> None:
        """Load or compile the kernel, so that the first picture is not kept waiting."""
        from robot_vision.perception.crop_rows.plant_kernels import share_among_seeds

        one = np.zeros(1, np.intp)
        share_among_seeds(one.copy(), one, one, np.array([0, 1], np.intp), np.zeros((1, 2), np.intp), one)


def _separate(cells: PlantCells, window: GroundWindow, radius: float, known: Array) -> None:
    """Cut blobs in which several bodies of a plant's size (radius, cells) stand out; each cell goes to the nearest."""
    large = cells.sizes > _TOO_LARGE * np.pi * radius**2
    large[0] = False
    if not large.any():
        return
    tops = bodies(window.cells, radius)
    index, inside = window.at(known)
    seeds = index[inside]
    # what has been cut off already is no seed, nor does it stand in the way of the body beside it
    seeds = seeds[large[cells.at(seeds)]]
    if len(seeds):
        away = np.linalg.norm(tops[:, None, :] - seeds[None, :, :], axis=2).min(axis=1)
        tops = np.concatenate([seeds, tops[away > _NEW * radius]])
    tops = tops[large[cells.at(tops)]]
    cells.share(tops, cells.at(tops))


def _part_side_by_side(
    cells: PlantCells, window: GroundWindow, radius: float, small: Array, least: float
) -> None:
    """Cut small blobs that are several plants side by side, by those that are known, or by a waist."""
    size, count = cells.sizes, cells.count
    most = np.pi * (_MAY_BE_SEVERAL * radius) ** 2
    index, inside = window.at(small)
    seeds = index[inside]
    of = cells.at(seeds)
    number = np.bincount(of, minlength=count)
    total = np.stack([np.bincount(of, part, count) for part in seeds.T], axis=1)
    middle = total / np.maximum(number, 1)[:, None]
    apart = ((seeds - middle[of]) ** 2).sum(axis=1) > _SEVERAL**2 * size[of] / np.pi
    several = (np.bincount(of, apart, count) > 1) & (size <= most)
    several[0] = False
    which, middles = twins(cells.row, cells.column, cells.label, count, least, most)
    new = ~several[which]
    seeds = np.concatenate([seeds[several[of]], np.rint(middles[new]).astype(np.intp).reshape(-1, 2)])
    cells.share(seeds, np.concatenate([of[several[of]], np.repeat(which[new], 2)]))


def _disc(cells: PlantCells, label: NDArray[np.intp], middle: Array, slopes: Array, amount: Array) -> Array:
    """Cells (N,) of discs as wide as blobs are across the sight: along it tall plants seem longer than they are."""
    ahead = slopes / np.maximum(np.linalg.norm(slopes, axis=1), 1e-9)[:, None]
    right, down = cells.column - middle[label, 1], cells.row - middle[label, 0]
    across = right * ahead[label, 0] - down * ahead[label, 1]
    # of a disc the variance is a quarter of the squared radius
    return np.asarray(4.0 * np.pi * (np.bincount(label, across**2, len(amount)) / amount + 1.0 / 12.0))
