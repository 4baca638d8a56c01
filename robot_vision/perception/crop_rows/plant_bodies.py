# SPDX-License-Identifier: Apache-2.0
"""Bodies of plants in the ground seen from above: where they stand, and what else touches them."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

#: Blur with which bodies of plants stand out, and distance between them, in radii of a usual plant.
_BODY, _APART = 0.3, 0.9
#: Height of a body in the blurred picture, 1 being grown over all around.
_LEAST_BODY = 0.3
#: Radius of a usual plant in the cells in which bodies are sought.
_COARSE = 6.0
#: What is cut off a plant covers at least so much, m^2.
_LEAST = 1.5e-4
#: A disc of so many radii of a usual plant fits into its body; share of a blob that must be body for its rest to be
#: cut off; how far the rest must stand out from the body, m, and how near to it leaves are the body's, m.
_CORE, _SOLID, _STANDS_OUT, _HEM = 0.3, 0.9, 0.02, 0.004
#: The same in radii of a usual plant; the rest is at most this share of one.
_OUT_SHARE, _MOST_BESIDE = 0.18, 0.15
#: A plant, or a blob, of which so much has another colour than the crop is none of it.
FOREIGN = 0.5


def bodies(cells: NDArray[np.uint8], radius: float) -> NDArray[np.intp]:
    """Cells (M, 2) about which more grows than about their neighbours.

    Args:
        cells: (H, W) of the ground, 0 where it is bare.
        radius: of a usual plant, cells.
    """
    step = max(int(radius / _COARSE), 1)
    height, width = (side // step * step for side in cells.shape)
    grown = (cells[:height, :width] > 0).astype(np.float32)
    share = grown.reshape(height // step, step, width // step, step).mean(axis=(1, 3))
    body = cv2.GaussianBlur(share, (0, 0), _BODY * radius / step)
    reach = max(int(_APART * radius / step), 1)
    around = cv2.dilate(body, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1)))
    tops = np.argwhere((body >= around) & (body > _LEAST_BODY))
    return np.asarray(tops * step + step // 2, np.intp)


def cut_beside(
    grown: NDArray[np.uint8], labels: NDArray[np.int32], count: int, radius: float, side: float, most: float
) -> int:
    """Cut small plants off larger ones that they touch: what stands out from the body of a blob gets its own label.

    The body is what a disc reaches within the blob (an opening); lobes of leaves hardly stand out from it.

    Args:
        grown: (H, W) cells in which something grows, 1, and bare ones, 0.
        labels: (H, W) of the blobs, 0 where it is bare; changed in place.
        count: of labels.
        radius: of a usual plant of the crop, cells.
        side: of a cell, m.
        most: larger blobs are left alone, cells.

    Returns:
        How many labels there are now.
    """
    core = _CORE * radius
    bare = (cv2.distanceTransform(grown, cv2.DIST_L2, 5) <= core).astype(np.uint8)
    if bare.all():
        return count
    row, column = np.nonzero(grown)
    away = cv2.distanceTransform(bare, cv2.DIST_L2, 5)[row, column] - core
    label = labels[row, column]
    size = np.bincount(label, minlength=count)
    solid = np.bincount(label, away <= 0.0, count) > _SOLID * np.maximum(size, 1)
    solid &= size < most
    rest = (away > _HEM / side) & solid[label]
    row, column, away = row[rest], column[rest], away[rest]
    beside = np.zeros_like(grown)
    beside[row, column] = 1
    parts, of = cv2.connectedComponents(beside, connectivity=8, ltype=cv2.CV_32S)
    part = np.asarray(of, np.intp)[row, column]
    farthest = np.zeros(parts)
    np.maximum.at(farthest, part, away)
    amount = np.bincount(part, minlength=parts)
    own = farthest > max(_STANDS_OUT / side, _OUT_SHARE * radius)
    own &= (amount * side**2 >= _LEAST) & (amount < _MOST_BESIDE * np.pi * radius**2)
    names = count - 1 + np.cumsum(own)
    mine = own[part]
    labels[row[mine], column[mine]] = names[part[mine]]
    return count + int(own.sum())


def cut_foreign(foreign: NDArray[np.bool_], labels: NDArray[np.int32], count: int, least: float) -> int:
    """Cut plants off others that they touch, or grow into, by their colour.

    Args:
        foreign: (H, W) cells in which what grows has another colour than the crop.
        labels: (H, W) of the blobs, 0 where it is bare; changed in place.
        count: of labels.
        least: smaller ones are left alone, cells.

    Returns:
        How many labels there are now.
    """
    row, column = np.nonzero(foreign & (labels > 0))
    if not len(row):
        return count
    label = labels[row, column]
    share = np.bincount(label, minlength=count) / np.maximum(np.bincount(labels.ravel(), minlength=count), 1)
    part = share[label] <= FOREIGN
    row, column = row[part], column[part]
    beside = np.zeros(labels.shape, np.uint8)
    beside[row, column] = 1
    parts, of = cv2.connectedComponents(beside, connectivity=8, ltype=cv2.CV_32S)
    which = np.asarray(of, np.intp)[row, column]
    own = np.bincount(which, minlength=parts) >= least
    names = count - 1 + np.cumsum(own)
    mine = own[which]
    labels[row[mine], column[mine]] = names[which[mine]]
    return count + int(own.sum())
