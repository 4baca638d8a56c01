# SPDX-License-Identifier: Apache-2.0
"""The files that calibrate leaves are read by what they are meant for: nodes, and whoever publishes camera_info."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter_client import AsyncParameterClient
from sensor_msgs.msg import CameraInfo

from robot_vision.bags.calibration import read_calibration
from robot_vision.bags.calibration_files import write_camera_yaml, write_parameters_yaml
from robot_vision.geometry import Camera
from robot_vision.ros.processes import NodeProcess

PLACE = {"camera.height": 0.6033, "camera.pitch": 0.0869, "camera.roll": -1e-5}


@pytest.fixture
def node(ros_domain: int, tmp_path: Path) -> Iterator[NodeProcess]:
    """A real vp_estimator, started with the parameter file."""
    file = tmp_path / "parameters.yaml"
    write_parameters_yaml(file, PLACE, ["from a drive: 100 % sure"])
    process = NodeProcess(
        "vp_estimator",
        arguments=("--ros-args", "--params-file", str(file)),
        environment={"ROS_DOMAIN_ID": str(ros_domain)},
    )
    yield process
    process.stop()
    process.remove_shared_memory()


def test_a_node_starts_with_the_parameters_of_the_file(node: NodeProcess, ros_domain: int) -> None:
    node.wait_until_up()
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain)
    asker = rclpy.create_node("asker", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(asker)
    client = AsyncParameterClient(asker, "vp_estimator")
    for _ in range(600):
        if client.services_are_ready():
            break
        executor.spin_once(timeout_sec=0.1)
    future = client.get_parameters(list(PLACE))
    executor.spin_until_future_complete(future, timeout_sec=60.0)
    values = [value.double_value for value in future.result().values]
    executor.shutdown()
    asker.destroy_node()
    rclpy.shutdown(context=context)
    assert values == list(PLACE.values())


@pytest.mark.parametrize("distortion", [(), (-0.3, 0.1, 0.001, -0.002, 0.0)])
def test_the_camera_file_is_the_camera(tmp_path: Path, distortion: tuple[float, ...]) -> None:
    camera = Camera(459.123456789, 458.0, 319.5, 239.5, 640, 480, distortion=distortion)
    write_camera_yaml(tmp_path / "camera.yaml", camera, remarks=["from a drive"])
    again = read_calibration(tmp_path / "camera.yaml", 640, 480)
    assert again.camera_info() == camera.camera_info()
    assert Camera.from_camera_info(CameraInfo(**again.camera_info())).fx == camera.fx
