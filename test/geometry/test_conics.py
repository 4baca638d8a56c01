# SPDX-License-Identifier: Apache-2.0
"""Where the centres of circles and ellipses appear, by formula, by algebra, by construction and by projection."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_cameras import angles, numbers

from robot_vision.geometry import (
    Camera,
    ConicError,
    ImageEllipse,
    centre_by_tangents,
    centre_shift,
    circle_normals,
    contact_points,
    plane_of_circles,
    projected_centre,
    vanishing_line,
    vanishing_offset,
)
from robot_vision.geometry.sphere import angle_between, tangent_basis

CAMERA = Camera(460.0, 465.0, 310.0, 250.0, 640, 480)


@dataclass(frozen=True)
class Hole:
    """A hole in a plane before a camera: its picture, the truth about it, and the plane's normal (3,)."""

    camera: Camera
    conic: np.ndarray
    centre: np.ndarray
    normal: np.ndarray

    @property
    def line(self) -> np.ndarray:
        return vanishing_line(self.camera, self.normal)


def hole(
    camera: Camera,
    normal: np.ndarray,
    ray: np.ndarray,
    radius: float,
    narrow: float = 1.0,
    turn: float = 0.0,
) -> Hole:
    """An ellipse with semi-axes `radius` and `narrow` radius, one metre away along a ray."""
    across, along = tangent_basis(normal)
    axes = np.column_stack(
        [np.cos(turn) * across + np.sin(turn) * along, np.cos(turn) * along - np.sin(turn) * across]
    ) * (radius, narrow * radius)
    middle = ray / np.linalg.norm(ray)
    into_picture = np.linalg.inv(camera.matrix @ np.column_stack([axes, middle]))
    conic = into_picture.T @ np.diag([1.0, 1.0, -1.0]) @ into_picture
    return Hole(camera, conic, camera.pixels([middle])[0], normal)


@st.composite
def holes(draw: st.DrawFn, narrowest: float = 0.3) -> Hole:
    focal = draw(numbers(300.0, 1500.0))
    camera = Camera(focal, focal * draw(numbers(0.95, 1.05)), 310.0, 250.0, 640, 480)
    tilt, azimuth = draw(numbers(0.02, 1.1)), draw(angles)
    normal = -np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
    ray = np.array([draw(numbers(-0.3, 0.3)), draw(numbers(-0.25, 0.25)), 1.0])
    radius = draw(numbers(0.02, 0.2))
    return hole(camera, normal, ray, radius, draw(numbers(narrowest, 1.0)), draw(angles))


@settings(max_examples=60, deadline=None)
@given(holes())
def test_the_pole_of_the_vanishing_line_is_the_projected_centre(hole):
    assert projected_centre(hole.conic, hole.line) == pytest.approx(hole.centre, rel=1e-9)
    assert projected_centre(-7.0 * hole.conic, -0.01 * hole.line) == pytest.approx(hole.centre, rel=1e-9)


@settings(max_examples=60, deadline=None)
@given(holes())
def test_tangent_chords_meet_at_the_projected_centre(hole):
    assert centre_by_tangents(hole.conic, hole.line) == pytest.approx(hole.centre, rel=1e-9)


@settings(max_examples=60, deadline=None)
@given(holes(), numbers(-1.5, 1.5))
def test_every_chord_of_contact_passes_through_the_pole(hole, azimuth):
    line = hole.line
    ellipse = ImageEllipse.from_conic(hole.conic)
    distance = line @ (ellipse.u, ellipse.v, 1.0)
    point = (
        ellipse.centre - distance * line[:2] + abs(distance) * np.tan(azimuth) * np.array([-line[1], line[0]])
    )
    first, second = contact_points(hole.conic, point)
    centre = projected_centre(hole.conic, line)
    for contact in (first, second):  # it lies on the ellipse, and the ellipse does not cross the way to it
        assert np.append(contact, 1.0) @ ellipse.conic @ np.append(contact, 1.0) == pytest.approx(
            0.0, abs=1e-9
        )
        assert np.append(contact, 1.0) @ ellipse.conic @ np.append(point, 1.0) == pytest.approx(
            0.0, abs=1e-9 * np.linalg.norm(point - contact) / ellipse.minor
        )
    chord = second - first
    away = centre - first
    aside = (chord[0] * away[1] - chord[1] * away[0]) / np.linalg.norm(chord)
    assert abs(aside) < 1e-8 * ellipse.major


