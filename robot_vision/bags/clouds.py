# SPDX-License-Identifier: Apache-2.0
"""Builds and reads the array messages of a bag: point clouds and occupancy grids."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from robot_vision.bags.errors import BagError
from robot_vision.bags.messages import header, pose, time
from robot_vision.bags.schema import message_class

_DATATYPES = {"|i1": 1, "|u1": 2, "<i2": 3, "<u2": 4, "<i4": 5, "<u4": 6, "<f4": 7, "<f8": 8}
_DTYPES = {number: name for name, number in _DATATYPES.items()}


def point_cloud(stamp_ns: int, frame_id: str, points: NDArray[np.void]) -> Any:
    """Build a sensor_msgs/PointCloud2 of one row.

    Args:
        stamp_ns: of the picture.
        frame_id: of the points.
        points: (N,) structured array; its field names, types and offsets become the cloud's.

    Raises:
        BagError: a field has a type that PointCloud2 does not know.
    """
    fields = []
    for name in points.dtype.names or ():
        kind, offset = points.dtype.fields[name][:2]  # type: ignore[index]  # it has fields, for it has names
        if kind.str not in _DATATYPES:
            raise BagError(f"field {name!r} of a point cloud cannot be {kind}")
        fields.append(
            message_class("sensor_msgs/msg/PointField")(
                name=name, offset=int(offset), datatype=_DATATYPES[kind.str], count=1
            )
        )
    return message_class("sensor_msgs/msg/PointCloud2")(
        header=header(stamp_ns, frame_id),
        height=1,
        width=len(points),
        fields=fields,
        is_bigendian=False,
        point_step=points.dtype.itemsize,
        row_step=points.dtype.itemsize * len(points),
        data=np.frombuffer(points.tobytes(), np.uint8),
        is_dense=True,
    )


def points(message: Any) -> NDArray[np.void]:
    """Read a sensor_msgs/PointCloud2 (of rosbags or of rclpy) as an (N,) structured array.

    Raises:
        BagError: the cloud contradicts itself.
    """
    order: Literal[">", "<"] = ">" if message.is_bigendian else "<"
    names, formats, offsets = [], [], []
    for field in message.fields:
        if field.datatype not in _DTYPES:
            raise BagError(f"field {field.name!r} of a point cloud has the unknown type {field.datatype}")
        kind = np.dtype(_DTYPES[field.datatype]).newbyteorder(order)
        names.append(field.name)
        formats.append(kind if field.count == 1 else np.dtype((kind, (field.count,))))
        offsets.append(field.offset)
    try:
        layout = np.dtype(
            {"names": names, "formats": formats, "offsets": offsets, "itemsize": message.point_step}
        )
        count = int(message.width) * int(message.height)
        return np.frombuffer(message.data, layout, count)
    except (ValueError, TypeError) as error:
        raise BagError(f"a point cloud contradicts itself: {error}") from error


def occupancy_grid(
    stamp_ns: int,
    frame_id: str,
    cells: NDArray[np.int8],
    resolution: float,
    origin: tuple[float, float] = (0.0, 0.0),
) -> Any:
    """Build a nav_msgs/OccupancyGrid.

    Args:
        stamp_ns: when the map was true.
        frame_id: of the origin.
        cells: (rows, columns) int8: 0 free, 100 occupied, -1 unknown; row 0 at the smallest y.
        resolution: side of a cell, m.
        origin: (x, y) of the corner of cell (0, 0), m.
    """
    meta = message_class("nav_msgs/msg/MapMetaData")(
        map_load_time=time(stamp_ns),
        resolution=float(resolution),
        width=cells.shape[1],
        height=cells.shape[0],
        origin=pose((*origin, 0.0), (0.0, 0.0, 0.0, 1.0)),
    )
    return message_class("nav_msgs/msg/OccupancyGrid")(
        header=header(stamp_ns, frame_id), info=meta, data=np.ascontiguousarray(cells, np.int8).reshape(-1)
    )
