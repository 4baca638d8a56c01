# SPDX-License-Identifier: Apache-2.0
"""True centres of holes on rendered plates, against the truth, and what is said when they cannot be told."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from robot_vision.geometry import Camera, ConicError, centre_shift, vanishing_line
from robot_vision.perception import CentreError, CentreFinder, Centres, EllipseDetector
from robot_vision.perception.centres_overlay import draw_centres
from robot_vision.perception.centres_report import inspect, numbers_of, table, write_drawing
from robot_vision.simulation.plate_view import PlateView, plate_view

SEEDS = range(5)


@pytest.fixture(scope="module")
def views() -> list[PlateView]:
    return [plate_view(seed) for seed in SEEDS]


def plate_in_linear_grey(seed: int, ground: int = 220, disc: int = 20) -> PlateView:
    """Discs on a slanted plate, supersampled, whose grey levels are light, with blur and noise."""
    random = np.random.default_rng((seed, 11))
    camera = Camera(focal := random.uniform(400.0, 800.0), focal, 319.5, 239.5, 640, 480)
    slant, turn = random.uniform(0.6, 1.1), random.uniform(0.0, 2.0 * np.pi)
    normal = -np.array([np.sin(slant) * np.cos(turn), np.sin(slant) * np.sin(turn), np.cos(slant)])
    right = np.cross(normal, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    across = np.array([right, np.cross(normal, right)])
    angles = np.linspace(0.0, 2.0 * np.pi, 400)
    circle = 0.08 * np.column_stack([np.cos(angles), np.sin(angles)])
    samples, centres = 8, []
    big = np.full((480 * samples, 640 * samples), ground, np.uint8)
    for place in 0.21 * np.indices((7, 7)).reshape(2, -1).T - 0.63:
        points = (circle + place) @ across + (0.0, 0.0, 1.0)
        border = camera.pixels(points)
        if points[:, 2].min() < 0.1 or (border < 12.0).any() or (border > (627.0, 467.0)).any():
            continue
        centres.append(camera.pixels((place @ across + (0.0, 0.0, 1.0))[None])[0])
        fine = np.rint(((border + 0.5) * samples - 0.5) * 16).astype(np.int32)
        cv2.fillPoly(big, [fine], disc, cv2.LINE_AA, 4)
    light = cv2.resize(big, (640, 480), interpolation=cv2.INTER_AREA).astype(np.float64)
    light = cv2.GaussianBlur(light, (0, 0), 0.7) + random.normal(0.0, 2.0, light.shape)
    picture = cv2.cvtColor(np.rint(light.clip(0.0, 255.0)).astype(np.uint8), cv2.COLOR_GRAY2BGR)
    return PlateView(picture, camera, np.array(centres), normal)


def places(centres: Centres) -> np.ndarray:
    return np.array([each.centre for each in centres.found])


def ellipses(centres: Centres) -> np.ndarray:
    return np.array([each.seen.ellipse.centre for each in centres.found])


def rms(errors: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))


@pytest.mark.parametrize("told_by", ["normal", "circles"])
def test_corrected_centres_are_true_where_those_of_the_ellipses_are_half_a_pixel_off(views, told_by):
    plain, true = [], []
    for view in views:
        normal = view.normal if told_by == "normal" else None
        found = CentreFinder().find(view.gray, view.camera, normal)
        assert len(found.found) == len(view.centres)
        plain.append(view.errors(ellipses(found)))
        true.append(view.errors(places(found)))
    plain, true = np.concatenate(plain), np.concatenate(true)
    shifted = plain >= 0.5
    assert shifted.sum() >= 10
    assert rms(true[shifted]) < 0.03
    assert rms(true) < 0.03
    assert true.max() < 0.08


@pytest.mark.parametrize(("ground", "disc"), [(220, 20), (20, 220)])
def test_centres_are_as_true_where_grey_levels_are_light(ground, disc):
    plain, true = [], []
    for seed in SEEDS:
        view = plate_in_linear_grey(seed, ground, disc)
        found = CentreFinder().find(view.gray, view.camera, view.normal)
        assert len(found.found) == len(view.centres)
        plain.append(view.errors(ellipses(found)))
        true.append(view.errors(places(found)))
    plain, true = np.concatenate(plain), np.concatenate(true)
    assert (plain >= 0.5).sum() >= 30
    assert rms(true[plain >= 0.5]) < 0.03


def test_circles_tell_how_the_plate_lies(views):
    for view in views:
        plane = CentreFinder().find(view.gray, view.camera).plane
        assert plane is not None
        assert np.degrees(np.arccos(plane.normal @ view.normal)) < 0.5
        assert 6 <= plane.circles.sum() <= len(view.centres)


def test_line_and_normal_say_the_same(views):
    view = views[0]
    by_normal = CentreFinder().find(view.gray, view.camera, -2.0 * view.normal)
    by_line = CentreFinder().find(view.gray, line=vanishing_line(view.camera, view.normal))
    assert places(by_line) == pytest.approx(places(by_normal), abs=1e-9)
    assert by_line.plane is None and by_line.found[0].circle is None


def test_grey_levels_taken_for_light_move_edges_to_the_dark_side(views):
    view = views[1]
    right, wrong = (EllipseDetector(gamma=gamma).detect(view.gray) for gamma in (2.2, 1.0))
    sizes = [np.mean([each.ellipse.minor for each in seen]) for seen in (right, wrong)]
    assert 0.05 < sizes[0] - sizes[1] < 0.5


def test_a_lens_is_taken_out_first(views):
    view = views[2]
    bent = replace(view.camera, distortion=(-0.12, 0.02, 0.0, 0.0, 0.0))
    rows, columns = np.indices(view.gray.shape).reshape(2, -1)
    straight = bent.rectified_pixels(np.column_stack([columns, rows])).astype(np.float32)
    through = cv2.remap(view.picture, straight.reshape(*view.gray.shape, 2), None, cv2.INTER_CUBIC)
    centres, _ = inspect(through, CentreFinder(), bent, view.normal)
    assert len(centres.found) == len(view.centres)
    assert rms(view.errors(places(centres))) < 0.05  # two resamplings


def test_the_table_and_the_drawing_show_every_centre(views, tmp_path):
    view = views[0]
    centres, drawing = inspect(view.picture, CentreFinder(), view.camera)
    rows = list(table(centres))
    assert len(rows) == 2 + len(centres.found)
    assert rows[0].startswith(f"plane as {centres.plane.circles.sum()} circles tell it")
    assert [float(row.split()[4]) for row in rows[2:]] == pytest.approx(
        [each.shift for each in centres.found], abs=1e-3
    )
    assert drawing.shape == (960, 1280, 3)
    plain = cv2.resize(view.picture, (1280, 960), interpolation=cv2.INTER_NEAREST)
    for each in centres.found:  # the cross of the true centre is there
        u, v = np.rint(2.0 * each.centre + 0.5).astype(int)
        assert (drawing[v - 3 : v + 4, u - 3 : u + 4] != plain[v - 3 : v + 4, u - 3 : u + 4]).any()
    write_drawing(tmp_path / "drawing.png", drawing)
    assert np.array_equal(cv2.imread(str(tmp_path / "drawing.png")), drawing)


def discs(*rows: int) -> np.ndarray:
    picture = np.full((200, 120), 200, np.uint8)
    for row in rows:
        cv2.circle(picture, (60, row), 12, 20, -1, cv2.LINE_AA)
    return picture


def test_a_grey_picture_is_drawn_on_and_a_horizon_in_it_too():
    centres = CentreFinder().find(discs(70), line=(0.0, 1.0, -20.0))
    (hole,) = centres.found
    assert hole.seen.ellipse.minor == pytest.approx(12.5, abs=0.5)
    assert hole.shift == pytest.approx(centre_shift(hole.seen.ellipse.minor, 50.0), rel=0.01)
    drawing = draw_centres(discs(70), centres, scale=3)
    assert drawing.shape == (600, 360, 3)
    assert tuple(drawing[61, 300]) != (200, 200, 200)


def test_what_cannot_be_told_is_refused_with_its_reason(views):
    finder, view = CentreFinder(), views[0]
    with pytest.raises(CentreError, match="nothing tells how the plane lies"):
        finder.find(view.gray)
    with pytest.raises(CentreError, match="640 x 480 pixels, its camera 100 x 100"):
        finder.find(view.gray, Camera(100.0, 100.0, 50.0, 50.0, 100, 100))
    with pytest.raises(ConicError, match="0 ellipses show no two circles"):
        finder.find(np.full((480, 640), 90, np.uint8), view.camera)
    with pytest.raises(ConicError, match="only a guess"):
        finder.find(view.gray, Camera.uncalibrated(640, 480))


def test_ellipses_that_cannot_lie_on_the_plane_are_left_out_with_the_reason():
    found = CentreFinder().find(discs(20, 60, 110, 160), line=(0.0, 1.0, -62.0))
    assert places(found)[:, 1] == pytest.approx([110.0, 160.0], abs=4.0)
    (above, beyond), (on_it, touches) = found.left_out
    assert (above.ellipse.v, on_it.ellipse.v) == pytest.approx((20.0, 60.0), abs=0.1)
    assert "beyond the vanishing line" in beyond
    assert "touches or crosses the vanishing line" in touches
    assert list(table(found))[-1].startswith("left out: the ellipse at (60.0, 60.0): it touches")
    with pytest.raises(ConicError, match=r"the ellipse at \(60.*touches or crosses the vanishing line"):
        CentreFinder().find(discs(60), line=(0.0, 1.0, -62.0))


def test_a_picture_without_ellipses_has_no_centres():
    assert CentreFinder().find(np.full((48, 64), 90, np.uint8), line=(0.0, 1.0, 500.0)).found == ()


@pytest.mark.parametrize("text", ["1,2", "1,2,x", "0,0,0", "1,2,nan", ""])
def test_numbers_that_are_none_are_named(text):
    with pytest.raises(CentreError, match="normal must be three numbers"):
        numbers_of("normal", text)


def test_a_drawing_that_cannot_be_written_is_named(tmp_path):
    picture = np.zeros((4, 4, 3), np.uint8)
    with pytest.raises(CentreError, match=r"as \.png or \.jpg, not as '\.xyz'"):
        write_drawing(tmp_path / "a.xyz", picture)
    with pytest.raises(CentreError, match="cannot write .*gone"):
        write_drawing(tmp_path / "gone" / "a.png", picture)
