# SPDX-License-Identifier: Apache-2.0
"""A weed that touches a plant of the crop is cut off it, by shape or colour; lobes of the crop's own leaves are not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from robot_vision.geometry import Camera
from robot_vision.perception.crop_rows.ground_window import GroundWindow, Lean
from robot_vision.perception.crop_rows.plant_blobs import PlantSegmenter
from robot_vision.perception.crop_rows.plant_bodies import cut_beside, cut_foreign

RADIUS, SIDE = 25.0, 0.006
Array = NDArray[np.generic]


def _cut(*discs: tuple[int, int, int], most: float = 5000.0) -> tuple[int, Array, Array]:
    grown = np.zeros((160, 160), np.uint8)
    for x, y, radius in discs:
        cv2.circle(grown, (x, y), radius, 1, -1)
    count, components = cv2.connectedComponents(grown, connectivity=8, ltype=cv2.CV_32S)
    labels = np.asarray(components, np.int32)
    return cut_beside(grown, labels, count, RADIUS, SIDE, most), labels, grown


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.0, 4.0])
def test_a_weed_at_the_edge_gets_its_own_label(angle: float) -> None:
    x, y = 70 + round(29 * np.cos(angle)), 70 + round(29 * np.sin(angle))
    count, labels, grown = _cut((70, 70, 25), (x, y, 5))
    assert count == 3
    assert labels[70, 70] == 1
    assert labels[y, x] == 2
    assert ((labels > 0) == (grown > 0)).all()
    assert 35 < np.count_nonzero(labels == 2) < 85


def test_a_lobe_stays_with_its_plant() -> None:
    count, labels, _ = _cut((70, 70, 25), (91, 70, 6))
    assert count == 2
    assert labels.max() == 1


def test_weeds_alone_stay_whole() -> None:
    count, labels, _ = _cut((40, 40, 5), (46, 40, 5), (100, 100, 6))
    assert count == 3
    assert labels[40, 40] == labels[40, 46] == 1


def test_several_plants_grown_together_are_left_alone() -> None:
    assert _cut((70, 70, 25), (99, 70, 5), most=1500.0)[0] == 2


def _foreign(*discs: tuple[int, int, int, bool]) -> tuple[int, Array]:
    """Discs, of which some have another colour than the crop."""
    grown, foreign = np.zeros((2, 160, 160), np.uint8)
    for x, y, radius, other in discs:
        cv2.circle(grown, (x, y), radius, 1, -1)
        cv2.circle(foreign, (x, y), radius, int(other), -1)
    count, components = cv2.connectedComponents(grown, connectivity=8, ltype=cv2.CV_32S)
    labels = np.asarray(components, np.int32)
    return cut_foreign(foreign > 0, labels, count, 6.0), labels


def test_a_weed_within_leaves_is_cut_out_by_its_colour() -> None:
    count, labels = _foreign((70, 70, 40, False), (80, 70, 5, True), (60, 75, 5, True), (70, 50, 1, True))
    assert count == 4
    assert len({labels[70, 70], labels[70, 80], labels[75, 60]}) == 3
    assert labels[50, 70] == labels[70, 70]
    assert np.count_nonzero(labels == labels[70, 80]) == np.count_nonzero(labels == labels[75, 60])


def test_a_weed_alone_keeps_what_has_the_colour_of_the_crop() -> None:
    count, labels = _foreign((70, 70, 8, True), (70, 70, 3, False))
    assert count == 2
    assert labels.max() == 1


def test_a_known_weed_hides_no_plant_of_the_crop_beside_it() -> None:
    radius, rows = 25, 30 + 40 * np.arange(5)
    grown = np.zeros((220, 300), np.uint8)
    for row in rows.tolist():
        cv2.circle(grown, (60, row), radius, 1, -1)
    grown[:, 130:] = 1  # the crop closes
    cv2.circle(grown, (93, 110), 5, 1, -1)
    seen = np.ones(grown.shape, np.bool_)
    window = GroundWindow(grown, seen, np.zeros_like(seen), np.array([0.7, -0.9]), 0.006, 1.2)
    camera = Camera(460.0, 460.0, 319.5, 239.5, 640, 480, height_m=1.4)

    def nearest(known: NDArray[np.float64]) -> NDArray[np.float64]:
        """Distance of the blob nearest to each plant, cells."""
        blobs = PlantSegmenter().cut(window, camera, Lean(), radius * 0.006, known, known)
        places = (blobs.slopes * window.fall - window.corner) / 0.006
        plants = np.column_stack([rows, np.full(5, 60)])
        return np.asarray(np.linalg.norm(places[:, None] - plants[None], axis=2).min(axis=0))

    unknown, known = nearest(np.zeros((0, 2))), nearest(window.corner + 0.006 * np.array([[110.0, 93.0]]))
    assert known == pytest.approx(unknown, abs=1.0)
