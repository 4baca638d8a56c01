# SPDX-License-Identifier: Apache-2.0
"""A crop field seen from above: where its rows, lane and borders lie follows from its settings alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robot_vision.simulation.crops import SORTS
from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.leaves import Floats
from robot_vision.simulation.world import Lane, PolyLane, StraightLane

HEADLAND_M = 6.0
"""Ground between the rows' ends and the meadow, where vehicles turn."""
MARGIN_M = 1.0
"""Ground beyond the outermost rows and before the first plants."""
_BORDER_POINTS = 40


@dataclass(frozen=True)
class FieldSettings:
    """What is sown, how well it came up, and from where it is seen; SI units.

    Attributes:
        set: "seedlings", "cabbages" or "canopy" (nearly closed).
        length: of the rows, metres.
        rows: how many; the lane is the middle one (of an even number, the one left of the middle).
        spacing: between rows, metres.
        curvature: of the middle row, 1/m, positive bends to the left.
        missing: share of the crop that did not come up.
        dead: share that withered; dead plants are seen, but are none of the world's plants.
        stunted: share that stayed behind in growth.
        scatter: standard deviation of a plant's distance from the line of its row, metres.
        weeds: number of weeds for each plant that was sown, on equal ground.
        gap: length of a piece of the field without any crop, metres; 0: there is none.
        gap_at: where it begins, metres from the beginning of the rows.
        sun: share of the light that comes straight from the sun; 0: an overcast sky.
        sun_azimuth: where the sun stands, radians, counter-clockwise from the middle row's beginning.
        sun_elevation: of the sun, radians.
        clouds: greatest share of light that passing clouds take away.
        camera_height: above the ground, metres.
        camera_pitch: downwards, radians.
    """

    set: str = "cabbages"
    length: float = 15.0
    rows: int = 29
    spacing: float = 0.5
    curvature: float = 0.0
    missing: float = 0.2
    dead: float = 0.03
    stunted: float = 0.08
    scatter: float = 0.012
    weeds: float = 1.0
    gap: float = 0.0
    gap_at: float = 6.0
    sun: float = 0.6
    sun_azimuth: float = 2.0
    sun_elevation: float = 0.9
    clouds: float = 0.4
    camera_height: float = 1.4
    camera_pitch: float = np.radians(35.0)

    def __post_init__(self) -> None:
        if self.set not in SORTS:
            raise SimulationError(f"field: set must be one of {', '.join(SORTS)}, not {self.set!r}")
        for name, low, high, unit in (
            ("length", 3.0, 200.0, " m"),
            ("rows", 1, 101, ""),
            ("spacing", 0.2, 3.0, " m"),
            ("curvature", -0.05, 0.05, " per metre"),
            ("missing", 0.0, 0.95, ""),
            ("dead", 0.0, 1.0, ""),
            ("stunted", 0.0, 1.0, ""),
            ("scatter", 0.0, 0.1, " m"),
            ("weeds", 0.0, 5.0, ""),
            ("gap", 0.0, 50.0, " m"),
            ("gap_at", 0.0, 200.0, " m"),
            ("sun", 0.0, 0.9, ""),
            ("sun_azimuth", -6.3, 6.3, " rad"),
            ("sun_elevation", 0.35, 1.57, " rad"),
            ("clouds", 0.0, 0.9, ""),
            ("camera_height", 0.5, 3.0, " m"),
            ("camera_pitch", 0.1, 1.5, " rad"),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise SimulationError(f"field: {name} must be between {low} and {high}{unit}, not {value}")
        half_width = (self.rows // 2 + 1) * self.spacing + MARGIN_M
        if abs(self.curvature) * half_width > 0.7:
            raise SimulationError(
                f"field: {self.rows} rows {self.spacing:g} m apart cannot bend with {self.curvature:g} per "
                "metre; give fewer rows or less curvature"
            )
        if (self.length + HEADLAND_M) * abs(self.curvature) > 2.5:
            raise SimulationError(
                f"field: rows of {self.length:g} m that bend with {self.curvature:g} per metre turn back; "
                "give less length or less curvature"
            )

    @property
    def to_sun(self) -> Floats:
        """Unit vector (3,) towards the sun."""
        level, up = np.cos(self.sun_elevation), np.sin(self.sun_elevation)
        return np.array([level * np.cos(self.sun_azimuth), level * np.sin(self.sun_azimuth), up])

    @property
    def row_places(self) -> Floats:
        """Distance (rows,) of each row to the left of the middle one, metres; row 0 is the rightmost."""
        return np.asarray(self.spacing * (np.arange(self.rows) - self.rows // 2), np.float64)

    @property
    def sides(self) -> tuple[float, float]:
        """Right and left border of the worked ground, metres to the left of the middle row."""
        places = self.row_places
        return float(places[0]) - MARGIN_M, float(places[-1]) + MARGIN_M

    @property
    def lane(self) -> Lane:
        """Along the middle row, as wide as the rows are apart."""
        if not self.curvature:
            return StraightLane(self.length, self.spacing)
        along = np.linspace(0.0, self.length, int(self.length / 0.5) + 2)
        return PolyLane(self.points(along, np.zeros_like(along)), self.spacing)

    def points(self, along: Floats, left: Floats) -> Floats:
        """Points (N, 2) of the world from ways along the middle row and distances to its left, metres."""
        turned = self.curvature * along
        chord = along * np.sinc(turned / 2 / np.pi)
        x = chord * np.cos(turned / 2) - left * np.sin(turned)
        y = chord * np.sin(turned / 2) + left * np.cos(turned)
        return np.column_stack([x, y])

    def ways(self, points: Floats) -> tuple[Floats, Floats]:
        """Ways along the middle row and distances to its left (N,), metres, of points (N, 2 or 3)."""
        x, y = points[:, 0], points[:, 1]
        if not self.curvature:
            return x, y
        radius = 1 / self.curvature
        side = np.sign(radius)
        return radius * np.arctan2(side * x, side * (radius - y)), radius - side * np.hypot(x, radius - y)

    def border(self, start: float, end: float) -> Floats:
        """Outline (K, 2) of the worked ground between two ways along the middle row, counter-clockwise."""
        count = _BORDER_POINTS if self.curvature else 2
        along, (right, left) = np.linspace(start, end, count), self.sides
        there, back = (
            self.points(along, np.full(count, right)),
            self.points(along[::-1], np.full(count, left)),
        )
        return np.concatenate([there, back])
