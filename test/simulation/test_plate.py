# SPDX-License-Identifier: Apache-2.0
"""The inspection plate: its holes are seen where geometry puts them, to far less than a pixel."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.simulation import Renderer, SimulationError, optical_pose
from robot_vision.simulation.plate import Plate, PlateSettings, PlateWorld, plate
from robot_vision.simulation.scene import Ellipse, Scene, quad
from robot_vision.simulation.texture import Texture


def pixels(camera: Camera, pose: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels (N, 2) of world points (N, 3)."""
    return np.asarray(camera.pixels((points - pose[:3, 3]) @ pose[:3, :3]))


def holes_seen(
    made: PlateWorld, pose: NDArray[np.float64]
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Centre of gravity of each hole, in a picture of a white plate before nothing and by its border."""
    item = next(q for q in made.scene.quads if q.holes)
    white = Texture.plain((1.0, 1.0, 1.0))
    sheets = [quad(item.origin, item.first, item.second, white, holes=h) for h in ((), item.holes)]
    full, cut = (Renderer(Scene((s,)), made.camera).render(pose)[..., 0].astype(float) for s in sheets)
    found = []
    for number in range(len(made.plate.holes)):
        border = pixels(made.camera, pose, made.plate.border(number, 4000))
        (u0, v0), (u1, v1) = np.floor(border.min(axis=0)).astype(int) - 2, border.max(axis=0).astype(int) + 3
        assert u0 >= 0 and v0 >= 0 and u1 < made.camera.width and v1 < made.camera.height
        missing = (full - cut)[v0 : v1 + 1, u0 : u1 + 1]
        rows, columns = np.indices(missing.shape)
        seen = np.array([(missing * columns).sum(), (missing * rows).sum()]) / missing.sum() + (u0, v0)
        moments = cv2.moments((border - (u0, v0)).astype(np.float32))
        found.append((seen, np.array([moments["m10"], moments["m01"]]) / moments["m00"] + (u0, v0)))
    return found


@pytest.mark.parametrize("x, y, yaw", [(1.9, 0.0, 0.0), (2.1, 0.08, -0.03), (2.0, -0.1, 0.05)])
def test_holes_are_seen_within_three_hundredths_of_a_pixel(x: float, y: float, yaw: float) -> None:
    made = plate(seed=2)
    pose = optical_pose(made.camera, x, y, yaw, 0.01, 0.02)
    found = holes_seen(made, pose)
    assert len(found) == 12
    errors = [np.hypot(*(seen - truth)) for seen, truth in found]
    assert np.sqrt(np.mean(np.square(errors))) < 0.015
    assert max(errors) < 0.03


def test_centres_are_shifted_by_perspective_enough_to_be_told() -> None:
    made = plate(seed=2)
    pose = optical_pose(made.camera, 2.1, 0.0, 0.0)
    centres = pixels(made.camera, pose, made.plate.centres)
    shifts = [np.hypot(*(seen - c)) for (seen, _), c in zip(holes_seen(made, pose), centres, strict=True)]
    assert max(shifts) > 0.5


def test_the_plates_frame_is_what_it_says() -> None:
    made = plate(PlateSettings(slant=0.4, lean=0.2), seed=3).plate
    turn = made.world_from_plate[:3, :3]
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    assert turn[2, 0] == pytest.approx(0.0, abs=1e-12)  # its lower edge is level
    assert turn[0, 0] > 0  # the right end is farther
    assert made.normal[0] < 0 and made.normal[2] == pytest.approx(np.sin(0.2))
    for hole, centre in enumerate(made.centres):
        np.testing.assert_allclose(made.border(hole).mean(axis=0), centre, atol=1e-9)


def test_holes_keep_apart_and_on_the_plate() -> None:
    for seed in range(10):
        made = plate(PlateSettings(columns=5, rows=4, smallest=0.02, largest=0.06), seed).plate
        assert isinstance(made, Plate)
        middles = np.array([hole.centre for hole in made.holes])
        radii = np.array([max(hole.axes) for hole in made.holes])
        apart = np.linalg.norm(middles[:, None] - middles, axis=2) - radii[:, None] - radii
        np.fill_diagonal(apart, 1.0)
        assert apart.min() > 0.003
        assert (middles - radii[:, None]).min() > 0.0
        assert (middles + radii[:, None] < (made.width, made.height)).all()


def test_the_same_seed_gives_the_same_plate_and_shapes_are_as_asked() -> None:
    one, two, other = (plate(seed=seed).plate.holes for seed in (5, 5, 6))
    assert one == two != other
    assert all(h.axes[0] == h.axes[1] for h in plate(PlateSettings(ellipses=0.0)).plate.holes)
    assert all(h.axes[0] > h.axes[1] for h in plate(PlateSettings(ellipses=1.0)).plate.holes)
    assert isinstance(one[0], Ellipse)


def test_impossible_plates_are_refused() -> None:
    with pytest.raises(SimulationError, match="slant"):
        PlateSettings(slant=2.0)
    with pytest.raises(SimulationError, match="do not fit"):
        PlateSettings(columns=8, largest=0.07)
    with pytest.raises(SimulationError, match="smaller than the smallest"):
        PlateSettings(smallest=0.06, largest=0.05)