@settings(max_examples=60, deadline=None)
@given(numbers(0.05, 1.0), numbers(0.02, 0.2), numbers(-0.2, 0.2))
def test_the_shift_of_a_circle_straight_ahead_is_b_squared_over_d(tilt, radius, height):
    camera = Camera(500.0, 500.0, 320.0, 240.0, 640, 480)
    normal = np.array([0.0, -np.sin(tilt), -np.cos(tilt)])
    seen = hole(camera, normal, np.array([0.0, height, 1.0]), radius)
    ellipse, line = ImageEllipse.from_conic(seen.conic), seen.line
    d = abs(float(line @ (ellipse.u, ellipse.v, 1.0)))
    vertical = np.sqrt(np.sum((ellipse.frame[1, :2]) ** 2))  # half its extent along the column
    shift = centre_shift(vertical, d)
    towards = -np.sign(line @ (ellipse.u, ellipse.v, 1.0)) * line[:2]
    assert ellipse.centre + shift * towards == pytest.approx(seen.centre, rel=1e-9, abs=1e-9)
    # It is (20.8) with y1 = b + ε, y2 = 2 b, y3 = b + d.
    assert vanishing_offset(vertical + shift, 2.0 * vertical) == pytest.approx(vertical + d, rel=1e-6)


@settings(max_examples=60, deadline=None)
@given(holes())
def test_across_the_vanishing_line_the_shift_of_any_ellipse_is_b_squared_over_d(hole):
    ellipse, line = ImageEllipse.from_conic(hole.conic), hole.line
    d = float(line @ (ellipse.u, ellipse.v, 1.0))
    extent = float(np.linalg.norm(ellipse.frame[:2, :2].T @ line[:2]))
    across = float(line[:2] @ (hole.centre - ellipse.centre))
    assert across == pytest.approx(-np.sign(d) * centre_shift(extent, abs(d)), rel=1e-6, abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(holes())
def test_along_its_axes_an_ellipse_is_two_cases_of_one_dimension(hole):
    # Problem 2: b is the semi-axis and d the way to the vanishing line, both along the same axis.
    ellipse, line = ImageEllipse.from_conic(hole.conic), hole.line
    shift = np.zeros(2)
    for axis, length in zip(ellipse.frame[:2, :2].T, (ellipse.major, ellipse.minor), strict=True):
        axis = axis / length
        slope = float(line[:2] @ axis)
        if abs(slope) > 1e-9:
            d = -float(line @ (ellipse.u, ellipse.v, 1.0)) / slope
            shift += np.sign(d) * centre_shift(length, abs(d)) * axis
    assert ellipse.centre + shift == pytest.approx(hole.centre, rel=1e-8)


@settings(max_examples=60, deadline=None)
@given(holes())
def test_an_ellipse_and_its_conic_say_the_same(hole):
    ellipse = ImageEllipse.from_conic(hole.conic)
    again = ImageEllipse.from_conic(-3.0 * ellipse.conic)
    assert again.conic == pytest.approx(ellipse.conic, rel=1e-8, abs=1e-10 * np.abs(ellipse.conic).max())
    on_it = np.column_stack([ellipse.points(24), np.ones(24)])
    assert np.einsum("ni,ij,nj->n", on_it, ellipse.conic, on_it) == pytest.approx(0.0, abs=1e-9)


@settings(max_examples=60, deadline=None)
@given(holes(narrowest=1.0))
def test_a_circle_fits_two_planes_of_which_one_is_its_own(hole):
    normals = circle_normals(ImageEllipse.from_conic(hole.conic), hole.camera)
    # Near the upright view both planes fall together, where a normal is the root of a difference.
    assert angle_between(normals, hole.normal).min() < 1e-5
    for normal in normals:
        line = vanishing_line(hole.camera, normal)
        assert (
            np.append(projected_centre(hole.conic, line), 1.0) @ hole.conic @ np.append(hole.centre, 1.0)
            < 0.0
        )


@settings(max_examples=60, deadline=None)
@given(numbers(0.1, 1.0), angles, st.integers(0, 500))
def test_circles_among_ellipses_tell_their_plane(tilt, azimuth, seed):
    random = np.random.default_rng(seed)
    normal = -np.array([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])
    shapes = [1.0] * 6 + [0.6, 0.7]
    rays = np.column_stack([random.uniform(-0.5, 0.5, (8, 2)), np.ones(8)])
    rays[:4, :2] = [(-0.3, -0.3), (0.3, 0.2), (-0.2, 0.3), (0.25, -0.25)]
    seen = [
        hole(CAMERA, normal, ray, 0.05, narrow, random.uniform(0, 3))
        for ray, narrow in zip(rays, shapes, strict=True)
    ]
    found = plane_of_circles([ImageEllipse.from_conic(each.conic) for each in seen], CAMERA)
    assert angle_between(found.normal, normal) < 1e-7
    assert found.circles.tolist() == [True] * 6 + [False] * 2
    assert np.linalg.eigvalsh(found.covariance)[-1] < 1e-12


def test_a_plane_parallel_to_the_picture_shifts_nothing():
    ellipse = ImageEllipse(100.0, 50.0, 30.0, 20.0, 0.4)
    assert projected_centre(ellipse.conic, (0.0, 0.0, 1.0)) == pytest.approx([100.0, 50.0])
    assert centre_by_tangents(ellipse.conic, (0.0, 0.0, -2.0)) == pytest.approx([100.0, 50.0])


ROUND = ImageEllipse(100.0, 50.0, 20.0, 20.0).conic


@pytest.mark.parametrize("centre", [projected_centre, centre_by_tangents])
@pytest.mark.parametrize(
    ("conic", "line", "reason"),
    [
        (ROUND, (0.0, 1.0, -70.0), "touches or crosses the vanishing line"),
        (ROUND, (0.0, 1.0, -55.0), "touches or crosses the vanishing line"),
        (ROUND, (0.0, 1.0, -50.0), r"\(0\.0 px away, 20\.0 px of extent\)"),
        (ROUND, (0.0, 0.0, 0.0), "not all zero"),
        (ROUND, (0.0, np.nan, 1.0), "finite"),
        (ROUND, (1.0, 2.0), "three finite numbers"),
        (np.diag([1.0, -1.0, -1.0]), (0.0, 1.0, 9.0), "hyperbola"),
        (np.diag([1.0, 0.0, -1.0]), (0.0, 1.0, 9.0), "no ellipse"),
        (np.diag([1.0, 1.0, 1.0]), (0.0, 1.0, 9.0), "without real points"),
        (np.zeros((3, 3)), (0.0, 1.0, 9.0), "no ellipse"),
        (np.eye(2), (0.0, 1.0, 9.0), r"finite \(3, 3\) matrix"),
    ],
)
def test_what_has_no_centre_is_refused_with_its_reason(centre, conic, line, reason):
    with pytest.raises(ConicError, match=reason):
        centre(conic, line)


@pytest.mark.parametrize(
    ("b", "d", "reason"),
    [
        (0.0, 5.0, "b must be positive"),
        (-1.0, 5.0, "b must be positive"),
        (5.0, 5.0, "touches or crosses"),
        (5.0, 3.0, "touches or crosses"),
        (5.0, np.nan, "touches or crosses"),
    ],
)
def test_a_shift_that_is_none_is_refused_with_its_reason(b, d, reason):
    with pytest.raises(ConicError, match=reason):
        centre_shift(b, d)


def test_no_tangent_leads_from_within():
    with pytest.raises(ConicError, match="on or in an ellipse"):
        contact_points(ROUND, (105.0, 50.0))


def test_an_ellipse_that_is_none_is_refused():
    with pytest.raises(ConicError, match="longer one first"):
        ImageEllipse(0.0, 0.0, 1.0, 2.0)
    with pytest.raises(ConicError, match="finite"):
        ImageEllipse(np.nan, 0.0, 2.0, 1.0)


def test_one_circle_alone_tells_no_plane():
    one = ImageEllipse(100.0, 50.0, 30.0, 20.0)
    with pytest.raises(ConicError, match="no two circles on one plane.*give the plane's normal"):
        plane_of_circles([one], CAMERA)
    with pytest.raises(ConicError, match="0 ellipses"):
        plane_of_circles([], CAMERA)
    with pytest.raises(ConicError, match="only a guess"):
        plane_of_circles([one, one], Camera.uncalibrated(640, 480))


def test_circles_seen_from_too_far_away_to_tell_which_end_is_farther_are_refused():
    tele = Camera(20000.0, 20000.0, 320.0, 240.0, 640, 480)
    normal = -np.array([0.5, 0.2, 1.0]) / np.linalg.norm([0.5, 0.2, 1.0])
    rays = [np.array([x, y, 1.0]) for x, y in ((-0.001, -0.0005), (0.001, 0.0), (0.0, 0.0008))]
    seen = [ImageEllipse.from_conic(hole(tele, normal, ray, 0.002).conic) for ray in rays]
    # Edges are placed to some hundredths of a pixel.
    shaky = [replace(each, major=each.major + by) for each, by in zip(seen, (0.03, -0.03, 0.02), strict=True)]
    with pytest.raises(ConicError, match="fit two planes about as well.*give the plane's normal"):
        plane_of_circles(shaky, tele)
    assert angle_between(plane_of_circles(seen, tele).normal, normal) < 1e-3
