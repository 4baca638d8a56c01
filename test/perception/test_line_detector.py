# SPDX-License-Identifier: Apache-2.0
"""Lines are found where they were drawn, by either method, and no picture is too odd to be looked at."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from drawn_pictures import angle_to, distances, half_plane, polygon
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from robot_vision.perception import LineDetector, LineSegments

METHODS = ["trace", "hough"]
SHAPE = (240, 320)


@pytest.fixture(scope="module", params=METHODS)
def detector(request: pytest.FixtureRequest) -> LineDetector:
    return LineDetector(method=request.param)


def longest(lines: LineSegments) -> NDArray[np.float64]:
    assert len(lines)
    return lines.endpoints[int(np.argmax(lines.lengths))]


def noise(shape: tuple[int, int], seed: int = 0) -> NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, shape, np.uint8)


def some_picture(seed: int, shape: tuple[int, int] = SHAPE) -> NDArray[np.uint8]:
    """Polygons of many greys, with the noise of a sensor."""
    random = np.random.default_rng(seed)
    picture = np.full(shape, 100, np.uint8)
    for _ in range(15):
        corners = random.uniform((0, 0), shape[::-1], (4, 2))
        hull = cv2.convexHull(np.rint(corners).astype(np.int32))
        cv2.fillPoly(picture, [hull], int(random.integers(20, 240)), cv2.LINE_AA)
    return np.clip(picture + random.normal(0, 2, shape), 0, 255).astype(np.uint8)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.sampled_from(METHODS),
    st.floats(-math.pi, math.pi),
    st.floats(-20, 20),
    st.floats(-20, 20),
    st.integers(25, 180),
)
def test_an_edge_is_found_where_it_was_drawn(method, angle, du, dv, step):
    place = (159.5 + du, 119.5 + dv)
    # Hough's thresholds want more contrast: see below.
    picture = half_plane(place, angle, SHAPE, 40, 40 + (step if method == "trace" else max(step, 80)))
    lines = LineDetector(method=method).detect(picture)
    line = longest(lines)
    length = math.hypot(*(line[2:] - line[:2]))
    assert length > (200 if method == "trace" else 30)
    true = np.array([*place, place[0] + math.cos(angle), place[1] + math.sin(angle)])
    assert distances(line.reshape(2, 2), true).max() < (0.1 if method == "trace" else 0.2)
    assert math.degrees(angle_to(line, angle)) < (0.05 if method == "trace" else 0.3)
    # Drawn bright to the left of its direction, and told in that direction.
    assert np.array([math.cos(angle), math.sin(angle)]) @ (line[2:] - line[:2]) > 0


def test_a_single_edge_is_a_single_line(detector):
    for angle in np.radians([0.0, 17.0, 45.0, 73.0, 90.0, 120.0]):
        lines = detector.detect(half_plane((150.3, 118.7), angle, SHAPE))
        true = np.array([150.3, 118.7, 150.3 + math.cos(angle), 118.7 + math.sin(angle)])
        for line in lines.endpoints:
            assert distances(line.reshape(2, 2), true).max() < 0.5
        if detector.method == "trace":
            assert len(lines) == 1


@pytest.mark.parametrize("turn_deg", [0.0, 12.0, 45.0, 77.0])
@pytest.mark.parametrize("dark_inside", [False, True])
def test_a_box_gives_its_four_sides(detector, turn_deg, dark_inside):
    turn = math.radians(turn_deg)
    corners = np.array([[-70, -45], [70, -45], [70, 45], [-70, 45]]) @ np.array(
        [[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]]
    ) + (161.2, 122.6)
    levels = (180, 60) if dark_inside else (60, 180)
    lines = detector.detect(polygon(corners, SHAPE, *levels))
    for k in range(4):
        first, last = corners[k], corners[(k + 1) % 4]
        # Round the box clockwise as seen, its inside lies to the right.
        wanted = np.array([*first, *last]) if dark_inside else np.array([*last, *first])
        if detector.method == "trace":
            gap = np.hypot(*(lines.endpoints - wanted).reshape(-1, 2, 2).transpose(2, 0, 1)).max(axis=1)
            # The blur before the gradient rounds the corners off.
            assert gap.min() < 3.0
            side = lines.endpoints[[int(gap.argmin())]]
        else:
            side = hough_side(lines, wanted)
        assert max(distances(ends.reshape(2, 2), wanted).max() for ends in side) < 0.25
    if detector.method == "trace":
        assert len(lines) == 4


def hough_side(lines: LineSegments, wanted: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lines along a side; together they cover most of it, but the transform may cut it into pieces."""
    along = (wanted[2:] - wanted[:2]) / np.hypot(*(wanted[2:] - wanted[:2]))
    near = np.array([distances(ends.reshape(2, 2), wanted).max() < 2.0 for ends in lines.endpoints])
    same_way = (lines.endpoints[:, 2:] - lines.endpoints[:, :2]) @ along > 0.0
    side = lines.endpoints[near & same_way]
    assert (side[:, 2:] @ along).max() - (side[:, :2] @ along).min() > 0.7 * np.hypot(
        *(wanted[2:] - wanted[:2])
    )
    return side


