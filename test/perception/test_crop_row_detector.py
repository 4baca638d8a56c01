# SPDX-License-Identifier: Apache-2.0
"""Rows are found where they were drawn, with nothing given; where there are none, none are."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from drawn_fields import CAMERA, Sown, drawn
from test_real_pictures import present

from bench.crbd import evaluate
from bench.row_scores import crda
from bench.sources import crop_rows
from robot_vision.geometry import GroundPlane
from robot_vision.perception import CropRowDetector, RowPattern

HORIZON = 239.5 - 460.0 * np.tan(np.deg2rad(35.0))


def true_columns(sown: Sown, v: float) -> np.ndarray:
    """Columns of straight rows at an image row, by projecting points of each."""
    columns = []
    for row in range(-4, 5):
        way = np.linspace(0.3, 14.0, 400)
        sine, cosine = np.sin(sown.yaw), np.cos(sown.yaw)
        y = row * sown.spacing - sown.offset
        line = np.column_stack([cosine * way + sine * y, cosine * y - sine * way])
        pixels = GroundPlane(CAMERA).to_pixels(line)
        order = np.argsort(pixels[:, 1])
        columns.append(np.interp(v, pixels[order, 1], pixels[order, 0]))
    return np.sort(columns)


def found(picture: np.ndarray, **hints: float) -> RowPattern:
    pattern = CropRowDetector().detect(picture, **hints)
    assert pattern is not None
    return pattern


@pytest.mark.parametrize(("offset", "yaw"), [(0.0, 0.0), (0.12, 0.08), (-0.2, -0.12)])
def test_rows_lie_where_they_were_drawn(offset: float, yaw: float) -> None:
    sown = Sown(offset=offset, yaw=yaw)
    pattern = found(drawn(sown, seed=1))
    for v in (150.0, 250.5, 400.0):
        true = true_columns(sown, v)
        spacing = float(np.median(np.diff(true)))
        nearest = true[np.argsort(np.abs(true - 319.5))[:3]]
        errors = np.abs(pattern.columns(v)[:, None] - nearest).min(axis=0)
        assert errors.max() < 0.08 * spacing
    assert pattern.horizon == pytest.approx(HORIZON, abs=25.0)


def test_the_answer_keeps_its_contract() -> None:
    pattern = found(drawn(Sown(), seed=2))
    counts = {len(pattern.columns(v)) for v in (0, 100, 239.5, 479)}
    assert len(counts) == 1
    for v in (0.0, 200.0, 479.0):
        assert (np.diff(pattern.columns(v)) > 0).all()
    assert pattern.unit == "px"
    assert pattern.covariance.shape == (3, 3)
    assert 0.0 < pattern.confidence <= 1.0
    middle = pattern.columns(240.5)
    assert middle == pytest.approx(0.5 * (pattern.columns(240) + pattern.columns(241)))


@pytest.mark.parametrize(("offset", "yaw"), [(0.1, 0.06), (-0.08, -0.1)])
def test_a_camera_makes_metres_of_it(offset: float, yaw: float) -> None:
    picture = drawn(Sown(offset=offset, yaw=yaw), seed=3)
    pattern = CropRowDetector(camera=CAMERA, spacing=0.5).detect(picture)
    assert pattern is not None
    assert pattern.unit == "m"
    assert pattern.offset == pytest.approx(offset, abs=0.04)
    assert pattern.yaw == pytest.approx(yaw, abs=0.02)
    blind = CropRowDetector(camera=CAMERA).detect(picture)
    assert blind is not None
    assert blind.spacing == pytest.approx(0.5, rel=0.1)


def test_hints_are_taken_and_nonsense_is_refused() -> None:
    picture = drawn(Sown(), seed=4)
    bottom = float(np.diff(true_columns(Sown(), 479.0)).mean())
    pattern = found(picture, horizon=HORIZON, spacing_at_bottom=bottom)
    assert pattern.horizon == pytest.approx(HORIZON)
    assert found(picture, horizon=HORIZON).horizon == pytest.approx(HORIZON)
    assert found(picture, spacing_at_bottom=bottom).spacing == pytest.approx(bottom, rel=0.15)
    for hints in ({"horizon": 479.0}, {"horizon": np.nan}, {"spacing_at_bottom": 0.0}):
        with pytest.raises(ValueError, match=next(iter(hints))):
            CropRowDetector().detect(picture, **hints)
    with pytest.raises(ValueError, match="picture"):
        CropRowDetector().detect(np.zeros((480, 640, 3), np.float32))


@pytest.mark.parametrize("seed", range(4))
def test_soil_and_scattered_weeds_are_no_rows(seed: int) -> None:
    random = np.random.default_rng(seed)
    weeds = drawn(Sown(missing=1.0), seed=seed)
    assert CropRowDetector().detect(weeds) is None
    for _ in range(300):
        place = tuple(random.integers((0, 0), (640, 480)).tolist())
        cv2.circle(weeds, place, int(random.integers(2, 12)), (60, 150, 80), -1)
    scattered = CropRowDetector().detect(weeds)
    assert scattered is None or scattered.confidence < 0.5
    assert CropRowDetector().detect(np.zeros((240, 320, 3), np.uint8)) is None
    assert CropRowDetector().detect(np.zeros((8, 8, 3), np.uint8)) is None


def test_the_same_picture_gives_the_same_rows() -> None:
    picture = drawn(Sown(weeds=1.0), seed=5)
    detector = CropRowDetector()
    first, again = detector.detect(picture), detector.detect(picture)
    assert first is not None
    assert again is not None
    assert np.array_equal(first.table, again.table)


@pytest.mark.parametrize("method", ["straight", "plants"])
def test_the_simpler_methods_find_simple_rows(method: str) -> None:
    picture = drawn(Sown(weeds=0.0, missing=0.0, radius=0.05), seed=6)
    bottom = float(np.diff(true_columns(Sown(), 479.0)).mean())
    detector = CropRowDetector(method=method)  # type: ignore[arg-type]
    pattern = detector.detect(picture, horizon=HORIZON, spacing_at_bottom=bottom)
    assert pattern is not None
    true = true_columns(Sown(), 300.0)
    errors = np.abs(pattern.columns(300.0)[:, None] - true[3:6]).min(axis=0)
    assert errors.max() < 0.15 * float(np.diff(true).mean())


def test_settings_without_meaning_are_refused() -> None:
    for name, value in (("spacing", -1.0), ("method", "guess"), ("least_confidence", 2.0)):
        with pytest.raises(ValueError, match=name):
            CropRowDetector(**{name: value})  # type: ignore[arg-type]


def test_the_score_knows_a_perfect_answer_and_a_useless_one() -> None:
    truth = np.column_stack([np.linspace(-3, 3, 100), np.linspace(20, 60, 100)])
    table = 160.0 + truth[:, :1] + np.arange(-4, 5) * truth[:, 1:]
    assert crda(table, truth, 160.0, 0.1) == pytest.approx(1.0)
    assert crda(table + 0.5 * truth[:, 1:], truth, 160.0, 0.1) == 0.0
    assert crda(table + 0.05 * truth[:, 1:], truth, 160.0, 0.1) == pytest.approx(0.75)


def test_real_fields_are_read_far_better_than_by_the_recipe() -> None:
    pictures = present(crop_rows)[::8]
    said = evaluate(pictures, CropRowDetector())
    recipe = evaluate(pictures, CropRowDetector(method="plants"))
    found, given = np.mean(said.blind, axis=0), np.mean(said.given, axis=0)
    assert found[0] > 0.78
    assert found[1] > 0.91
    assert given[0] > 0.80
    assert found[0] > np.mean(recipe.given, axis=0)[0] + 0.3
