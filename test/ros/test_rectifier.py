# SPDX-License-Identifier: Apache-2.0
"""Pictures arrive grey and rectified, whatever their encoding, size or lens, without a fresh array each."""

from __future__ import annotations

import array

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Header

from robot_vision.geometry import Camera
from robot_vision.perception.picture import PictureError
from robot_vision.ros.images import Rectifier, image_message, picture_of

WIDTH, HEIGHT = 160, 120
LENS = Camera(150.0, 150.0, 79.5, 59.5, WIDTH, HEIGHT, distortion=(-0.3, 0.1, 0.001, -0.001, 0.0))
PLAIN = Camera(150.0, 150.0, 79.5, 59.5, WIDTH, HEIGHT)


def scene(width: int = WIDTH, height: int = HEIGHT) -> NDArray[np.uint8]:
    """A smooth colour picture: interpolation differs little from one library to the next."""
    rows, columns = np.indices((height, width))
    return np.stack([columns, rows, (rows + columns) / 2], axis=2).astype(np.uint8)


@pytest.mark.parametrize("grey", [False, True])
def test_a_picture_comes_back_as_it_went(grey: bool) -> None:
    picture = scene()[:, :, 0].copy() if grey else scene()
    message = image_message(Header(), picture)
    assert message.encoding == ("mono8" if grey else "bgr8")
    np.testing.assert_array_equal(picture_of(message), picture)


def test_without_a_lens_a_picture_is_only_turned_grey() -> None:
    rectifier = Rectifier()
    expected = cv2.cvtColor(scene(), cv2.COLOR_BGR2GRAY)
    for camera in (None, PLAIN):
        rectifier.use(camera)
        np.testing.assert_array_equal(rectifier.gray(image_message(Header(), scene())), expected)


def test_with_a_lens_it_is_what_opencv_makes_of_it() -> None:
    rectifier = Rectifier()
    rectifier.use(LENS)
    grey = cv2.cvtColor(scene(), cv2.COLOR_BGR2GRAY)
    expected = cv2.undistort(grey, LENS.matrix, np.array(LENS.distortion))
    got = rectifier.gray(image_message(Header(), scene()))
    inside = (slice(10, -10), slice(10, -10))
    np.testing.assert_allclose(got[inside].astype(int), expected[inside].astype(int), atol=1)
    assert np.abs(got[inside].astype(int) - grey[inside].astype(int)).max() > 1, "nothing was rectified"


def test_png_and_raw_are_the_same() -> None:
    rectifier = Rectifier()
    rectifier.use(LENS)
    png = cv2.imencode(".png", scene())[1]
    compressed = CompressedImage(format="png", data=array.array("B", png.tobytes()))
    raw = rectifier.gray(image_message(Header(), scene())).copy()
    np.testing.assert_allclose(rectifier.gray(compressed).astype(int), raw.astype(int), atol=1)


def test_memory_is_used_again_while_the_size_stays() -> None:
    rectifier = Rectifier()
    rectifier.use(LENS)
    first = rectifier.gray(image_message(Header(), scene()))
    rectifier.use(Camera(**{**LENS.__dict__}))
    assert np.shares_memory(first, rectifier.gray(image_message(Header(), scene())))


def test_a_size_the_calibration_is_not_for_is_refused_in_figures() -> None:
    rectifier = Rectifier()
    rectifier.use(PLAIN)
    with pytest.raises(PictureError, match="80 x 60, but camera_info is for 160 x 120"):
        rectifier.gray(image_message(Header(), scene(80, 60)))
    assert rectifier.gray(image_message(Header(), scene())).shape == (HEIGHT, WIDTH)
    rectifier.use(None)
    assert rectifier.gray(image_message(Header(), scene(80, 60))).shape == (60, 80)


def test_colour_is_ones_own_to_draw_upon() -> None:
    rectifier = Rectifier()
    message = image_message(Header(), scene())
    rectifier.colour(message)[:] = 0
    np.testing.assert_array_equal(rectifier.colour(message), scene())
    assert rectifier.colour(image_message(Header(), scene()[:, :, 0].copy())).shape == (HEIGHT, WIDTH, 3)
