# SPDX-License-Identifier: Apache-2.0
"""Finds whole ellipses in a picture, such as holes, discs and printed dots, placed to a few hundredths of a pixel."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import ImageEllipse
from robot_vision.perception.edge_light import light_exponent
from robot_vision.perception.ellipse_fit import fit_ellipse

Array = NDArray[np.float64]

#: Parts into which an ellipse's border is cut to see how much of it shows, fewer where it has few points.
_PARTS = 36
#: Cosine of the angle to the border's normal beyond which a gradient is not that of the border.
_ACROSS = 0.7
#: px: edge points nearer than that are of one chain; crests leave gaps of a pixel where the steeper axis changes.
_TOUCHING = 2.3
#: px around an ellipse that are looked at again, and px from its border within which edge points are its own.
_MARGIN, _NEAR = 8, 3.0
#: Share of the median contrast of a border below which a point is not its own.
_FAINT = 0.3
#: Share of the points that must lie on the ellipse, and be bright on the same side.
_AGREEING = 0.7
#: Of the grey levels of ordinary cameras.
_USUAL_GAMMA = 2.2


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
    is fitted to each such chain. What is no ellipse is left out by the fit. A lens blurs light, not grey levels, in
    which the crest of the gradient lies some tenths of a pixel on the dark side of an edge: so the border of each
    ellipse is looked at again in light, as bright as its surroundings allow, and fitted to that.

    Args:
        contrast: least gradient of an edge point, grey levels a pixel.
        blur: standard deviation of the blur before the gradient, px.
        smallest: least semi-axis, px.
        coverage: least share of the border that shows.
        misfit: greatest standard deviation of the edge points about an ellipse, px.
        gamma: of the picture's grey levels, which are light to the power of 1 / gamma: 2.2 fits ordinary cameras,
            1 those that give raw light. None: told by each picture's own edges, 2.2 where they tell nothing.
    """

    def __init__(
        self,
        contrast: float = 6.0,
        blur: float = 1.0,
        smallest: float = 3.0,
        coverage: float = 0.8,
        misfit: float = 0.3,
        gamma: float | None = None,
    ) -> None:
        for name, value, low, high in (
            ("contrast", contrast, 0.5, 255.0),
            ("blur", blur, 0.0, 10.0),
            ("smallest", smallest, 2.0, 1e4),
            ("coverage", coverage, 0.3, 1.0),
            ("misfit", misfit, 0.01, 5.0),
            ("gamma", gamma, 0.2, 5.0),
        ):
            if value is not None and not low <= value <= high:
                raise ValueError(f"{name} must lie between {low:g} and {high:g}, not {value}")
        self._contrast, self._blur = contrast, blur
        self._smallest, self._coverage, self._misfit = smallest, coverage, misfit
        # White noise after a Gaussian is shared by the edge points along 2 √π of its standard deviation.
        self._shared = max(1.0, 2.0 * math.sqrt(math.pi) * blur)
        self._gamma = gamma

    def detect(self, gray: NDArray[np.uint8]) -> list[SeenEllipse]:
        """Find the ellipses of a grey picture (H, W) uint8, from top to bottom.

        Raises:
            ValueError: not a grey picture of 8 bits.
        """
        if gray.ndim != 2 or gray.dtype != np.uint8 or gray.size == 0:
            raise ValueError(f"gray must be uint8 (H, W), not {gray.dtype} {gray.shape}")
        points, normals, _ = _edges(gray, self._blur, self._contrast)
        chains = (self._ellipse(points[chain], normals[chain]) for chain in _chains(points, normals))
        coarse = [each for each in chains if each is not None]
        gamma = self._gamma or light_exponent(gray, [each.ellipse for each in coarse]) or _USUAL_GAMMA
        fine = (self._in_light(gray, each, gamma) for each in coarse)
        return sorted(
            (each for each in fine if each is not None), key=lambda each: (each.ellipse.v, each.ellipse.u)
        )

    def _in_light(self, gray: NDArray[np.uint8], coarse: SeenEllipse, gamma: float) -> SeenEllipse | None:
        """The same ellipse by the crests of the gradient of light along its border."""
        border = coarse.ellipse.points(72)
        left, top = np.maximum(np.floor(border.min(axis=0)).astype(int) - _MARGIN, 0)
        right, bottom = np.ceil(border.max(axis=0)).astype(int) + _MARGIN + 1
        window = gray[top:bottom, left:right]
        light = np.rint(255.0 * (window / window.max()) ** gamma).astype(np.uint8)
        points, normals, contrast = _edges(light, self._blur, 1.0)
        points = points + (left, top)
        distances, outward = _beside(coarse.ellipse, points)
        towards = np.einsum("ni,ni->n", normals, outward) * (1.0 if coarse.dark else -1.0)
        there = (np.abs(distances) < _NEAR) & (towards > _ACROSS)
        if not there.any():
            return None
        there &= contrast > _FAINT * np.median(contrast[there])
        return self._ellipse(points[there], normals[there])

    def _ellipse(self, points: Array, normals: Array) -> SeenEllipse | None:
        """The ellipse that a chain of edge points (N, 2) with gradients (N, 2) is, or None."""
        extent = np.ptp(points, axis=0) if len(points) else np.zeros(2)
        if extent.min(initial=np.inf) < 2.0 * self._smallest * 0.8:
            return None
        fit = fit_ellipse(points)
        if fit is None or fit.ellipse.minor < self._smallest or fit.sigma > self._misfit:
            return None
        on_it = fit.weights > 0.0
        outward = np.einsum("ni,ni->n", normals, _beside(fit.ellipse, points)[1])
        dark, bright = outward > _ACROSS, outward < -_ACROSS
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


