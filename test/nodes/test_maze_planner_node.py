# SPDX-License-Identifier: Apache-2.0
"""The planner as a process: it plans on maps it hears, steers along the way, and says why when it cannot."""

from __future__ import annotations

import array
import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from node_bench import NodeBench
from numpy.typing import NDArray
from sensor_msgs.msg import Image
from std_srvs.srv import SetBool, Trigger

from robot_vision.nodes.maze_planner import LASTING
from robot_vision.planning import with_clearance
from robot_vision.planning.distance import distance_field

CELL = 0.1
RADIUS = 0.15


@pytest.fixture(scope="module")
def bench(ros_domain: int) -> Iterator[NodeBench]:
    bench = NodeBench(ros_domain, "maze_planner", {"radius": RADIUS, "timeout": 20.0, "frontier": 0.2})
    try:
        bench.speaks(OccupancyGrid, "map", LASTING)
        bench.speaks(Odometry, "odom")
        bench.speaks(PoseStamped, "goal_pose")
        bench.hears(TwistStamped, "steering")
        bench.hears(Path, "path")
        bench.hears(Image, "distance_field")
        bench.connect()
        yield bench
    finally:
        bench.close()


def room(rows: int = 40, columns: int = 60) -> NDArray[np.int8]:
    cells = np.zeros((rows, columns), np.int8)
    cells[0] = cells[-1] = cells[:, 0] = cells[:, -1] = 100
    return cells


def grid(bench: NodeBench, cells: NDArray[np.int8], frame: str = "odom") -> OccupancyGrid:
    message = OccupancyGrid(header=bench.header(frame))
    message.info.height, message.info.width = cells.shape
    message.info.resolution = CELL
    message.info.origin.orientation.w = 1.0
    message.data = array.array("b", cells.astype(np.int8).tobytes())
    return message


def see(bench: NodeBench, cells: NDArray[np.int8]) -> None:
    bench.say_surely("map", grid(bench, cells))


def aim(bench: NodeBench, x: float, y: float, frame: str = "odom") -> None:
    message = PoseStamped(header=bench.header(frame))
    message.pose.position.x, message.pose.position.y = x, y
    bench.say_surely("goal_pose", message)


def odometry(bench: NodeBench, x: float, y: float, yaw: float = 0.0, frame: str = "odom") -> Odometry:
    message = Odometry(header=bench.header(frame))
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    message.pose.pose.orientation.z, message.pose.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return message


def stand(bench: NodeBench, x: float, y: float, yaw: float = 0.0) -> TwistStamped:
    """Tell where the robot is and wait for the steering; odometry promises no delivery, so it may take a second go."""
    answers: list[Any] = []

    def answered() -> bool:
        nonlocal message
        found = [said for said in bench.said("steering") if said.header.stamp == message.header.stamp]
        answers[:] = found
        if not found and waits.pop(0):
            message = odometry(bench, x, y, yaw)
            waits.append(True)
            bench.say("odom", message)
        return bool(found)

    waits = [True]
    message = odometry(bench, x, y, yaw)
    bench.say("odom", message)
    waits[:] = [False] * 20 + [True]
    bench.until(answered, "steering answers odometry")
    answer: TwistStamped = answers[-1]
    assert answer.header.frame_id == "base_link"
    return answer


def way(bench: NodeBench, x: float, y: float) -> NDArray[np.float64]:
    """Tell where the robot is and wait for the new way it plans from there, (M, 2) m."""
    answer = stand(bench, x, y)
    path = bench.answer("path", answer.header)
    assert path.header.frame_id == "odom"
    return np.array([(pose.pose.position.x, pose.pose.position.y) for pose in path.poses])


def is_still(message: TwistStamped) -> bool:
    return message.twist.linear.x == 0.0 and message.twist.angular.z == 0.0


def says(bench: NodeBench, words: str) -> None:
    bench.until(lambda: words in bench.state("message"), f"it says {words!r}, not {bench.state('message')!r}")


def test_before_it_has_a_map_or_a_goal_it_stands_and_says_so(bench: NodeBench) -> None:
    assert is_still(stand(bench, 1.0, 1.0))
    says(bench, "no map yet")
    see(bench, room())
    assert is_still(stand(bench, 1.0, 1.0))
    says(bench, "no goal yet")


def test_it_says_way_and_field_and_drives(bench: NodeBench) -> None:
    cells = room()
    cells[1:25, 30] = 100
    see(bench, cells)
    aim(bench, 5.05, 1.05)
    points = way(bench, 1.05, 1.05)
    for _ in range(5):
        steering = stand(bench, 1.05, 1.05, 0.5)
    assert steering.twist.linear.x > 0.0
    assert np.allclose(points[0], (1.05, 1.05), atol=1e-6)
    assert np.allclose(points[-1], (5.05, 1.05), atol=1e-6)
    assert points[:, 1].max() > 2.5
    bench.until(lambda: bench.said("distance_field"), "it says the distance function")
    image = bench.said("distance_field")[-1]
    field = np.frombuffer(image.data, "<f4").reshape(image.height, image.width)
    true = distance_field(with_clearance(cells == 0, RADIUS, CELL), (10, 50), CELL)
    assert image.encoding == "32FC1"
    assert np.allclose(field, true.astype(np.float32))
    says(bench, "drives")


