# SPDX-License-Identifier: Apache-2.0
"""Plants, and what is to be sprayed, as clouds of points in base_link."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from robot_vision.mapping.plants import Plants
from robot_vision.planning.sprayer import Spray
from robot_vision.ros.messages import cloud_from_points

_PLANT = [(name, "<f4") for name in ("x", "y", "z", "area")] + [("id", "<u4"), ("kind", "u1")]
PLANTS_LAYOUT = np.dtype(_PLANT)
SPRAY_LAYOUT = np.dtype([*_PLANT, ("lane", "u1"), ("time_to_nozzle", "<f4")])


def plants_to_message(header: Header, plants: Plants) -> PointCloud2:
    """Build `plants`: where their stems stand on the ground, with the stamp of `header`."""
    return _cloud(header, np.zeros(len(plants), PLANTS_LAYOUT), plants)


def spray_to_message(header: Header, spray: Spray) -> PointCloud2:
    """Build `spray`: one point for each weed and lane that reaches it, with the stamp of `header`."""
    points = np.zeros(len(spray), SPRAY_LAYOUT)
    points["lane"], points["time_to_nozzle"] = spray.lanes, spray.times
    return _cloud(header, points, spray.weeds)


def _cloud(header: Header, points: NDArray[np.void], plants: Plants) -> PointCloud2:
    points["x"], points["y"] = plants.places.T
    points["area"], points["id"], points["kind"] = plants.areas, plants.ids, plants.kinds
    return cloud_from_points(Header(stamp=header.stamp, frame_id="base_link"), points)
