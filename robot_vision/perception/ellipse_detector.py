# SPDX-License-Identifier: Apache-2.0
"""Finds whole ellipses in a picture, such as holes, discs and printed dots, placed to a few hundredths of a pixel."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from robot_vision.geometry import ImageEllipse
from robot_vision.perception.ellipse_fit import FittedEllipse, fit_ellipse

Array = NDArray[np.float64]

#: Parts into which an ellipse's border is cut to see how much of it shows, fewer where it has few points.
_PARTS = 36
#: Cosine of the angle to the border's normal beyond which a gradient is not that of the border.
_ACROSS = 0.7
#: px: edge points nearer than that are of one chain; crests leave gaps of a pixel where the steeper axis changes.
_TOUCHING = 2.3
#: Share of the points that must lie on the ellipse, and be bright on the same side.
_AGREEING = 0.7


@dataclass(frozen=True)
class SeenEllipse:
    """An ellipse in a picture.

    Attributes:
        ellipse: px, pixel centres at integers.
        covariance: (2, 2) of its centre (u, v), px².
        sigma: standard deviation of its edge points about it, px.
        coverage: share of its border that shows.
        dark: whether it is darker inside.
    """

    ellipse: ImageEllipse
    covariance: Array
    sigma: float
    coverage: float
    dark: bool


class EllipseDetector:
    """Finds ellipses whose border shows nearly whole against what surrounds them.

    Edge points are placed to a fraction of a pixel, those that touch each other are taken together, and an ellipse
    is fitted to each such chain. What is no ellipse is left out by the fit.

    Args:
        contrast: least gradient of an edge point, levels of light a pixel, of 255.
        blur: standard deviation of the blur before the gradient, px.
        smallest: least semi-axis, px.
        coverage: least share of the border that shows.
        misfit: greatest standard deviation of the edge points about an ellipse, px.
        gamma: of the picture's grey levels: light to the power of 1 / gamma. A lens blurs light, not grey levels,
            and without this the crest of the gradient lies some tenths of a pixel on the dark side of an edge.
            2.2 fits ordinary cameras; 1 is for those that give raw light.
    """

    def __init__(
        self,
        contrast: float = 4.0,
        blur: float = 1.0,
        smallest: float = 4.0,
        coverage: float = 0.8,
        misfit: float = 0.3,
        gamma: float = 2.2,
    ) -> None:
        for name, value, low, high in (
            ("contrast", contrast, 0.5, 255.0),
            ("blur", blur, 0.0, 10.0),
            ("smallest", smallest, 2.0, 1e4),
            ("coverage", coverage, 0.3, 1.0),
            ("misfit", misfit, 0.01, 5.0),
            ("gamma", gamma, 0.2, 5.0),
        ):
            if not low <= value <= high:
                raise ValueError(f"{name} must lie between {low:g} and {high:g}, not {value}")
        self._contrast, self._blur = contrast, blur
        self._smallest, self._coverage, self._misfit = smallest, coverage, misfit
        # White noise after a Gaussian is shared by the edge points along 2 √π of its standard deviation.
        self._shared = max(1.0, 2.0 * math.sqrt(math.pi) * blur)
        self._light = np.rint(255.0 * (np.arange(256) / 255.0) ** gamma).astype(np.uint8)

    def detect(self, gray: NDArray[np.uint8]) -> list[SeenEllipse]:
        """Find the ellipses of a grey picture (H, W) uint8, from top to bottom.

        Raises:
            ValueError: not a grey picture of 8 bits.
        """
        # numba is slow to import, and pages of help need no edges
        from robot_vision.perception.edges import NORMAL_U, NORMAL_V, EdgeFinder

        if gray.ndim != 2 or gray.dtype != np.uint8 or gray.size == 0:
            raise ValueError(f"gray must be uint8 (H, W), not {gray.dtype} {gray.shape}")
        height, width = gray.shape
        finder = EdgeFinder(height, width, self._blur)
        finder.look(np.asarray(self._light[gray]))
        _, found = finder.find(self._contrast)
        points = found.astype(np.float64)
        places, normals = points[:, :2], points[:, [NORMAL_U, NORMAL_V]]
        chains = (self._ellipse(places[chain], normals[chain]) for chain in _chains(places, normals))
        seen = [each for each in chains if each is not None]
        return sorted(seen, key=lambda each: (each.ellipse.v, each.ellipse.u))

    def _ellipse(self, points: Array, normals: Array) -> SeenEllipse | None:
        """The ellipse that a chain of edge points (N, 2) with gradients (N, 2) is, or None."""
        extent = np.ptp(points, axis=0) if len(points) else np.zeros(2)
        if extent.min(initial=np.inf) < 2.0 * self._smallest * 0.8:
            return None
        fit = fit_ellipse(points)
        if fit is None or fit.ellipse.minor < self._smallest or fit.sigma > self._misfit:
            return None
        border = _border(fit, points)
        on_it = fit.weights > 0.0
        outward = np.einsum("ni,ni->n", normals, border)
        dark = outward > _ACROSS
        bright = outward < -_ACROSS
        agreeing = on_it & (dark if (dark & on_it).sum() >= (bright & on_it).sum() else bright)
        if agreeing.mean() < _AGREEING:
            return None
        around = np.linalg.solve(fit.ellipse.frame, np.column_stack([points, np.ones(len(points))]).T)[:2]
        parts = min(_PARTS, len(points) // 2)
        turn = np.arctan2(around[1], around[0]) / (2.0 * np.pi) + 0.5
        coverage = len(np.unique(np.floor(turn[agreeing] * parts) % parts)) / parts
        if coverage < self._coverage:
            return None
        is_dark = bool(dark[agreeing].all())
        return SeenEllipse(fit.ellipse, fit.covariance * self._shared, fit.sigma, coverage, is_dark)


def _chains(points: Array, normals: Array) -> list[NDArray[np.intp]]:
    """Indices of edge points that touch each other and are bright on the same side, a chain each.

    The border of a hole close to the rim of its plate touches that rim, but is bright on the other side.
    """
    pairs = cKDTree(points).query_pairs(_TOUCHING, output_type="ndarray")
    alike = np.einsum("ni,ni->n", normals[pairs[:, 0]], normals[pairs[:, 1]]) > _ACROSS
    first, second = pairs[alike].T
    links = coo_matrix((np.ones(len(first), np.int8), (first, second)), shape=(len(points), len(points)))
    count, chain = connected_components(links, directed=False)
    order = np.argsort(chain, kind="stable")
    return np.split(order, np.searchsorted(chain[order], np.arange(1, count)))


def _border(fit: FittedEllipse, points: Array) -> Array:
    """Outward unit normals (N, 2) of the ellipse beside points (N, 2)."""
    conic = fit.ellipse.conic
    slope = np.column_stack([points, np.ones(len(points))]) @ conic[:, :2]
    return np.asarray(slope / np.linalg.norm(slope, axis=1, keepdims=True))