def test_a_wall_across_the_way_makes_another_one_and_elsewhere_none(bench: NodeBench) -> None:
    cells = room()
    see(bench, cells)
    aim(bench, 5.05, 2.05)
    straight = way(bench, 1.05, 2.05)
    elsewhere = cells.copy()
    elsewhere[35:38, 5:9] = 100
    see(bench, elsewhere)
    stamps = [stand(bench, 1.05, 2.05).header.stamp for _ in range(2)]
    across = cells.copy()
    across[1:30, 30] = 100
    see(bench, across)
    around = way(bench, 1.05, 2.05)
    assert len(around) > len(straight)
    assert around[:, 1].max() > 2.9
    assert not any(path.header.stamp in stamps for path in bench.said("path"))


def test_a_goal_that_moves_is_followed_and_reached(bench: NodeBench) -> None:
    see(bench, room())
    aim(bench, 5.05, 1.05)
    stand(bench, 1.05, 1.05)
    aim(bench, 1.05, 3.05)
    assert way(bench, 1.05, 1.05)[-1] == pytest.approx((1.05, 3.05))
    assert is_still(stand(bench, 1.05, 3.03))
    says(bench, "arrived")


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        ((0.05, 0.05), "lies in a wall"),
        ((99.0, 1.0), "lies outside the map"),
        ((5.05, 2.05), "no way leads"),
    ],
)
def test_a_goal_that_cannot_be_reached_stops_it_and_the_next_one_moves_it(
    bench: NodeBench, goal: tuple[float, float], words: str
) -> None:
    cells = room()
    cells[:, 30] = 100
    see(bench, cells)
    aim(bench, *goal)
    assert is_still(stand(bench, 1.05, 1.05))
    says(bench, words)
    aim(bench, 2.05, 3.05)
    assert not is_still(stand(bench, 1.05, 1.05, 1.0))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"rows": 39}, "not 60 x 39 as its info says"),
        ({"rows": 0, "cells": np.zeros((0, 0), np.int8)}, "has no cells"),
        ({"resolution": 0.0}, "resolution must be a positive number"),
        ({"resolution": math.nan}, "resolution must be a positive number"),
        ({"x": math.nan}, "info.origin.position.x is nan"),
        ({"w": 0.0}, "info.origin.orientation is missing"),
        ({"cells": np.full((40, 60), 101, np.int8)}, "is 101, neither -1 nor 0 to 100"),
    ],
)
def test_a_bad_map_gets_a_line_and_the_last_good_one_goes_on(
    bench: NodeBench, change: dict[str, Any], words: str
) -> None:
    see(bench, room())
    aim(bench, 5.05, 1.05)
    assert not is_still(stand(bench, 1.05, 1.05))
    message = grid(bench, change.get("cells", room()))
    message.info.height = change.get("rows", message.info.height)
    message.info.resolution = change.get("resolution", CELL)
    message.info.origin.position.x = change.get("x", 0.0)
    message.info.origin.orientation.w = change.get("w", 1.0)
    bench.say_surely("map", message)
    bench.log_line("/map", words)
    assert not is_still(stand(bench, 1.05, 1.05))


def test_a_map_of_nothing_known_and_one_of_one_cell(bench: NodeBench) -> None:
    see(bench, np.full((20, 20), -1, np.int8))
    aim(bench, 1.55, 1.55)
    assert is_still(stand(bench, 0.55, 0.55))
    says(bench, "knows nothing of the place")
    see(bench, np.zeros((1, 1), np.int8))
    aim(bench, 0.05, 0.05)
    assert is_still(stand(bench, 0.05, 0.05))
    see(bench, room())


@pytest.mark.parametrize("field", ["x", "w"])
def test_odometry_that_is_no_number_gets_a_line_and_no_steering(bench: NodeBench, field: str) -> None:
    message = odometry(bench, 1.05, 1.05)
    if field == "x":
        message.pose.pose.position.x = math.nan
    else:
        message.pose.pose.orientation.w = math.nan
    count = len(bench.said("steering"))
    for _ in range(3):
        bench.say("odom", message)
    bench.log_line("/odom", "is nan")
    assert len(bench.said("steering")) == count


def test_a_goal_that_is_no_number_is_refused_and_the_old_one_kept(bench: NodeBench) -> None:
    see(bench, room())
    aim(bench, 5.05, 1.05)
    aim(bench, math.nan, 1.0)
    bench.log_line("/goal_pose", "pose.position.x is nan")
    assert not is_still(stand(bench, 1.05, 1.05))