def test_brighter_side_is_on_the_left_of_every_line(detector):
    picture = some_picture(1)
    lines = detector.detect(picture)
    assert len(lines) > 15
    smooth = cv2.GaussianBlur(picture, (0, 0), 1.0).astype(np.float32)
    along = lines.endpoints[:, 2:] - lines.endpoints[:, :2]
    along = along / lines.lengths[:, None]
    left = np.stack([along[:, 1], -along[:, 0]], axis=1)
    share = np.linspace(0.1, 0.9, 9)[None, :, None]
    places = lines.endpoints[:, None, :2] + share * (lines.endpoints[:, 2:] - lines.endpoints[:, :2])[:, None]
    sides = [
        cv2.remap(
            smooth, *np.moveaxis((places + side * left[:, None]).astype(np.float32), 2, 0), cv2.INTER_LINEAR
        )
        for side in (2, -2)
    ]
    brighter = sides[0].mean(axis=1) - sides[1].mean(axis=1)
    assert np.mean(brighter > 0) > (0.99 if detector.method == "trace" else 0.9)


def test_strength_follows_the_contrast(detector):
    steps = np.array([60, 80, 120, 160])
    strength = []
    for step in steps:
        lines = detector.detect(half_plane((160.2, 120.0), 0.3, SHAPE, 20, 20 + int(step)))
        strength.append(lines.strength[int(np.argmax(lines.lengths))])
    np.testing.assert_allclose(np.array(strength) / steps, np.mean(strength / steps), rtol=0.1)


def test_a_line_may_begin_at_the_contrast_set(detector):
    # Across the edge a ramp of 9 grey levels a pixel.
    ramp = np.tile(np.clip(60 + 9 * (np.arange(320) - 155), 60, 180).astype(np.uint8), (240, 1))
    for contrast, seen in ((8.0, True), (10.0, False)):
        once = replace(detector, contrast=contrast, blur=0.0, faint=1.0)
        assert (once.detect(ramp).lengths.max(initial=0.0) > 150) == seen
    # Where too few were found, a second look for the faint finds it.
    twice = replace(detector, contrast=10.0, blur=0.0, faint=0.5)
    assert twice.detect(ramp).lengths.max(initial=0.0) > 150
    assert len(replace(twice, enough=0).detect(ramp)) == 0


def test_strength_is_the_gradient_in_grey_levels_a_pixel():
    ramp = np.tile(np.clip(60 + 12 * (np.arange(320) - 155), 60, 180).astype(np.uint8), (240, 1))
    lines = LineDetector(blur=0.0).detect(ramp)
    assert lines.strength.max() == pytest.approx(12.0, rel=0.05)


def test_sigma_is_the_spread_of_the_edge_about_the_line():
    clean = half_plane((160.2, 120.0), 1.2, SHAPE)
    sigmas = []
    for sd in (0.0, 8.0, 25.0):
        noisy = np.clip(clean + np.random.default_rng(3).normal(0, sd, SHAPE), 0, 255).astype(np.uint8)
        lines = LineDetector().detect(noisy)
        sigmas.append(lines.sigma[int(np.argmax(lines.lengths))])
    assert sigmas[0] < 0.03 and 0.1 < sigmas[2] < 0.4
    assert sigmas == sorted(sigmas)


@pytest.mark.parametrize("size", [(1200, 1600), (1081, 1923), (2000, 800), (960, 1280)])
def test_large_pictures_give_lines_in_their_own_pixels(detector, size):
    place, angle = (0.47 * size[1], 0.52 * size[0]), math.radians(31.0)
    picture = (
        half_plane(place, angle, size) if size[0] * size[1] < 1e6 else coarse_half_plane(place, angle, size)
    )
    line = longest(detector.detect(picture))
    true = np.array([*place, place[0] + math.cos(angle), place[1] + math.sin(angle)])
    assert distances(line.reshape(2, 2), true).max() < 0.6
    assert math.degrees(angle_to(line, angle)) < 0.1
    assert math.hypot(*(line[2:] - line[:2])) > 0.8 * min(size)


