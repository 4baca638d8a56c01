# SPDX-License-Identifier: Apache-2.0
"""Plants keep their numbers, places and kinds while the robot drives over them and leans."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from plant_scenes import CAMERA, HEIGHT, LEAF, SPACING, STEP, TALL, Scene, rows_seen, sown

from robot_vision.mapping.plant_errors import common_lean
from robot_vision.mapping.plant_kinds import InRow, PlantJudge
from robot_vision.mapping.plant_map import PlantMap
from robot_vision.mapping.plant_shift import PITCH, ROLL, common_shift
from robot_vision.mapping.plants import PlantKind, Plants
from robot_vision.mapping.pose import Pose
from robot_vision.perception.crop_rows.ground_window import Lean
from robot_vision.perception.crop_rows.plant_blobs import PlantSegmenter
from robot_vision.perception.crop_rows.row_filter import Motion
from robot_vision.perception.crop_rows.sensitivity import PRESETS
from robot_vision.perception.vegetation import LeafMask

WAY = 0.12
STILL = Motion(0.1, 0.0, 0.0)


def at(picture: int) -> Pose:
    """Straight ahead, a little to the left of the rows."""
    return Pose(WAY * picture, 0.02 + 0.01 * WAY * picture, 0.01)


def driven(
    scene: Scene, plant_map: PlantMap, count: int, lean: float = 0.0, fit: bool = True
) -> list[tuple[Pose, Plants]]:
    told = []
    for n in range(count):
        pose = at(n)
        roll, pitch = lean * math.sin(1.7 * n), lean * math.cos(2.3 * n)
        motion = Motion(0.1, WAY / 0.1, 0.0) if n else STILL
        picture = scene.picture(pose, roll, pitch)
        plants = plant_map.update(picture, CAMERA, rows_seen(pose, fit), SPACING, motion)
        told.append((pose, plants))
    return told


def same(scene: Scene, pose: Pose, plants: Plants, within: float) -> dict[int, int]:
    """Row of each told plant by the number of the true plant within some metres of it."""
    away = np.linalg.norm(scene.seen_from(pose)[:, None] - plants.places[None], axis=2)
    return {int(n): int(away[n].argmin()) for n in np.flatnonzero(away.min(axis=1, initial=9.0) < within)}


def test_plants_keep_their_numbers_under_exact_motion() -> None:
    scene, numbers = sown(), dict[int, set[int]]()
    for pose, plants in driven(scene, PlantMap(), 18)[5:]:
        assert len(set(plants.ids.tolist())) == len(plants)
        for true, row in same(scene, pose, plants, 0.02).items():
            numbers.setdefault(true, set()).add(int(plants.ids[row]))
    assert len(numbers) > 50
    assert all(len(ids) == 1 for ids in numbers.values())


def test_every_plant_in_the_middle_of_the_view_is_known_and_in_its_place() -> None:
    scene = sown(1)
    for pose, plants in driven(scene, PlantMap(), 16)[8:]:
        here = scene.seen_from(pose)
        middle = np.flatnonzero((here[:, 0] > 1.0) & (here[:, 0] < 2.0) & (np.abs(here[:, 1]) < 0.8))
        found = same(scene, pose, plants, 0.012)
        assert set(middle.tolist()) <= set(found)
        areas = np.array([plants.areas[found[int(n)]] for n in middle]) / (np.pi * scene.radii[middle] ** 2)
        assert np.median(areas) == pytest.approx(1.0, abs=0.3)


def test_places_that_nobody_sees_any_more_are_carried_by_odometry() -> None:
    scene = sown(2)
    pose, plants = driven(scene, PlantMap(), 25)[-1]
    here = scene.seen_from(pose)
    passed = np.flatnonzero((here[:, 0] > -0.6) & (here[:, 0] < 0.5) & (np.abs(here[:, 1]) < 0.6))
    found = same(scene, pose, plants, 0.015)
    assert len(passed) > 10
    assert np.mean([int(n) in found for n in passed]) > 0.95


def test_roll_and_pitch_of_two_degrees_are_taken_out_where_no_row_tells_them() -> None:
    scene, away, numbers = sown(3), list[float](), dict[int, set[int]]()
    for pose, plants in driven(scene, PlantMap(), 20, math.radians(2.0), fit=False)[8:]:
        here = scene.seen_from(pose)
        for true, row in same(scene, pose, plants, 0.1).items():
            if 1.0 < here[true, 0] < 1.8:
                numbers.setdefault(true, set()).add(int(plants.ids[row]))
                away.append(float(np.linalg.norm(plants.places[row] - here[true])))
    # 2 degrees of pitch alone move a plant 1.4 m ahead by 98 mm
    assert float(np.sqrt(np.mean(np.square(away)))) < 0.015
    assert np.mean([len(ids) == 1 for ids in numbers.values()]) > 0.95


def test_places_are_as_sure_as_they_say_where_the_rows_tell_a_wrong_lean_for_metres() -> None:
    random, sigma, kept = np.random.default_rng(9), math.radians(0.7), math.exp(-WAY / 1.5)
    surprises = list[float]()
    for seed in range(10, 13):
        scene, plant_map, lean = sown(seed), PlantMap(), random.normal(0.0, sigma, 2)
        for n in range(14):
            pose, motion = at(n), Motion(0.1, WAY / 0.1, 0.0) if n else STILL
            picture = scene.picture(pose, *lean)
            lean = kept * lean + random.normal(0.0, sigma * math.sqrt(1.0 - kept**2), 2)
            plants = plant_map.update(picture, CAMERA, rows_seen(pose, lean=sigma), SPACING, motion)
            if n < 8:
                continue
            here = scene.seen_from(pose)
            for true, row in same(scene, pose, plants, 0.04).items():
                if -0.3 < here[true, 0] < 1.6:
                    error = plants.places[row] - here[true]
                    surprises.append(float(error @ np.linalg.solve(plants.covariance[row], error)))
    # two degrees of freedom
    assert 0.7 < np.mean(surprises) < 3.0


def test_what_is_wrong_with_the_lean_means_the_same_from_picture_to_picture() -> None:
    for claimed in (
        [[1e-4, 1e-7], [1e-7, 1e-4]],
        [[1.0e-4, 2e-5], [2e-5, 1.1e-4]],
        [[2e-4, 0.0], [0.0, 5e-5]],
    ):
        one, other = np.array(claimed), np.array(claimed)[::-1, ::-1]
        roots = [common_lean(part, 0.0, 0.0) for part in (one, one * [[1, -1], [-1, 1]], other)]
        np.testing.assert_allclose(roots[0] @ roots[0].T, one, atol=1e-12)
        assert all((np.diag(root) > 5.0 * np.abs(root[[0, 1], [1, 0]])).all() for root in roots)


def test_the_common_shift_is_found_from_the_sights() -> None:
    from robot_vision.geometry import rotation_from_rpy

    random = np.random.default_rng(0)
    slopes = random.uniform((0.5, -0.8), (2.0, 0.8), (30, 2))
    roll, pitch = 0.02, -0.015
    sights = np.column_stack([slopes, -np.ones(30)]) @ rotation_from_rpy(roll, pitch, 0.0).T
    expected = 1.4 * sights[:, :2] / -sights[:, 2:]
    covariance = np.broadcast_to(1e-6 * np.eye(2), (30, 2, 2))
    sigmas = np.array([1e-4, 1e-4, 1e-4, 0.05, 0.05, 1e-4])
    found = common_shift(slopes, expected, covariance, 1.4, 0.0, sigmas)
    assert found.values[ROLL] == pytest.approx(roll, abs=1e-3)
    assert found.values[PITCH] == pytest.approx(pitch, abs=1e-3)
    assert 1.4 * found.straightened(slopes) == pytest.approx(expected, abs=5e-3)


def test_two_plants_nearer_than_the_motion_do_not_change_places() -> None:
    # 7 cm apart along the way, while each picture brings them nearer by 12 cm
    pair = np.array([[3.0, 0.0], [3.07, 0.0], [2.0, 0.5], [2.5, -0.5], [3.5, 0.5]])
    scene = Scene(pair, np.array([0.02, 0.02, 0.05, 0.05, 0.05]), np.zeros(5, bool))
    numbers: dict[int, set[int]] = {}
    for pose, plants in driven(scene, PlantMap(), 18)[3:]:
        for true, row in same(scene, pose, plants, 0.03).items():
            numbers.setdefault(true, set()).add(int(plants.ids[row]))
    assert len(numbers[0]) == len(numbers[1]) == 1
    assert numbers[0] != numbers[1]


def test_a_plant_that_is_taken_away_is_forgotten_and_one_hidden_for_a_moment_is_not() -> None:
    scene = sown(4)
    plant_map = PlantMap()
    pose, plants = driven(scene, plant_map, 8)[-1]
    here = scene.seen_from(pose)
    gone = int(np.flatnonzero((here[:, 0] > 1.5) & (here[:, 0] < 2.0) & (np.abs(here[:, 1]) < 0.3))[0])
    number = plants.ids[same(scene, pose, plants, 0.02)[gone]]
    without = Scene(*(np.delete(part, gone, axis=0) for part in (scene.places, scene.radii, scene.weed)))
    for pictures, there in ((2, True), (4, False)):
        for _ in range(pictures):
            plants = plant_map.update(without.picture(pose), CAMERA, rows_seen(pose), SPACING, STILL)
        assert (number in plants.ids) == there


def test_weeds_between_the_rows_are_told_from_the_crop() -> None:
    scene = sown(5)
    pose, plants = driven(scene, PlantMap(), 25)[-1]
    found = same(scene, pose, plants, 0.02)
    right = [
        plants.kinds[row] == (PlantKind.WEED if scene.weed[n] else PlantKind.CROP) for n, row in found.items()
    ]
    assert len(right) > 60
    assert np.mean(right) > 0.95


def test_without_a_row_nobody_is_called_anything() -> None:
    scene = sown(6)
    plant_map = PlantMap()
    driven(scene, plant_map, 6)
    pose = at(6)
    lost = replace(rows_seen(pose), lane=None, rows=None)
    plants = plant_map.update(scene.picture(pose), CAMERA, lost, SPACING, Motion(0.1, WAY / 0.1, 0.0))
    assert len(plants) > 20
    assert (plants.kinds == PlantKind.UNSURE).all()
    assert np.isnan(plants.weed).all()


def test_without_odometry_plants_are_those_of_the_picture_alone() -> None:
    scene = sown(7)
    plant_map = PlantMap()
    pose = Pose(0.0, 0.0, 0.0)
    first, second = (
        plant_map.update(scene.picture(pose), CAMERA, rows_seen(pose), SPACING, Motion(0.1)) for _ in range(2)
    )
    assert len(first) == len(second) > 20
    assert not set(first.ids.tolist()) & set(second.ids.tolist())
    assert len(same(scene, pose, first, 0.02)) > 20


def test_the_step_of_the_grid_and_a_weed_in_the_row_are_found() -> None:
    random = np.random.default_rng(8)
    judge = PlantJudge()
    for _ in range(12):
        row = np.repeat(np.arange(-2, 3), 16)
        along = STEP * np.tile(np.arange(16), 5) + 0.03 * row + random.normal(0.0, 0.008, 80)
        aside = random.normal(0.0, 0.01, 80)
        row, along, aside = (
            np.append(part, own) for part, own in ((row, 0), (along, 1.5 * STEP), (aside, 0.0))
        )
        plants = InRow(row, aside, along, np.full(81, 1e-6), np.full(81, math.log(0.005)), np.zeros(81))
        weed = judge.judge(plants, SPACING)
    assert judge.found_step == pytest.approx(STEP, rel=0.02)
    assert weed[-1] > 5.0 * np.median(weed[:-1])
    assert (weed[:-1] < 0.5).mean() > 0.97


def test_plants_and_weeds_are_told_in_the_near_infrared_as_in_colour() -> None:
    scene, told = sown(5), dict[str, Plants]()
    for name in ("colour", "mono8", "filtered"):
        plant_map = PlantMap(mask=LeafMask(index="infrared" if name == "filtered" else "auto"))
        for n in range(7):
            picture, pose = scene.picture(at(n)), at(n)
            grey = np.where(picture[..., 1] > picture[..., 2], 190, 100).astype(np.uint8)
            if name != "colour":
                picture = grey if name == "mono8" else np.repeat(grey[..., None], 3, axis=2)
            motion = Motion(0.1, WAY / 0.1, 0.0) if n else STILL
            told[name] = plant_map.update(picture, CAMERA, rows_seen(pose), SPACING, motion)
    assert told["mono8"].ids.tolist() == told["filtered"].ids.tolist()
    count = len(told["colour"])
    assert count > 50
    away = np.linalg.norm(told["colour"].places[:, None] - told["mono8"].places[None], axis=2)
    nearest = away.argmin(axis=1)
    alike = away[np.arange(count), nearest] < 0.015
    assert alike.mean() > 0.95
    assert (told["colour"].kinds == told["mono8"].kinds[nearest])[alike].mean() > 0.95


def test_what_grows_in_the_row_and_has_the_colour_of_weeds_is_one() -> None:
    random = np.random.default_rng(9)
    row, along = np.repeat(np.arange(-2, 3), 20), np.tile(STEP * np.arange(20), 5)
    crop, foreign = np.zeros(100), np.repeat([0.0, 1.0, 0.0], (100, 20, 2))
    foreign[120] = 1.0
    row = np.concatenate([row, random.integers(-2, 3, 20), [0, 0]])
    along = np.concatenate([along, random.uniform(0.0, 5.0, 20), [1.1, 3.6]])
    aside = np.concatenate([crop, np.full(20, 0.2), [0.03, 0.03]])
    plants = InRow(row, aside, along, np.full(122, 1e-6), np.full(122, math.log(0.005)), foreign)
    by_colour, without = PlantJudge(), PlantJudge(cues=("row", "grid", "area"))
    for _ in range(15):
        told, before = by_colour.judge(plants, SPACING), without.judge(plants, SPACING)
    assert told[120] > max(0.9, before[120])
    assert told[121] <= before[121]


def test_weeds_that_grow_into_a_closed_crop_are_known_by_their_colour() -> None:
    along, row = np.meshgrid(np.arange(0.1, 5.0, STEP), np.arange(-2, 3) * SPACING, indexing="ij")
    crop = np.column_stack([along.ravel(), row.ravel()])
    weeds = np.column_stack([np.arange(1.3, 3.4, 0.3), 0.18 * np.array([1, -1, 1, -1, 1, -1, 1])])
    radii = np.append(np.full(len(crop), 0.17), np.full(len(weeds), 0.025))
    weed = np.arange(len(radii)) >= len(crop)
    found = dict[bool, int]()
    for other in (True, False):
        scene = Scene(np.concatenate([crop, weeds]), radii, weed, (100, 170, 140) if other else LEAF)
        plant_map = PlantMap()
        pose, plants = driven(scene, plant_map, 12)[-1]
        near = same(scene, pose, plants, 0.03)
        mine = [near[n] for n in np.flatnonzero(weed).tolist() if n in near]
        found[other] = int((plants.kinds[mine] == PlantKind.WEED).sum())
        leaves = plant_map.leaves
        assert leaves is not None
        here = scene.seen_from(pose)
        beside = (here[:, 0] > 0.0) & (here[:, 0] < 0.9) & (np.abs(here[:, 1]) < 0.6)
        away = np.linalg.norm(here[beside, None] - leaves[None], axis=2).min(axis=1)
        assert away[~weed[beside]].max() < 0.02
    assert found[True] >= 6
    assert found[False] <= 1


def test_a_readier_preset_calls_more_plants_weeds() -> None:
    scene, weeds = sown(8), []
    for preset in PRESETS.values():
        plants = driven(scene, PlantMap(sure=preset.sure), 6)[-1][1]
        weeds.append(set(plants.ids[plants.kinds == PlantKind.WEED].tolist()))
    assert weeds[0] < weeds[1] < weeds[2]
    assert len(weeds[0]) > 10


def test_touching_plants_are_cut_and_leaves_of_one_are_joined() -> None:
    row = np.column_stack([np.arange(1.0, 2.3, 0.11), np.zeros(12)])
    leaves = np.array([[1.5, 0.6], [1.5, 0.63], [1.52, 0.615]])
    scene = Scene(
        np.concatenate([row, leaves]), np.append(np.full(12, 0.06), np.full(3, 0.011)), np.zeros(15, bool)
    )
    pose = Pose(0.0, 0.0, 0.0)
    plant_map = PlantMap()
    segmenter, lean = PlantSegmenter(), Lean(height=0.0)
    window = segmenter.look(plant_map.mask.of(scene.picture(pose)), CAMERA, lean)
    blobs = segmenter.cut(window, CAMERA, lean, 0.06, np.zeros((0, 2)), np.zeros((0, 2)))
    places = blobs.slopes * window.fall * (1.0 - TALL * 0.06 / HEIGHT)
    assert int((np.abs(places[:, 1]) < 0.1).sum()) == 12
    assert np.linalg.norm(places[:, None] - row[None], axis=2).min(axis=0).max() < 0.03
    assert int((np.abs(places[:, 1] - 0.615) < 0.05).sum()) == 1


@pytest.mark.parametrize("wrong", [{"slip": 0.0}, {"gate": math.nan}, {"lean": -0.1}, {"behind": -1.0}])
def test_settings_without_meaning_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        PlantMap(**wrong)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="cues"):
        PlantJudge(cues=())
