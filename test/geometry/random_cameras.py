# SPDX-License-Identifier: Apache-2.0
"""Random cameras for the tests of this room: every lens model, as strong as real lenses are."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import strategies as st

from robot_vision.geometry import Camera, rotation_from_rpy


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


angles = numbers(-math.pi, math.pi)
small_angles = numbers(-0.5, 0.5)

plumb_bob = st.tuples(
    numbers(-0.4, 0.2),
    numbers(-0.1, 0.2),
    numbers(-0.003, 0.003),
    numbers(-0.003, 0.003),
    numbers(-0.05, 0.05),
)
rational = st.tuples(
    numbers(-0.3, 0.3),
    numbers(-0.05, 0.1),
    numbers(-0.002, 0.002),
    numbers(-0.002, 0.002),
    numbers(-0.02, 0.02),
    numbers(-0.2, 0.4),
    numbers(-0.05, 0.1),
    numbers(-0.02, 0.02),
)
fisheye = st.tuples(numbers(-0.1, 0.1), numbers(-0.05, 0.05), numbers(-0.02, 0.02), numbers(-0.01, 0.01))
lenses = st.one_of(
    st.just(("plumb_bob", ())),
    st.tuples(st.just("plumb_bob"), plumb_bob),
    st.tuples(st.just("plumb_bob"), plumb_bob.map(lambda k: k[:4])),
    st.tuples(st.just("rational_polynomial"), rational),
    st.tuples(st.sampled_from(["equidistant", "fisheye"]), fisheye),
)


@st.composite
def cameras(draw: st.DrawFn, pitch: float = 0.5, roll: float = 0.5) -> Camera:
    model, distortion = draw(lenses)
    width, height = draw(st.integers(64, 1920)), draw(st.integers(48, 1080))
    focal = draw(numbers(0.5, 2.0)) * max(width, height)
    turn = draw(st.none() | st.tuples(*[numbers(-0.05, 0.05)] * 3))
    rescaled = draw(st.none() | numbers(0.6, 1.3))
    cx, cy = width * draw(numbers(0.3, 0.7)), height * draw(numbers(0.3, 0.7))
    projection = None
    if rescaled is not None:
        projection = np.array(
            [[focal * rescaled, 0, cx + 3, -40.0], [0, focal * rescaled, cy - 2, 0], [0, 0, 1, 0]],
            dtype=float,
        )
    return Camera(
        focal,
        focal * draw(numbers(0.95, 1.05)),
        cx,
        cy,
        width,
        height,
        distortion=distortion,
        height_m=draw(numbers(0.05, 20.0)),
        pitch=draw(numbers(-pitch, pitch)),
        roll=draw(numbers(-roll, roll)),
        x_m=draw(numbers(-1.0, 1.0)),
        distortion_model=model,
        rectification=None if turn is None else rotation_from_rpy(*turn),
        projection=projection,
    )


def grid(camera: Camera, columns: int = 9, rows: int = 7) -> np.ndarray:
    """Pixels (N, 2) spread over the whole picture, corners included."""
    u, v = np.meshgrid(np.linspace(0, camera.width - 1, columns), np.linspace(0, camera.height - 1, rows))
    return np.column_stack([u.ravel(), v.ravel()])
