# SPDX-License-Identifier: Apache-2.0
"""What there is to see: textured rectangles in space, and the boxes, cylinders and discs made of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.texture import Colour, Texture

Illumination = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]
"""Light that falls on points (N, 3) of a surface with unit normal (3,): (N, 3), linear blue, green, red."""


@dataclass(frozen=True)
class Ellipse:
    """An ellipse in the plane of a quad; its border is exact, not painted.

    Attributes:
        centre: metres along (first, second) from the quad's origin.
        axes: semi-axes, metres.
        angle: of the first axis, radians from the first edge towards the second.
    """

    centre: tuple[float, float]
    axes: tuple[float, float]
    angle: float = 0.0

    def __post_init__(self) -> None:
        if min(self.axes) <= 0:
            raise SimulationError(f"ellipse: semi-axes must be positive metres, not {self.axes}")


@dataclass(frozen=True, eq=False)
class Quad:
    """A rectangle in the world frame, seen only from the side its normal `first x second` points to.

    Attributes:
        origin: corner (3,), metres.
        first: edge vector (3,) along which texture columns count, metres.
        second: edge vector (3,) along which texture rows count, metres.
        texture: its material.
        texture_origin: metres along (first, second) at which the texture starts, so that walls cut into
            pieces go on with the same pattern.
        light: light that falls on it, float (rows, columns, 3), given at a lattice that includes the edges
            and linear between; multiplies the texture. One node (1, 1, 3) is the same everywhere.
        gloss: reflectance at perpendicular view (0.04 for a polished floor); the scene's lamps mirror in it.
        shines: True for lamps and windows: seen as mirrored light in glossy quads.
        both_sides: whether it is seen from behind as well, with the same light: leaves, signs, meshes.
        holes: ellipses through which one sees what is behind.
        outline: the only part there is, if not all: an ellipse, for discs.
        rounding: unit normals (2, 3) at the start and the end of the first edge, by which a facet of a round
            body is lit; None for a flat one.
    """

    origin: NDArray[np.float64]
    first: NDArray[np.float64]
    second: NDArray[np.float64]
    texture: Texture
    texture_origin: tuple[float, float] = (0.0, 0.0)
    light: NDArray[np.floating] | None = None
    gloss: float = 0.0
    shines: bool = False
    both_sides: bool = False
    holes: tuple[Ellipse, ...] = ()
    outline: Ellipse | None = None
    rounding: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        if self.texture.alpha is not None and (self.holes or self.outline):
            raise SimulationError("quad: a cut-out texture cannot have holes or an outline as well")

    @property
    def normal(self) -> NDArray[np.float64]:
        """Unit normal (3,) on the visible side."""
        normal = np.cross(self.first, self.second)
        return np.asarray(normal / np.linalg.norm(normal))

    @property
    def corners(self) -> NDArray[np.float64]:
        """Corners (4, 3) in the order origin, +first, +first+second, +second, metres."""
        return np.array(
            [
                self.origin,
                self.origin + self.first,
                self.origin + self.first + self.second,
                self.origin + self.second,
            ]
        )

    def lit(self, illumination: Illumination, spacing: float = 0.15) -> Quad:
        """The same rectangle with its light worked out at nodes at most `spacing` metres apart."""
        columns, rows = (
            int(np.ceil(np.linalg.norm(edge) / spacing)) + 1 for edge in (self.first, self.second)
        )
        points = self.lattice(columns, rows)
        if self.rounding is None:
            light = illumination(points.reshape(-1, 3), self.normal).reshape(rows, columns, 3)
            return replace(self, light=light)
        start, end = self.rounding
        light = np.empty((rows, columns, 3))
        for column, s in enumerate(np.linspace(0, 1, columns)):
            normal = (1 - s) * start + s * end
            light[:, column] = illumination(points[:, column], normal / np.linalg.norm(normal))
        return replace(self, light=light)

    def lattice(self, columns: int, rows: int) -> NDArray[np.float64]:
        """Points (rows, columns, 3) spread evenly from edge to edge, metres in the world."""
        s, t = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
        return np.asarray(self.origin + s[..., None] * self.first + t[..., None] * self.second)


@dataclass(frozen=True, eq=False)
class Scene:
    """All rectangles of a world, and what is seen where there is none.

    Attributes:
        quads: the rectangles.
        background: colour where nothing is (linear blue, green, red); with a sky, below the horizon only.
            The air takes on this colour with distance.
        sky: float32 (R, C, 3) linear light of the sky, or None; row i at sin(elevation) = i / (R - 1),
            column j at azimuth 2 pi j / C, counter-clockwise from +x.
        visibility_m: distance at which 1/20 of the contrast is left in the air, metres.
    """

    quads: tuple[Quad, ...]
    background: Colour = (0.0, 0.0, 0.0)
    sky: NDArray[np.float32] | None = None
    visibility_m: float = float("inf")

    def __post_init__(self) -> None:
        if not self.quads:
            raise SimulationError("scene: it has no surface to show")
        if self.sky is not None and (self.sky.ndim != 3 or self.sky.shape[2] != 3 or 0 in self.sky.shape):
            raise SimulationError(f"scene: the sky must be (rows, columns, 3), not {self.sky.shape}")
        if not self.visibility_m > 0:
            raise SimulationError(f"scene: visibility_m must be above 0 m, not {self.visibility_m}")

    @property
    def extinction(self) -> float:
        """Share of light the air takes away a metre."""
        return float(np.log(20.0) / self.visibility_m)


def quad(
    origin: ArrayLike,
    first: ArrayLike,
    second: ArrayLike,
    texture: Texture,
    texture_origin: tuple[float, float] = (0.0, 0.0),
    gloss: float = 0.0,
    shines: bool = False,
    both_sides: bool = False,
    holes: tuple[Ellipse, ...] = (),
    outline: Ellipse | None = None,
) -> Quad:
    """A rectangle from anything that can be a vector (metres).

    Raises:
        SimulationError: edges that are not perpendicular or have no length.
    """
    corner, along, across = (np.asarray(vector, np.float64) for vector in (origin, first, second))
    lengths = np.linalg.norm(along) * np.linalg.norm(across)
    if lengths == 0 or abs(along @ across) > 1e-9 * lengths:
        raise SimulationError(f"quad: edges {along} and {across} do not span a rectangle")
    return Quad(
        corner, along, across, texture, texture_origin, None, gloss, shines, both_sides, holes, outline
    )


def box(low: ArrayLike, high: ArrayLike, texture: Texture, without: str = "") -> tuple[Quad, ...]:
    """The outside of a box along the axes from corner `low` to `high` (metres).

    Args:
        low: smallest x, y, z.
        high: largest x, y, z.
        texture: of all faces.
        without: faces nobody can see, as words of "-x +x -y +y -z +z".
    """
    x0, y0, z0 = np.asarray(low, np.float64)
    dx, dy, dz = np.asarray(high, np.float64) - (x0, y0, z0)
    faces = {
        "-x": ((x0, y0 + dy, z0), (0, -dy, 0), (0, 0, dz)),
        "+x": ((x0 + dx, y0, z0), (0, dy, 0), (0, 0, dz)),
        "-y": ((x0, y0, z0), (dx, 0, 0), (0, 0, dz)),
        "+y": ((x0 + dx, y0 + dy, z0), (-dx, 0, 0), (0, 0, dz)),
        "-z": ((x0, y0 + dy, z0), (dx, 0, 0), (0, -dy, 0)),
        "+z": ((x0, y0, z0 + dz), (dx, 0, 0), (0, dy, 0)),
    }
    hidden = without.split()
    return tuple(quad(*vectors, texture) for name, vectors in faces.items() if name not in hidden)


def disc(centre: ArrayLike, radius: float, texture: Texture, normal: ArrayLike = (0.0, 0.0, 1.0)) -> Quad:
    """A round plate, seen from the side its normal points to; the texture's middle is its centre."""
    first, second = _across(np.asarray(normal, np.float64))
    middle = np.asarray(centre, np.float64)
    return quad(
        middle - radius * (first + second),
        2 * radius * first,
        2 * radius * second,
        texture,
        (texture.size[0] / 2 - radius, texture.size[1] / 2 - radius),
        outline=Ellipse((radius, radius), (radius, radius)),
    )