def _edges(picture: NDArray[np.uint8], blur: float, contrast: float) -> tuple[Array, Array, Array]:
    """Places (N, 2), unit gradients (N, 2) and contrasts (N,) of the edge points of a picture (H, W)."""
    # numba is slow to import, and pages of help need no edges
    from robot_vision.perception.edges import CONTRAST, NORMAL_U, NORMAL_V, EdgeFinder

    height, width = picture.shape
    finder = EdgeFinder(height, width, blur)
    finder.look(picture)
    found = finder.find(contrast)[1].astype(np.float64)
    return found[:, :2], found[:, [NORMAL_U, NORMAL_V]], found[:, CONTRAST]


def _chains(points: Array, normals: Array) -> list[NDArray[np.intp]]:
    """Indices of edge points that touch each other and are bright on the same side, a chain each.

    The border of a hole close to the rim of its plate touches that rim, but is bright on the other side.
    """
    from scipy.sparse import coo_matrix  # slow to import, as the next ones
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    pairs = cKDTree(points).query_pairs(_TOUCHING, output_type="ndarray")
    alike = np.einsum("ni,ni->n", normals[pairs[:, 0]], normals[pairs[:, 1]]) > _ACROSS
    first, second = pairs[alike].T
    links = coo_matrix((np.ones(len(first), np.int8), (first, second)), shape=(len(points), len(points)))
    count, chain = connected_components(links, directed=False)
    order = np.argsort(chain, kind="stable")
    return np.split(order, np.searchsorted(chain[order], np.arange(1, count)))


def _beside(ellipse: ImageEllipse, points: Array) -> tuple[Array, Array]:
    """Distances (N,) of points (N, 2) from an ellipse, to first order, and its outward unit normals (N, 2) there."""
    inverse = np.linalg.inv(ellipse.frame[:2, :2])
    circle = (points - ellipse.centre) @ inverse.T
    radius = np.maximum(np.linalg.norm(circle, axis=1), 1e-12)
    slope = (circle / radius[:, None]) @ inverse
    steepness = np.linalg.norm(slope, axis=1)
    return (radius - 1.0) / steepness, slope / steepness[:, None]
