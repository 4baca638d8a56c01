# SPDX-License-Identifier: Apache-2.0
"""Draws docs/gaze.png: `python -m bench.gaze_picture docs/gaze.png`. A bend as two cameras see it, and from above."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.gaze import ROADS
from bench.gaze_drives import Moment, on_road, with_lens
from robot_vision.geometry import Camera
from robot_vision.simulation.head import HeadSettings
from robot_vision.simulation.record import build_world
from robot_vision.simulation.renderer import Renderer
from robot_vision.simulation.sensors import CameraSensor
from robot_vision.simulation.world import World

SEED, AT_S = 101, 11.5
ORANGE, BLUE, GREY = "#e07b00", "#1f6fb4", "#555555"
SHOWN_M = 26.0


def draw(output: Path) -> None:
    """Drive until the bend, and draw that moment."""
    settings, focal, speed = ROADS["the sharpest bends, a lens of 50 degrees"]
    world = with_lens(build_world("road", SEED, settings), focal)
    *_, moment = on_road(world, SEED, HeadSettings(), AT_S, speed)
    straight = Renderer(world.scene, world.camera).render(moment.state.camera_pose(world.camera))
    _plot(output, world, moment, CameraSensor(SEED).capture(straight))


def _plot(output: Path, world: World, moment: Moment, fixed: NDArray[np.uint8]) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.5, 4.3), layout="constrained")
    left, middle, right = figure.subplots(1, 3, gridspec_kw={"width_ratios": [1.0, 1.0, 0.85]})
    _picture(left, fixed, world.camera, moment, "a fixed camera")
    pan = f"on a head, panned {abs(np.degrees(moment.camera.pan)):.0f}° to the "
    _picture(
        middle, moment.picture, moment.camera, moment, pan + ("left" if moment.camera.pan > 0 else "right")
    )
    assert moment.gaze is not None
    look = moment.gaze.point
    (pixel,) = _pixels(moment.camera, look[None])
    middle.plot(*pixel, "+", color="white", markersize=18, markeredgewidth=2.5)
    middle.annotate("look_at", pixel, (12, 12), textcoords="offset points", color="white", fontsize=12)
    _plan(right, world, moment, look)
    figure.savefig(output, dpi=75, bbox_inches="tight")


def _picture(axes: Any, picture: NDArray[np.uint8], camera: Camera, moment: Moment, title: str) -> None:
    axes.imshow(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB))
    if moment.way.path is not None:
        way = np.column_stack([moment.way.path, np.zeros(len(moment.way.path))])
        axes.plot(*_pixels(camera, way).T, color=ORANGE, linewidth=2.5)
    axes.set(xlim=(0, camera.width - 1), ylim=(camera.height - 1, 0), xticks=[], yticks=[], title=title)


def _pixels(camera: Camera, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels (N, 2) of points (N, 3) of base_link."""
    return camera.pixels((points - (camera.x_m, 0.0, camera.height_m or 0.0)) @ camera.optical_to_base)


def _plan(axes: Any, world: World, moment: Moment, look: NDArray[np.float64]) -> None:
    """The road from above, x ahead drawn upwards, and what each camera has in view."""
    state, lane = moment.state, getattr(world.lane, "road", world.lane)
    assert lane is not None  # a road has one
    pose = lane.locate(state.x, state.y, state.yaw)
    cos, sin = np.cos(state.yaw), np.sin(state.yaw)
    half = 0.5 * pose.width
    for side in (half, 0.0, -half):
        line = []
        for along in pose.along + np.arange(-4.0, SHOWN_M + 8.0, 0.5):
            x, y, yaw, _ = lane.point(float(along))
            line.append((x - side * np.sin(yaw) - state.x, y + side * np.cos(yaw) - state.y))
        ahead = np.array(line) @ np.array([[cos, -sin], [sin, cos]])
        axes.plot(-ahead[:, 1], ahead[:, 0], "--" if side == 0.0 else "-", color=GREY, linewidth=1.2)
    for camera, colour, name in ((world.camera, GREY, "fixed"), (moment.camera, BLUE, "on a head")):
        open_to = np.arctan2(0.5 * camera.width, camera.fx)
        rim = camera.pan + np.linspace(-open_to, open_to, 30)
        away = np.column_stack([-np.sin(rim), np.cos(rim)]) * SHOWN_M
        axes.fill(*np.vstack([[0.0, 0.0], away]).T, color=colour, alpha=0.18, label=f"in view, {name}")
    if moment.way.path is not None:
        axes.plot(
            -moment.way.path[:, 1], moment.way.path[:, 0], color=ORANGE, linewidth=2.5, label="path_ahead"
        )
    axes.plot(-look[1], look[0], "+", color=BLUE, markersize=14, markeredgewidth=2.5, label="look_at")
    axes.plot(0.0, 0.0, "^", color="black", markersize=9)
    axes.set(
        xlim=(-13.0, 13.0), ylim=(-3.0, SHOWN_M), aspect="equal", xlabel="m to the right", ylabel="m ahead"
    )
    axes.legend(loc="upper left", fontsize=9)


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