def test_frames_that_nothing_joins_are_told(bench: NodeBench) -> None:
    see(bench, room())
    aim(bench, 5.05, 1.05)
    assert not is_still(stand(bench, 1.05, 1.05))
    aim(bench, 2.0, 2.0, frame="kitchen")
    bench.log_line("/goal_pose", "kitchen", "nothing joins the two")
    bench.say("odom", odometry(bench, 1.05, 1.05, frame="elsewhere"))
    bench.log_line("/odom", "elsewhere")
    bench.until(lambda: is_still(bench.said("steering")[-1]), "it stands still")
    assert not is_still(stand(bench, 1.05, 1.05))


def test_a_clock_that_jumps_back_gets_a_line_and_driving_goes_on(bench: NodeBench) -> None:
    see(bench, room())
    aim(bench, 5.05, 1.05)
    stand(bench, 1.05, 1.05)
    bench.next_stamp(-900_000_000)
    assert not is_still(stand(bench, 1.05, 1.05))
    bench.log_line("/odom", "went back")


def test_modes_are_changed_by_services(bench: NodeBench) -> None:
    see(bench, room())
    aim(bench, 5.05, 1.05)
    assert not is_still(stand(bench, 1.05, 1.05))
    assert bench.call(Trigger, "hold", Trigger.Request()).success
    bench.until(lambda: is_still(bench.said("steering")[-1]), "it stands still")
    count = len(bench.said("steering"))
    bench.say("odom", odometry(bench, 1.05, 1.05))
    says(bench, "holds")
    assert len(bench.said("steering")) == count
    assert bench.call(Trigger, "explore", Trigger.Request()).success
    assert is_still(stand(bench, 1.05, 1.05))
    says(bench, "explored: nothing unseen can be reached any more")
    half = room()
    half[:, 30:] = -1
    see(bench, half)
    assert way(bench, 1.05, 1.05)[-1, 0] > 2.5
    assert not is_still(stand(bench, 1.05, 1.05))
    assert bench.call(Trigger, "go", Trigger.Request()).success
    assert way(bench, 1.05, 1.05)[-1, 0] == pytest.approx(5.05)
    says(bench, "leads over floor nobody has seen yet")


def test_it_stands_where_the_known_floor_ends_and_goes_on_when_the_map_grows(bench: NodeBench) -> None:
    half = room()
    half[:, 30:] = -1
    see(bench, half)
    aim(bench, 5.05, 1.05)
    assert not is_still(stand(bench, 1.05, 1.05))
    assert is_still(stand(bench, 2.99, 1.05))
    says(bench, "stands still: the way leads over floor nobody has seen yet")
    see(bench, room())
    assert not is_still(stand(bench, 2.99, 1.05))


def test_disabled_it_stands_and_enabled_it_goes_on(bench: NodeBench) -> None:
    see(bench, room())
    aim(bench, 5.05, 1.05)
    stand(bench, 1.05, 1.05)
    assert bench.call(SetBool, "enable", SetBool.Request(data=False)).success
    bench.until(lambda: is_still(bench.said("steering")[-1]), "it stands still")
    assert bench.call(SetBool, "maze_planner/enable", SetBool.Request(data=True)).success
    assert not is_still(stand(bench, 1.05, 1.05))


def test_odometry_that_is_too_old_is_not_steered_by(bench: NodeBench) -> None:
    see(bench, room())
    aim(bench, 5.05, 1.05)
    assert bench.set_parameter("max_age", 2.0).successful  # the stamps here are of 1970
    assert is_still(stand(bench, 1.05, 1.05))
    says(bench, "stands still: the odometry is ")
    assert bench.set_parameter("max_age", 0.0).successful
    assert not is_still(stand(bench, 1.05, 1.05))


def test_settings_change_live_and_nonsense_is_refused(bench: NodeBench) -> None:
    assert bench.set_parameter("speed", 0.2).successful
    refused = bench.set_parameter("radius", -1.0)
    assert not refused.successful
    assert "radius" in refused.reason
    refused = bench.set_parameter("mode", "fly")
    assert "mode must be one of" in refused.reason
    see(bench, room())
    aim(bench, 5.05, 1.05)
    for _ in range(20):
        said = stand(bench, 1.05, 1.05)
    assert 0.1 < said.twist.linear.x <= 0.2


def test_silence_makes_it_stand(bench: NodeBench) -> None:
    see(bench, room())
    aim(bench, 5.05, 1.05)
    assert bench.set_parameter("timeout", 0.5).successful
    last = stand(bench, 1.05, 1.05)
    bench.until(lambda: "no odometry for 0.5 s" in bench.state("message"), "it says that it stands still")
    bench.until(lambda: is_still(bench.said("steering")[-1]), "it stands still")
    assert bench.said("steering")[-1].header.stamp == last.header.stamp