def coarse_half_plane(place: tuple[float, float], angle: float, size: tuple[int, int]) -> NDArray[np.uint8]:
    """The same without supersampling: the grey of a pixel follows its distance from the edge."""
    v, u = np.indices(size)
    away = (u - place[0]) * math.sin(angle) - (v - place[1]) * math.cos(angle)
    return (120 + 60 * np.clip(2 * away, -1, 1)).astype(np.uint8)


@pytest.mark.parametrize(
    "picture",
    [
        np.zeros((0, 0), np.uint8),
        np.zeros((0, 320), np.uint8),
        np.zeros((240, 0), np.uint8),
        np.zeros((1, 1), np.uint8),
        noise((7, 500)),
        noise((500, 7)),
        np.zeros(SHAPE, np.uint8),
        np.full(SHAPE, 255, np.uint8),
        np.full(SHAPE, 128, np.uint8),
    ],
    ids=lambda picture: f"{picture.shape}",
)
def test_no_lines_where_there_is_nothing_straight(detector, picture):
    lines = detector.detect(picture)
    assert len(lines) == 0
    assert lines.endpoints.shape == (0, 4)


@pytest.mark.parametrize(
    "picture",
    [
        noise((8, 8)),
        noise((9, 11)),
        noise((8, 3000)),
        noise((3000, 8)),
        noise(SHAPE),
        noise((480, 640), 5),
        (np.indices(SHAPE).sum(axis=0) % 2 * 255).astype(np.uint8),
        (np.indices(SHAPE)[1] % 2 * 255).astype(np.uint8),
        (np.indices(SHAPE)[0] // 3 % 2 * 255).astype(np.uint8),
        np.tile(np.arange(320) % 256, (240, 1)).astype(np.uint8),
    ],
    ids=lambda picture: f"{picture.shape}-{int(picture[:2, :7].sum())}",
)
def test_odd_pictures_are_looked_at_all_the_same(detector, picture):
    lines = detector.detect(picture)
    assert np.isfinite(lines.endpoints).all()
    assert np.isfinite(lines.strength).all() and np.isfinite(lines.sigma).all()
    height, width = picture.shape
    assert (lines.endpoints >= -2).all()
    assert (lines.endpoints <= np.array([width, height] * 2) + 1).all()


@settings(max_examples=30, deadline=None, derandomize=True)
@given(st.sampled_from(METHODS), st.integers(1, 70), st.integers(1, 90), st.integers(0, 2**32 - 1))
def test_any_size_of_noise(method, height, width, seed):
    lines = LineDetector(method=method, min_length=4.0).detect(noise((height, width), seed))
    assert np.isfinite(lines.endpoints).all()


def test_noise_holds_no_long_lines():
    lines = LineDetector().detect(noise((480, 640), 9))
    assert len(lines) < 100
    assert lines.lengths.max(initial=0.0) < 45


def test_a_huge_picture(detector):
    picture = np.full((6000, 8000), 60, np.uint8)
    picture[:, 5001:] = 180
    line = longest(detector.detect(picture))
    np.testing.assert_allclose(line[[0, 2]], 5000.5, atol=0.5)
    assert abs(line[3] - line[1]) > 5500


def test_a_long_ribbon_of_a_picture(detector):
    picture = np.full((12, 40000), 60, np.uint8)
    picture[6:] = 180
    lines = detector.detect(picture)
    np.testing.assert_allclose(lines.endpoints[:, [1, 3]], 5.5, atol=0.3)
    assert lines.lengths.max() > 30000


def test_strides_do_not_matter(detector):
    picture = some_picture(2, (240, 640))
    for view in (picture[:, ::2], picture[::-1], picture[:, ::-1], picture.T, picture[3:200, 5:500]):
        same = detector.detect(np.ascontiguousarray(view))
        np.testing.assert_array_equal(detector.detect(view).endpoints, same.endpoints)


def test_the_picture_is_not_written_to(detector):
    picture = some_picture(3)
    before = picture.copy()
    picture.setflags(write=False)
    detector.detect(picture)
    np.testing.assert_array_equal(picture, before)


@pytest.mark.parametrize(
    "picture",
    [
        np.zeros((10, 10), np.uint16),
        np.zeros((10, 10), np.float32),
        np.zeros((10, 10), bool),
        np.zeros((10, 10, 3), np.uint8),
        np.zeros(10, np.uint8),
    ],
    ids=lambda picture: f"{picture.dtype}{picture.shape}",
)
def test_what_is_no_grey_picture_is_refused_in_words(detector, picture):
    with pytest.raises(ValueError, match=rf"grey picture, uint8 \(H, W\), not {picture.dtype}"):
        detector.detect(picture)


def test_the_same_picture_gives_the_same_lines_whatever_came_between(detector):
    picture = some_picture(4)
    first = detector.detect(picture)
    kept = [array.copy() for array in (first.endpoints, first.strength, first.sigma)]
    assert len(first) > 10
    detector.detect(some_picture(5))
    detector.detect(noise((100, 500)))
    detector.detect(noise((900, 900)))
    for array, copy in zip((first.endpoints, first.strength, first.sigma), kept, strict=True):
        np.testing.assert_array_equal(array, copy)
    for again in (detector.detect(picture), LineDetector(method=detector.method).detect(picture)):
        np.testing.assert_array_equal(again.endpoints, kept[0])
        np.testing.assert_array_equal(again.strength, kept[1])
        np.testing.assert_array_equal(again.sigma, kept[2])


def test_faint_edges_are_looked_for_where_little_else_is_seen():
    faint = half_plane((160.0, 120.0), 0.4, SHAPE, 100, 112)
    assert len(LineDetector(faint=1.0).detect(faint)) == 0
    line = longest(LineDetector().detect(faint))
    assert math.degrees(angle_to(line, 0.4)) < 0.5
    assert len(LineDetector(enough=0).detect(faint)) == 0


@pytest.mark.parametrize("method", METHODS)
def test_the_shortest_line_is_as_long_as_asked(method):
    lines = LineDetector(method=method, min_length=40.0).detect(some_picture(6))
    assert len(lines)
    assert lines.lengths.min() > 35.0


def test_a_gap_is_bridged_when_it_is_small_enough():
    picture = half_plane((160.0, 120.3), 0.0, SHAPE)
    picture[:, 150:153] = 60
    assert LineDetector(blur=0.5, max_gap=8).detect(picture).lengths.max() > 280
    assert LineDetector(blur=0.5, max_gap=0).detect(picture).lengths.max() < 180


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("method", "lsd"),
        ("contrast", 0.0),
        ("contrast", math.nan),
        ("contrast", math.inf),
        ("edge_contrast", -1.0),
        ("edge_contrast", 11.0),
        ("min_length", 0.0),
        ("faint", 0.0),
        ("faint", 1.5),
        ("faint", math.nan),
        ("blur", -1.0),
        ("blur", math.nan),
        ("blur", 11.0),
        ("max_gap", -1),
        ("enough", -1),
        ("largest_area", 10),
    ],
)
def test_settings_without_meaning_are_named(setting, value):
    with pytest.raises(ValueError, match=setting):
        LineDetector(**{setting: value})