def cylinder(
    base: ArrayLike,
    axis: ArrayLike,
    radius: float,
    texture: Texture,
    facets: int = 24,
    top: Texture | None = None,
    bottom: Texture | None = None,
) -> tuple[Quad, ...]:
    """The outside of a cylinder as a prism that is lit as if it were round.

    The prism's width, seen from all sides, is the cylinder's in the mean: for 24 facets it is nowhere
    more than 0.9 % off. The texture goes around counter-clockwise (seen from the tip of the axis) in
    metres along the columns, and along the axis in rows; it starts on the side of the world's +x (for an
    axis along x: +y).

    Args:
        base: centre (3,) of the lower end, metres.
        axis: vector (3,) from there to the centre of the upper end, metres.
        radius: metres.
        texture: of the mantle.
        facets: sides of the prism.
        top: material of the upper end; None leaves it open.
        bottom: likewise of the lower end.

    Raises:
        SimulationError: no radius, no length, or fewer than 3 facets.
    """
    foot, along = np.asarray(base, np.float64), np.asarray(axis, np.float64)
    length = float(np.linalg.norm(along))
    if radius <= 0 or length == 0 or facets < 3:
        raise SimulationError(
            f"cylinder: it needs radius and length above 0 and 3 facets, not {radius}, {length}, {facets}"
        )
    first, second = _across(along)
    angles = 2 * np.pi * np.arange(facets + 1) / facets
    out = np.cos(angles)[:, None] * first + np.sin(angles)[:, None] * second
    rim = foot + 2 * radius / (1 + np.cos(np.pi / facets)) * out
    width = float(np.linalg.norm(rim[1] - rim[0]))
    sides = [
        replace(
            quad(rim[n], rim[n + 1] - rim[n], along, texture, (n * width, 0.0)),
            rounding=out[n : n + 2],
        )
        for n in range(facets)
    ]
    if top is not None:
        sides.append(disc(foot + along, radius, top, along))
    if bottom is not None:
        sides.append(disc(foot, radius, bottom, -along))
    return tuple(sides)


def _across(normal: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two unit vectors that form a right-handed frame with a normal, the first as near to +x as can be."""
    up = normal / np.linalg.norm(normal)
    ahead = np.array([1.0, 0.0, 0.0]) if abs(up[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    first = ahead - (ahead @ up) * up
    first /= np.linalg.norm(first)
    return first, np.cross(up, first)


def billboard(base: ArrayLike, width: float, height: float, texture: Texture, yaw: float = 0.0) -> Quad:
    """An upright picture seen from both sides, such as a bush or a tree with a cut-out texture.

    Args:
        base: middle (3,) of its lower edge, metres.
        width: metres.
        height: metres.
        texture: row 0 at the bottom; its `size` should be (width, height).
        yaw: direction the front looks to, radians.
    """
    right = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    origin = np.asarray(base, np.float64) - width / 2 * right
    return quad(origin, width * right, (0.0, 0.0, height), texture, both_sides=True)
