# SPDX-License-Identifier: Apache-2.0
"""Vanishing points keep their ids while the robot turns, and one wrong picture moves none of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from robot_vision.geometry import Camera
from robot_vision.geometry.sphere import angle_between, front_half, local_coordinates, retract
from robot_vision.perception import Role, VanishingPoints, VanishingPointTracker

CAMERA = Camera(500.0, 500.0, 319.5, 239.5, 640, 480)
STEP = 0.1
SIGMA = math.radians(0.3)
#: Ahead, down, right.
AXES = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
ROLES = (Role.PRIMARY, Role.VERTICAL, Role.HORIZONTAL)


def seen(
    directions: NDArray[np.float64],
    roles: tuple[Role, ...] = ROLES,
    random: np.random.Generator | None = None,
    camera: Camera = CAMERA,
) -> VanishingPoints:
    """An observation of directions, with the error it says it has; line k leads to direction k, one is clutter."""
    count = len(directions)
    moved = directions
    if random is not None:
        moved = np.array([retract(d, random.normal(0, SIGMA, 2)) for d in directions]).reshape(-1, 3)
    return VanishingPoints(
        directions=front_half(moved),
        covariance=np.tile(SIGMA**2 * np.eye(2), (count, 1, 1)),
        weight=np.linspace(30, 20, count) if count else np.zeros(0),
        roles=np.array(roles[:count], np.uint32),
        ids=np.zeros(count, np.uint32),
        labels=np.append(np.arange(count), -1),
        camera=camera,
    )


def turned(yaw: float) -> NDArray[np.float64]:
    """The axes as a robot sees them that has turned counter-clockwise by `yaw` (rad): the world goes right."""
    return np.asarray(AXES @ Rotation.from_euler("y", yaw).as_matrix().T)


def step(
    tracker: VanishingPointTracker, stamp: float, observed: VanishingPoints, rate: float | None = None
) -> VanishingPoints:
    tracker.predict(stamp, observed.camera, rate)
    return tracker.update(observed)


def settled(tracker: VanishingPointTracker, pictures: int = 10, seed: int | None = 0) -> VanishingPoints:
    random = None if seed is None else np.random.default_rng(seed)
    for k in range(pictures):
        points = step(tracker, k * STEP, seen(AXES, random=random))
    return points


def test_the_first_picture_is_believed():
    points = settled(VanishingPointTracker(), 1, None)
    np.testing.assert_allclose(points.directions, AXES, atol=1e-12)
    assert points.roles.tolist() == list(ROLES)
    assert points.ids.tolist() == [1, 2, 3]
    assert points.labels.tolist() == [0, 1, 2, -1]


@pytest.mark.parametrize("rate", [0.0, 0.1, -0.25, 0.5])
@pytest.mark.parametrize("told", [True, False])
def test_ids_last_while_the_robot_turns(rate, told):
    tracker, random = VanishingPointTracker(), np.random.default_rng(1)
    errors, squared = [], []
    for k in range(int(0.9 / max(abs(rate), 0.03) / STEP)):
        axes = turned(rate * k * STEP)
        points = step(tracker, k * STEP, seen(axes, random=random), rate if told else None)
        assert points.ids.tolist() == [1, 2, 3]
        assert points.roles.tolist() == list(ROLES)
        errors.append(angle_between(points.directions, axes))
        offsets = [local_coordinates(d, a) for d, a in zip(points.directions, axes, strict=True)]
        squared += [float(o @ np.linalg.solve(c, o)) for o, c in zip(offsets, points.covariance, strict=True)]
    assert np.sqrt(np.mean(np.square(errors[5:]))) < 1.5 * SIGMA
    assert np.max(errors) < 5 * SIGMA
    # Two degrees of freedom; the filter allows for turns nobody announced, so it is rather too careful.
    assert 0.3 < np.mean(squared) < 3.0


def test_what_is_told_of_the_turn_makes_it_surer():
    errors = []
    for told in (True, False):
        tracker, random, away = VanishingPointTracker(), np.random.default_rng(2), []
        for k in range(100):
            yaw = 0.3 * math.sin(2.0 * k * STEP)
            rate = 0.6 * math.cos(2.0 * (k - 0.5) * STEP) if told else None
            points = step(tracker, k * STEP, seen(turned(yaw), random=random), rate)
            away.append(angle_between(points.directions[0], turned(yaw)[0]))
        errors.append(np.sqrt(np.mean(np.square(away))))
    assert errors[0] < 0.95 * errors[1]


def test_the_sign_of_the_turn():
    tracker = VanishingPointTracker()
    settled(tracker, seed=None)
    ahead = tracker.predict(10 * STEP, CAMERA, 0.5)
    # Turning left brings the way ahead to the right of the picture.
    assert ahead is not None and ahead[0] == pytest.approx(math.sin(0.05), rel=0.05)
    pitched = replace(CAMERA, pitch=0.5)
    tracker = VanishingPointTracker()
    for k in range(10):
        step(
            tracker, k * STEP, seen(AXES @ pitched.optical_to_base @ CAMERA.optical_to_base.T, camera=pitched)
        )
    before = tracker.predict(9 * STEP, pitched)
    after = tracker.predict(10 * STEP, pitched, 0.5)
    assert before is not None and after is not None
    up = pitched.optical_to_base[2]
    assert float(before @ up) == pytest.approx(float(after @ up), abs=1e-6)


@pytest.mark.parametrize("degrees", [8.0, 12.0, 20.0])
@pytest.mark.parametrize("towards", [(1, 0), (-1, 0), (0.6, 0.8)])
def test_one_wrong_picture_does_not_move_the_primary(degrees, towards):
    tracker = VanishingPointTracker()
    before = settled(tracker, 20)
    wrong = AXES.copy()
    wrong[0] = retract(AXES[0], math.radians(degrees) * np.array(towards))
    points = step(tracker, 20 * STEP, seen(wrong))
    assert points.ids[0] == before.ids[0] == 1
    assert angle_between(points.directions[0], before.directions[0]) < 3 * points.sigma[0]
    assert angle_between(points.directions[0], AXES[0]) < math.radians(2.0)
    after = step(tracker, 21 * STEP, seen(AXES))
    assert after.ids.tolist() == [1, 2, 3]
    assert angle_between(after.directions[0], AXES[0]) < 2 * SIGMA


def test_a_wrong_direction_is_not_shown_before_it_is_confirmed():
    tracker = VanishingPointTracker(confirmations=3)
    settled(tracker)
    fourth = np.vstack([AXES, [[0.5, 0.1, 0.86]]])
    fourth /= np.linalg.norm(fourth, axis=1, keepdims=True)
    roles = (*ROLES, Role.OTHER)
    counts = []
    for k in range(10, 14):
        points = step(tracker, k * STEP, seen(fourth, roles))
        counts.append(len(points))
        # Lines to a direction that is not believed yet are clutter.
        assert points.labels[3] == (3 if len(points) == 4 else -1)
    assert counts == [3, 3, 4, 4]
    assert points.ids.tolist() == [1, 2, 3, 4]


def test_a_false_primary_never_takes_the_lead_from_a_true_one():
    tracker = VanishingPointTracker()
    settled(tracker)
    aside = turned(math.radians(30.0))[:1]
    both = np.vstack([aside, AXES])
    for k in range(10, 30):
        points = step(
            tracker, k * STEP, seen(both, (Role.PRIMARY, Role.HORIZONTAL, Role.VERTICAL, Role.OTHER))
        )
        assert points.ids[0] == 1 and points.roles[0] == Role.PRIMARY
        assert (points.roles == Role.PRIMARY).sum() == 1


def test_unseen_it_lives_on_with_growing_doubt_and_then_dies():
    tracker = VanishingPointTracker(patience=0.6)
    settled(tracker)
    sigmas = []
    for k in range(10, 16):
        points = step(tracker, k * STEP - 1e-6, seen(AXES[:0]))
        assert points.ids.tolist() == [1, 2, 3]
        assert (points.weight == 0.0).all()
        assert points.labels.tolist() == [-1]
        sigmas.append(points.sigma[0])
    assert (np.diff(sigmas) > 0.0).all()
    assert len(step(tracker, 16 * STEP, seen(AXES[:0]))) == 0
    for k in (17, 18):
        assert len(step(tracker, k * STEP, seen(AXES))) == 0
    born = step(tracker, 19 * STEP, seen(AXES))
    assert born.ids.min() > 3
    assert born.roles.tolist() == list(ROLES)


def test_after_all_have_died_one_wrong_picture_is_not_believed():
    tracker = VanishingPointTracker(confirmations=3)
    settled(tracker)
    for k in range(10, 20):
        step(tracker, k * STEP, seen(AXES[:0]))
    wrong = np.asarray(AXES @ Rotation.from_euler("zyx", [0.3, 0.3, 0.3]).as_matrix().T)
    assert len(step(tracker, 20 * STEP, seen(wrong))) == 0
    # Nor does it tell the estimator where to look.
    assert tracker.predict(21 * STEP, CAMERA) is None
    assert len(tracker.update(seen(AXES))) == 0
    assert len(step(tracker, 22 * STEP, seen(AXES))) == 0
    points = step(tracker, 23 * STEP, seen(AXES))
    assert points.roles.tolist() == list(ROLES)
    assert angle_between(points.directions, AXES).max() < SIGMA


def test_a_first_picture_that_shows_nothing_is_the_first_all_the_same():
    tracker = VanishingPointTracker(confirmations=2)
    assert len(step(tracker, 0.0, seen(AXES[:0]))) == 0
    assert len(step(tracker, STEP, seen(AXES))) == 0
    assert len(step(tracker, 2 * STEP, seen(AXES))) == 3


def test_one_lost_alone_is_born_again_with_a_new_id():
    tracker = VanishingPointTracker()
    settled(tracker)
    for k in range(10, 20):
        points = step(tracker, k * STEP, seen(AXES[:2]))
    assert points.ids.tolist() == [1, 2]
    for k in range(20, 23):
        points = step(tracker, k * STEP, seen(AXES))
    assert points.ids.tolist() == [1, 2, 4]
    assert points.labels.tolist() == [0, 1, 2, -1]


@pytest.mark.parametrize("stamp", [-5.0, 0.5])
def test_a_clock_that_jumps_starts_afresh(stamp):
    tracker = VanishingPointTracker()
    settled(tracker)
    assert tracker.predict(stamp, CAMERA) is None
    points = tracker.update(seen(turned(0.3)))
    assert points.ids.tolist() == [4, 5, 6]
    np.testing.assert_allclose(points.directions, front_half(turned(0.3)), atol=1e-12)


def test_after_a_gap_one_picture_is_not_believed():
    tracker = VanishingPointTracker(longest_step=2.0, confirmations=3)
    settled(tracker)
    for k, ids in enumerate([[], [], [4, 5, 6]]):
        assert tracker.predict(60.0 + k * STEP, CAMERA) is None
        assert tracker.update(seen(turned(0.3))).ids.tolist() == ids


def test_reset_forgets_the_tracks_but_not_the_numbers():
    tracker = VanishingPointTracker()
    settled(tracker)
    tracker.reset()
    assert step(tracker, 10 * STEP, seen(AXES)).ids.tolist() == [4, 5, 6]


@pytest.mark.parametrize("apart", [0.7, 1.0, 2.0])
def test_pictures_far_apart_are_followed(apart):
    tracker = VanishingPointTracker(patience=0.6, longest_step=2.0)
    for k in range(6):
        points = step(tracker, apart * k, seen(AXES))
        assert points.ids.tolist() == [1, 2, 3]
        assert (points.weight > 0.0).all()
    # What is not seen in a picture after longer than patience is not believed.
    assert step(tracker, 6 * apart, seen(AXES[:2])).ids.tolist() == [1, 2]


def test_two_pictures_of_one_moment_are_two_pictures():
    tracker = VanishingPointTracker()
    settled(tracker)
    points = step(tracker, 9 * STEP, seen(AXES[:2]))
    assert points.ids.tolist() == [1, 2, 3]
    assert points.weight[2] == 0.0


def test_labels_follow_their_vanishing_points_whatever_the_order():
    tracker, random = VanishingPointTracker(), np.random.default_rng(3)
    settled(tracker)
    for k in range(10, 40):
        order = random.permutation(3)
        observed = seen(AXES[order], tuple(ROLES[i] for i in order), random)
        points = step(tracker, k * STEP, observed)
        for line, direction in enumerate(observed.directions):
            assert angle_between(points.directions[points.labels[line]], direction) < math.radians(2.0)
        assert points.labels[-1] == -1


def test_the_lead_is_given_up_far_to_the_side():
    tracker = VanishingPointTracker()
    rate = 0.5
    for k in range(40):
        yaw = rate * k * STEP
        axes = turned(yaw)
        # After 45 degrees the estimator takes the other direction for the way ahead.
        swapped = yaw > math.radians(45.0)
        roles = (Role.HORIZONTAL, Role.VERTICAL, Role.PRIMARY) if swapped else ROLES
        points = step(tracker, k * STEP, seen(axes, roles), rate)
        if yaw < math.radians(60.0):
            assert points.ids[0] == 1 and points.roles[0] == Role.PRIMARY
        elif math.radians(70.0) < yaw:
            assert points.ids[0] == 3 and points.roles[0] == Role.PRIMARY
            assert points.roles[points.ids == 1].tolist() == [Role.HORIZONTAL]
        assert sorted(points.ids.tolist()) == [1, 2, 3]


def test_a_direction_that_goes_round_the_rim_stays_the_same():
    tracker = VanishingPointTracker()
    rate = 0.4
    for k in range(60):
        # The direction to the right passes the plane of the lens and shows on the left.
        axes = turned(0.3 - rate * k * STEP * 0.25)
        points = step(tracker, k * STEP, seen(axes), -rate * 0.25)
        assert points.ids.tolist() == [1, 2, 3]
        assert (points.directions[:, 2] >= 0.0).all()
        assert angle_between(points.directions, axes).max() < math.radians(1.0)


def test_the_same_sequence_gives_the_same_answer():
    first, again = settled(VanishingPointTracker()), settled(VanishingPointTracker())
    np.testing.assert_array_equal(first.directions, again.directions)
    np.testing.assert_array_equal(first.covariance, again.covariance)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_turn_rate_or_a_stamp_that_is_no_number_is_refused_and_spoils_nothing(value):
    refusing, other = VanishingPointTracker(), VanishingPointTracker()
    settled(refusing)
    settled(other)
    with pytest.raises(ValueError, match="^turn_rate must be a finite number"):
        refusing.predict(10 * STEP, CAMERA, value)
    with pytest.raises(ValueError, match="^stamp_s must be a finite number"):
        refusing.predict(value, CAMERA)
    np.testing.assert_array_equal(
        step(refusing, 10 * STEP, seen(AXES)).directions, step(other, 10 * STEP, seen(AXES)).directions
    )


@pytest.mark.parametrize(
    ("setting", "values"),
    [
        ("gate", [0.0, -1.0, math.nan, math.inf]),
        ("widest_jump", [0.0, -1.0, math.nan, math.inf]),
        ("confirmations", [0, -1]),
        ("patience", [-1.0, math.nan, math.inf]),
        ("agility", [0.0, -1.0, math.nan, math.inf]),
        ("turn_rate_error", [(-0.1, 0.0), (0.0, math.nan), (0.1,)]),
        ("rate_memory", [0.0, -1.0, math.nan, math.inf]),
        ("longest_step", [0.0, -1.0, math.nan, math.inf]),
    ],
)
def test_settings_without_meaning_are_named(setting, values):
    for value in values:
        with pytest.raises(ValueError, match=f"^{setting} must be"):
            replace(VanishingPointTracker(), **{setting: value})