def test_warming_up_changes_nothing(detector):
    picture = some_picture(7)
    before = detector.detect(picture)
    detector.warm_up()
    np.testing.assert_array_equal(detector.detect(picture).endpoints, before.endpoints)


def test_segments_know_their_lengths_and_middles():
    lines = LineSegments.from_endpoints(np.array([[0.0, 0.0, 3.0, 4.0], [1.0, 1.0, 1.0, 1.0]]))
    np.testing.assert_allclose(lines.lengths, [5.0, 0.0])
    np.testing.assert_allclose(lines.midpoints, [[1.5, 2.0], [1.0, 1.0]])
    assert len(lines[np.array([True, False])]) == 1
    assert len(LineSegments.empty()) == 0


def test_segments_whose_parts_differ_in_number_are_refused():
    with pytest.raises(ValueError, match="strength has 2 values for 3 segments"):
        LineSegments(np.zeros((3, 4)), np.zeros(2), np.zeros(3))
    with pytest.raises(ValueError, match="sigma has 1 values for 3 segments"):
        LineSegments(np.zeros((3, 4)), np.zeros(3), np.zeros(1))


@pytest.mark.parametrize(
    ("shape", "words"),
    [((4, 5), "4 x 5"), ((5, 4, 1), "5 x 4 x 1"), ((8,), "8"), ((0,), "0"), ((2, 2, 2), "2 x 2 x 2")],
)
def test_ends_of_another_shape_are_refused(shape, words):
    ends = np.zeros(shape)
    count = ends.size // 4
    with pytest.raises(ValueError, match=rf"^endpoints must be N x 4 .*, not {words}$"):
        LineSegments(ends, np.zeros(count), np.zeros(count))


@pytest.mark.parametrize("name", ["strength", "sigma"])
def test_strength_and_sigma_are_rows(name):
    parts = {"endpoints": np.zeros((3, 4)), "strength": np.zeros(3), "sigma": np.zeros(3)}
    parts[name] = np.zeros((3, 1))
    with pytest.raises(ValueError, match=f"^{name} must be one row of numbers, not of 2 dimensions"):
        LineSegments(**parts)
