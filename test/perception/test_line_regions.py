# SPDX-License-Identifier: Apache-2.0
"""Lines looked for in a part of a picture: those of the whole picture there, and none of the border's own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from robot_vision.bags import BagReader, decode
from robot_vision.perception import LineDetector, LineSegments
from robot_vision.perception.picture import gray_from_compressed
from robot_vision.perception.region import Region

BAG = Path(__file__).resolve().parents[2] / "bags" / "corridor.mcap"
REGIONS = [
    Region(0, 160, 640, 320),
    Region(101, 0, 333, 480),
    Region(37, 91, 500, 300),
    Region(0, 0, 640, 480),
]
AWAY = 12.0  # px from the border within which a line may be another


@pytest.fixture(scope="module")
def pictures() -> list[NDArray[np.uint8]]:
    messages = list(BagReader(BAG).messages(["image/compressed"]))[::75]
    return [gray_from_compressed(bytes(decode(each.cdr, each.type_name).data)) for each in messages]


def inside(lines: LineSegments, region: Region, by: float) -> LineSegments:
    u, v = lines.endpoints[:, ::2], lines.endpoints[:, 1::2]
    within = (u >= region.left + by) & (u <= region.right - 1 - by)
    within &= (v >= region.top + by) & (v <= region.bottom - 1 - by)
    return lines[within.all(axis=1)]


def nearest(ends: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64]:
    """Greatest difference (px) of the ends of each line from those of the most alike among others."""
    return np.asarray(np.abs(ends[:, None] - others[None]).max(axis=2).min(axis=1))


@pytest.mark.parametrize("method", ["trace", "hough"])
@pytest.mark.parametrize("region", REGIONS)
def test_away_from_its_border_lines_are_those_of_the_whole_picture(
    pictures: list[NDArray[np.uint8]], region: Region, method: str
) -> None:
    detector = LineDetector(method=method)  # type: ignore[arg-type]
    for gray in pictures:
        whole = detector.detect(gray)
        part = detector.detect(gray, region)
        there = inside(whole, region, AWAY)
        assert len(there) > 20
        again = nearest(there.endpoints, part.endpoints) < 0.5
        if method == "trace":
            assert again.mean() > 0.97
        else:  # chance draws other pixels in another picture: lines lie as well, but end elsewhere
            assert len(part) > 0.6 * len(there)
        room = inside(part, region, -10.0)
        assert len(room) == len(part)


def test_a_line_that_leaves_the_region_ends_at_its_border() -> None:
    gray = np.full((240, 320), 40, np.uint8)
    gray[:, 161:] = 200
    lines = LineDetector().detect(gray, Region(100, 60, 120, 90))
    assert len(lines) == 1
    np.testing.assert_allclose(lines.endpoints[0, ::2], 160.5, atol=0.1)
    np.testing.assert_allclose(np.sort(lines.endpoints[0, 1::2]), [60, 149], atol=8.0)


@pytest.mark.parametrize("region", REGIONS[:3])
def test_the_border_shows_no_line(region: Region) -> None:
    """Whatever the brightness there: nothing but what the picture shows."""
    steps = np.tile(np.linspace(0.0, 250.0, 640), (480, 1)).astype(np.uint8)
    assert len(LineDetector().detect(steps, region)) == len(LineDetector().detect(steps)) == 0


def test_a_region_is_searched_at_the_contrast_that_the_whole_picture_needed(
    pictures: list[NDArray[np.uint8]],
) -> None:
    """Few lines are in a part of a picture in any case: they are no reason for a second look."""
    rich, plain = LineDetector(enough=1), LineDetector(faint=1.0)
    region = REGIONS[0]
    rich.detect(pictures[0])
    plain.detect(pictures[0])
    assert (
        rich.detect(pictures[0], region).endpoints.tolist()
        == plain.detect(pictures[0], region).endpoints.tolist()
    )
    faint = LineDetector()
    faint.detect(pictures[0])
    assert len(faint.detect(pictures[0], region)) > 1.2 * len(plain.detect(pictures[0], region))


def test_large_pictures_are_searched_at_the_same_scale(pictures: list[NDArray[np.uint8]]) -> None:
    large = np.kron(pictures[0], np.ones((2, 2), np.uint8))
    region = Region(100, 200, 1100, 740)
    detector = LineDetector()
    there = inside(detector.detect(large), region, 2.0 * AWAY)
    there = there[there.lengths > 50.0]
    # Pixels are put together otherwise in a part of the picture: the ends of a line may lie elsewhere.
    again = nearest(there.endpoints, detector.detect(large, region).endpoints) < 6.0
    assert len(there) > 15
    assert again.mean() > 0.8


@pytest.mark.parametrize("region", [Region(600, 0, 41, 480), Region(0, 479, 640, 2), Region(700, 500, 9, 9)])
def test_a_region_outside_the_picture_is_refused(region: Region) -> None:
    with pytest.raises(ValueError, match="does not lie in a picture of 640 x 480"):
        LineDetector().detect(np.zeros((480, 640), np.uint8), region)


@pytest.mark.parametrize("bad", [(0, 0, 0, 5), (0, 0, 5, 0), (-1, 0, 5, 5), (0, -1, 5, 5)])
def test_what_is_no_region_is_refused(bad: tuple[int, int, int, int]) -> None:
    with pytest.raises(ValueError, match="region"):
        Region(*bad)


def test_the_smallest_region_holds_no_line() -> None:
    assert len(LineDetector().detect(np.zeros((480, 640), np.uint8), Region(3, 3, 1, 1))) == 0
