# SPDX-License-Identifier: Apache-2.0
"""Pictures of every encoding become the same arrays; broken ones say what is wrong."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from robot_vision.perception.picture import (
    ENCODINGS,
    PictureError,
    gray_from_compressed,
    picture_from_buffer,
    picture_from_compressed,
    to_gray,
)

BGR = np.random.default_rng(1).integers(0, 256, (12, 16, 3), np.uint8)


def smooth(height: int = 32, width: int = 48) -> NDArray[np.uint8]:
    v, u = np.mgrid[:height, :width]
    return np.stack([u * 4, v * 6, 255 - u * 2 - v], -1).astype(np.uint8)


def padded(pixels: NDArray[np.generic], extra: int) -> tuple[int, bytes]:
    rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(len(pixels), -1)
    return rows.shape[1] + extra, np.pad(rows, ((0, 0), (0, extra)), constant_values=77).tobytes()


@pytest.mark.parametrize("extra", [0, 5])
@pytest.mark.parametrize(
    ("encoding", "stored"),
    [
        ("bgr8", BGR),
        ("8UC3", BGR),
        ("rgb8", BGR[..., ::-1]),
        ("bgra8", np.dstack([BGR, BGR[..., 0]])),
        ("rgba8", np.dstack([BGR[..., ::-1], BGR[..., 0]])),
        ("bgr16", BGR.astype("<u2") * 256 + 9),
        ("rgb16", BGR[..., ::-1].astype("<u2") * 256 + 9),
    ],
)
def test_colour_comes_back_as_bgr(encoding: str, stored: NDArray[np.generic], extra: int) -> None:
    step, data = padded(stored, extra)
    assert np.array_equal(picture_from_buffer(encoding, 16, 12, step, data), BGR)


@given(
    st.integers(1, 20),
    st.integers(1, 20),
    st.integers(0, 3),
    st.booleans(),
    st.sampled_from(["mono8", "mono16"]),
)
def test_grey_comes_back_as_it_was(width: int, height: int, extra: int, big: bool, encoding: str) -> None:
    depth = np.uint8 if encoding == "mono8" else np.uint16
    pixels = np.random.default_rng(width).integers(0, np.iinfo(depth).max, (height, width), depth)
    stored = pixels.astype(pixels.dtype.newbyteorder(">" if big else "<"))
    step, data = padded(stored, extra)
    got = picture_from_buffer(encoding, width, height, step, data, big)
    assert got.dtype == depth and np.array_equal(got, pixels)


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
@pytest.mark.parametrize("bits", [8, 16])
def test_bayer_patterns_give_the_colours_they_were_made_of(pattern: str, bits: int) -> None:
    picture = smooth()
    mosaic = np.zeros(picture.shape[:2], np.uint8)
    for place, colour in enumerate(pattern):
        row, column = divmod(place, 2)
        mosaic[row::2, column::2] = picture[row::2, column::2, "bgr".index(colour)]
    stored = mosaic if bits == 8 else mosaic.astype("<u2") * 256
    step, data = padded(stored, 0)
    got = picture_from_buffer(f"bayer_{pattern}{bits}", 48, 32, step, data)
    difference = np.abs(got.astype(int) - picture)[4:-4, 4:-4]
    assert difference.max() <= 8


@pytest.mark.parametrize(("encoding", "order"), [("yuyv", "yuyv"), ("yuv422_yuy2", "yuyv"), ("uyvy", "uyvy")])
def test_yuv422_keeps_the_brightness(encoding: str, order: str) -> None:
    luma = np.clip(smooth()[..., 0], 16, 235).astype(np.uint8)
    stored = np.full((*luma.shape, 2), 128, np.uint8)
    stored[..., order.index("y")] = luma
    step, data = padded(stored, 0)
    grey = to_gray(picture_from_buffer(encoding, 48, 32, step, data))
    assert np.abs(grey - (luma.astype(float) - 16) * 255 / 219).max() <= 2


def test_an_unchanged_picture_is_not_copied() -> None:
    data = BGR.tobytes()
    assert np.shares_memory(picture_from_buffer("bgr8", 16, 12, 48, data), np.frombuffer(data, np.uint8))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("bgr9", 4, 4, 12, bytes(48)), "'bgr9' is not known; known are mono8"),
        (("bgr8", 0, 4, 12, bytes(48)), r"no size \(0 x 4\)"),
        (("bgr8", 4, 4, 11, bytes(48)), "step 11 is too small for 4 pixels of bgr8"),
        (("bgr8", 4, 4, 12, bytes(47)), "has 47 bytes; .* needs 48"),
        (("mono8", 4, 4, 4, b""), "is empty"),
        (("uyvy", 3, 4, 6, bytes(24)), "even width"),
        (("bayer_rggb8", 1, 1, 1, bytes(1)), "at least 2 x 2"),
    ],
)
def test_broken_pictures_name_the_cause(arguments: tuple[str, int, int, int, bytes], words: str) -> None:
    with pytest.raises(PictureError, match=words):
        picture_from_buffer(*arguments)


@given(
    st.sampled_from(ENCODINGS),
    st.integers(-1, 9),
    st.integers(-1, 9),
    st.integers(0, 90),
    st.binary(max_size=300),
)
def test_no_message_brings_the_decoder_down(
    encoding: str, width: int, height: int, step: int, data: bytes
) -> None:
    try:
        picture = picture_from_buffer(encoding, width, height, step, data)
    except PictureError:
        return
    assert to_gray(picture).shape == (height, width)


def test_png_comes_back_exactly_and_jpeg_nearly() -> None:
    picture = smooth()
    png = cv2.imencode(".png", picture)[1].tobytes()
    jpeg = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 98])[1].tobytes()
    assert np.array_equal(picture_from_compressed(png), picture)
    assert np.abs(picture_from_compressed(jpeg).astype(int) - picture).mean() < 3
    assert np.abs(gray_from_compressed(jpeg).astype(int) - to_gray(picture)).mean() < 2
    grey = picture[..., 0]
    assert np.array_equal(picture_from_compressed(cv2.imencode(".png", grey)[1].tobytes()), grey)
    deep = cv2.imencode(".png", picture.astype(np.uint16) * 257)[1].tobytes()
    assert np.array_equal(picture_from_compressed(deep), picture)


@pytest.mark.parametrize("part", [0.0, 0.01, 0.3, 0.8, 0.99])
def test_a_cut_off_jpeg_is_refused_and_not_filled_with_grey(part: float) -> None:
    jpeg = cv2.imencode(".jpg", BGR)[1].tobytes()
    with pytest.raises(PictureError, match=r"cut off|empty|no picture"):
        picture_from_compressed(jpeg[: int(part * len(jpeg))])


def test_a_jpeg_with_zeros_behind_it_is_whole() -> None:
    jpeg = cv2.imencode(".jpg", BGR)[1].tobytes()
    assert picture_from_compressed(jpeg + bytes(1000)).shape == BGR.shape


@pytest.mark.parametrize("data", [b"hello", b"\x89PNG\r\n\x1a\n", bytes(100)])
def test_what_is_no_picture_file_is_refused(data: bytes) -> None:
    with pytest.raises(PictureError, match="no picture"):
        picture_from_compressed(data)


def test_grey_of_other_arrays_is_refused() -> None:
    with pytest.raises(PictureError, match="no grey or BGR"):
        to_gray(np.zeros((3, 3, 2), np.uint8))
