# SPDX-License-Identifier: Apache-2.0
"""A world: what can be seen, and beside it what is true there of lane, floor, objects, shadows and plants."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.simulation.drive import FollowSettings, WeavingSettings
from robot_vision.simulation.errors import SimulationError
from robot_vision.simulation.lane import Lane, LanePoint, LanePose, PolyLane, StraightLane
from robot_vision.simulation.scene import Scene

__all__ = [
    "Lane",
    "LanePoint",
    "LanePose",
    "Plant",
    "PolyLane",
    "SceneObject",
    "StartPose",
    "StraightLane",
    "World",
    "standard_camera",
    "walls_around",
]

KINDS = ("crop", "weed")
"""Of plants."""


def standard_camera() -> Camera:
    """The usual camera of simulated bags: 640x480, 69.6 degrees wide, 0.6 m up, looking 5 degrees down."""
    return Camera(460.0, 460.0, 319.5, 239.5, 640, 480, height_m=0.6, pitch=float(np.radians(5.0)))


@dataclass(frozen=True, eq=False)
class SceneObject:
    """Something solid that stands on the floor.

    Attributes:
        name: in words, such as "waste bin 2".
        footprint: (K, 2) corners of its outline on the floor in order, metres.
        height: metres.
        kind: "wall" for what bounds the floor, "object" for what stands on it.
    """

    name: str
    footprint: NDArray[np.float64]
    height: float
    kind: str = "object"

    def __post_init__(self) -> None:
        object.__setattr__(self, "footprint", _polygon(self.name, self.footprint))


@dataclass(frozen=True)
class Plant:
    """A plant that grows in a field.

    Attributes:
        id: number, unique in its world.
        row: number of its row from the right, -1 for a weed between rows.
        kind: "crop" or "weed".
        x: of its stem, metres.
        y: of its stem, metres.
        radius: of the circle about the stem that holds its leaves, metres.
        area: of ground its leaves cover as seen from above, square metres.
        height: metres.
    """

    id: int
    row: int
    kind: str
    x: float
    y: float
    radius: float
    area: float
    height: float

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise SimulationError(
                f"plant {self.id}: its kind is one of {', '.join(KINDS)}, not {self.kind!r}"
            )


class StartPose(NamedTuple):
    """Where a robot begins: x, y (m), yaw (rad) in the world."""

    x: float
    y: float
    yaw: float


@dataclass(frozen=True, eq=False)
class World:
    """Something to drive through.

    Attributes:
        name: by which it is asked for.
        scene: everything visible; ground at z = 0.
        frame: name of the lane's frame in messages: corridor, road, row or path.
        lane: where the robot is meant to go; None where there is no lane (a maze, a plate to look at).
        objects: what a robot can run into, walls included (see `walls_around`).
        shadows: (K, 2) outlines of shadows on the floor, metres.
        plants: that grow there.
        floor: (K, 2) outlines; what lies in one of them and in no object is free to drive.
        start: where a robot begins; None: at the beginning of the lane.
        camera: on the robot that records the world.
        drive: how a recording drives: `WeavingSettings` (straight lanes along x) or `FollowSettings`.
        clouds: greatest share of light that passing clouds take away during a drive, 0 to 0.9.
        resolution: of the true plan of the floor, metres a cell.
        robot_width: of the robot that is to pass here, metres.
        robot_length: likewise, metres; base_link is its middle.
    """

    name: str
    scene: Scene
    frame: str
    lane: Lane | None = None
    objects: tuple[SceneObject, ...] = ()
    shadows: tuple[NDArray[np.float64], ...] = ()
    plants: tuple[Plant, ...] = ()
    floor: tuple[NDArray[np.float64], ...] = ()
    start: StartPose | None = None
    camera: Camera = field(default_factory=standard_camera)
    drive: WeavingSettings | FollowSettings = field(default_factory=WeavingSettings)
    clouds: float = 0.0
    resolution: float = 0.05
    robot_width: float = 0.5
    robot_length: float = 0.6

    def __post_init__(self) -> None:
        for part in ("shadows", "floor"):
            outlines = tuple(_polygon(f"{self.name}: {part}", outline) for outline in getattr(self, part))
            object.__setattr__(self, part, outlines)
        if not 0.0 <= self.clouds <= 0.9:
            raise SimulationError(f"{self.name}: clouds must be between 0 and 0.9, not {self.clouds}")

    @property
    def beginning(self) -> StartPose:
        """Where a robot begins, whether the world says so or only its lane does."""
        if self.start is not None:
            return StartPose(*self.start)
        if self.lane is None:
            return StartPose(0.0, 0.0, 0.0)
        return StartPose(*self.lane.point(self.drive.start)[:3])


def walls_around(
    outline: NDArray[np.float64], thickness: float = 0.1, height: float = 2.6, closed: bool = True
) -> tuple[SceneObject, ...]:
    """Walls outside each side of a free floor, counter-clockwise outline (K, 2) in metres.

    Args:
        outline: (K, 2) inner faces of the walls, the floor to the left of each side.
        thickness: metres.
        height: metres.
        closed: whether a wall joins the last corner to the first.
    """
    corners = _polygon("walls", outline)
    following = np.roll(corners, -1, axis=0)
    walls = []
    for number, (a, b) in enumerate(zip(corners, following, strict=True)):
        if number == len(corners) - 1 and not closed:
            break
        along = (b - a) / np.linalg.norm(b - a)
        out = thickness * np.array([along[1], -along[0]])
        footprint = np.array([a, b, b + out, a + out])
        walls.append(SceneObject(f"wall {number + 1}", footprint, height, "wall"))
    return tuple(walls)


def _polygon(name: str, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    outline = np.asarray(corners, np.float64)
    if outline.ndim != 2 or outline.shape[1] != 2 or len(outline) < 3 or not np.isfinite(outline).all():
        raise SimulationError(f"{name}: an outline must be finite (K, 2) with K >= 3, not {outline.shape}")
    return outline
