# SPDX-License-Identifier: Apache-2.0
"""The part of the packaging that has to look at the tree: which files go to share/robot_vision.

Everything else is in setup.cfg, but for `python_requires`: read from there it becomes an object that
colcon cannot pass between its processes, and `colcon build` stops. Both pip and colcon run this file.
"""

from glob import glob

from setuptools import setup

SHARE = "share/robot_vision"

setup(
    python_requires=">=3.10,<3.14",
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/robot_vision"]),
        (SHARE, ["package.xml"]),
        (f"{SHARE}/launch", sorted(glob("launch/*.launch.py"))),
        (f"{SHARE}/config", sorted(glob("config/*.yaml") + glob("config/*.xml"))),
        (f"{SHARE}/bags", sorted(glob("bags/*.mcap"))),
    ],
)
